//! What the finder found.

use super::flags::Flags;
use super::marks::{Placed, Placement, Window};
use super::method::Method;
use super::threshold::Threshold;
use crate::Warning;

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
    /// What is remarkable about it.
    pub flags: Flags,
}

/// What the finder found.
#[derive(Clone, Debug, PartialEq)]
pub struct Found {
    /// The starts, in order.
    pub starts: Vec<FrameStart>,
    /// The frames between them; as many as there are starts.
    pub frames: Vec<FrameSpan>,
    /// Where the last frame ends, s.
    pub end_s: f64,
    /// How it was found.
    pub method: Method,
    /// The window as compared, after cutting, s.
    pub window: Window,
    /// Which minima were taken, and why.
    pub threshold: Threshold,
    /// Where the result stands on weak ground.
    pub warnings: Vec<Warning>,
}

/// The least distance between two frame starts, in samples: half the window, as no frame is shorter than that.
pub(super) fn spacing(window_samples: usize) -> usize {
    (window_samples / 2).max(1)
}

pub(super) fn marked_starts(placement: &Placement, profile: &[f64]) -> Vec<FrameStart> {
    let start = |mark: &Placed| FrameStart {
        time_s: mark.mark_s,
        distance_w2: profile.get(mark.first).copied().unwrap_or(0.0),
        confidence: 1.0,
        marked: true,
    };
    placement.marks.iter().map(start).collect()
}
