//! Counter-based random numbers: a value depends on its counter alone.

/// Increment of SplitMix64: the odd number nearest to 2^64 over the golden ratio.
pub const GOLDEN: u64 = 0x9E37_79B9_7F4A_7C15;

/// Finalizer of SplitMix64 (Steele, Lea, Flood 2014): a bijection of 64-bit words that mixes all bits.
pub const fn mix(word: u64) -> u64 {
    let z = word ^ (word >> 30);
    let z = z.wrapping_mul(0xBF58_476D_1CE4_E5B9);
    let z = z ^ (z >> 27);
    let z = z.wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^ (z >> 31)
}

/// A number in [0, 1), a multiple of 2^-53, from the upper bits of a word.
#[inline]
pub const fn unit(word: u64) -> f64 {
    (word >> 11) as f64 / (1_u64 << 53) as f64
}

/// A number in [0, 1) in single precision, a multiple of 2^-24, from the upper bits of a word.
#[inline]
pub const fn unit_single(word: u64) -> f32 {
    (word >> 40) as f32 / 16_777_216.0
}

/// Sequence of SplitMix64 from a seed.
#[derive(Clone, Copy, Debug)]
pub struct SplitMix(u64);

impl SplitMix {
    /// The sequence from `seed`.
    pub const fn new(seed: u64) -> Self {
        Self(seed)
    }

    /// The next word.
    pub const fn next_word(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(GOLDEN);
        mix(self.0)
    }

    /// The next number in [0, 1).
    pub const fn next_unit(&mut self) -> f64 {
        unit(self.next_word())
    }

    /// The next number between `low` and `high`.
    pub fn within(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.next_unit()
    }

    /// The next number between `low` and `high` in single precision.
    pub fn within_single(&mut self, low: f32, high: f32) -> f32 {
        low + (high - low) * unit_single(self.next_word())
    }
}

/// A 64-bit word from a seed and two counters.
pub(crate) const fn word(seed: u64, first: u64, second: u64) -> u64 {
    let inner = mix(seed.wrapping_add(GOLDEN.wrapping_mul(first.wrapping_add(1))));
    mix(inner.wrapping_add(GOLDEN.wrapping_mul(second.wrapping_add(1))))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn splitmix_reference_values() {
        // First outputs of SplitMix64 from seed 0, as published with the generator.
        let mut random = SplitMix::new(0);
        assert_eq!(random.next_word(), 0xE220_A839_7B1D_CDAF);
        assert_eq!(random.next_word(), 0x6E78_9E6A_A1B9_65F4);
    }

    #[test]
    fn units_run_from_zero_to_below_one() {
        assert_eq!([0, 1 << 63, 1 << 11].map(unit), [0.0, 0.5, f64::EPSILON / 2.0]);
        assert_eq!(unit(u64::MAX), 1.0 - f64::EPSILON / 2.0);
        assert_eq!([0, 1 << 63, u64::MAX].map(unit_single), [0.0, 0.5, 1.0 - f32::EPSILON / 2.0]);
    }
}
