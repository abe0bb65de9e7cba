//! Which method, where none was asked for.

use super::beat;
use super::find::Found;
use super::marks::{MarkError, Marks};
use super::matched::find_matched;
use super::method::Method;
use super::tracked::find_tracked;
use crate::trace::Trace;

/// With fewer starts than this there is too little to learn from: the sum of squares is kept.
const FEW: usize = 16;
/// With fewer samples in the window shapes are too coarse to be followed: of all methods that with the most even beat is taken.
const COARSE: usize = 20;
/// With fewer yet, the sum of squares is kept: any beat can be found among so many look-alikes.
const COARSEST: usize = 8;
/// Traces of more samples are tracked only where the sum of squares is in doubt.
const LONG: usize = 1 << 24;
/// How much more of the trace another method must cover with an even beat to be preferred to the sum of squares.
const BETTER: f64 = 0.02;

/// [`Method::Auto`].
pub(super) fn find_auto(trace: &Trace, marks: &Marks) -> Result<Found, MarkError> {
    let squares = find_matched(trace, marks, Method::SumOfSquares)?;
    let samples = marks.place(trace)?.samples;
    if squares.starts.len() < FEW || samples < COARSEST {
        return Ok(squares);
    }
    if samples < COARSE {
        return Ok(steadiest(
            squares,
            [find_tracked(trace, marks)?, find_matched(trace, marks, Method::Normalized)?],
        ));
    }
    let long_and_clear = trace.samples() > LONG && squares.threshold.clarity() >= 1.0;
    if long_and_clear { Ok(squares) } else { find_tracked(trace, marks) }
}

/// That of the results whose even beat covers most time.
fn steadiest(first: Found, others: [Found; 2]) -> Found {
    others.into_iter().fold(first, |best, other| {
        let more_s = covered_s(&other) - covered_s(&best);
        if more_s > BETTER * span_s(&best).max(span_s(&other)) { other } else { best }
    })
}

fn covered_s(found: &Found) -> f64 {
    let gaps_s: Vec<f64> = found.starts.windows(2).map(|two| two[1].time_s - two[0].time_s).collect();
    beat::covered(&gaps_s)
}

fn span_s(found: &Found) -> f64 {
    found.starts.last().zip(found.starts.first()).map_or(0.0, |(last, first)| last.time_s - first.time_s)
}
