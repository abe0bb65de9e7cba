//! Counter-based random numbers: each depends on the seed and the counter alone.

use pipeline::random::{mix, unit};

const GOLDEN: u64 = 0x9E37_79B9_7F4A_7C15;

/// A sequence of random words with random access: SplitMix64 (Steele, Lea, Flood 2014) with its own start.
#[derive(Clone, Copy, Debug)]
pub(super) struct Stream(u64);

impl Stream {
    /// Stream of a seed for one purpose.
    pub fn new(seed: u64, purpose: u64) -> Self {
        Self(mix(mix(seed.wrapping_add(GOLDEN)) ^ mix(GOLDEN.wrapping_mul(purpose.wrapping_add(2)))))
    }

    /// Sub-stream for one of many items.
    #[inline]
    pub fn of(self, number: u64) -> Self {
        Self(mix(self.0 ^ mix(number.wrapping_add(GOLDEN))))
    }

    /// Word at a position.
    #[inline]
    pub fn word(self, at: u64) -> u64 {
        mix(self.0.wrapping_add(GOLDEN.wrapping_mul(at.wrapping_add(1))))
    }

    /// Number in [0, 1), a multiple of 2^-53.
    #[inline]
    pub fn unit(self, at: u64) -> f64 {
        unit(self.word(at))
    }

    /// Integer below `count`.
    #[inline]
    pub fn below(self, at: u64, count: u64) -> u64 {
        ((u128::from(self.word(at)) * u128::from(count)) >> 64) as u64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_uniform_and_streams_independent() {
        let (one, other) = (Stream::new(1, 0), Stream::new(1, 1));
        let mean = (0..10_000).map(|at| one.unit(at)).sum::<f64>() / 1e4;
        assert!((mean - 0.5).abs() < 0.01, "{mean}");
        let both: f64 = (0..10_000).map(|at| (one.unit(at) - 0.5) * (other.unit(at) - 0.5)).sum();
        assert!(both.abs() / 1e4 < 0.005, "{both}");
        assert!((0..10_000).all(|at| one.below(at, 7) < 7));
    }
}
