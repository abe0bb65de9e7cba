//! A mark proposed by the program: of the steepest rises, the one whose likes are most evenly spaced.

use super::find::{Options, find_with};
use super::marks::{Marks, default_window};
use super::method::Method;
use crate::metadata::Metadata;
use crate::trace::Trace;
use serde::Serialize;

/// No more samples than this, around the middle, are looked at.
const LOOKED_AT: usize = 1 << 20;
/// How many rises are tried.
const TRIED: usize = 8;

/// A proposed mark.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Proposal {
    /// The frame start, s.
    pub mark_s: f64,
    /// How evenly the starts like it divide the stretch that was looked at, 0 to 1.
    pub regularity: f64,
    /// How many starts like it there are in that stretch.
    pub alike: usize,
    /// How many rises were tried.
    pub tried: usize,
}

/// Proposes the start of a frame about the middle of a trace; `None` where power never rises.
pub fn propose(trace: &Trace) -> Option<Proposal> {
    let from = trace.samples().saturating_sub(LOOKED_AT) / 2;
    let to = trace.samples().min(from + LOOKED_AT);
    let (voltage_v, current_a) = (trace.voltage_v()[from..to].to_vec(), trace.current_a()[from..to].to_vec());
    let start_s = trace.time_s(from);
    let part = Trace::new(voltage_v, current_a, trace.rate_hz(), start_s, Metadata::default()).ok()?;
    let rises = rises(&part);
    let tried = rises.len();
    let judged = rises.into_iter().filter_map(|mark_s| {
        let window = default_window(0.0, part.rate_hz());
        let marks = Marks::one(mark_s, window, part.end_s());
        let found = find_with(&part, &marks, &Options { method: Method::SumOfSquares }).ok()?;
        let (regularity, alike) = (found.threshold.regularity, found.starts.len());
        Some(Proposal { mark_s, regularity, alike, tried })
    });
    // Of equally even ones the rarer: a start comes once a frame, what is alike within frames more often.
    judged.max_by(|a, b| {
        let even = |p: &Proposal| libm::round(p.regularity * 20.0);
        even(a).total_cmp(&even(b)).then(b.alike.cmp(&a.alike)).then(b.mark_s.total_cmp(&a.mark_s))
    })
}

/// Times of the steepest rises in the middle half, apart by at least the usual window.
fn rises(trace: &Trace) -> Vec<f64> {
    let power: Vec<f64> = trace.powers_w().collect();
    let half = (libm::round(4e-4 * trace.rate_hz()) as usize).max(2);
    let (first, last) = (power.len() / 4, 3 * power.len() / 4);
    let mut prefix = vec![0.0];
    prefix.extend(power.iter().scan(0.0, |sum, watts| {
        *sum += watts;
        Some(*sum)
    }));
    let rise = |k: usize| prefix[k + half] - 2.0 * prefix[k] + prefix[k - half];
    let mut places: Vec<usize> =
        (first.max(half)..last.min(power.len().saturating_sub(half))).filter(|&k| rise(k) > 0.0).collect();
    places.sort_by(|&a, &b| rise(b).total_cmp(&rise(a)).then(a.cmp(&b)));
    let apart = libm::round(5e-3 * trace.rate_hz()) as usize;
    let mut taken: Vec<usize> = Vec::new();
    for place in places {
        if taken.len() == TRIED {
            break;
        }
        if taken.iter().all(|other| other.abs_diff(place) > apart) {
            taken.push(place);
        }
    }
    taken.into_iter().map(|place| trace.time_s(place)).collect()
}
