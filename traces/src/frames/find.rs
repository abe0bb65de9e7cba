//! Finding frames, by the method asked for.

use super::assess;
use super::auto::find_auto;
use super::found::{Found, marked_starts};
use super::marks::{MarkError, Marks};
use super::matched::find_matched;
use super::method::Method;
use super::threshold::choose;
use super::tracked::find_tracked;
use crate::trace::Trace;

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
