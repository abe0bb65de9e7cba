//! The first frames after launch draw more (Paper III, Figure 5); how many they are.

use crate::squares::about_mean;
use serde::Serialize;

/// A change of the mean must be this many of its standard errors to count.
const CLEAR: f64 = 5.0;

/// Where the mean settles.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct WarmUp {
    /// Frames to discard; 0 where there is no clear change.
    pub frames: usize,
    /// Mean of the frames before the change less that of those after it, J.
    pub excess_j: f64,
    /// The same in standard errors.
    pub clearness: f64,
}

/// The frame at which the mean energy changes, by least squares of two levels (Hinkley 1970, eq. 2.2), looked for in the
/// first half. It is the knee of [`mean_over_discarded`].
pub fn warm_up(energies_j: &[f64]) -> WarmUp {
    let none = WarmUp { frames: 0, excess_j: 0.0, clearness: 0.0 };
    let count = energies_j.len();
    if count < 8 {
        return none;
    }
    let total: f64 = energies_j.iter().sum();
    let (mut before, mut best) = (0.0, (0.0, 0));
    for split in 1..=count / 2 {
        before += energies_j[split - 1];
        let apart = before / split as f64 - (total - before) / (count - split) as f64;
        let between = split as f64 * (count - split) as f64 / count as f64 * apart * apart;
        if between > best.0 {
            best = (between, split);
        }
    }
    let split = best.1;
    if split == 0 {
        return none;
    }
    let (early, late) = energies_j.split_at(split);
    let [(early_j, early_squares), (late_j, late_squares)] = [early, late].map(about_mean);
    let excess_j = early_j - late_j;
    let variance = (early_squares + late_squares) / (count - 2) as f64;
    let error_j = libm::sqrt(variance * (1.0 / split as f64 + 1.0 / (count - split) as f64));
    let clearness = excess_j / error_j.max(1e-12 * late_j.abs()).max(f64::MIN_POSITIVE);
    // A split after one frame is that frame's own oddness.
    WarmUp { frames: if clearness > CLEAR && split > 1 { split } else { 0 }, excess_j, clearness }
}

/// Mean energy of the frames left when the first `d` are discarded, J, for each `d` that leaves one.
pub fn mean_over_discarded(energies_j: &[f64]) -> Vec<f64> {
    let mut sum = 0.0;
    let mut means: Vec<f64> = energies_j
        .iter()
        .rev()
        .enumerate()
        .map(|(index, energy_j)| {
            sum += energy_j;
            sum / (index + 1) as f64
        })
        .collect();
    means.reverse();
    means
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_step_is_found_under_noise_and_none_is_invented() {
        let noise = |i: usize| 0.02 * ((i * 7919 % 101) as f64 / 101.0 - 0.5);
        let frames: Vec<f64> = (0..300).map(|i| 1.0 + if i < 48 { 0.03 } else { 0.0 } + noise(i)).collect();
        assert_eq!(warm_up(&frames).frames, 48);
        let steady: Vec<f64> = (0..300).map(|i| 1.0 + noise(i)).collect();
        assert_eq!(warm_up(&steady).frames, 0);
        assert_eq!(warm_up(&[1.0; 3]).frames, 0);
    }

    #[test]
    fn means_over_what_is_left() {
        assert_eq!(mean_over_discarded(&[4.0, 2.0, 1.0]), [7.0 / 3.0, 1.5, 1.0]);
    }
}
