//! Medians, means, spreads, exact running sums, and random numbers as a pure function of (seed, stream,
//! counter): any order, any thread, the same numbers.
//!
//! There are two medians: `median` is what reports print; `upper_median` takes an actual value, as the
//! frame finder and the time base need.

use core::f64::consts::TAU;
use serde::Serialize;

/// The `n`-th smallest value, from 0; the values are left in another order. There must be more than `n`.
pub(crate) fn nth_smallest(values: &mut [f64], n: usize) -> f64 {
    *values.select_nth_unstable_by(n, f64::total_cmp).1
}

/// The median, of an even number of values the upper of the middle two; 0 for no values, which are left in
/// another order.
pub(crate) fn upper_median(values: &mut [f64]) -> f64 {
    if values.is_empty() { 0.0 } else { nth_smallest(values, values.len() / 2) }
}

/// The median, of an even number of values the mean of the middle two; there must be one. They are left in
/// another order.
fn median(values: &mut [f64]) -> f64 {
    let odd = values.len() % 2 == 1;
    let (below, &mut upper, _) = values.select_nth_unstable_by(values.len() / 2, f64::total_cmp);
    let lower = if odd { upper } else { below.iter().copied().fold(f64::MIN, f64::max) };
    0.5 * (lower + upper)
}

/// The mean; NaN for no values.
pub(crate) fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

/// The mean and the sum of squared differences from it; the mean of no values is NaN.
pub(crate) fn about_mean(values: &[f64]) -> (f64, f64) {
    let mean = mean(values);
    (mean, values.iter().map(|value| (value - mean) * (value - mean)).sum())
}

/// The mean and its standard error.
pub(crate) fn mean_and_error(values: &[f64]) -> [f64; 2] {
    let (mean, squares) = about_mean(values);
    let count = values.len() as f64;
    [mean, libm::sqrt(squares / (count - 1.0) / count)]
}

/// Mean and standard deviation (over `n`).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Moments {
    pub mean: f64,
    pub deviation: f64,
}

/// Mean and standard deviation (over `n`); zeros for no values.
pub(crate) fn moments(values: &[f64]) -> Moments {
    if values.is_empty() {
        return Moments::default();
    }
    let count = values.len() as f64;
    let (mean, squares) = about_mean(values);
    Moments { mean, deviation: libm::sqrt(squares / count) }
}

/// Mean, sample standard deviation (over `n - 1`; 0 for one value) and median.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Spread {
    /// Arithmetic mean.
    pub mean: f64,
    /// Standard deviation.
    pub deviation: f64,
    /// Median; the mean of the middle two for an even number.
    pub median: f64,
}

impl Spread {
    /// Of some values, in any order; `None` for no values.
    pub fn of(values: &[f64]) -> Option<Self> {
        if values.is_empty() {
            return None;
        }
        let count = values.len() as f64;
        let (mean, squares) = about_mean(values);
        let deviation = if values.len() > 1 { libm::sqrt(squares / (count - 1.0)) } else { 0.0 };
        Some(Self { mean, deviation, median: median(&mut values.to_vec()) })
    }
}

/// A running sum as an unevaluated pair `hi + lo` (double-double; two-sum: Knuth 1969, TAOCP vol. 2, 4.2.2;
/// Dekker 1971 for the renormalization).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct PairSum {
    hi: f64,
    lo: f64,
}

/// The rounded sum and its exact rounding error.
fn two_sum(a: f64, b: f64) -> (f64, f64) {
    let sum = a + b;
    let b_part = sum - a;
    (sum, (a - (sum - b_part)) + (b - b_part))
}

impl PairSum {
    /// Starts from one number.
    pub(crate) fn from_f64(value: f64) -> Self {
        Self { hi: value, lo: 0.0 }
    }

    /// This sum and one more number.
    #[must_use]
    pub(crate) fn plus(self, value: f64) -> Self {
        let (sum, error) = two_sum(self.hi, value);
        let tail = error + self.lo;
        let hi = sum + tail;
        Self { hi, lo: tail - (hi - sum) }
    }

    /// This sum and the exact product `a b`.
    #[must_use]
    pub(crate) fn plus_product(self, a: f64, b: f64) -> Self {
        let product = a * b;
        self.plus(product).plus(libm::fma(a, b, -product))
    }

    /// This sum and `(end - begin) x`, with the difference taken exactly.
    #[must_use]
    pub(crate) fn plus_span(self, begin: f64, end: f64, x: f64) -> Self {
        let (width, error) = two_sum(end, -begin);
        self.plus_product(width, x).plus(error * x)
    }

    /// `self - earlier`, rounded once at the end.
    pub(crate) fn minus(self, earlier: Self) -> f64 {
        let (difference, error) = two_sum(self.hi, -earlier.hi);
        difference + (error + (self.lo - earlier.lo))
    }

    /// The sum, rounded to one f64.
    pub(crate) fn value(self) -> f64 {
        self.hi + self.lo
    }
}

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

    /// Two independent normal numbers of mean 0 and variance 1 (Box and Muller 1958), from the even ones `2
    /// n` and `2 n + 1`.
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
    fn the_upper_of_two_middles_and_nothing_of_nothing() {
        assert_eq!((upper_median(&mut [3.0, 1.0, 2.0, 9.0]), upper_median(&mut [])), (3.0, 0.0));
    }

    #[test]
    fn of_known_numbers_and_of_none() {
        assert_eq!(about_mean(&[1.0, 2.0, 6.0]), (3.0, 14.0));
        let (mean, squares) = about_mean(&[]);
        assert!(mean.is_nan() && squares == 0.0);
    }

    #[test]
    fn ten_million_tenths_keep_the_last_one() {
        let mut sum = PairSum::default();
        for _ in 0..10_000_000 {
            sum = sum.plus(0.1);
        }
        let before = sum;
        assert_eq!(sum.plus(0.1).minus(before), 0.1);
        // 0.1 as f64 is 0.1 + 5.55e-18; the sum is exactly 1e7 times that.
        assert!((sum.value() - 1.0e6).abs() < 1e-9);
    }

    #[test]
    fn a_product_keeps_the_bits_one_f64_loses() {
        let x = 1.0 + f64::EPSILON;
        let sum = PairSum::default().plus_product(x, x);
        assert_eq!(sum.plus(-1.0).plus(-2.0 * f64::EPSILON).value(), f64::EPSILON * f64::EPSILON);
    }

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
