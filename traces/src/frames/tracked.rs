//! Starts by the sequence that fits best.

use super::assess;
use super::find::{Found, FrameStart, spacing};
use super::lock::{Ticks, ticks};
use super::marks::{MarkError, Marks, Placed};
use super::method::Method;
use super::register::register;
use super::rest;
use super::settle::settle;
use super::threshold::choose;
use super::track::{Start, track};
use super::uncovered::uncovered;
use crate::trace::Trace;

/// What is left of the confidence of a start between the ticks of the display that the others wait for.
const BETWEEN: f64 = 0.4;

/// By the sequence of starts that fits best.
pub(super) fn find_tracked(trace: &Trace, marks: &Marks) -> Result<Found, MarkError> {
    let placement = marks.place(trace)?;
    let power: Vec<f64> = trace.powers_w().collect();
    let tracked = track(&power, &placement);
    let offsets: Vec<usize> = tracked.starts.iter().map(|start| start.offset).collect();
    let marked: Vec<Option<&Placed>> =
        offsets.iter().map(|offset| placement.marks.iter().find(|mark| mark.first == *offset)).collect();
    let fixed: Vec<bool> = marked.iter().map(Option::is_some).collect();
    let anchor = placement.marks.first().map_or(0.0, |mark| mark.anchor);
    let positions = register(&power, &offsets, &fixed, libm::round(anchor) as usize, placement.samples);
    let positions = settle(&power, positions, &fixed, anchor, placement.samples);
    let first_mark = fixed.iter().position(|fixed| *fixed);
    let (positions, kept) = match first_mark.and_then(|mark| ticks(&positions, mark, placement.samples)) {
        // What begins on a tick is in the phase of the mark, whatever happened on the way.
        Some(Ticks { positions, between }) => {
            (positions, between.iter().map(|between| if *between { BETWEEN } else { 1.0 }).collect())
        }
        None => {
            let places: Vec<f64> = positions.iter().map(|position| position + anchor).collect();
            let rests = rest::left(&power, &places, &fixed, placement.samples);
            let kept: Vec<f64> =
                tracked.starts.iter().zip(rests).map(|(start, rest)| start.left * rest).collect();
            (positions, kept)
        }
    };
    let start = |(((start, position), kept), marked): (((&Start, f64), f64), &Option<&Placed>)| FrameStart {
        time_s: marked.map_or(trace.start_s() + (position + anchor) * trace.period_s(), |mark| mark.mark_s),
        distance_w2: start.distance_w2,
        confidence: kept * start.confidence,
        marked: marked.is_some(),
    };
    let mut starts: Vec<FrameStart> =
        tracked.starts.iter().zip(positions).zip(kept).zip(&marked).map(start).collect();
    starts.dedup_by(|later, earlier| later.time_s <= earlier.time_s && !later.marked);
    let end_tolerance_s = 0.5 * spacing(placement.samples) as f64 * trace.period_s();
    starts.retain(|start| start.marked || start.time_s < marks.end_s - end_tolerance_s);
    let nothing = choose(&[], 0.0, 0.0, 0.0, |_| 0.0);
    let mut found = assess::conclude(trace, marks, &placement, starts, nothing);
    let places: Vec<f64> = found.starts.iter().map(|start| trace.position(start.time_s)).collect();
    let end = (trace.position(marks.end_s).max(0.0) as usize).min(power.len());
    found.warnings.extend(uncovered(&power[..end], &places));
    found.method = Method::Tracking;
    Ok(found)
}
