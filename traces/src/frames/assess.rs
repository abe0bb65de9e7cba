//! Confidence of each start, and warnings about the result as a whole: also about work before the first start
//! and after the last frame.
//!
//! *Consensus*: found starts are tried as marks. Any ordinary frame as the mark gives the same frames, and
//! among them the one that was marked. Where a search has lost its way it does not: the frames found from its
//! own starts are others, and the mark is none of them. So several found starts, evenly chosen, are tried as
//! marks, by tracking and by the sum of squares. The method whose searches agree more with its first one is
//! taken, and how many of them find a frame is the confidence in that.

use super::marks::{Marks, Placement, Window};
use super::threshold::{MIN_SEPARATION, Rule, Threshold};
use super::{FinderMethod, Flag, Found, FrameStart, MIN_CONFIDENCE, Sampling, median_duration_s, spans};
use crate::pairing::{TOLERANCE_S, true_beside_found};
use crate::trace::{Metadata, Trace};
use core::ops::Range;
use rayon::prelude::*;
use std::borrow::Cow;
use warnings::{Code, Warning};

/// Frames of fewer samples are measured coarsely: half a sample at either end is a hundredth of the frame.
const MIN_FRAME_SAMPLES: f64 = 50.0;
/// Largest share of frames of odd length, by number or by covered time, of a regular spacing: as for low confidence.
const MAX_ODD_SHARE: f64 = 0.1;
/// Largest share of frames of low confidence without a warning about the whole result: above the share of
/// right frames that are flagged in the median over the seeds of `docs/finding.md` (*Flags*).
const MAX_LOW_CONFIDENCE_SHARE: f64 = 0.1;

/// The confidence of a distance (W^2): 1 at or below the mean of the matches, 0 at or above that of the rest,
/// linear in the logarithm between; scaled down where neither the populations are distinct nor the starts
/// evenly spaced.
pub(crate) fn confidence(threshold: &Threshold) -> impl Fn(f64) -> f64 {
    let [low, high] =
        [threshold.matched, threshold.rest].map(|of| libm::log(of.mean_w2.max(f64::MIN_POSITIVE)));
    move |distance_w2| {
        if high <= low {
            return 0.0;
        }
        let nearness = (high - libm::log(threshold.excess_w2(distance_w2))) / (high - low);
        nearness.clamp(0.0, 1.0) * threshold.clarity()
    }
}

/// Frames, flags and warnings from the starts.
pub(super) fn conclude(
    trace: &Trace,
    marks: &Marks,
    placement: &Placement,
    starts: Vec<FrameStart>,
    threshold: Threshold,
) -> Found {
    conclude_at(trace.rate_hz(), marks, placement, starts, threshold)
}

/// As [`conclude`], of samples at `rate_hz` that need not be in memory.
pub(crate) fn conclude_at(
    rate_hz: f64,
    marks: &Marks,
    placement: &Placement,
    starts: Vec<FrameStart>,
    threshold: Threshold,
) -> Found {
    let frames = spans(&starts, marks.end_s, Sampling { window: placement.samples, rate_hz });
    let period_s = 1.0 / rate_hz;
    let pre_s = placement.marks.first().map_or(0.0, |mark| libm::round(mark.anchor) * period_s);
    let window = Window { pre_s, post_s: placement.samples as f64 * period_s - pre_s };
    let mut found = Found {
        starts,
        frames,
        end_s: marks.end_s,
        method: FinderMethod::SumOfSquares,
        window,
        threshold,
        warnings: Vec::new(),
    };
    let median_s = median_duration_s(&found.frames);
    found.warnings = [
        window_cut(placement, &found),
        only_marks(&found),
        weak_separation(&found),
        irregular(&found),
        low_confidence(&found),
        median_s.and_then(|median_s| window_too_long(&found, median_s)),
        median_s.and_then(|median_s| few_samples(median_s, rate_hz)),
    ]
    .into_iter()
    .flatten()
    .collect();
    found
}

fn window_cut(placement: &Placement, found: &Found) -> Option<Warning> {
    placement.cut.then(|| {
        Warning::new(Code::WindowCut, format!(
            "the marked window reaches beyond the trace and was cut to {:.3} ms before and {:.3} ms after the mark; \
             mark a frame further inside",
            found.window.pre_s * 1e3, found.window.post_s * 1e3))
    })
}

fn only_marks(found: &Found) -> Option<Warning> {
    found.starts.iter().all(|start| start.marked).then(|| {
        Warning::new(Code::OnlyMark, String::from(
            "nothing else in the trace resembles the marked frame: what is reported is the mark to the end mark; mark a \
             more typical frame, or several"))
    })
}

fn weak_separation(found: &Found) -> Option<Warning> {
    let threshold = &found.threshold;
    let split = matches!(threshold.rule, Rule::Otsu | Rule::OtsuRegular | Rule::OtsuDistinct);
    (split && threshold.clarity() < 1.0).then(|| {
        Warning::new(Code::WeakSeparation, format!(
            "frame starts and other minima are not distinct (separation {:.2}, clear above {MIN_SEPARATION}; {:.0} % evenly \
             spaced; mean {:.3e} W^2 below the threshold {:.3e} W^2, {:.3e} W^2 above): starts may be missed or false; \
             mark several frames, or record with V-sync",
            threshold.separation, 100.0 * threshold.regularity, threshold.matched.mean_w2, threshold.value_w2, threshold.rest.mean_w2))
    })
}

fn irregular(found: &Found) -> Option<Warning> {
    let inner = found.frames.split_last().map_or(&[][..], |(_, inner)| inner);
    let odd = |flag: Flag| inner.iter().filter(move |frame| frame.flags.contains(flag));
    let (long, short) = (odd(Flag::Long).count(), odd(Flag::Short).count());
    let covered_s: f64 = inner.iter().map(|frame| frame.end_s - frame.start_s).sum();
    // From 0.0, as the sum of nothing is -0.0 and would be printed so.
    let long_s = odd(Flag::Long).fold(0.0, |sum, frame| sum + (frame.end_s - frame.start_s));
    let irregular =
        (long + short) as f64 > MAX_ODD_SHARE * inner.len() as f64 || long_s > MAX_ODD_SHARE * covered_s;
    irregular.then(|| {
        Warning::new(Code::IrregularSpacing, format!(
            "of {} frames {long} are longer than 1.5 median durations ({:.0} % of the time) and {short} shorter than \
             0.5: starts were missed, are false, or the frame time really jumps",
            inner.len(), 100.0 * long_s / covered_s))
    })
}

fn low_confidence(found: &Found) -> Option<Warning> {
    let flagged = found.frames.iter().filter(|frame| frame.flags.contains(Flag::LowConfidence)).count();
    let all = found.frames.len();
    (flagged as f64 > MAX_LOW_CONFIDENCE_SHARE * all as f64).then(|| {
        Warning::new(Code::LowConfidence, format!(
            "{flagged} of {all} frames have a confidence below one half: their starts may be those of something else that \
             repeats; look at them before their energies are used, mark several frames, or sample faster"))
    })
}

fn window_too_long(found: &Found, median_s: f64) -> Option<Warning> {
    let window_s = found.window.pre_s + found.window.post_s;
    // A tenth of slack: a window of just the period is what default_window gives.
    (found.frames.len() > 1 && window_s > 1.1 * median_s).then(|| {
        Warning::new(Code::WindowLongerThanFrame, format!(
            "the window of {:.3} ms is longer than the median frame of {:.3} ms: shorter frames may be missed; shrink it",
            window_s * 1e3, median_s * 1e3))
    })
}

impl Found {
    /// With other confidences of starts, except the marks, and of frames.
    pub(super) fn with_confidence(mut self, starts: Vec<f64>, frames: Vec<f64>) -> Self {
        let unmarked = self.starts.iter_mut().zip(starts).filter(|(start, _)| !start.marked);
        unmarked.for_each(|(start, confidence)| start.confidence = confidence);
        for (frame, confidence) in self.frames.iter_mut().zip(frames) {
            frame.confidence = confidence;
            frame.flags.set(Flag::LowConfidence, confidence < MIN_CONFIDENCE);
        }
        self.warnings.retain(|warning| warning.code != Code::LowConfidence);
        self.warnings.extend(low_confidence(&self));
        self
    }

    /// Adds the warning about a window that is longer than the time after which power repeats, where the
    /// frames found do not show it: starts nearer than half the window are never found.
    pub(crate) fn warn_of_long_window(&mut self, repetition_s: Option<f64>) {
        let warned = self.warnings.iter().any(|warning| warning.code == Code::WindowLongerThanFrame);
        let window_s = self.window.pre_s + self.window.post_s;
        if let Some(repetition_s) =
            repetition_s.filter(|repetition_s| !warned && window_s > 1.1 * repetition_s)
        {
            self.warnings.push(Warning::new(Code::WindowLongerThanFrame, format!(
                "the window of {:.3} ms is longer than the {:.3} ms after which power repeats: frames may be as short; shrink it",
                window_s * 1e3, repetition_s * 1e3)));
        }
    }
}

fn few_samples(median_s: f64, rate_hz: f64) -> Option<Warning> {
    let samples = median_s * rate_hz;
    (samples < MIN_FRAME_SAMPLES).then(|| {
        Warning::new(Code::FewSamples, format!(
            "the median frame has {samples:.1} samples, fewer than {MIN_FRAME_SAMPLES}: starts and energies are coarse; \
             sample faster"))
    })
}

/// Least work without a start that gives a warning, in usual lengths of a frame.
const MIN_UNCOVERED_LENGTHS: usize = 3;
/// A segment is busy above this share of the way from the lowest power to the mean within frames.
const BUSY_LEVEL: f64 = 0.5;
/// Segments per usual length of a frame; the lowest power is that of a segment.
const SEGMENTS_PER_LENGTH: usize = 20;

/// Work beyond the starts, in usual lengths of a frame; places are in samples and in order. `None` for fewer
/// than three starts.
fn uncovered_lengths(power: &[f64], starts: &[f64]) -> Option<usize> {
    let (&first, &last) = starts.first().zip(starts.last())?;
    let mut gaps: Vec<f64> = starts.windows(2).map(|two| two[1] - two[0]).collect();
    gaps.sort_by(f64::total_cmp);
    let usual = (*gaps.get(gaps.len() / 2).filter(|_| gaps.len() > 1)? as usize).max(1);
    let place = |position: f64| (position.max(0.0) as usize).min(power.len());
    let mean = |of: &[f64]| of.iter().sum::<f64>() / of.len().max(1) as f64;
    let lowest =
        power.chunks_exact((usual / SEGMENTS_PER_LENGTH).max(1)).map(mean).fold(f64::INFINITY, f64::min);
    let busy_w = lowest + BUSY_LEVEL * (mean(&power[place(first)..place(last)]) - lowest);
    let (before, after) = (&power[..place(first)], &power[place(last + usual as f64)..]);
    let busy = before.rchunks_exact(usual).chain(after.chunks_exact(usual)).filter(|of| mean(of) > busy_w);
    Some(busy.count())
}

/// The warning, where there is much.
pub(super) fn uncovered_work(power: &[f64], starts: &[f64]) -> Option<Warning> {
    let frames = uncovered_lengths(power, starts).filter(|frames| *frames >= MIN_UNCOVERED_LENGTHS)?;
    Some(Warning::new(
        Code::Uncovered,
        format!(
            "before the first start and after the last frame there is work of about {frames} frames in which none was found: \
         frames are missing there; mark one of them, too"
        ),
    ))
}

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

    /// A result with the share of all searches that find a start or a frame as its confidence; the first
    /// search counts with the confidence that it has, and where no other has looked the others agree as they
    /// do elsewhere.
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frames::tests::starts;

    #[test]
    fn many_frames_of_low_confidence_give_a_warning() {
        let marks = Marks::one(0.0, Window { pre_s: 0.1, post_s: 0.4 }, 21.0);
        let placement = Placement { marks: Vec::new(), samples: 50, cut: false };
        let warned = |flagged: usize| {
            let mut starts = starts(&[1.0; 20], 1.0);
            starts[..flagged].iter_mut().for_each(|start| start.confidence = 0.2);
            let found = conclude_at(100.0, &marks, &placement, starts, Threshold::none());
            found.warnings.iter().any(|warning| warning.code == "low-confidence")
        };
        assert!(!warned(0) && !warned(2) && warned(3));
    }

    /// Idle of 500 samples, frames of 100, busy for 70, and idle again.
    fn power(frames: usize) -> Vec<f64> {
        let work = (0..100 * frames).map(|i| if i % 100 < 70 { 3.0 } else { 1.0 });
        [1.0; 500].into_iter().chain(work).chain([1.0; 500]).collect()
    }

    fn every_100(from: usize, to: usize) -> Vec<f64> {
        (from..to).map(|frame| 500.0 + 100.0 * frame as f64).collect()
    }

    #[test]
    fn frames_left_out_at_either_end_are_counted() {
        let power = power(40);
        assert_eq!(uncovered_lengths(&power, &every_100(0, 40)), Some(0));
        assert_eq!(uncovered_lengths(&power, &every_100(7, 40)), Some(7));
        assert_eq!(uncovered_lengths(&power, &every_100(7, 30)), Some(17));
        assert_eq!(uncovered_lengths(&power, &every_100(0, 2)), None);
    }

    #[test]
    fn one_frame_more_or_less_is_no_matter() {
        let power = power(40);
        assert!(uncovered_work(&power, &every_100(1, 39)).is_none());
        let warning = uncovered_work(&power, &every_100(0, 37)).unwrap();
        assert_eq!(warning.code, Code::Uncovered);
        assert!(warning.message.contains("about 3 frames"));
    }
}
