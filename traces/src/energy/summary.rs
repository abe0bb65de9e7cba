//! Frames in a few numbers.

use super::FrameEnergy;
use crate::frames::{Flag, Flags};
use crate::squares::about_mean;
use serde::Serialize;

/// Mean, sample standard deviation (over `n - 1`; 0 for one value) and median.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Spread {
    /// Arithmetic mean.
    pub mean: f64,
    /// Standard deviation.
    pub deviation: f64,
    /// Median; the mean of the middle two for an even number.
    pub median: f64,
}

impl Spread {
    /// Of some values, in any order; `None` for no values.
    pub fn of(values: &[f64]) -> Option<Self> {
        if values.is_empty() {
            return None;
        }
        let count = values.len() as f64;
        let (mean, squares) = about_mean(values);
        let deviation = if values.len() > 1 { libm::sqrt(squares / (count - 1.0)) } else { 0.0 };
        let mut others = values.to_vec();
        let (below, &mut upper, _) = others.select_nth_unstable_by(values.len() / 2, f64::total_cmp);
        let lower =
            if values.len() % 2 == 1 { upper } else { below.iter().copied().fold(f64::MIN, f64::max) };
        Some(Self { mean, deviation, median: 0.5 * (lower + upper) })
    }
}

/// A table of frames in a few numbers. Averages are over frames; for joules per pixel divide by the pixels.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Summary {
    /// How many frames.
    pub frames: usize,
    /// Sum of the energies, J.
    pub total_j: f64,
    /// Energy per frame, J.
    pub energy_j: Spread,
    /// Duration of a frame, s.
    pub duration_s: Spread,
    /// Mean power of a frame, W; frames count alike, however long they are.
    pub power_w: Spread,
    /// All energy over all time, W.
    pub overall_power_w: f64,
}

impl Summary {
    /// Of some frames; `None` for no frames.
    pub fn of(frames: &[FrameEnergy]) -> Option<Self> {
        let spread =
            |value: fn(&FrameEnergy) -> f64| Spread::of(&frames.iter().map(value).collect::<Vec<_>>());
        let total_j: f64 = frames.iter().map(|frame| frame.energy_j).sum();
        let total_s: f64 = frames.iter().map(FrameEnergy::duration_s).sum();
        Some(Self {
            frames: frames.len(),
            total_j,
            overall_power_w: if total_s > 0.0 { total_j / total_s } else { 0.0 },
            energy_j: spread(|frame| frame.energy_j)?,
            duration_s: spread(FrameEnergy::duration_s)?,
            power_w: spread(FrameEnergy::power_w)?,
        })
    }
}

/// The frames without a last one that ends with the trace, or at an end mark, rather than where a frame would: it is much longer or
/// shorter than the others.
pub fn whole(frames: &[FrameEnergy]) -> &[FrameEnergy] {
    let cut = |flags: Flags| {
        flags.contains(Flag::Last) && (flags.contains(Flag::Long) || flags.contains(Flag::Short))
    };
    match frames.split_last() {
        Some((last, others)) if cut(last.flags) && !others.is_empty() => others,
        _ => frames,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn mean_deviation_and_median_of_known_numbers() {
        let spread = Spread::of(&[2.0, 4.0, 4.0, 4.0, 5.0, 5.0, 7.0, 9.0]).unwrap();
        assert_eq!((spread.mean, spread.median), (5.0, 4.5));
        assert!((spread.deviation - (32.0_f64 / 7.0).sqrt()).abs() < 1e-15);
        assert_eq!(Spread::of(&[3.0]), Some(Spread { mean: 3.0, deviation: 0.0, median: 3.0 }));
        assert_eq!(Spread::of(&[]), None);
        assert_eq!(Summary::of(&[]), None);
    }
}
