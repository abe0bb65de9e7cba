//! Frame starts from one marked frame (the thesis' Paper III, section 3.1). A window of power around the mark
//! is compared with every window of the trace by summed squared difference. A threshold chosen from the trace
//! itself separates starts from the rest; where it cannot, the result carries a [`Warning`].
//!
//! Constants of the finder have their reason beside them. Those that state none were tuned on the synthetic
//! scenes and seeds of `docs/finding.md`, section *Flags*, which also has the result on seeds that were not
//! used.

mod assess;
mod find;
mod idle_gap;
mod marks;
mod matched;
mod periodicity;
pub mod profile;
mod register;
mod segments;
mod split_frames;
mod subsample;
mod threshold;
mod track;

use crate::stats::upper_median;
use core::fmt;
use core::str::FromStr;
pub use find::{FinderOptions, FinderStep, Proposal, find, find_with, marked_only, propose};
use marks::Placed;
pub(crate) use marks::Placement;
pub use marks::{MarkError, Marks, Window, default_window};
pub(crate) use matched::{MatchPlan, Matched, Samples, noise_deviation};
pub(crate) use periodicity::repetition_samples;
use serde::Serialize;
pub use threshold::{Population, Rule, Threshold};
use warnings::Warning;

/// One frame start.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FrameStart {
    /// When, s; finer than a sample.
    pub time_s: f64,
    /// Summed squared difference to the nearest marked window, W^2.
    pub distance_w2: f64,
    /// 1 where it is as near as the matches are on average, 0 where it is as far as the rest.
    pub confidence: f64,
    /// Whether this is one of the marks; its time is then the mark's, to the last bit.
    pub marked: bool,
}

/// One frame: from its start to the next start, or to the end mark.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FrameSpan {
    /// Start, s.
    pub start_s: f64,
    /// End, s.
    pub end_s: f64,
    /// The lower confidence of its two ends (of its start for the last frame).
    pub confidence: f64,
    /// Flags of the frame.
    pub flags: Flags,
}

/// The result of the frame finder.
#[derive(Clone, Debug, PartialEq)]
pub struct Found {
    /// The starts, in order.
    pub starts: Vec<FrameStart>,
    /// The frames between them; as many as there are starts.
    pub frames: Vec<FrameSpan>,
    /// Where the last frame ends, s.
    pub end_s: f64,
    /// How it was found.
    pub method: FinderMethod,
    /// The window as compared, after cutting, s.
    pub window: Window,
    /// Which minima were taken, and why.
    pub threshold: Threshold,
    /// Warnings about the result.
    pub warnings: Vec<Warning>,
}

/// The least distance between two frame starts, in samples: half the window, as no frame is shorter than
/// that.
fn spacing(window_samples: usize) -> usize {
    (window_samples / 2).max(1)
}

fn marked_start(mark: &Placed) -> FrameStart {
    FrameStart { time_s: mark.mark_s, distance_w2: 0.0, confidence: 1.0, marked: true }
}

/// Frames of lower confidence are flagged. Confidence is 1 at the mean distance of the matches and 0 at that
/// of the other minima, on a logarithmic scale: below one half a start is nearer to the others.
const MIN_CONFIDENCE: f64 = 0.5;
/// Confidence factor of a start that may be misplaced: below [`MIN_CONFIDENCE`], so that its frames are
/// flagged however well it matches. Its exact value only orders flagged frames; confidence is not calibrated.
const SUSPECT_CONFIDENCE: f64 = 0.8 * MIN_CONFIDENCE;
/// Confidence factor of a start beyond a phase slip: below [`SUSPECT_CONFIDENCE`], as it is off by a part of a frame.
const SLIPPED_CONFIDENCE: f64 = 0.6 * MIN_CONFIDENCE;

/// A note on a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Flag {
    /// The frame whose start was marked.
    Marked,
    /// The frame ends at the end mark, not at a found start.
    Last,
    /// More than 1.5 times the median duration: perhaps two frames with a start missed between them.
    Long,
    /// Less than half the median duration: perhaps part of a frame.
    Short,
    /// Confidence below one half.
    LowConfidence,
    /// Over 1.6 times as long as the frames around it: starts in between may have been missed.
    Merged,
    /// Less than 1 / 1.6 as long as the frames around it: it may be part of one.
    Split,
    /// The frame's length deviates from the even period of its neighbours: one of its ends may be misplaced.
    IrregularLength,
    /// The frame has fewer than 16 samples: its ends, known to half a sample at best, may be off by a
    /// thirtieth of it and more.
    Coarse,
}

impl Flag {
    /// Every flag, in the order in which they are written.
    pub const ALL: [Self; 9] = [
        Self::Marked,
        Self::Last,
        Self::Long,
        Self::Short,
        Self::LowConfidence,
        Self::Merged,
        Self::Split,
        Self::IrregularLength,
        Self::Coarse,
    ];

    /// Whether an end of the frame may be misplaced. The flags of its position in the trace do not mean that.
    pub fn lowers_confidence(self) -> bool {
        !matches!(self, Self::Marked | Self::Last)
    }

    /// The word in the `flags` column.
    pub fn name(self) -> &'static str {
        match self {
            Self::Marked => "marked",
            Self::Last => "last",
            Self::Long => "long",
            Self::Short => "short",
            Self::LowConfidence => "low_confidence",
            Self::Merged => "merged",
            Self::Split => "split",
            Self::IrregularLength => "irregular_length",
            Self::Coarse => "coarse",
        }
    }

    fn bit(self) -> u16 {
        1 << self as u16
    }
}

/// A set of [`Flag`]s; shown as their names joined by `+`, empty if there are none.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Flags(u16);

impl Flags {
    /// Adds a flag.
    pub fn insert(&mut self, flag: Flag) {
        self.0 |= flag.bit();
    }

    /// Adds or removes a flag.
    pub fn set(&mut self, flag: Flag, on: bool) {
        self.0 = if on { self.0 | flag.bit() } else { self.0 & !flag.bit() };
    }

    /// Whether a flag is set.
    pub fn contains(self, flag: Flag) -> bool {
        self.0 & flag.bit() != 0
    }

    /// Whether a flag [lowers the confidence](Flag::lowers_confidence) in the frame.
    pub fn has_low_confidence(self) -> bool {
        Flag::ALL.into_iter().any(|flag| flag.lowers_confidence() && self.contains(flag))
    }
}

impl fmt::Display for Flags {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut separator = "";
        for flag in Flag::ALL.into_iter().filter(|flag| self.contains(*flag)) {
            write!(f, "{separator}{}", flag.name())?;
            separator = "+";
        }
        Ok(())
    }
}

/// How frame starts are found.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum FinderMethod {
    /// Sum of squared differences to the marked window, threshold, local minima (Paper III).
    SumOfSquares,
    /// The same by z-normalized distance: likeness of shape, whatever the level and the scale of power.
    Normalized,
    /// The sequence of starts with the most evidence: similar to several templates, by shape and by squares,
    /// to each other, and at an even period.
    Tracking,
    /// Tracking. With fewer than 20 samples in the window, the most even of tracking, the sum of squares and
    /// normalized; with fewer than 8 the sum of squares. Also the sum of squares for fewer than 16 frames, or
    /// for more than 16 million samples without a warning.
    #[default]
    Auto,
    /// The same, but the sum of squares also where searches from the frames found agree more by it than by
    /// tracking. How far these searches agree is the confidence.
    Consensus,
    /// Segmentation of the whole trace by one probabilistic model, or the result of another method where a
    /// criterion without truth prefers that.
    Segments,
}

impl FinderMethod {
    /// All of them, in order.
    pub const ALL: [Self; 6] =
        [Self::SumOfSquares, Self::Normalized, Self::Tracking, Self::Auto, Self::Consensus, Self::Segments];

    /// The name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::SumOfSquares => "squares",
            Self::Normalized => "normalized",
            Self::Tracking => "tracking",
            Self::Auto => "auto",
            Self::Consensus => "consensus",
            Self::Segments => "segments",
        }
    }
}

impl fmt::Display for FinderMethod {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for FinderMethod {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let names = || Self::ALL.map(Self::name).join(", ");
        Self::ALL
            .into_iter()
            .find(|method| method.name() == text)
            .ok_or_else(|| format!("no method {text}: choose one of {}", names()))
    }
}

/// A frame longer than this many usual lengths may be two; one shorter than the inverse, part of one.
const MAX_LENGTH_RATIO: f64 = 1.6;
/// A length is odd if it differs from the usual one by more than this share of it, and by more than this many
/// times the usual difference nearby.
const ODD_LIMITS: [f64; 2] = [0.1, 6.0];
/// In windows of fewer samples many things resemble a start, and only the period decides.
const COARSE_WINDOW_SAMPLES: usize = 20;
/// In windows of fewer samples a start may be a sample off, and even gaps must agree within half a sample.
const MIN_WINDOW_SAMPLES: usize = 8;
/// In windows of fewer samples than the first, confidence is lowered where less than the second, a share of
/// the gaps, is even.
const MIN_EVEN_SHARES: [(usize, f64); 2] = [(COARSE_WINDOW_SAMPLES, 0.9), (50, 0.6)];
/// At a median gap of fewer windows, nothing distinguishes a start from the middle of a frame.
const MIN_GAP_WINDOWS: f64 = 1.2;
/// Frames of fewer samples are coarse: half a sample, the uncertainty of their ends, is a thirtieth of the
/// frame.
const COARSE_FRAME_SAMPLES: f64 = 16.0;

/// How finely a window is sampled.
#[derive(Clone, Copy, Debug)]
struct Sampling {
    /// Samples in the window.
    pub window: usize,
    /// Samples per second.
    pub rate_hz: f64,
}

/// Frames and their flags from the starts; the last one ends at `end_s`.
fn spans(starts: &[FrameStart], end_s: f64, sampling: Sampling) -> Vec<FrameSpan> {
    let mut frames: Vec<FrameSpan> = Vec::with_capacity(starts.len());
    for (index, start) in starts.iter().enumerate() {
        let next = starts.get(index + 1);
        let mut flags = Flags::default();
        if start.marked {
            flags.insert(Flag::Marked);
        }
        if next.is_none() {
            flags.insert(Flag::Last);
        }
        frames.push(FrameSpan {
            start_s: start.time_s,
            end_s: next.map_or(end_s, |next| next.time_s),
            confidence: next.map_or(start.confidence, |next| start.confidence.min(next.confidence)),
            flags,
        });
    }
    lower_coarse_confidence(&mut frames, sampling);
    for frame in frames.iter_mut().filter(|frame| frame.confidence < MIN_CONFIDENCE) {
        frame.flags.insert(Flag::LowConfidence);
    }
    for frame in frames
        .iter_mut()
        .filter(|frame| (frame.end_s - frame.start_s) * sampling.rate_hz < COARSE_FRAME_SAMPLES)
    {
        frame.flags.insert(Flag::Coarse);
    }
    flag_lengths(&mut frames);
    flag_unusual(&mut frames);
    frames
}

/// Lengths of all frames but the last, which is cut by the end mark, s.
fn lengths_s(frames: &[FrameSpan]) -> Vec<f64> {
    let inner = frames.split_last().map_or(&[][..], |(_, inner)| inner);
    inner.iter().map(|frame| frame.end_s - frame.start_s).collect()
}

/// Lowers confidence in coarse windows: of frames off the period, or of all frames if there is no period.
fn lower_coarse_confidence(frames: &mut [FrameSpan], sampling: Sampling) {
    let Some((_, mostly)) = MIN_EVEN_SHARES.into_iter().find(|(samples, _)| sampling.window < *samples)
    else {
        return;
    };
    let lengths_s = lengths_s(frames);
    let most_s = if sampling.window < MIN_WINDOW_SAMPLES { 0.5 / sampling.rate_hz } else { f64::INFINITY };
    let mut even = periodicity::even_gaps(&lengths_s, most_s);
    let many = even.iter().filter(|even| **even).count() as f64;
    let crowded =
        upper_median(&mut lengths_s.clone()) * sampling.rate_hz < MIN_GAP_WINDOWS * sampling.window as f64;
    if many < mostly * even.len() as f64 || crowded && sampling.window < COARSE_WINDOW_SAMPLES {
        even.fill(false);
    } else if sampling.window >= COARSE_WINDOW_SAMPLES {
        return;
    }
    even.push(even.last().copied().unwrap_or(false));
    frames
        .iter_mut()
        .zip(even)
        .filter(|(_, even)| !even)
        .for_each(|(frame, _)| frame.confidence *= SUSPECT_CONFIDENCE);
}

fn flag_lengths(frames: &mut [FrameSpan]) {
    let Some(median_s) = median_duration_s(frames) else { return };
    for frame in frames {
        let duration_s = frame.end_s - frame.start_s;
        if duration_s > 1.5 * median_s {
            frame.flags.insert(Flag::Long);
        } else if duration_s < 0.5 * median_s {
            frame.flags.insert(Flag::Short);
        }
    }
}

/// Flags frames about as long as several of their neighbours, as a part of one, or of odd length.
fn flag_unusual(frames: &mut [FrameSpan]) {
    let lengths_s = lengths_s(frames);
    for ((frame, length_s), usual_s) in
        frames.iter_mut().zip(&lengths_s).zip(periodicity::usual_gaps(&lengths_s))
    {
        let Some([usual_s, others_s]) = usual_s else { continue };
        if *length_s > MAX_LENGTH_RATIO * usual_s {
            frame.flags.insert(Flag::Merged);
        } else if length_s * MAX_LENGTH_RATIO < usual_s {
            frame.flags.insert(Flag::Split);
        } else if (length_s - usual_s).abs() > (ODD_LIMITS[0] * usual_s).max(ODD_LIMITS[1] * others_s) {
            frame.flags.insert(Flag::IrregularLength);
        }
    }
}

/// Median duration of the frames between found starts, s: the last one, cut by the end mark, counts only if
/// alone.
fn median_duration_s(frames: &[FrameSpan]) -> Option<f64> {
    let counted = if frames.len() > 1 { &frames[..frames.len() - 1] } else { frames };
    let mut durations: Vec<f64> = counted.iter().map(|frame| frame.end_s - frame.start_s).collect();
    (!durations.is_empty()).then(|| upper_median(&mut durations))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn flags_print_in_a_fixed_order() {
        let mut flags = Flags::default();
        assert_eq!(flags.to_string(), "");
        flags.insert(Flag::LowConfidence);
        flags.insert(Flag::Last);
        assert_eq!(flags.to_string(), "last+low_confidence");
        assert!(flags.contains(Flag::Last) && !flags.contains(Flag::Long));
    }

    #[test]
    fn every_name_is_read_back_and_others_are_refused_with_the_choice() {
        for method in FinderMethod::ALL {
            assert_eq!(method.to_string().parse(), Ok(method));
        }
        assert_eq!(
            "dtw".parse::<FinderMethod>(),
            Err("no method dtw: choose one of squares, normalized, tracking, auto, consensus, segments"
                .to_owned())
        );
    }

    const FINE: Sampling = Sampling { window: 250, rate_hz: 50e3 };

    /// Starts with gaps of so many seconds, all of one confidence.
    pub(super) fn starts(gaps_s: &[f64], confidence: f64) -> Vec<FrameStart> {
        let mut time_s = 0.0;
        let mut start = |gap_s: f64| {
            time_s += gap_s;
            FrameStart { time_s, distance_w2: 0.0, confidence, marked: false }
        };
        core::iter::once(0.0).chain(gaps_s.iter().copied()).map(&mut start).collect()
    }

    fn flagged(gaps_s: &[f64], flag: Flag) -> Vec<usize> {
        let starts = starts(gaps_s, 1.0);
        let end_s = starts.last().map_or(1.0, |last| last.time_s + 1.0);
        let frames = spans(&starts, end_s, FINE);
        (0..frames.len()).filter(|&index| frames[index].flags.contains(flag)).collect()
    }

    #[test]
    fn a_start_misplaced_in_an_even_beat_makes_both_its_frames_odd() {
        let gaps_s = [1.0, 1.01, 0.99, 1.0, 1.2, 0.8, 1.0, 1.01, 1.0, 0.99];
        assert_eq!(flagged(&gaps_s, Flag::IrregularLength), [4, 5]);
    }

    #[test]
    fn a_clock_step_and_lengths_that_vary_anyway_are_not_odd() {
        let step_s = [1.0, 1.01, 0.99, 1.0, 1.01, 1.4, 1.41, 1.39, 1.4, 1.4, 1.41];
        assert!(flagged(&step_s, Flag::IrregularLength).is_empty());
        let varied_s = [1.0, 1.2, 0.9, 1.15, 0.85, 1.1, 0.95, 1.2, 0.9, 1.0];
        assert!(flagged(&varied_s, Flag::IrregularLength).is_empty());
    }

    #[test]
    fn merged_and_split_frames_are_called_that_and_not_odd() {
        let gaps_s = [1.0, 1.0, 1.0, 2.0, 1.0, 1.0, 0.5, 0.5, 1.0, 1.0, 1.0];
        assert_eq!((flagged(&gaps_s, Flag::Merged), flagged(&gaps_s, Flag::Split)), (vec![3], vec![6, 7]));
        assert!(flagged(&gaps_s, Flag::IrregularLength).is_empty());
    }

    #[test]
    fn frames_of_a_handful_of_samples_are_coarse() {
        let starts = starts(&[0.9, 1.7, 1.5], 1.0);
        let frames = spans(&starts, 4.2, Sampling { window: 5, rate_hz: 10.0 });
        let coarse: Vec<bool> = frames.iter().map(|frame| frame.flags.contains(Flag::Coarse)).collect();
        assert_eq!(coarse, [true, false, true, true]);
    }

    fn low_confidence(gaps_s: &[f64], sampling: Sampling) -> Vec<usize> {
        let starts = starts(gaps_s, 1.0);
        let frames = spans(&starts, starts.last().map_or(1.0, |last| last.time_s + 1.0), sampling);
        (0..frames.len()).filter(|&index| frames[index].flags.contains(Flag::LowConfidence)).collect()
    }

    #[test]
    fn in_a_coarse_window_what_breaks_the_beat_has_low_confidence_and_without_a_beat_all_is() {
        let coarse = Sampling { window: 10, rate_hz: 20.0 };
        let mut gaps_s = vec![1.0; 30];
        (gaps_s[10], gaps_s[11]) = (1.15, 0.85);
        assert_eq!(low_confidence(&gaps_s, coarse), [10, 11]);
        assert!(low_confidence(&gaps_s, FINE).is_empty());
        let halves: Vec<f64> = (0..30).map(|i| if i % 2 == 0 { 1.2 } else { 0.8 }).collect();
        assert_eq!(low_confidence(&halves, coarse).len(), 31);
        assert_eq!(low_confidence(&halves, Sampling { window: 40, ..coarse }).len(), 31);
        assert!(low_confidence(&halves, FINE).is_empty());
    }

    #[test]
    fn with_a_handful_of_samples_gaps_must_agree_within_half_of_one() {
        let mut gaps_s = vec![1.0; 30];
        (gaps_s[10], gaps_s[11]) = (1.06, 0.94);
        assert_eq!(low_confidence(&gaps_s, Sampling { window: 5, rate_hz: 10.0 }), [10, 11]);
        assert!(low_confidence(&gaps_s, Sampling { window: 8, rate_hz: 10.0 }).is_empty());
    }

    #[test]
    fn frames_hardly_longer_than_a_coarse_window_all_have_low_confidence() {
        assert_eq!(low_confidence(&[1.0; 30], Sampling { window: 10, rate_hz: 11.0 }).len(), 31);
    }
}
