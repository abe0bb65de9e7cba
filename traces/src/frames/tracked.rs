//! Starts by the sequence with the most evidence.

use super::assess::uncovered_work;
use super::found::{Found, FrameStart, Method, SUSPECT_CONFIDENCE, spacing};
use super::marks::{MarkError, Marks, Placed, Placement, flat_mark_of};
use super::matched::noise_variance;
use super::register::register;
use super::split_frames::SplitFrames;
use super::start_refinement::refine_starts;
use super::threshold::{Rule, Threshold, choose};
use super::track::{Start, track};
use super::vsync::{Snapped, snap_to_ticks};
use super::{assess, idle_gap};
use crate::trace::Trace;

/// Finds the sequence of starts with the most evidence.
pub(super) fn find_tracked(trace: &Trace, marks: &Marks) -> Result<Found, MarkError> {
    let placement = marks.place(trace)?;
    let power: Vec<f64> = trace.powers_w().collect();
    let tracked = without_false_starts(&power, track(&power, &placement).starts, &placement);
    let offsets: Vec<usize> = tracked.iter().map(|start| start.offset).collect();
    let marked: Vec<Option<&Placed>> =
        offsets.iter().map(|offset| placement.marks.iter().find(|mark| mark.first == *offset)).collect();
    let fixed: Vec<bool> = marked.iter().map(Option::is_some).collect();
    let anchor = placement.marks.first().map_or(0.0, |mark| mark.anchor);
    let positions = register(&power, &offsets, &fixed, libm::round(anchor) as usize, placement.samples);
    let positions = refine_starts(&power, positions, &fixed, anchor, placement.samples);
    let noise_w = libm::sqrt(noise_variance(&power));
    let (positions, kept) = in_phase(&power, noise_w, positions, &tracked, &fixed, anchor, placement.samples);
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
    found.warnings.extend(uncovered_work(&power[..end], &places));
    found.warnings.extend(flat_mark_of(&power, &placement, noise_w));
    found.method = Method::Tracking;
    Ok(found)
}

/// The starts without those that split a frame; alternating starts have lower confidence.
fn without_false_starts(power: &[f64], starts: Vec<Start>, placement: &Placement) -> Vec<Start> {
    let is_marked = |start: &Start| placement.marks.iter().any(|mark| mark.first == start.offset);
    let anchor = placement.marks.first().map_or(0.0, |mark| mark.anchor);
    let places: Vec<f64> = starts.iter().map(|start| start.offset as f64 + anchor).collect();
    let marked: Vec<bool> = starts.iter().map(is_marked).collect();
    let split = SplitFrames::new(power, &places, &marked, placement.samples);
    let kept = starts
        .into_iter()
        .zip(spread_from_unmarked(split.confidence_factors, &marked))
        .zip(split.splits_frame)
        .filter(|(_, cut)| !cut);
    kept.map(|((start, factor), _)| Start { confidence_factor: factor * start.confidence_factor, ..start })
        .collect()
}

/// Positions, on the ticks of the display if there are any, and confidence factors.
fn in_phase(
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
    let (positions, in_phase) = match first_mark.and_then(|mark| snap_to_ticks(&positions, mark, width)) {
        // What begins on a tick is in the phase of the mark, whatever happened on the way.
        Some(Snapped { positions, off_tick }) => {
            (positions, off_tick.iter().map(|off| if *off { SUSPECT_CONFIDENCE } else { 1.0 }).collect())
        }
        None => {
            let factors = spread_from_unmarked(
                idle_gap::shifted_gap_confidence(power, &places(&positions), fixed, width),
                fixed,
            );
            (positions, product(starts.iter().map(|start| start.confidence_factor), factors))
        }
    };
    let with_gap = spread_from_unmarked(
        idle_gap::missing_gap_confidence(power, &places(&positions), width, noise_w),
        fixed,
    );
    (positions, product(in_phase, with_gap))
}

/// Spreads suspicion to nearby starts, but not to marks, which are exact.
fn spread_from_unmarked(factors: Vec<f64>, marked: &[bool]) -> Vec<f64> {
    let spread = idle_gap::spread_to_neighbours(factors).into_iter().zip(marked);
    spread.map(|(factor, marked)| if *marked { 1.0 } else { factor }).collect()
}

fn product(a: impl IntoIterator<Item = f64>, b: Vec<f64>) -> Vec<f64> {
    a.into_iter().zip(b).map(|(a, b)| a * b).collect()
}
