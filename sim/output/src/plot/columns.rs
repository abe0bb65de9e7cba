//! Reduction of many samples to few columns.

/// Lowest and highest finite value of the samples in a column.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Extremes {
    pub low: f64,
    pub high: f64,
}

/// Splits `values` into `columns` segments of (almost) equal length and gives the extremes of each; `None` where a
/// segment has no finite value. Every value is in a segment. There are at most as many segments as values.
pub(super) fn extremes(values: &[f64], columns: usize) -> Vec<Option<Extremes>> {
    segments(values.len(), columns)
        .map(|(from, to)| {
            let finite = || values[from..to].iter().copied().filter(|value| value.is_finite());
            let low = finite().reduce(f64::min)?;
            let high = finite().reduce(f64::max)?;
            Some(Extremes { low, high })
        })
        .collect()
}

/// Splits `values` in the same way and gives the mean of each segment. Values that are not finite count as 0.
pub(super) fn means(values: &[f64], columns: usize) -> Vec<f64> {
    segments(values.len(), columns)
        .map(|(from, to)| values[from..to].iter().filter(|v| v.is_finite()).sum::<f64>() / (to - from) as f64)
        .collect()
}

/// Moving mean of the finite `values`: for the middle of each of `columns` segments, its position in samples and the mean
/// over `width` samples around it.
pub(super) fn moving_mean(values: &[f64], width: usize, columns: usize) -> Vec<(f64, f64)> {
    let width = width.clamp(1, values.len().max(1));
    let mut sums = Vec::with_capacity(values.len() + 1);
    let mut sum = (0.0, 0_usize);
    sums.push(sum);
    for value in values {
        if value.is_finite() {
            sum = (sum.0 + value, sum.1 + 1);
        }
        sums.push(sum);
    }
    segments(values.len(), columns)
        .filter_map(|(from, to)| {
            let middle = (from + to) / 2;
            // At the ends the window stays whole and stops moving: a shorter one would show a part of a frame.
            let first = middle.saturating_sub(width / 2).min(values.len() - width);
            let end = first + width;
            let count = sums[end].1 - sums[first].1;
            (count > 0).then(|| ((from + to) as f64 / 2.0, (sums[end].0 - sums[first].0) / count as f64))
        })
        .collect()
}

fn segments(length: usize, columns: usize) -> impl Iterator<Item = (usize, usize)> {
    let columns = columns.min(length);
    let edge = move |i: usize| (i as u128 * length as u128 / columns.max(1) as u128) as usize;
    (0..columns).map(move |i| (edge(i), edge(i + 1)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_spike_is_missed() {
        for place in [0, 1, 499, 9_999] {
            let mut values = vec![1.0; 10_000];
            values[place] = 9.0;
            let columns = extremes(&values, 333);
            assert_eq!(columns.len(), 333);
            assert_eq!(columns.iter().flatten().filter(|column| column.high == 9.0).count(), 1);
        }
    }

    #[test]
    fn few_values_have_a_column_each_and_none_have_none() {
        assert_eq!(extremes(&[1.0, f64::NAN], 100), [Some(Extremes { low: 1.0, high: 1.0 }), None]);
        assert!(
            extremes(&[], 100).is_empty() && means(&[], 10).is_empty() && moving_mean(&[], 3, 5).is_empty()
        );
    }

    #[test]
    fn means_keep_the_energy() {
        let values: Vec<f64> = (0..1000).map(f64::from).collect();
        let mean = means(&values, 10).iter().sum::<f64>() / 10.0;
        assert!((mean - 499.5).abs() < 1e-9);
    }

    #[test]
    fn the_moving_mean_of_a_constant_is_the_constant() {
        assert!(moving_mean(&[2.0; 100], 7, 30).iter().all(|(_, mean)| *mean == 2.0));
    }
}
