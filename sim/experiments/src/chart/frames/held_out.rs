//! Methods on the [`HELD_OUT_DEVICES`]: devices of different structure, so that what was learnt on one is judged on others.
//! Also how many wrong and right results carry an alarm.

use serde::Serialize;
use traces::Trace;
use traces::energy::{PowerIntegral, TOLERANCE_S, score, true_frames};
use traces::frames::{FinderMethod, FinderOptions, Marks, default_window, find_with};
use traces::synth::{HELD_OUT_DEVICES, HeldOutDevice, SynthScene};

use super::{FAILS_BELOW, HAND_S, MARKED};
use crate::study::StudyError;

/// Bins of confidence, of equal width.
const BINS: usize = 10;
/// A start counts as found within this share of a short frame (one in twenty is shorter), and [`TOLERANCE_S`]
/// at most.
const TOLERANCE_SHARE: f64 = 0.15;
const SHORT_PLACE: usize = 20;

/// One method on one device.
#[derive(Clone, Debug, Serialize)]
pub struct HeldOutRow {
    /// The kind of device.
    #[serde(rename = "witness")]
    pub device: &'static str,
    /// Seed of the device.
    pub seed: u64,
    /// The method.
    pub method: &'static str,
    /// F1 with each of the five marks alone.
    pub f1: Vec<f64>,
    /// Confidence of the frames found with any of the marks.
    pub calibration: Calibration,
    /// Flags of these frames.
    pub flags: AlarmCount,
    /// Warnings of the searches with each mark.
    pub warnings: AlarmCount,
}

/// How often frames of a confidence are right.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Calibration {
    /// Number of frames in each bin of confidence, their summed confidence, and how many are right.
    bins: [(f64, f64, f64); BINS],
}

impl Calibration {
    fn add(&mut self, confidence: f64, right: bool) {
        let bin = &mut self.bins[((confidence * BINS as f64) as usize).min(BINS - 1)];
        *bin = (bin.0 + 1.0, bin.1 + confidence, bin.2 + f64::from(u8::from(right)));
    }

    fn join(mut self, other: &Self) -> Self {
        for (bin, more) in self.bins.iter_mut().zip(other.bins) {
            *bin = (bin.0 + more.0, bin.1 + more.1, bin.2 + more.2);
        }
        self
    }

    /// Expected calibration error (Naeini, Cooper and Hauskrecht 2015): the mean over frames of the difference, in
    /// each bin, between mean confidence and the share that is right. `None` without frames.
    pub fn error(&self) -> Option<f64> {
        let frames: f64 = self.bins.iter().map(|bin| bin.0).sum();
        let off: f64 = self.bins.iter().map(|(_, confidence, right)| (confidence - right).abs()).sum();
        (frames > 0.0).then(|| off / frames)
    }
}

/// Every method on every device.
///
/// # Errors
/// [`StudyError`] if a device cannot be made, recorded or searched.
pub(super) fn measure(frames: usize, seeds: &[u64]) -> Result<Vec<HeldOutRow>, StudyError> {
    let mut rows = Vec::new();
    for device in &HELD_OUT_DEVICES {
        for &seed in seeds {
            let scene = device.scene(frames, seed)?;
            let trace = scene.record(&device.recorder(seed))?;
            for method in FinderMethod::ALL {
                rows.push(row(device, seed, method, &scene, &trace)?);
            }
        }
    }
    Ok(rows)
}

fn row(
    device: &HeldOutDevice,
    seed: u64,
    method: FinderMethod,
    scene: &SynthScene,
    trace: &Trace,
) -> Result<HeldOutRow, StudyError> {
    let truth_s: Vec<f64> = scene.truth.iter().map(|frame| frame.start_s).collect();
    let tolerance_s = tolerance_s(&truth_s);
    let (mut f1, mut calibration) = (Vec::new(), Calibration::default());
    let [mut flags, mut warnings] = [AlarmCount::default(); 2];
    for (share, hand_s) in MARKED.into_iter().zip(HAND_S) {
        let mark_s = truth_s[(share * truth_s.len() as f64) as usize] + hand_s;
        let marks = Marks::one(mark_s, default_window(0.0, trace.rate_hz()), trace.end_s());
        let found = find_with(trace, &marks, &FinderOptions { method, ..FinderOptions::default() })?;
        let frames = PowerIntegral::new(trace).frames(&found);
        f1.push(score(&frames, &scene.truth, tolerance_s).f1());
        warnings.add(f1[f1.len() - 1] >= FAILS_BELOW, !found.warnings.is_empty());
        let found_s: Vec<f64> = frames.iter().map(|frame| frame.start_s).collect();
        for (right, frame) in true_frames(&found_s, &truth_s, tolerance_s).into_iter().zip(&frames) {
            calibration.add(frame.confidence, right);
            flags.add(right, frame.flags.has_low_confidence());
        }
    }
    Ok(HeldOutRow { device: device.name, seed, method: method.name(), f1, calibration, flags, warnings })
}

fn tolerance_s(starts_s: &[f64]) -> f64 {
    let mut lengths_s: Vec<f64> = starts_s.windows(2).map(|two| two[1] - two[0]).collect();
    lengths_s.sort_by(f64::total_cmp);
    lengths_s
        .get(lengths_s.len() / SHORT_PLACE)
        .map_or(TOLERANCE_S, |short_s| TOLERANCE_S.min(TOLERANCE_SHARE * short_s))
}

/// A method on all devices of a kind.
#[derive(Clone, Debug)]
pub(super) struct HeldOutSummary {
    pub device: &'static str,
    pub method: &'static str,
    /// Mean F1 with the first mark.
    pub first: f64,
    /// Mean over devices of the F1 with the worst of the five marks.
    pub worst: f64,
    /// Number of devices where F1 with the first mark is more than 0.02 below that of the better simple method.
    pub below_simple: usize,
    pub devices: usize,
    pub calibration: Calibration,
    pub flags: AlarmCount,
    pub warnings: AlarmCount,
}

/// F1 that a method may be below the better simple one.
const MAX_BELOW: f64 = 0.02;

/// By kind of device and method.
pub(super) fn summaries(rows: &[HeldOutRow]) -> Vec<HeldOutSummary> {
    let first = |row: &HeldOutRow| row.f1.first().copied().unwrap_or(0.0);
    let simple = [FinderMethod::SumOfSquares, FinderMethod::Normalized].map(FinderMethod::name);
    let better = |of: &HeldOutRow| {
        let same = rows.iter().filter(|row| (row.device, row.seed) == (of.device, of.seed));
        same.filter(|row| simple.contains(&row.method)).map(first).fold(0.0, f64::max)
    };
    let mut all = Vec::new();
    for device in &HELD_OUT_DEVICES {
        for method in FinderMethod::ALL.map(FinderMethod::name) {
            let of: Vec<&HeldOutRow> =
                rows.iter().filter(|row| (row.device, row.method) == (device.name, method)).collect();
            let mean = |value: &dyn Fn(&HeldOutRow) -> f64| {
                of.iter().map(|row| value(row)).sum::<f64>() / of.len().max(1) as f64
            };
            all.push(HeldOutSummary {
                device: device.name,
                method,
                first: mean(&first),
                worst: mean(&|row| row.f1.iter().copied().fold(1.0, f64::min)),
                below_simple: of.iter().filter(|row| first(row) < better(row) - MAX_BELOW).count(),
                devices: of.len(),
                calibration: of.iter().fold(Calibration::default(), |sum, row| sum.join(&row.calibration)),
                flags: AlarmCount::sum(of.iter().map(|row| &row.flags)),
                warnings: AlarmCount::sum(of.iter().map(|row| &row.warnings)),
            });
        }
    }
    all
}

/// How many frames or searches are wrong and right, and how many of each carry a flag or a warning.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct AlarmCount {
    /// Wrong ones: frames with an end that is not a true one, or a start missed within; searches that fail
    /// ([`FAILS_BELOW`](super::FAILS_BELOW)).
    pub wrong: usize,
    /// Number of them with an alarm.
    pub wrong_with: usize,
    /// The others.
    pub right: usize,
    /// Number of them with an alarm all the same.
    pub right_with: usize,
}

impl AlarmCount {
    /// Counts one more.
    pub(super) fn add(&mut self, right: bool, alarm: bool) {
        let (all, some) = if right {
            (&mut self.right, &mut self.right_with)
        } else {
            (&mut self.wrong, &mut self.wrong_with)
        };
        *all += 1;
        *some += usize::from(alarm);
    }

    /// The sum of all.
    pub(super) fn sum<'a>(counts: impl IntoIterator<Item = &'a Self>) -> Self {
        counts.into_iter().fold(Self::default(), |sum, more| Self {
            wrong: sum.wrong + more.wrong,
            wrong_with: sum.wrong_with + more.wrong_with,
            right: sum.right + more.right,
            right_with: sum.right_with + more.right_with,
        })
    }

    /// How many of the wrong ones have an alarm: `2 of 3`.
    pub(super) fn of_wrong(self) -> String {
        format!("{} of {}", self.wrong_with, self.wrong)
    }

    /// How many of the right ones have one all the same.
    pub(super) fn of_right(self) -> String {
        format!("{} of {}", self.right_with, self.right)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn confidence_that_is_right_as_often_as_it_says_has_no_error() {
        let mut calibration = Calibration::default();
        (0..10).for_each(|n| calibration.add(0.7, n < 7));
        assert!(calibration.error().unwrap() < 1e-12);
        (0..10).for_each(|_| calibration.add(1.0, false));
        assert!((calibration.error().unwrap() - 0.5).abs() < 1e-12);
        assert_eq!(Calibration::default().error(), None);
    }

    #[test]
    fn every_method_is_scored_on_every_device() {
        let rows = measure(40, &[1]).unwrap();
        assert_eq!(rows.len(), HELD_OUT_DEVICES.len() * FinderMethod::ALL.len());
        for summary in summaries(&rows) {
            assert!(summary.worst <= summary.first && summary.first > 0.0, "{summary:?}");
            assert_eq!(summary.devices, 1);
        }
    }

    #[test]
    fn counts_are_added_to_their_kind() {
        let mut one = AlarmCount::default();
        [(true, false), (false, true), (false, false)]
            .into_iter()
            .for_each(|(right, alarm)| one.add(right, alarm));
        let two = AlarmCount::sum([&one, &one]);
        assert_eq!(two, AlarmCount { wrong: 4, wrong_with: 2, right: 2, right_with: 0 });
        assert_eq!([two.of_wrong(), two.of_right()], ["2 of 4", "0 of 2"]);
    }
}
