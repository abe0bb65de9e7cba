//! Consensus: found starts are tried as marks.
//!
//! Any ordinary frame as the mark gives the same frames, and among them the one that was marked. Where a search has lost its way it does
//! not: the frames found from its own starts are others, and the mark is none of them. So several found starts, evenly chosen, are tried
//! as marks, by tracking and by the sum of squares. The method whose searches agree more with its first one is taken, and how many
//! of them find a frame is the confidence in that.

use super::marks::Marks;
use super::{FinderMethod, Found};
use crate::pairing::{TOLERANCE_S, true_beside_found};
use crate::trace::{Metadata, Trace};
use core::ops::Range;
use rayon::prelude::*;
use std::borrow::Cow;

/// Found starts that are tried as marks.
const TRIED: usize = 4;
/// Samples about the mark in which they are tried: hundreds of frames, and little beside a search of a long trace.
const MAX_SAMPLES: usize = 1 << 18;
/// By how much more the sum of squares must agree with itself than tracking does.
const MIN_GAIN: f64 = 0.05;

/// The better of two results, with what the searches from its own starts say as its confidence.
pub(super) fn more_agreed(
    trace: &Trace,
    marks: &Marks,
    [tracked, squares]: [Found; 2],
    search: impl Fn(&Trace, &Marks, FinderMethod) -> Option<Found> + Sync,
) -> Found {
    let part = part(trace, marks.starts_s[0]);
    let votes = [&tracked, &squares].map(|found| {
        let again = |starts_s| {
            let end_s = marks.end_s.min(part.end_s());
            search(&part, &Marks { starts_s, window: marks.window, end_s }, found.method)
        };
        Votes::of(&part, marks, found, again)
    });
    let [by_tracking, by_squares] = votes;
    if by_squares.agreement > by_tracking.agreement + MIN_GAIN {
        by_squares.applied(squares)
    } else {
        by_tracking.applied(tracked)
    }
}

/// The trace about a mark.
fn part(trace: &Trace, mark_s: f64) -> Cow<'_, Trace> {
    let middle = trace.position(mark_s).max(0.0) as usize;
    let from = middle.saturating_sub(MAX_SAMPLES / 2).min(trace.samples().saturating_sub(MAX_SAMPLES));
    let to = trace.samples().min(from + MAX_SAMPLES);
    let samples = |of: &[f32]| of[from..to].to_vec();
    let (voltage_v, current_a) = (samples(trace.voltage_v()), samples(trace.current_a()));
    Trace::new(voltage_v, current_a, trace.rate_hz(), trace.time_s(from), Metadata::default())
        .map_or(Cow::Borrowed(trace), Cow::Owned)
}

/// What searches from found starts say of a result.
struct Votes {
    searches: usize,
    /// The starts that lie in the searched part.
    inside: Range<usize>,
    /// How many searches have each of these starts, and the whole frame that begins there.
    starts: Vec<f64>,
    frames: Vec<f64>,
    /// Mean over searches of the F1 of their starts beside those of the result: 0 if the mark is none of them.
    agreement: f64,
}

impl Votes {
    fn of(
        part: &Trace,
        marks: &Marks,
        found: &Found,
        search: impl Fn(Vec<f64>) -> Option<Found> + Sync,
    ) -> Self {
        let all: Vec<f64> = found.starts.iter().map(|start| start.time_s).collect();
        let place = |time_s: f64| all.partition_point(|start_s| *start_s < time_s);
        let inside = place(part.start_s())..place(part.end_s());
        let own = &all[inside.clone()];
        let count = TRIED.min(own.len());
        let again = |index: usize| -> Option<Vec<f64>> {
            let found = search(vec![own[(2 * index + 1) * own.len() / (2 * count)]])?;
            Some(found.starts.iter().map(|start| start.time_s).collect())
        };
        let searches: Vec<Vec<f64>> = (0..count).into_par_iter().filter_map(again).collect();
        let mut votes = Self {
            searches: searches.len(),
            inside: inside.clone(),
            starts: vec![0.0; own.len()],
            frames: vec![0.0; own.len()],
            agreement: 0.0,
        };
        for other in searches {
            votes.count(own, &other, weight(&other, marks, part));
        }
        votes
    }

    /// Counts the votes of a search, by their weight.
    fn count(&mut self, own: &[f64], other: &[f64], weight: f64) {
        let beside = true_beside_found(own, other, TOLERANCE_S);
        for (index, here) in beside.iter().enumerate() {
            let Some(here) = here else { continue };
            let next = beside.get(index + 1).is_none_or(|next| *next == Some(here + 1));
            self.starts[index] += weight;
            self.frames[index] += if next { weight } else { 0.0 };
        }
        let shared = beside.iter().flatten().count();
        self.agreement +=
            weight * 2.0 * shared as f64 / (own.len() + other.len()) as f64 / self.searches as f64;
    }

    /// A result with the share of all searches that find a start or a frame as its confidence; the first search counts with the
    /// confidence that it has, and where no other has looked the others agree as they do elsewhere.
    fn applied(&self, found: Found) -> Found {
        let share = |votes: &[f64], index: usize, own: f64| {
            let elsewhere = self.agreement * self.searches as f64;
            let votes = index.checked_sub(self.inside.start).and_then(|index| votes.get(index));
            (votes.copied().unwrap_or(elsewhere) + own) / (self.searches + 1) as f64
        };
        let starts = found.starts.iter().enumerate();
        let starts = starts.map(|(index, start)| share(&self.starts, index, start.confidence)).collect();
        let frames = found.frames.iter().enumerate();
        let frames = frames.map(|(index, frame)| share(&self.frames, index, frame.confidence)).collect();
        found.with_confidence(starts, frames)
    }
}

/// The share of the marks in a part of a trace that a search finds.
fn weight(found_s: &[f64], marks: &Marks, part: &Trace) -> f64 {
    let inside = |mark_s: &&f64| (part.start_s()..part.end_s()).contains(*mark_s);
    let marks_s: Vec<f64> = marks.starts_s.iter().filter(inside).copied().collect();
    let has = |mark_s: &&f64| found_s.iter().any(|start_s| (start_s - **mark_s).abs() <= TOLERANCE_S);
    marks_s.iter().filter(has).count() as f64 / marks_s.len().max(1) as f64
}
