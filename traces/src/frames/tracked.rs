//! Starts by the sequence that fits best.

use super::alternate::Turns;
use super::assess;
use super::flat::flat_mark_of;
use super::found::{Found, FrameStart, spacing};
use super::lock::{Ticks, ticks};
use super::marks::{MarkError, Marks, Placed, Placement};
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

/// By the sequence of starts that fits best.
pub(super) fn find_tracked(trace: &Trace, marks: &Marks) -> Result<Found, MarkError> {
    let placement = marks.place(trace)?;
    let power: Vec<f64> = trace.powers_w().collect();
    let tracked = whole(&power, track(&power, &placement).starts, &placement);
    let offsets: Vec<usize> = tracked.iter().map(|start| start.offset).collect();
    let marked: Vec<Option<&Placed>> =
        offsets.iter().map(|offset| placement.marks.iter().find(|mark| mark.first == *offset)).collect();
    let fixed: Vec<bool> = marked.iter().map(Option::is_some).collect();
    let anchor = placement.marks.first().map_or(0.0, |mark| mark.anchor);
    let positions = register(&power, &offsets, &fixed, libm::round(anchor) as usize, placement.samples);
    let positions = settle(&power, positions, &fixed, anchor, placement.samples);
    let noise_w = libm::sqrt(noise_variance(&power));
    let (positions, kept) = phases(&power, noise_w, positions, &tracked, &fixed, anchor, placement.samples);
    let start = |(((start, position), kept), marked): (((&Start, f64), f64), &Option<&Placed>)| FrameStart {
        time_s: marked.map_or(trace.start_s() + (position + anchor) * trace.period_s(), |mark| mark.mark_s),
        distance_w2: start.distance_w2,
        confidence: kept * start.confidence,
        marked: marked.is_some(),
    };
    let mut starts: Vec<FrameStart> =
        tracked.iter().zip(positions).zip(kept).zip(&marked).map(start).collect();
    starts.dedup_by(|later, earlier| later.time_s <= earlier.time_s && !later.marked);
    let end_tolerance_s = 0.5 * spacing(placement.samples) as f64 * trace.period_s();
    starts.retain(|start| start.marked || start.time_s < marks.end_s - end_tolerance_s);
    let nothing = Threshold { rule: Rule::Sequence, ..choose(&[], 0.0, 0.0, 0.0, |_| 0.0) };
    let mut found = assess::conclude(trace, marks, &placement, starts, nothing);
    let places: Vec<f64> = found.starts.iter().map(|start| trace.position(start.time_s)).collect();
    let end = (trace.position(marks.end_s).max(0.0) as usize).min(power.len());
    found.warnings.extend(uncovered(&power[..end], &places));
    found.warnings.extend(flat_mark_of(&power, &placement, noise_w));
    found.method = Method::Tracking;
    Ok(found)
}

/// The starts without those that cut a frame in two; what is left of the confidence of those that take turns is less.
fn whole(power: &[f64], starts: Vec<Start>, placement: &Placement) -> Vec<Start> {
    let is_marked = |start: &Start| placement.marks.iter().any(|mark| mark.first == start.offset);
    let anchor = placement.marks.first().map_or(0.0, |mark| mark.anchor);
    let places: Vec<f64> = starts.iter().map(|start| start.offset as f64 + anchor).collect();
    let marked: Vec<bool> = starts.iter().map(is_marked).collect();
    let turns = Turns::new(power, &places, &marked, placement.samples);
    let uncut = starts.into_iter().zip(spread(turns.left, &marked)).zip(turns.cut).filter(|(_, cut)| !cut);
    uncut.map(|((start, left), _)| Start { left: left * start.left, ..start }).collect()
}

/// Positions on the ticks of the display, where there are any, and what is left of the confidence of each start.
fn phases(
    power: &[f64],
    noise_w: f64,
    positions: Vec<f64>,
    starts: &[Start],
    fixed: &[bool],
    anchor: f64,
    width: usize,
) -> (Vec<f64>, Vec<f64>) {
    let places =
        |positions: &[f64]| -> Vec<f64> { positions.iter().map(|position| position + anchor).collect() };
    let first_mark = fixed.iter().position(|fixed| *fixed);
    let (positions, in_phase) = match first_mark.and_then(|mark| ticks(&positions, mark, width)) {
        // What begins on a tick is in the phase of the mark, whatever happened on the way.
        Some(Ticks { positions, between }) => {
            (positions, between.iter().map(|between| if *between { BETWEEN } else { 1.0 }).collect())
        }
        None => {
            let rests = spread(rest::left(power, &places(&positions), fixed, width), fixed);
            (positions, product(starts.iter().map(|start| start.left), rests))
        }
    };
    let rested = spread(unrested::left(power, &places(&positions), width, noise_w), fixed);
    (positions, product(in_phase, rested))
}

/// Doubts spread to the starts near, but not to marks, which are where they were put.
fn spread(left: Vec<f64>, marked: &[bool]) -> Vec<f64> {
    let spread = rest::spread(left).into_iter().zip(marked);
    spread.map(|(left, marked)| if *marked { 1.0 } else { left }).collect()
}

fn product(a: impl IntoIterator<Item = f64>, b: Vec<f64>) -> Vec<f64> {
    a.into_iter().zip(b).map(|(a, b)| a * b).collect()
}
