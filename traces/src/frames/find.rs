//! What is found, and by which method.

use super::assess;
use super::auto::find_auto;
use super::flags::Flags;
use super::marks::{MarkError, Marks, Placed, Placement, Window};
use super::matched::find_matched;
use super::method::Method;
use super::threshold::{Threshold, choose};
use super::tracked::find_tracked;
use crate::trace::Trace;
use crate::warning::Warning;

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

/// Finds every frame start like the marked ones, anywhere the window fits into the trace and before the end mark, by
/// [`Method::Auto`].
///
/// A start is at `mark + offset of the best alignment`: the marks themselves are exact by definition, and a mark set
/// late by some microseconds makes every start late by as many. Starts nearer to the end mark than a quarter of the
/// window are taken to be that end.
///
/// # Errors
/// [`MarkError`] if the marks do not fit the trace.
pub fn find(trace: &Trace, marks: &Marks) -> Result<Found, MarkError> {
    find_with(trace, marks, &Options::default())
}

/// How to search.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Options {
    /// Which method.
    pub method: Method,
}

/// As [`find`], with a method chosen.
///
/// # Errors
/// [`MarkError`] if the marks do not fit the trace.
pub fn find_with(trace: &Trace, marks: &Marks, options: &Options) -> Result<Found, MarkError> {
    match options.method {
        Method::SumOfSquares | Method::Normalized => find_matched(trace, marks, options.method),
        Method::Tracking => find_tracked(trace, marks),
        Method::Auto => find_auto(trace, marks),
    }
}

/// The marked frames alone, nothing searched for: for a recording that is known to hold no others.
///
/// # Errors
/// [`MarkError`] if the marks do not fit the trace.
pub fn marked_only(trace: &Trace, marks: &Marks) -> Result<Found, MarkError> {
    let placement = marks.place(trace)?;
    let nothing = choose(&[], 0.0, 0.0, 0.0, |_| 0.0);
    Ok(assess::conclude(trace, marks, &placement, marked_starts(&placement, &[]), nothing))
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
