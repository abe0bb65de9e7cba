//! How alike frames are to their neighbours: starts that were put where there is nothing have windows with nothing in common.

use super::found::Found;
use crate::median::median;
use crate::trace::Trace;
use rayon::prelude::*;

/// The median correlation (Pearson 1896) of the windows at neighbouring starts: about 0 in noise, 1 for frames that repeat.
/// 0 for fewer than two windows inside the trace.
pub(super) fn neighbours(trace: &Trace, found: &Found) -> f64 {
    let width = libm::round((found.window.pre_s + found.window.post_s) * trace.rate_hz()) as usize;
    let first = |time_s: f64| libm::round(trace.position(time_s - found.window.pre_s));
    let firsts: Vec<usize> = found
        .starts
        .iter()
        .map(|start| first(start.time_s))
        .filter(|&first| first >= 0.0 && first as usize + width <= trace.samples())
        .map(|first| first as usize)
        .collect();
    let power: Vec<f64> = trace.powers_w().collect();
    let window = |first: usize| &power[first..first + width];
    let alike = |pair: &[usize]| correlation(window(pair[0]), window(pair[1]));
    let mut all: Vec<f64> = firsts.par_windows(2).map(alike).collect();
    median(&mut all)
}

/// Of two lists of equal length; 0 where one is constant.
fn correlation(a: &[f64], b: &[f64]) -> f64 {
    let mean = |of: &[f64]| of.iter().sum::<f64>() / of.len().max(1) as f64;
    let (mean_a, mean_b) = (mean(a), mean(b));
    let (mut both, mut own) = (0.0, [0.0; 2]);
    for (a, b) in a.iter().zip(b) {
        let (a, b) = (a - mean_a, b - mean_b);
        both += a * b;
        own = [own[0] + a * a, own[1] + b * b];
    }
    let size = libm::sqrt(own[0] * own[1]);
    if size > 0.0 { both / size } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scale_and_level_do_not_matter_and_the_unlike_has_none() {
        let a: Vec<f64> = (0..100).map(|i| f64::from(i * 37 % 11)).collect();
        let scaled: Vec<f64> = a.iter().map(|x| 3.0 + 0.1 * x).collect();
        let turned: Vec<f64> = a.iter().map(|x| -x).collect();
        assert!((correlation(&a, &scaled) - 1.0).abs() < 1e-12);
        assert!((correlation(&a, &turned) + 1.0).abs() < 1e-12);
        assert_eq!(correlation(&a, &[2.0; 100]), 0.0);
        let other: Vec<f64> = (0..100).map(|i| f64::from(i * i * 53 % 17)).collect();
        assert!(correlation(&a, &other).abs() < 0.3);
    }
}
