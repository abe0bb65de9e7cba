//! Hashed samples: plain random samples, reproducible to the bit in other programs.

use super::{LensShape, Sample, SampleSource};
use crate::random::mix;

/// Independent uniform samples, each a hash of (seed, pixel, index).
///
/// All arithmetic is modulo 2^64, with `G = 0x9E3779B97F4A7C15` and `index = (py * width + px) * per_pixel +
/// s`. Then `state = mix(seed + G (index + 1))`, and the numbers are `r(d) = mix(state + G (d + 1)) >> 40`,
/// 24 bits each. `x, y, t` are `r(0), r(1), r(2)` over 2^24. The lens uses the first pair `2 r(3 + 2k) -
/// 2^24, 2 r(4 + 2k) - 2^24` inside the disk, or the first pair for a square.
#[derive(Clone, Copy, Debug)]
pub struct HashedSamples {
    seed: u64,
    width: u32,
    per_pixel: u32,
    shape: LensShape,
}

const GOLDEN: u64 = 0x9E37_79B9_7F4A_7C15;
/// 2^24.
const RANGE: i64 = 1 << 24;

impl HashedSamples {
    /// Samples for an image of `width` pixels, or `None` if `per_pixel` is not 1 to 256.
    pub fn new(seed: u64, width: u32, per_pixel: u32, shape: LensShape) -> Option<Self> {
        (1..=256).contains(&per_pixel).then_some(Self { seed, width, per_pixel, shape })
    }

    fn sample(&self, index: u64) -> Sample {
        let state = mix(self.seed.wrapping_add(GOLDEN.wrapping_mul(index.wrapping_add(1))));
        let number = |d: u64| mix(state.wrapping_add(GOLDEN.wrapping_mul(d + 1))) >> 40;
        let unit = |d: u64| number(d) as f32 / RANGE as f32;
        let place = |d: u64| 2 * number(d) as i64 - RANGE;
        let mut pair = 3;
        let [u, v] = loop {
            let [u, v] = [place(pair), place(pair + 1)];
            let inside = match self.shape {
                LensShape::Square => true,
                LensShape::Disk => u * u + v * v < RANGE * RANGE,
                polygon => polygon.contains([u, v].map(|c| c as f32 / RANGE as f32)),
            };
            if inside {
                break [u, v];
            }
            pair += 2;
        };
        Sample { x: unit(0), y: unit(1), u: u as f32 / RANGE as f32, v: v as f32 / RANGE as f32, t: unit(2) }
    }
}

impl SampleSource for HashedSamples {
    fn per_pixel(&self) -> u32 {
        self.per_pixel
    }

    fn pixel_into(&self, px: u32, py: u32, into: &mut [Sample]) {
        let first = (u64::from(py) * u64::from(self.width) + u64::from(px)) * u64::from(self.per_pixel);
        for (sample, index) in into.iter_mut().zip(first..) {
            *sample = self.sample(index);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_polygon_rejects_points_outside() {
        let shape = LensShape::Polygon { blades: 5, rotation_deg: 10 };
        let source = HashedSamples::new(3, 64, 16, shape).unwrap();
        let mut found = [Sample::default(); 16];
        source.pixel_into(5, 6, &mut found);
        assert!(found.iter().all(|s| shape.contains([s.u, s.v])));
    }

    #[test]
    fn the_first_samples_are_those_of_the_peer() {
        // Digest from an independent implementation (a ray caster on Embree): seed 71, 128x128, one sample
        // per pixel, little-endian bytes of x y u v t.
        let source = HashedSamples::new(71, 128, 1, LensShape::Disk).unwrap();
        let bytes = [
            [0x3d20_6530, 0x3f5c_690b, 0x3ddc_5ab0_u32, 0xbd88_efc0, 0x3f01_3905],
            [0x3f55_45c4, 0x3e20_c740, 0xbf1f_fc24, 0xbed1_a8ac, 0x3efb_39fc],
        ];
        for (index, [x, y, u, v, t]) in (0..).zip(bytes) {
            let mut found = [Sample::default()];
            source.pixel_into(index, 0, &mut found);
            let [x, y, u, v, t] = [x, y, u, v, t].map(f32::from_bits);
            assert_eq!(found, [Sample { x, y, u, v, t }]);
        }
    }
}
