//! One analog-to-digital converter.

/// Rounds to the nearest of `2^bits` codes whose first and last stand for the ends of the range.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Quantizer {
    lowest: f64,
    step: f64,
    last_code: f64,
}

impl Quantizer {
    pub(super) fn new(range: [f64; 2], bits: u32) -> Self {
        let last_code = f64::from((1_u32 << bits) - 1);
        Self { lowest: range[0], step: (range[1] - range[0]) / last_code, last_code }
    }

    /// The stored value, and whether the input was beyond the range.
    pub(super) fn quantize(&self, value: f64) -> (f32, bool) {
        let code = libm::round((value - self.lowest) / self.step);
        let kept = code.clamp(0.0, self.last_code);
        ((self.lowest + kept * self.step) as f32, kept != code)
    }

    /// The most a stored, unclipped value can differ from its input: half a step, the rounding to f32
    /// (half a unit in the last place, at most 2^-24 of the value), and the f64 arithmetic on the way.
    pub(super) fn error(&self, stored: f32) -> f64 {
        let span = self.lowest.abs() + self.last_code * self.step;
        0.5 * self.step + f64::from(stored).abs() * f64::from(f32::EPSILON) * 0.5 + 8.0 * f64::EPSILON * span
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_error_is_within_its_bound_and_the_ends_are_codes() {
        let quantizer = Quantizer::new([-2.0, 6.0], 10);
        for index in 0..10_000 {
            let value = -2.0 + 8.0 * f64::from(index) / 9_999.0;
            let (stored, clipped) = quantizer.quantize(value);
            assert!(!clipped && (f64::from(stored) - value).abs() <= quantizer.error(stored));
        }
        assert_eq!(quantizer.quantize(6.0), (6.0, false));
        assert_eq!(quantizer.quantize(6.1), (6.0, true));
        assert_eq!(quantizer.quantize(-9.0), (-2.0, true));
    }
}
