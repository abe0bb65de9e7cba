//! Found frames compared with the ground truth.

use crate::energy::{FrameEnergy, TrueFrame};
pub use crate::stats::{TOLERANCE_S, found_beside_true, pairs, true_beside_found, true_frames};
use serde::Serialize;

/// How well found frames agree with true ones. Counts; the rates are functions of them.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Score {
    /// True frames.
    pub truth: usize,
    /// Found frames.
    pub found: usize,
    /// Pairs, one to one, of starts within the tolerance.
    pub matched: usize,
    /// Found start less true start of each pair, s, in order.
    pub timing_errors_s: Vec<f64>,
    /// Relative energy error of each pair whose frame also ends right (its end is the next true frame's
    /// partner), in order.
    pub energy_errors: Vec<f64>,
}

/// Scores found frames, both sorted by start.
pub fn score(found: &[FrameEnergy], truth: &[TrueFrame], tolerance_s: f64) -> Score {
    let found_s: Vec<f64> = found.iter().map(|frame| frame.start_s).collect();
    let truth_s: Vec<f64> = truth.iter().map(|frame| frame.start_s).collect();
    let pairs = pairs(&found_s, &truth_s, tolerance_s);
    let clean = pairs.windows(2).filter(|two| two[1] == (two[0].0 + 1, two[0].1 + 1)).map(|two| two[0]);
    let error = |(f, t): (usize, usize)| {
        let true_j = truth[t].energy_j;
        (true_j != 0.0).then(|| (found[f].energy_j - true_j) / true_j)
    };
    Score {
        truth: truth.len(),
        found: found.len(),
        matched: pairs.len(),
        timing_errors_s: pairs.iter().map(|&(f, t)| found_s[f] - truth_s[t]).collect(),
        energy_errors: clean.filter_map(error).collect(),
    }
}

/// The true frame beside each found one, for
/// [`FrameTable::with_truth`](crate::energy::FrameTable::with_truth).
pub fn truth_beside(found: &[FrameEnergy], truth: &[TrueFrame], tolerance_s: f64) -> Vec<Option<TrueFrame>> {
    let found_s: Vec<f64> = found.iter().map(|frame| frame.start_s).collect();
    let truth_s: Vec<f64> = truth.iter().map(|frame| frame.start_s).collect();
    let beside = true_beside_found(&found_s, &truth_s, tolerance_s);
    beside.into_iter().map(|place| place.map(|place| truth[place])).collect()
}

impl Score {
    /// Share of the found starts that are true; 0 if none was found.
    pub fn precision(&self) -> f64 {
        share(self.matched, self.found)
    }

    /// Share of the true starts that were found; 0 if there is none.
    pub fn recall(&self) -> f64 {
        share(self.matched, self.truth)
    }

    /// Harmonic mean of precision and recall.
    pub fn f1(&self) -> f64 {
        share(2 * self.matched, self.found + self.truth)
    }

    /// Median of |timing error|, s.
    pub fn median_timing_error_s(&self) -> Option<f64> {
        median_of_magnitudes(&self.timing_errors_s)
    }

    /// Worst |timing error|, s.
    pub fn worst_timing_error_s(&self) -> Option<f64> {
        self.timing_errors_s.iter().map(|error| error.abs()).reduce(f64::max)
    }

    /// Median of |relative energy error| of the frames whose two ends were found.
    pub fn median_energy_error(&self) -> Option<f64> {
        median_of_magnitudes(&self.energy_errors)
    }

    /// Worst |relative energy error| of the frames whose two ends were found.
    pub fn worst_energy_error(&self) -> Option<f64> {
        self.energy_errors.iter().map(|error| error.abs()).reduce(f64::max)
    }
}

fn share(part: usize, whole: usize) -> f64 {
    if whole == 0 { 0.0 } else { part as f64 / whole as f64 }
}

fn median_of_magnitudes(values: &[f64]) -> Option<f64> {
    let magnitudes: Vec<f64> = values.iter().map(|value| value.abs()).collect();
    crate::energy::Spread::of(&magnitudes).map(|spread| spread.median)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frames::Flags;

    fn found(start_s: f64, energy_j: f64) -> FrameEnergy {
        FrameEnergy { start_s, end_s: start_s + 1.0, energy_j, confidence: 1.0, flags: Flags::default() }
    }

    fn truth(start_s: f64, energy_j: f64) -> TrueFrame {
        TrueFrame { start_s, energy_j }
    }

    #[test]
    fn a_frame_is_true_if_its_ends_follow_each_other() {
        let found_s = [0.0, 1.0, 3.0, 3.5, 4.0];
        assert_eq!(true_frames(&found_s, &[0.0, 1.0, 2.0, 3.0, 4.0], 0.1), [true, false, false, false]);
        assert!(true_frames(&[], &[1.0], 0.1).is_empty());
    }

    #[test]
    fn one_missed_one_false_one_late() {
        let found = [found(0.0, 1.0), found(1.01, 2.2), found(1.5, 1.0), found(3.0, 1.0)];
        let truth = [truth(0.0, 1.0), truth(1.0, 2.0), truth(2.0, 1.0), truth(3.0, 1.0), truth(4.0, 1.0)];
        let score = score(&found, &truth, 0.1);
        assert_eq!((score.matched, score.found, score.truth), (3, 4, 5));
        assert_eq!((score.precision(), score.recall()), (0.75, 0.6));
        assert!((score.f1() - 6.0 / 9.0).abs() < 1e-15);
        assert!((score.worst_timing_error_s().unwrap() - 0.01).abs() < 1e-12);
        // Only frame 0 has both ends right; frame 1 is followed by a false start.
        assert_eq!(score.energy_errors, [0.0]);
        assert_eq!(
            truth_beside(&found, &truth, 0.1).iter().map(Option::is_some).collect::<Vec<_>>(),
            [true, true, false, true]
        );
    }

    #[test]
    fn nothing_found_scores_zero() {
        let score = score(&[], &[truth(0.0, 1.0)], 0.1);
        assert_eq!((score.precision(), score.recall(), score.f1()), (0.0, 0.0, 0.0));
        assert_eq!((score.median_timing_error_s(), score.worst_energy_error()), (None, None));
    }

    #[test]
    fn the_nearer_of_two_found_starts_is_the_partner() {
        assert_eq!(pairs(&[0.9, 1.01], &[1.0], 0.2), [(1, 0)]);
        assert_eq!(pairs(&[0.9, 1.01], &[1.0, 1.1], 0.2), [(0, 0), (1, 1)]);
    }
}
