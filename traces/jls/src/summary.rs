//! Summaries of samples: mean, standard deviation, lowest and highest.

/// Sums computed together, so that the compiler may use as many lanes. Their order is fixed.
const LANES: usize = 8;

/// Number, mean, sum of squared differences from it, lowest and highest of some samples. Non-finite samples
/// count as missing.
///
/// Parts are put together by Chan, Golub and LeVeque, "Updating Formulae and a Pairwise Algorithm for
/// Computing Sample Variances", 1979, equation 2.1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Moments {
    count: u64,
    mean: f64,
    squares: f64,
    lowest: f32,
    highest: f32,
}

fn lanes(values: &[f32], add: impl Fn(f64) -> f64) -> f64 {
    let (chunks, rest) = values.as_chunks::<LANES>();
    let mut sums = [0.0; LANES];
    for chunk in chunks {
        for (sum, &value) in sums.iter_mut().zip(chunk) {
            *sum += add(f64::from(value));
        }
    }
    sums.iter().sum::<f64>() + rest.iter().map(|&value| add(f64::from(value))).sum::<f64>()
}

/// The lowest by `below`; written out, as `f32::min` may take either of 0 and -0.
fn extreme(values: &[f32], below: impl Fn(f32, f32) -> bool) -> f32 {
    let pick = |a: f32, b: f32| if below(b, a) { b } else { a };
    let (chunks, rest) = values.as_chunks::<LANES>();
    let mut best = [values[0]; LANES];
    for chunk in chunks {
        for (best, &value) in best.iter_mut().zip(chunk) {
            *best = pick(*best, value);
        }
    }
    best.iter().chain(rest).copied().fold(values[0], pick)
}

impl Moments {
    const NONE: Self = Self { count: 0, mean: 0.0, squares: 0.0, lowest: 0.0, highest: 0.0 };

    /// The moments of samples.
    pub fn of(values: &[f32]) -> Self {
        // No sum of so few f32 overflows: it is finite if and only if all of them are.
        if lanes(values, |value| value).is_finite() {
            return Self::finite(values);
        }
        let kept: Vec<f32> = values.iter().copied().filter(|value| value.is_finite()).collect();
        Self::finite(&kept)
    }

    fn finite(values: &[f32]) -> Self {
        if values.is_empty() {
            return Self::NONE;
        }
        let mean = lanes(values, |value| value) / values.len() as f64;
        Self {
            count: values.len() as u64,
            mean,
            squares: lanes(values, |value| (value - mean) * (value - mean)),
            lowest: extreme(values, |a, b| a < b),
            highest: extreme(values, |a, b| a > b),
        }
    }

    /// The moments of several parts together.
    pub fn together(parts: &[Self]) -> Self {
        parts.iter().fold(Self::NONE, |sum, part| sum.and(part))
    }

    fn and(self, other: &Self) -> Self {
        if self.count == 0 || other.count == 0 {
            return if self.count == 0 { *other } else { self };
        }
        let count = self.count + other.count;
        let (difference, share) = (other.mean - self.mean, other.count as f64 / count as f64);
        Self {
            count,
            mean: self.mean + difference * share,
            squares: self.squares + other.squares + difference * difference * share * self.count as f64,
            lowest: if other.lowest < self.lowest { other.lowest } else { self.lowest },
            highest: if other.highest > self.highest { other.highest } else { self.highest },
        }
    }

    /// The entry in a file: mean, standard deviation (over the number), lowest, highest; NaN where all are
    /// missing.
    pub fn entry(&self) -> [f32; 4] {
        if self.count == 0 {
            return [f32::NAN; 4];
        }
        let deviation = (self.squares / self.count as f64).sqrt();
        [self.mean as f32, deviation as f32, self.lowest, self.highest]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_few_samples_by_hand() {
        assert_eq!(Moments::of(&[1.0, 3.0]).entry(), [2.0, 1.0, 1.0, 3.0]);
        assert_eq!(Moments::of(&[-2.5]).entry(), [-2.5, 0.0, -2.5, -2.5]);
        assert_eq!(Moments::of(&[f32::NAN, 4.0, f32::INFINITY, 2.0]).entry(), [3.0, 1.0, 2.0, 4.0]);
        assert!(Moments::of(&[f32::NAN; 128]).entry().iter().all(|value| value.is_nan()));
        assert!(Moments::together(&[]).entry()[0].is_nan());
        // f32::MAX 128 times is no overflow in f64.
        assert_eq!(Moments::of(&[f32::MAX; 128]).entry(), [f32::MAX, 0.0, f32::MAX, f32::MAX]);
    }

    proptest! {
        #[test]
        fn parts_together_are_the_whole(
            values in prop::collection::vec(prop_oneof![20 => -1e3_f32..1e3, 1 => Just(f32::NAN)], 1..400),
            size in 1_usize..50,
        ) {
            let parts: Vec<Moments> = values.chunks(size).map(Moments::of).collect();
            let finite: Vec<f64> = values.iter().filter(|v| v.is_finite()).map(|&v| f64::from(v)).collect();
            let [mean, deviation, lowest, highest] = Moments::together(&parts).entry().map(f64::from);
            if finite.is_empty() {
                prop_assert!(mean.is_nan() && highest.is_nan());
            } else {
                let true_mean = finite.iter().sum::<f64>() / finite.len() as f64;
                let variance = finite.iter().map(|v| (v - true_mean).powi(2)).sum::<f64>() / finite.len() as f64;
                prop_assert!((mean - true_mean).abs() <= 1e-3 * 1.2e-7 * 1e3 + 1e-7 * true_mean.abs());
                prop_assert!((deviation - variance.sqrt()).abs() <= 1e-6 * variance.sqrt() + 1e-9);
                prop_assert_eq!(lowest, finite.iter().copied().fold(f64::INFINITY, f64::min));
                prop_assert_eq!(highest, finite.iter().copied().fold(f64::NEG_INFINITY, f64::max));
            }
        }
    }
}
