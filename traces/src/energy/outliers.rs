//! Frames that differ from those around them: touched by something that is not theirs.

use rayon::prelude::*;

/// How many frames on either side tell what is usual.
const AROUND: usize = 15;
/// Values a thread goes along at once.
const TASK: usize = 4096;
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
    let tasks = (0..values.len()).into_par_iter().step_by(TASK);
    let deviations: Vec<f64> = tasks.flat_map_iter(|from| deviations(values, from)).collect();
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

/// How many deviations each value of one task is off those around it.
fn deviations(values: &[f64], from: usize) -> impl Iterator<Item = f64> + '_ {
    let mut around = Around::new(values, from);
    (from..values.len().min(from + TASK)).map(move |index| {
        around.go_to(index);
        let (usual, spread) = around.usual_and_spread();
        (values[index] - usual) / spread
    })
}

/// The values around one of many, in order of their size: going on by one exchanges one.
struct Around<'a> {
    values: &'a [f64],
    from: usize,
    sorted: Vec<f64>,
}

impl<'a> Around<'a> {
    fn new(values: &'a [f64], index: usize) -> Self {
        let width = (2 * AROUND + 1).min(values.len());
        let from = index.saturating_sub(AROUND).min(values.len() - width);
        let mut sorted = values[from..from + width].to_vec();
        sorted.sort_unstable_by(f64::total_cmp);
        Self { values, from, sorted }
    }

    fn go_to(&mut self, index: usize) {
        let width = self.sorted.len();
        while self.from < index.saturating_sub(AROUND).min(self.values.len() - width) {
            let [old, new] = [self.values[self.from], self.values[self.from + width]];
            let place = |sorted: &[f64], value: f64| sorted.partition_point(|x| x.total_cmp(&value).is_lt());
            self.sorted.remove(place(&self.sorted, old));
            self.sorted.insert(place(&self.sorted, new), new);
            self.from += 1;
        }
    }

    /// The median, and what the median absolute deviation from it says of the standard deviation.
    fn usual_and_spread(&self) -> (f64, f64) {
        let middle = self.sorted.len() / 2;
        let usual = self.sorted[middle];
        // The nearest half of all, from the middle outwards.
        let (mut below, mut above) = (self.sorted[..middle].iter().rev(), self.sorted[middle + 1..].iter());
        let mut next = [below.next(), above.next()].map(|value| apart(value, usual));
        let mut farthest = 0.0;
        for _ in 0..middle {
            let side = usize::from(next[1] < next[0]);
            farthest = next[side];
            next[side] = apart(if side == 0 { below.next() } else { above.next() }, usual);
        }
        (usual, (NORMAL * farthest).max(LEAST * usual.abs()).max(f64::MIN_POSITIVE))
    }
}

/// How far off a value is; beyond all if there is none.
fn apart(value: Option<&f64>, usual: f64) -> f64 {
    value.map_or(f64::INFINITY, |value| (value - usual).abs())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::median::median;

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
    fn oracle_windows_that_go_along_are_those_taken_anew() {
        for count in [5, 6, 30, 31, 32, 2 * TASK + 3] {
            let values: Vec<f64> = (0..count).map(|i| ((i * 7919) % 101) as f64 / 7.0 - 3.0).collect();
            let tasks = (0..count).step_by(TASK);
            let found: Vec<f64> = tasks.flat_map(|from| deviations(&values, from)).collect();
            let width = (2 * AROUND + 1).min(count);
            for (index, found) in found.into_iter().enumerate() {
                let from = index.saturating_sub(AROUND).min(count - width);
                let mut around = values[from..from + width].to_vec();
                let usual = median(&mut around);
                around.iter_mut().for_each(|value| *value = (*value - usual).abs());
                let spread = (NORMAL * median(&mut around)).max(LEAST * usual.abs()).max(f64::MIN_POSITIVE);
                assert_eq!(found, (values[index] - usual) / spread, "{index} of {count}");
            }
        }
    }

    #[test]
    fn slow_drift_and_equal_values_have_none() {
        let drift: Vec<f64> = (0..200).map(|i| 5.0 + 0.01 * f64::from(i) + 0.02 * f64::from(i % 3)).collect();
        assert!(outliers(&drift).iter().chain(&outliers(&[1.0; 50])).all(|out| !out));
        assert_eq!(outliers(&[1.0, 9.0]), [false, false]);
    }
}
