//! The sRGB transfer function (IEC 61966-2-1:1999), through `libm` so that bytes do not depend on the machine.

use std::sync::LazyLock;

static TO_LINEAR: LazyLock<[f32; 256]> = LazyLock::new(|| std::array::from_fn(|code| decode(code as f64)));

fn decode(code: f64) -> f32 {
    let c = code / 255.0;
    (if c <= 0.040_45 { c / 12.92 } else { libm::pow((c + 0.055) / 1.055, 2.4) }) as f32
}

/// The linear value in [0, 1] of an 8-bit sRGB code.
pub fn srgb8_to_linear(code: u8) -> f32 {
    TO_LINEAR[code as usize]
}

/// The linear values half way between neighbouring codes.
static BORDERS: LazyLock<[f32; 255]> =
    LazyLock::new(|| std::array::from_fn(|code| decode(code as f64 + 0.5)));

/// The nearest 8-bit sRGB code of a linear value; values outside [0, 1] are clamped, NaN becomes 0.
pub fn linear_to_srgb8(linear: f32) -> u8 {
    BORDERS.partition_point(|&border| border <= linear) as u8
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_code_survives_the_round_trip() {
        for code in 0..=255 {
            assert_eq!(linear_to_srgb8(srgb8_to_linear(code)), code);
        }
    }

    #[test]
    fn values_out_of_range_are_clamped() {
        assert_eq!(linear_to_srgb8(-1.0), 0);
        assert_eq!(linear_to_srgb8(7.0), 255);
        assert_eq!(linear_to_srgb8(f32::NAN), 0);
    }
}
