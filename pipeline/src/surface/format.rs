//! Formats: how a value is kept in memory, and what it reads as afterwards. The rounding is that of Direct3D
//! 11 (Functional Specification 3.0, section 3.2.3), and of IEEE 754 for halves.

use glam::Vec4;
use half::f16;

use crate::texture::{linear_to_srgb8, srgb8_to_linear};

/// Format of a texel or sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Format {
    /// Four bytes, colour as sRGB codes and opacity linear, 0 to 1.
    Rgba8Srgb,
    /// Four bytes, 0 to 1.
    Rgba8,
    /// Four halves.
    Rgba16f,
    /// One single.
    R32f,
    /// Two singles.
    Rg32f,
    /// An unsigned integer. Shaders see numbers of single precision, which hold integers up to 2^24.
    R32u,
    /// Depth as a single.
    D32,
    /// Depth as a floating-point number of 24 bits (exponent of 8, fraction of 16 and no sign, as depths are
    /// positive and may be infinite), and a stencil value.
    D24S8,
}

/// Bits of the fraction of a single that [`Format::D24S8`] lacks.
const DROPPED_BITS: u32 = 7;

impl Format {
    /// All formats.
    pub const ALL: [Self; 8] = [
        Self::Rgba8Srgb,
        Self::Rgba8,
        Self::Rgba16f,
        Self::R32f,
        Self::Rg32f,
        Self::R32u,
        Self::D32,
        Self::D24S8,
    ];
    /// Bytes of the largest format.
    pub const MAX_BYTES: usize = 8;

    /// Bytes of a value.
    pub const fn bytes(self) -> u64 {
        match self {
            Self::Rgba16f | Self::Rg32f => 8,
            _ => 4,
        }
    }

    /// Words of 32 bits of a value, the unit in which writes are counted.
    pub const fn words(self) -> u32 {
        self.bytes() as u32 / 4
    }

    /// Whether it keeps depths.
    pub const fn is_depth(self) -> bool {
        matches!(self, Self::D32 | Self::D24S8)
    }

    /// Whether it keeps stencil values.
    pub const fn has_stencil(self) -> bool {
        matches!(self, Self::D24S8)
    }

    /// Whether values can be combined: blended, filtered and averaged.
    pub const fn can_blend(self) -> bool {
        !matches!(self, Self::R32u | Self::D32 | Self::D24S8)
    }

    /// Bytes of `value`, padded with zeros. Depths are in `x`, stencil values in `y`.
    pub fn encode(self, value: Vec4) -> [u8; Self::MAX_BYTES] {
        let word = |word: u32| pair([word, 0]);
        match self {
            Self::Rgba8Srgb => {
                let [r, g, b] = value.truncate().to_array().map(linear_to_srgb8);
                word(u32::from_le_bytes([r, g, b, unorm8(value.w)]))
            }
            Self::Rgba8 => word(u32::from_le_bytes(value.to_array().map(unorm8))),
            Self::Rgba16f => {
                let [r, g, b, a] = value.to_array().map(|part| u32::from(f16::from_f32(part).to_bits()));
                pair([r | g << 16, b | a << 16])
            }
            Self::R32f | Self::D32 => word(value.x.to_bits()),
            Self::Rg32f => pair([value.x.to_bits(), value.y.to_bits()]),
            Self::R32u => word(value.x as u32),
            Self::D24S8 => word(depth24(value.x) << 8 | u32::from(value.y as u8)),
        }
    }

    /// Value of at least [`Self::bytes`] bytes. Channels that the format lacks are 0, the opacity 1.
    pub fn decode(self, bytes: &[u8]) -> Vec4 {
        let byte = |index: usize| bytes[index];
        let word = |index: usize| u32::from_le_bytes(std::array::from_fn(|part| bytes[4 * index + part]));
        let single = |index: usize| f32::from_bits(word(index));
        let half = |index: usize| f16::from_le_bytes([bytes[2 * index], bytes[2 * index + 1]]).to_f32();
        let linear = |index: usize| f32::from(byte(index)) / 255.0;
        let color = |index: usize| srgb8_to_linear(byte(index));
        match self {
            Self::Rgba8Srgb => Vec4::new(color(0), color(1), color(2), linear(3)),
            Self::Rgba8 => Vec4::from_array([0, 1, 2, 3].map(linear)),
            Self::Rgba16f => Vec4::from_array([0, 1, 2, 3].map(half)),
            Self::R32f | Self::D32 => Vec4::new(single(0), 0.0, 0.0, 1.0),
            Self::Rg32f => Vec4::new(single(0), single(1), 0.0, 1.0),
            Self::R32u => Vec4::new(word(0) as f32, 0.0, 0.0, 1.0),
            Self::D24S8 => {
                let depth = f32::from_bits(word(0) >> 8 << DROPPED_BITS);
                Vec4::new(depth, f32::from(byte(0)), 0.0, 1.0)
            }
        }
    }

    /// What is left of `value` after it was stored.
    pub fn round(self, value: Vec4) -> Vec4 {
        self.decode(&self.encode(value))
    }

    /// What is left of a depth after it was stored: not decreasing in the depth.
    pub fn round_depth(self, depth: f32) -> f32 {
        match self {
            Self::D24S8 => f32::from_bits(depth24(depth) << DROPPED_BITS),
            _ => depth,
        }
    }
}

fn pair(words: [u32; 2]) -> [u8; Format::MAX_BYTES] {
    (u64::from(words[0]) | u64::from(words[1]) << 32).to_le_bytes()
}

/// Nearest of 256 steps from 0 to 1; NaN becomes 0.
fn unorm8(value: f32) -> u8 {
    (f64::from(value) * 255.0 + 0.5) as u8
}

/// The nearest depth of 24 bits; of two as near, the farther one.
fn depth24(depth: f32) -> u32 {
    (depth.max(0.0).to_bits() + (1 << (DROPPED_BITS - 1))) >> DROPPED_BITS
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Values between and at the codes of all formats.
    fn values() -> impl Iterator<Item = f32> {
        let mix = |i: u32| crate::random::mix(u64::from(i)) as u32;
        let spread = (0..2000).map(move |i| mix(i) as f32 / u32::MAX as f32);
        let wide = (0..2000).map(move |i| f32::from_bits(mix(i))).filter(|value| value.is_finite());
        spread.chain(wide).chain([0.0, 1.0, -1.0, 0.5, 1e9, f32::INFINITY])
    }

    #[test]
    fn what_is_stored_is_stored_again() {
        for format in Format::ALL {
            for value in values().map(|x| Vec4::new(x, 1.0 - x, 0.25 * x, x)) {
                let once = format.round(value);
                assert_eq!(format.encode(once), format.encode(value), "{format:?} {value}");
                assert!(format.encode(value)[format.bytes() as usize..].iter().all(|byte| *byte == 0));
            }
        }
    }

    /// Half of a step, which bounds the error of every renderer that stores these formats.
    #[test]
    fn errors_are_half_a_step() {
        for x in values().filter(|x| (0.0..=1.0).contains(x)) {
            let error = |format: Format| (format.round(Vec4::splat(x)).x - x).abs();
            assert!(error(Format::Rgba8) <= 0.5 / 255.0 + 1e-7);
            assert!(error(Format::Rgba16f) <= (x * 2.0_f32.powi(-11)).max(2.0_f32.powi(-25)));
            // Below the smallest normal number steps are as far apart as above it.
            assert!(error(Format::D24S8) <= x.max(f32::MIN_POSITIVE) * 2.0_f32.powi(-17), "{x:e}");
            assert_eq!([Format::R32f, Format::Rg32f, Format::D32].map(error), [0.0; 3]);
        }
    }

    #[test]
    fn codes_are_those_of_the_standards() {
        let bytes = |format: Format, value| format.encode(value)[..format.bytes() as usize].to_vec();
        assert_eq!(bytes(Format::Rgba8Srgb, Vec4::new(0.0, 0.5, 1.0, 0.5)), [0, 188, 255, 128]);
        assert_eq!(bytes(Format::Rgba8, Vec4::new(-1.0, 0.5, 2.0, f32::NAN)), [0, 128, 255, 0]);
        let halves = bytes(Format::Rgba16f, Vec4::new(1.0, -2.0, 65504.0, 1e6));
        assert_eq!(halves, [0x00, 0x3C, 0x00, 0xC0, 0xFF, 0x7B, 0x00, 0x7C]);
        assert_eq!(bytes(Format::R32u, Vec4::new(70_000.9, 0.0, 0.0, 0.0)), 70_000_u32.to_le_bytes());
        assert_eq!(Format::D24S8.round(Vec4::new(f32::INFINITY, 7.0, 0.0, 0.0)).x, f32::INFINITY);
        assert_eq!(Format::D24S8.encode(Vec4::new(0.0, 7.0, 0.0, 0.0))[0], 7);
    }

    #[test]
    fn rounded_depths_keep_their_order() {
        let mut depths: Vec<f32> = values().filter(|depth| *depth > 0.0).collect();
        depths.sort_by(f32::total_cmp);
        for format in [Format::D32, Format::D24S8] {
            assert!(depths.windows(2).all(|two| format.round_depth(two[0]) <= format.round_depth(two[1])));
            assert!(depths.iter().all(|d| format.round_depth(*d) == format.round(Vec4::splat(*d)).x));
        }
    }
}
