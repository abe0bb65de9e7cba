//! Splitting sorted numbers into populations.

use crate::squares::about_mean;
use rayon::prelude::*;

/// Mean and standard deviation.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Moments {
    pub mean: f64,
    pub deviation: f64,
}

/// Sorted numbers cut in two.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Split {
    /// How many of all the numbers lie below.
    pub count: usize,
    /// All numbers below.
    pub low: Moments,
    /// The numbers above, up to the next higher split this one was made within.
    pub high: Moments,
}

/// The split of all numbers, then of its two sides, and so on to `depth` levels, level by level. Values must be
/// sorted; where they are all the same there is no split.
pub(super) fn otsu_tree(sorted: &[f64], depth: usize) -> Vec<Split> {
    let mut ranges = vec![(0, sorted.len())];
    let mut splits = Vec::new();
    let split = |&(from, to): &(usize, usize)| {
        let count = from + otsu(&sorted[from..to])?;
        let (low, high) = rayon::join(|| moments(&sorted[..count]), || moments(&sorted[count..to]));
        Some(([(from, count), (count, to)], Split { count, low, high }))
    };
    for _ in 0..depth {
        let (sides, level): (Vec<_>, Vec<Split>) = ranges.par_iter().filter_map(split).unzip();
        splits.extend(level);
        ranges = sides.into_flattened();
    }
    splits
}

/// How many numbers lie below the cut with the greatest variance between its sides (Otsu 1979, eq. 14), tried at every
/// gap; `None` if they are all the same.
fn otsu(sorted: &[f64]) -> Option<usize> {
    let total: f64 = sorted.iter().sum();
    let (mut below, mut best) = (0.0, (0.0, None));
    for (index, pair) in sorted.windows(2).enumerate() {
        below += pair[0];
        let counts = [(index + 1) as f64, (sorted.len() - index - 1) as f64];
        let apart = below / counts[0] - (total - below) / counts[1];
        let between = counts[0] * counts[1] * apart * apart;
        if pair[0] < pair[1] && between > best.0 {
            best = (between, Some(index + 1));
        }
    }
    best.1
}

/// Mean and standard deviation (over `n`); zeros for no values.
pub(super) fn moments(values: &[f64]) -> Moments {
    if values.is_empty() {
        return Moments::default();
    }
    let count = values.len() as f64;
    let (mean, squares) = about_mean(values);
    Moments { mean, deviation: libm::sqrt(squares / count) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn three_populations_come_apart_in_two_levels() {
        let mut values: Vec<f64> =
            [0.0, 5.0, 6.0].iter().flat_map(|c| (0..10).map(move |i| c + 0.01 * f64::from(i))).collect();
        values.sort_by(f64::total_cmp);
        let counts: Vec<usize> = otsu_tree(&values, 2).iter().map(|split| split.count).collect();
        assert_eq!(counts[0], 10);
        assert!(counts.contains(&20));
        assert!(otsu_tree(&[1.0; 5], 3).is_empty() && otsu_tree(&[], 3).is_empty());
    }
}
