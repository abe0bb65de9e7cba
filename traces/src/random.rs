//! Random numbers as a pure function of (seed, stream, counter): any order, any thread, the same numbers.

use core::f64::consts::TAU;

/// The odd constant nearest to 2^64 over the golden ratio: SplitMix64's increment (Steele, Lea and Flood
/// 2014, "Fast splittable pseudorandom number generators", fig. 17).
pub const GOLDEN: u64 = 0x9E37_79B9_7F4A_7C15;

/// SplitMix64's output function (same source; constants by Stafford, variant 13).
pub fn mix(mut z: u64) -> u64 {
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^ (z >> 31)
}

/// One stream of numbers, by their counters.
#[derive(Clone, Copy, Debug)]
pub struct Random {
    key: u64,
}

impl Random {
    /// A stream of a seed: of one rail, or of one thing that varies.
    pub fn new(seed: u64, stream: u64) -> Self {
        Self { key: mix(seed.wrapping_add(GOLDEN.wrapping_mul(stream.wrapping_add(1)))) }
    }

    /// Even over `(0, 1)`.
    pub fn uniform(self, counter: u64) -> f64 {
        let bits = mix(self.key.wrapping_add(GOLDEN.wrapping_mul(counter.wrapping_add(1))));
        // 53 bits, shifted by half a step: never 0, so the logarithm is finite.
        ((bits >> 11) as f64 + 0.5) * (1.0 / 9_007_199_254_740_992.0)
    }

    /// Even between two numbers.
    pub fn between(self, counter: u64, [low, high]: [f64; 2]) -> f64 {
        low + (high - low) * self.uniform(counter)
    }

    /// Two independent normal numbers of mean 0 and variance 1 (Box and Muller 1958), from the even ones `2 n` and `2 n + 1`.
    pub fn normals(self, n: u64) -> (f64, f64) {
        let counter = n.wrapping_mul(2);
        let radius = libm::sqrt(-2.0 * libm::log(self.uniform(counter)));
        let angle = TAU * self.uniform(counter.wrapping_add(1));
        (radius * libm::cos(angle), radius * libm::sin(angle))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn mean_variance_kurtosis_and_correlation_are_those_of_a_standard_normal() {
        let random = Random::new(7, 0);
        let n = 200_000_u64;
        let (mut sum, mut square, mut fourth, mut cross, mut lag) = (0.0, 0.0, 0.0, 0.0, 0.0);
        for sample in 0..n {
            let (a, b) = random.normals(sample);
            sum += a;
            square += a * a;
            fourth += a * a * a * a;
            cross += a * b;
            lag += a * random.normals(sample + 1).0;
        }
        let n = n as f64;
        // Five standard errors each: 1, sqrt 2, sqrt 96, 1, 1 over sqrt n.
        let sigma = 5.0 / n.sqrt();
        assert!((sum / n).abs() < sigma);
        assert!((square / n - 1.0).abs() < sigma * 1.4143);
        assert!((fourth / n - 3.0).abs() < sigma * 9.8);
        assert!((cross / n).abs() < sigma);
        assert!((lag / n).abs() < sigma);
    }

    #[test]
    fn seeds_and_streams_differ_and_repeat() {
        assert_eq!(Random::new(1, 0).normals(5), Random::new(1, 0).normals(5));
        assert_ne!(Random::new(1, 0).normals(5), Random::new(2, 0).normals(5));
        assert_ne!(Random::new(1, 0).normals(5), Random::new(1, 1).normals(5));
    }
}
