//! Distribution of values over bins of equal width.

/// Counts of values in bins of equal width, from the lowest value to the highest.
#[derive(Clone, Debug, PartialEq)]
pub struct Histogram {
    /// Lower edge of the first bin.
    pub low: f64,
    /// Width of a bin; above 0.
    pub width: f64,
    /// Number of values in each bin.
    pub counts: Vec<u32>,
}

/// Least width of a bin, as a share of the highest value: equal values have a bin, too.
const MIN_WIDTH_SHARE: f64 = 1e-12;

impl Histogram {
    /// The distribution of finite values. The number of bins is the square root of that of the values, at most `max_bins`;
    /// no values give one empty bin.
    pub fn of(values: &[f64], max_bins: usize) -> Self {
        let bins = ((values.len() as f64).sqrt() as usize).clamp(1, max_bins.max(1));
        let low = values.iter().copied().reduce(f64::min).unwrap_or(0.0);
        let high = values.iter().copied().reduce(f64::max).unwrap_or(0.0);
        let width = (high - low) / bins as f64;
        let width = width.max(MIN_WIDTH_SHARE * high.abs()).max(f64::MIN_POSITIVE);
        let mut counts = vec![0; bins];
        for value in values {
            counts[(((value - low) / width) as usize).min(bins - 1)] += 1;
        }
        Self { low, width, counts }
    }

    /// Lower edge, upper edge and count of each bin.
    pub fn bins(&self) -> impl Iterator<Item = (f64, f64, u32)> + '_ {
        let edge = |index: usize| self.low + index as f64 * self.width;
        self.counts.iter().enumerate().map(move |(index, &count)| (edge(index), edge(index + 1), count))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_value_is_in_the_bin_around_it() {
        let values: Vec<f64> = (0..100).map(|i| f64::from(i % 10)).collect();
        let histogram = Histogram::of(&values, 60);
        assert_eq!(histogram.counts, [10; 10]);
        let (from, to, _) = histogram.bins().last().unwrap();
        assert!((from - 8.1).abs() < 1e-12 && (to - 9.0).abs() < 1e-12);
        assert_eq!(Histogram::of(&values, 5).counts, [20; 5]);
    }

    #[test]
    fn equal_values_and_none_have_a_bin() {
        for value in [0.0, 3.0, -3.0] {
            let histogram = Histogram::of(&[value; 9], 60);
            assert_eq!((histogram.counts.iter().sum::<u32>(), histogram.low), (9, value));
            assert!(histogram.width > 0.0);
        }
        assert_eq!(Histogram::of(&[], 60).counts, [0]);
    }
}
