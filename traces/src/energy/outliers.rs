//! Frames that differ from those around them: touched by something that is not theirs.

use crate::median::median;
use rayon::prelude::*;

/// How many frames on either side tell what is usual.
const AROUND: usize = 15;
/// A frame this many deviations off is an outlier; one beside it from the second number on: a disturbance that lasts for
/// several frames touches the outermost ones only in part.
const FAR: [f64; 2] = [5.0, 2.5];
/// The least deviation, as a share of the median: frames that are all alike differ by rounding alone.
const LEAST: f64 = 1e-3;
/// Median absolute deviation to standard deviation of a normal distribution.
const NORMAL: f64 = 1.4826;

/// Whether each of `values` is an outlier among its neighbours: off their median by so many of their median absolute
/// deviations (Hampel 1974). Fewer than five values have none.
pub fn outliers(values: &[f64]) -> Vec<bool> {
    if values.len() < 5 {
        return vec![false; values.len()];
    }
    let deviations: Vec<f64> =
        (0..values.len()).into_par_iter().map(|index| deviation(values, index)).collect();
    let mut out: Vec<bool> = deviations.iter().map(|z| z.abs() > FAR[0]).collect();
    let core = out.clone();
    for index in 0..values.len() {
        let beside = [index.checked_sub(1), Some(index + 1)].into_iter().flatten();
        let same_way = |other: usize| deviations.get(other).is_some_and(|z| z * deviations[index] > 0.0);
        out[index] |= deviations[index].abs() > FAR[1]
            && beside.into_iter().any(|other| core.get(other) == Some(&true) && same_way(other));
    }
    out
}

/// How many deviations a value is off those around it.
fn deviation(values: &[f64], index: usize) -> f64 {
    let width = (2 * AROUND + 1).min(values.len());
    let from = index.saturating_sub(AROUND).min(values.len() - width);
    let mut around = values[from..from + width].to_vec();
    let usual = median(&mut around);
    around.iter_mut().for_each(|value| *value = (*value - usual).abs());
    let spread = (NORMAL * median(&mut around)).max(LEAST * usual.abs()).max(f64::MIN_POSITIVE);
    (values[index] - usual) / spread
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_disturbance_over_three_frames_is_found_with_its_edges() {
        let mut values: Vec<f64> = (0..100).map(|i| 10.0 + 0.1 * f64::from(i * 37 % 11) / 11.0).collect();
        values[50] += 0.15;
        values[51] += 1.0;
        values[52] += 0.3;
        let found: Vec<usize> =
            outliers(&values).iter().enumerate().filter(|(_, out)| **out).map(|(index, _)| index).collect();
        assert_eq!(found, [50, 51, 52]);
    }

    #[test]
    fn slow_drift_and_equal_values_have_none() {
        let drift: Vec<f64> = (0..200).map(|i| 5.0 + 0.01 * f64::from(i) + 0.02 * f64::from(i % 3)).collect();
        assert!(outliers(&drift).iter().chain(&outliers(&[1.0; 50])).all(|out| !out));
        assert_eq!(outliers(&[1.0, 9.0]), [false, false]);
    }
}
