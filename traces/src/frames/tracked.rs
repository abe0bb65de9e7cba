//! Starts by the sequence that fits best.

use super::alternate;
use super::assess;
use super::find::{Found, FrameStart, spacing};
use super::flat::flat_mark_of;
use super::lock::{Ticks, ticks};
use super::marks::{MarkError, Marks, Placed};
use super::matched::noise_variance;
use super::method::Method;
use super::register::register;
use super::rest;
use super::settle::settle;
use super::threshold::{Rule, Threshold, choose};
use super::track::{Start, track};
use super::uncovered::uncovered;
use super::unrested;
use crate::trace::Trace;

/// What is left of the confidence of a start between the ticks of the display that the others wait for.
const BETWEEN: f64 = 0.4;

/// What is left of the confidence of each start, from the power, their places, which are marked, and the width of the window.
type Doubts = fn(&[f64], &[f64], &[bool], usize) -> Vec<f64>;

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
    let (positions, kept) = phases(&power, positions, &tracked.starts, &fixed, anchor, placement.samples);
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
    let nothing = Threshold { rule: Rule::Sequence, ..choose(&[], 0.0, 0.0, 0.0, |_| 0.0) };
    let mut found = assess::conclude(trace, marks, &placement, starts, nothing);
    let places: Vec<f64> = found.starts.iter().map(|start| trace.position(start.time_s)).collect();
    let end = (trace.position(marks.end_s).max(0.0) as usize).min(power.len());
    found.warnings.extend(uncovered(&power[..end], &places));
    found.warnings.extend(flat_mark_of(&power, &placement));
    found.method = Method::Tracking;
    Ok(found)
}

/// Positions on the ticks of the display, where there are any, and what is left of the confidence of each start.
fn phases(
    power: &[f64],
    positions: Vec<f64>,
    starts: &[Start],
    fixed: &[bool],
    anchor: f64,
    width: usize,
) -> (Vec<f64>, Vec<f64>) {
    let places =
        |positions: &[f64]| -> Vec<f64> { positions.iter().map(|position| position + anchor).collect() };
    // Marks are where they were put.
    let spread = |left: Vec<f64>| -> Vec<f64> {
        let spread = rest::spread(left).into_iter().zip(fixed);
        spread.map(|(left, fixed)| if *fixed { 1.0 } else { left }).collect()
    };
    let first_mark = fixed.iter().position(|fixed| *fixed);
    let (positions, in_phase) = match first_mark.and_then(|mark| ticks(&positions, mark, width)) {
        // What begins on a tick is in the phase of the mark, whatever happened on the way.
        Some(Ticks { positions, between }) => {
            (positions, between.iter().map(|between| if *between { BETWEEN } else { 1.0 }).collect())
        }
        None => {
            let doubts = |left: Doubts| spread(left(power, &places(&positions), fixed, width));
            let moved = product(doubts(rest::left), doubts(alternate::left));
            (positions, product(starts.iter().map(|start| start.left), moved))
        }
    };
    let noise_w = libm::sqrt(noise_variance(power));
    let rested = spread(unrested::left(power, &places(&positions), width, noise_w));
    (positions, product(in_phase, rested))
}

fn product(a: impl IntoIterator<Item = f64>, b: Vec<f64>) -> Vec<f64> {
    a.into_iter().zip(b).map(|(a, b)| a * b).collect()
}
