//! Frame starts from one marked frame (the thesis' Paper III, section 3.1). A window of power around the mark
//! is compared with every window of the trace by summed squared difference. A threshold chosen from the trace
//! itself separates starts from the rest; where it cannot, the result carries a [`Warning`].
//!
//! Constants of the finder have their reason beside them. Those that state none were tuned on the synthetic scenes and
//! seeds of `docs/finding.md`, section *Flags*, which also has the result on seeds that were not used.

mod assess;
mod consensus;
mod find;
mod idle_gap;
mod marks;
mod matched;
mod periodicity;
pub mod profile;
mod register;
mod segments;
mod spans;
mod split_frames;
mod start_refinement;
mod subsample;
mod threshold;
mod track;
mod vsync;

pub use find::{Options, Proposal, Step, find, find_with, marked_only, propose};
use marks::Placed;
pub(crate) use marks::Placement;
pub use marks::{MarkError, Marks, Window, default_window};
pub(crate) use matched::{Matched, Plan as MatchPlan, Samples, noise_deviation};
pub(crate) use periodicity::repetition_samples;
pub use threshold::{Population, Rule, Threshold};

use core::fmt;
use core::str::FromStr;
use serde::Serialize;
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
    /// Its flags.
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

/// Frames of lower confidence are flagged. Confidence is 1 at the mean distance of the matches and 0 at that of the other
/// minima, on a logarithmic scale: below one half a start is nearer to the others.
const MIN_CONFIDENCE: f64 = 0.5;
/// Confidence factor of a start that may be misplaced: below [`MIN_CONFIDENCE`], so that its frames are flagged however
/// well it matches. Its exact value only orders flagged frames; confidence is not calibrated.
const SUSPECT_CONFIDENCE: f64 = 0.8 * MIN_CONFIDENCE;
/// Confidence factor of a start beyond a phase slip: below [`SUSPECT_CONFIDENCE`], as it is off by a part of a frame.
const SLIPPED_CONFIDENCE: f64 = 0.6 * MIN_CONFIDENCE;

/// A note on a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Flag {
    /// The frame whose start was marked.
    Marked,
    /// It ends at the end mark, not at a found start.
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
    /// Its length deviates from the even period of its neighbours: one of its ends may be misplaced.
    IrregularLength,
    /// It has fewer than 16 samples: its ends, known to half a sample at best, may be off by a thirtieth of
    /// it and more.
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
    /// normalized; with fewer than 8 the sum of squares. Also the sum of squares for fewer than 16 frames, or for more than
    /// 16 million samples without a warning.
    #[default]
    Auto,
    /// The same, but the sum of squares also where searches from the frames found agree more by it than by tracking. How far
    /// these searches agree is the confidence.
    Consensus,
    /// Segmentation of the whole trace by one probabilistic model, or the result of another method where a criterion without truth
    /// prefers that.
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
}
