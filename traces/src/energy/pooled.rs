//! Several runs of the same thing.

use crate::squares::about_mean;
use serde::Serialize;

/// Runs taken together.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Pooled {
    /// How many runs.
    pub runs: usize,
    /// How many values in all.
    pub values: usize,
    /// Mean of all values.
    pub mean: f64,
    /// `sqrt(sum (n_i - 1) s_i^2 / sum (n_i - 1))`: the spread within runs, whatever lies between them.
    pub deviation: f64,
}

/// Mean and pooled standard deviation of runs; `None` where there is no value.
pub fn pooled(runs: &[Vec<f64>]) -> Option<Pooled> {
    let runs: Vec<&Vec<f64>> = runs.iter().filter(|run| !run.is_empty()).collect();
    let values: usize = runs.iter().map(|run| run.len()).sum();
    if values == 0 {
        return None;
    }
    let squares: f64 = runs.iter().map(|run| about_mean(run).1).sum();
    let freedom = values - runs.len();
    let deviation = if freedom > 0 { libm::sqrt(squares / freedom as f64) } else { 0.0 };
    let mean = runs.iter().flat_map(|run| run.iter()).sum::<f64>() / values as f64;
    Some(Pooled { runs: runs.len(), values, mean, deviation })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_difference_between_runs_does_not_widen_the_pool() {
        let pool = pooled(&[vec![1.0, 2.0, 3.0], vec![11.0, 12.0, 13.0], vec![]]).unwrap();
        assert_eq!((pool.runs, pool.values, pool.mean, pool.deviation), (2, 6, 7.0, 1.0));
        assert_eq!(pooled(&[vec![]]), None);
    }

    #[test]
    fn a_million_frames_take_no_longer_than_their_number_says() {
        // Taking the mean anew for each of them once took minutes.
        let run: Vec<f64> = (0..1_000_000).map(|i| f64::from(i % 2)).collect();
        let pool = pooled(&[run]).unwrap();
        assert!(pool.mean == 0.5 && (pool.deviation - 0.5).abs() < 1e-6);
    }
}
