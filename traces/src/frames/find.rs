//! Finding frames: by a given method, by the most suitable one, or from a mark that the program proposes.

use super::assess::{more_agreed, uncovered_work};
use super::marks::{MarkError, Marks, Placed, Placement, default_window, flat_mark_of};
use super::matched::{find_matched, noise_variance};
use super::periodicity::{Snapped, snap_to_ticks};
use super::register::{refine_starts, register};
use super::segments::{Segmentation, segment};
use super::split_frames::SplitFrames;
use super::threshold::{Rule, Threshold};
use super::track::{Start, track};
use super::{FinderMethod, Found, FrameStart, SUSPECT_CONFIDENCE, marked_start, spacing};
use super::{assess, idle_gap, periodicity};
use crate::stats::upper_median;
use crate::trace::{Metadata, Trace};
use rayon::prelude::*;
use serde::Serialize;

/// Finds every frame start like the marked ones, anywhere the window fits into the trace and before the end
/// mark, by [`FinderMethod::Auto`].
///
/// A start is at `mark + offset of the best alignment`: the marks themselves are exact by definition, and a
/// mark set late by some microseconds makes every start late by as many. Starts nearer to the end mark than a
/// quarter of the window are taken to be that end.
///
/// # Errors
/// [`MarkError`] if the marks do not fit the trace.
pub fn find(trace: &Trace, marks: &Marks) -> Result<Found, MarkError> {
    find_with(trace, marks, &FinderOptions::default())
}

/// How to search.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FinderOptions {
    /// Which method.
    pub method: FinderMethod,
    /// A step that is left out, to measure what it is worth.
    pub without: Option<FinderStep>,
}

/// A step of tracking that can be left out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FinderStep {
    /// Frames of both sides of a clock step aligned.
    ClockSteps,
    /// Starts that split frames taken out.
    SplitFrames,
    /// Starts moved to where frames begin to agree.
    StartRefinement,
    /// Starts put on the ticks of the display.
    DisplayTicks,
    /// Lower confidence where the idle gap before a frame differs or is missing.
    IdleGaps,
    /// Lower confidence beyond a phase slip.
    PhaseSlips,
}

impl FinderStep {
    /// All of them, with their names.
    pub const ALL: [(&'static str, Self); 6] = [
        ("clock-steps", Self::ClockSteps),
        ("split-frames", Self::SplitFrames),
        ("start-refinement", Self::StartRefinement),
        ("display-ticks", Self::DisplayTicks),
        ("idle-gaps", Self::IdleGaps),
        ("phase-slips", Self::PhaseSlips),
    ];
}

/// As [`find`], with a method chosen.
///
/// # Errors
/// [`MarkError`] if the marks do not fit the trace.
pub fn find_with(trace: &Trace, marks: &Marks, options: &FinderOptions) -> Result<Found, MarkError> {
    match options.method {
        FinderMethod::SumOfSquares | FinderMethod::Normalized => find_matched(trace, marks, options.method),
        FinderMethod::Tracking => find_tracked(trace, marks, options.without),
        FinderMethod::Auto | FinderMethod::Consensus => find_auto(trace, marks, options),
        FinderMethod::Segments => find_segments(trace, marks, options),
    }
}

/// The marked frames alone, nothing searched for: for a recording that is known to hold no others.
///
/// # Errors
/// [`MarkError`] if the marks do not fit the trace.
pub fn marked_only(trace: &Trace, marks: &Marks) -> Result<Found, MarkError> {
    let placement = marks.place(trace)?;
    Ok(assess::conclude(
        trace,
        marks,
        &placement,
        placement.marks.iter().map(marked_start).collect(),
        Threshold::none(),
    ))
}

/// With fewer starts there is too little to learn from: the sum of squares is kept, unless tracking gives a
/// plainly good sequence.
const MIN_TRACKED_STARTS: usize = 16;
/// Fewest starts of a plainly good sequence where the sum of squares found more and warns: three gaps can
/// just be tested for evenness.
const MIN_STARTS: usize = 4;
/// Least share at an even period of a plainly good sequence.
const MIN_TRACKED_COVERAGE: f64 = 0.9;
/// Least correlation of neighbours in it. In noise it is 0.05, in frames at 0 dB 0.3 to 0.5.
const MIN_TRACKED_SIMILARITY: f64 = 0.5;
/// In windows of fewer samples shapes are too coarse to track: the method with the most even period is taken.
const COARSE_WINDOW_SAMPLES: usize = 20;
/// In windows of fewer samples the sum of squares is kept: any period can be found among so many similar
/// windows.
const MIN_WINDOW_SAMPLES: usize = 8;
/// Traces of more samples are tracked only where the sum of squares gives a warning.
const MAX_TRACKED_SAMPLES: usize = 1 << 24;
/// Share of the trace that another method must cover more at an even period, to be preferred to the sum of
/// squares.
const MIN_COVERAGE_GAIN: f64 = 0.02;

/// [`FinderMethod::Auto`] and [`FinderMethod::Consensus`].
fn find_auto(trace: &Trace, marks: &Marks, options: &FinderOptions) -> Result<Found, MarkError> {
    let without = options.without;
    let squares = find_matched(trace, marks, FinderMethod::SumOfSquares)?;
    let samples = marks.place(trace)?.samples;
    if samples < MIN_WINDOW_SAMPLES {
        return Ok(squares);
    }
    if squares.starts.len() < MIN_TRACKED_STARTS {
        // A mark that hardly any frame resembles may be alone among frames that are plainly there.
        let tracked = (trace.samples() <= MAX_TRACKED_SAMPLES)
            .then(|| find_tracked(trace, marks, without))
            .transpose()?;
        let plain = |tracked: &Found| enough_starts(tracked, &squares) && even_and_similar(trace, tracked);
        return Ok(tracked.filter(plain).unwrap_or(squares));
    }
    if samples < COARSE_WINDOW_SAMPLES {
        return Ok(most_even(
            squares,
            [find_tracked(trace, marks, without)?, find_matched(trace, marks, FinderMethod::Normalized)?],
        ));
    }
    let long_and_clear = trace.samples() > MAX_TRACKED_SAMPLES && squares.threshold.clarity() >= 1.0;
    if long_and_clear {
        return Ok(squares);
    }
    let tracked = find_tracked(trace, marks, without)?;
    if options.method == FinderMethod::Auto {
        return Ok(tracked);
    }
    let search =
        |part: &Trace, marks: &Marks, method| find_with(part, marks, &FinderOptions { method, without }).ok();
    Ok(more_agreed(trace, marks, [tracked, squares], search))
}

/// Traces of more samples are not segmented.
const MAX_SEGMENTED_SAMPLES: usize = 1 << 20;

/// [`FinderMethod::Segments`]: segmentation up to the end mark, with the results of the other methods as proposals.
fn find_segments(trace: &Trace, marks: &Marks, options: &FinderOptions) -> Result<Found, MarkError> {
    let auto = find_auto(trace, marks, &FinderOptions { method: FinderMethod::Auto, ..*options })?;
    let placement = marks.place(trace)?;
    if placement.samples < COARSE_WINDOW_SAMPLES || trace.samples() > MAX_SEGMENTED_SAMPLES {
        return Ok(auto);
    }
    let other = match auto.method {
        FinderMethod::Tracking => find_matched(trace, marks, FinderMethod::SumOfSquares)?,
        _ => find_tracked(trace, marks, options.without)?,
    };
    let power: Vec<f64> = trace.powers_w().collect();
    let places = |found: &Found| found.starts.iter().map(|start| trace.position(start.time_s)).collect();
    let end = (trace.position(marks.end_s).max(0.0) as usize).min(power.len());
    let found = segment(&power[..end], &placement, &[places(&auto), places(&other)]);
    let confidence = |found: Found, segments: Segmentation| {
        let last = segments.start_confidence.last().copied();
        let frames = segments.frame_confidence.into_iter().chain(last).collect();
        found.with_confidence(segments.start_confidence, frames)
    };
    Ok(match found.proposal {
        Some(0) => confidence(auto, found),
        Some(_) => confidence(other, found),
        None => confidence(concluded(trace, &power, marks, &placement, &found), found),
    })
}

/// Frames from the starts of a segmentation, each aligned with its neighbours.
fn concluded(
    trace: &Trace,
    power: &[f64],
    marks: &Marks,
    placement: &Placement,
    found: &Segmentation,
) -> Found {
    let anchor = placement.marks.first().map_or(0.0, |mark| mark.anchor);
    let nearest = |mark: &Placed| {
        let off = |index: &usize| (found.starts[*index] - mark.first as f64 - mark.anchor).abs();
        (0..found.starts.len()).min_by(|a, b| off(a).total_cmp(&off(b)))
    };
    let mut marked: Vec<Option<&Placed>> = vec![None; found.starts.len()];
    for mark in &placement.marks {
        if let Some(index) = nearest(mark) {
            marked[index] = Some(mark);
        }
    }
    let last = power.len().saturating_sub(placement.samples);
    let offset = |start: &f64| (libm::round(start - anchor).max(0.0) as usize).min(last);
    let offsets: Vec<usize> = found
        .starts
        .iter()
        .zip(&marked)
        .map(|(start, mark)| mark.map_or(offset(start), |mark| mark.first))
        .collect();
    let fixed: Vec<bool> = marked.iter().map(Option::is_some).collect();
    let positions = register(power, &offsets, &fixed, libm::round(anchor) as usize, placement.samples);
    let starts = positions.iter().zip(&marked).map(|(position, mark)| FrameStart {
        time_s: mark.map_or(trace.start_s() + (position + anchor) * trace.period_s(), |mark| mark.mark_s),
        distance_w2: 0.0,
        confidence: 1.0,
        marked: mark.is_some(),
    });
    let nothing = Threshold { rule: Rule::Sequence, ..Threshold::none() };
    let mut found = assess::conclude(trace, marks, placement, starts.collect(), nothing);
    found.method = FinderMethod::Segments;
    found
}

/// Whether tracking found enough starts for a test: many, or fewer than the sum of squares where that gives a
/// warning, over as long a part of the trace.
fn enough_starts(tracked: &Found, squares: &Found) -> bool {
    let count = tracked.starts.len();
    let last_s = span_s(tracked) / count.max(2).saturating_sub(1) as f64;
    let over = span_s(tracked) + last_s >= MIN_TRACKED_COVERAGE * span_s(squares);
    count >= MIN_TRACKED_STARTS
        || (squares.threshold.clarity() < 1.0 && (MIN_STARTS..squares.starts.len()).contains(&count) && over)
}

/// Whether starts keep the period, and frames are similar to their neighbours.
fn even_and_similar(trace: &Trace, found: &Found) -> bool {
    covered_s(found) >= MIN_TRACKED_COVERAGE * span_s(found)
        && neighbour_similarity(trace, found) >= MIN_TRACKED_SIMILARITY
}

/// The result that covers most time at an even period.
fn most_even(first: Found, others: [Found; 2]) -> Found {
    others.into_iter().fold(first, |best, other| {
        let more_s = covered_s(&other) - covered_s(&best);
        if more_s > MIN_COVERAGE_GAIN * span_s(&best).max(span_s(&other)) { other } else { best }
    })
}

fn covered_s(found: &Found) -> f64 {
    let gaps_s: Vec<f64> = found.starts.windows(2).map(|two| two[1].time_s - two[0].time_s).collect();
    periodicity::even_coverage(&gaps_s)
}

fn span_s(found: &Found) -> f64 {
    found.starts.last().zip(found.starts.first()).map_or(0.0, |(last, first)| last.time_s - first.time_s)
}

/// Most samples, around the middle of the trace, that are searched for rises.
const MAX_SEARCHED_SAMPLES: usize = 1 << 20;
/// Most rises that are tried.
const MAX_RISES: usize = 8;

/// A proposed mark.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Proposal {
    /// The frame start, s.
    pub mark_s: f64,
    /// How evenly the starts like it divide the segment that was looked at, 0 to 1.
    pub regularity: f64,
    /// How many starts like it there are in that segment.
    pub similar_starts: usize,
    /// How many rises were tried.
    pub tried: usize,
}

/// Proposes the start of a frame about the middle of a trace; `None` where power never rises.
pub fn propose(trace: &Trace) -> Option<Proposal> {
    let from = trace.samples().saturating_sub(MAX_SEARCHED_SAMPLES) / 2;
    let to = trace.samples().min(from + MAX_SEARCHED_SAMPLES);
    let (voltage_v, current_a) = (trace.voltage_v()[from..to].to_vec(), trace.current_a()[from..to].to_vec());
    let start_s = trace.time_s(from);
    let part = Trace::new(voltage_v, current_a, trace.rate_hz(), start_s, Metadata::default()).ok()?;
    let rises = rises(&part);
    let tried = rises.len();
    let judged = rises.into_iter().filter_map(|mark_s| {
        let window = default_window(0.0, part.rate_hz());
        let marks = Marks::one(mark_s, window, part.end_s());
        let found =
            find_with(&part, &marks, &FinderOptions { method: FinderMethod::SumOfSquares, without: None })
                .ok()?;
        let (regularity, similar_starts) = (found.threshold.regularity, found.starts.len());
        Some(Proposal { mark_s, regularity, similar_starts, tried })
    });
    // Of equally even ones the rarer: a start occurs once per frame, similar parts of frames more often.
    judged.max_by(|a, b| {
        let even = |p: &Proposal| libm::round(p.regularity * 20.0);
        even(a)
            .total_cmp(&even(b))
            .then(b.similar_starts.cmp(&a.similar_starts))
            .then(b.mark_s.total_cmp(&a.mark_s))
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
        if taken.len() == MAX_RISES {
            break;
        }
        if taken.iter().all(|other| other.abs_diff(place) > apart) {
            taken.push(place);
        }
    }
    taken.into_iter().map(|place| trace.time_s(place)).collect()
}

/// The median correlation (Pearson 1896) of the windows at neighbouring starts: about 0 in noise, 1 for
/// frames that repeat. 0 for fewer than two windows inside the trace.
fn neighbour_similarity(trace: &Trace, found: &Found) -> f64 {
    let width = libm::round((found.window.pre_s + found.window.post_s) * trace.rate_hz()) as usize;
    let first = |time_s: f64| libm::round(trace.position(time_s - found.window.pre_s));
    let firsts: Vec<usize> = found
        .starts
        .iter()
        .map(|start| first(start.time_s))
        .filter(|&first| first >= 0.0 && first as usize + width <= trace.samples())
        .map(|first| first as usize)
        .collect();
    let power: Vec<f64> = trace.powers_w().collect();
    let window = |first: usize| &power[first..first + width];
    let similarity = |pair: &[usize]| correlation(window(pair[0]), window(pair[1]));
    let mut all: Vec<f64> = firsts.par_windows(2).map(similarity).collect();
    upper_median(&mut all)
}

/// The correlation of two lists of equal length; 0 if one is constant.
fn correlation(a: &[f64], b: &[f64]) -> f64 {
    let mean = |of: &[f64]| of.iter().sum::<f64>() / of.len().max(1) as f64;
    let (mean_a, mean_b) = (mean(a), mean(b));
    let (mut both, mut own) = (0.0, [0.0; 2]);
    for (a, b) in a.iter().zip(b) {
        let (a, b) = (a - mean_a, b - mean_b);
        both += a * b;
        own = [own[0] + a * a, own[1] + b * b];
    }
    let size = libm::sqrt(own[0] * own[1]);
    if size > 0.0 { both / size } else { 0.0 }
}

/// Finds the sequence of starts with the most evidence.
fn find_tracked(trace: &Trace, marks: &Marks, without: Option<FinderStep>) -> Result<Found, MarkError> {
    let with = |step: FinderStep| without != Some(step);
    let placement = marks.place(trace)?;
    let power: Vec<f64> = trace.powers_w().collect();
    let mut tracked = track(&power, &placement, with(FinderStep::ClockSteps)).starts;
    if !with(FinderStep::PhaseSlips) {
        tracked.iter_mut().for_each(|start| start.confidence_factor = 1.0);
    }
    if with(FinderStep::SplitFrames) {
        tracked = without_false_starts(&power, tracked, &placement);
    }
    let offsets: Vec<usize> = tracked.iter().map(|start| start.offset).collect();
    let marked: Vec<Option<&Placed>> =
        offsets.iter().map(|offset| placement.marks.iter().find(|mark| mark.first == *offset)).collect();
    let fixed: Vec<bool> = marked.iter().map(Option::is_some).collect();
    let anchor = placement.marks.first().map_or(0.0, |mark| mark.anchor);
    let positions = register(&power, &offsets, &fixed, libm::round(anchor) as usize, placement.samples);
    let positions = match with(FinderStep::StartRefinement) {
        true => refine_starts(&power, positions, &fixed, anchor, placement.samples),
        false => positions,
    };
    let noise_w = libm::sqrt(noise_variance(&power));
    let (positions, kept) = in_phase(&power, noise_w, positions, &tracked, &fixed, &placement, without);
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
    let nothing = Threshold { rule: Rule::Sequence, ..Threshold::none() };
    let mut found = assess::conclude(trace, marks, &placement, starts, nothing);
    let places: Vec<f64> = found.starts.iter().map(|start| trace.position(start.time_s)).collect();
    let end = (trace.position(marks.end_s).max(0.0) as usize).min(power.len());
    found.warnings.extend(uncovered_work(&power[..end], &places));
    found.warnings.extend(flat_mark_of(&power, &placement, noise_w));
    found.method = FinderMethod::Tracking;
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
    placement: &Placement,
    without: Option<FinderStep>,
) -> (Vec<f64>, Vec<f64>) {
    let anchor = placement.marks.first().map_or(0.0, |mark| mark.anchor);
    let width = placement.samples;
    let places =
        |positions: &[f64]| -> Vec<f64> { positions.iter().map(|position| position + anchor).collect() };
    let first_mark = fixed.iter().position(|fixed| *fixed);
    let (positions, in_phase) = match first_mark
        .filter(|_| without != Some(FinderStep::DisplayTicks))
        .and_then(|mark| snap_to_ticks(&positions, mark, width))
    {
        // What begins on a tick is in the phase of the mark, whatever happened on the way.
        Some(Snapped { positions, off_tick }) => {
            (positions, off_tick.iter().map(|off| if *off { SUSPECT_CONFIDENCE } else { 1.0 }).collect())
        }
        None if without == Some(FinderStep::IdleGaps) => {
            (positions, starts.iter().map(|start| start.confidence_factor).collect())
        }
        None => {
            let factors = spread_from_unmarked(
                idle_gap::shifted_gap_confidence(power, &places(&positions), fixed, width),
                fixed,
            );
            (positions, product(starts.iter().map(|start| start.confidence_factor), factors))
        }
    };
    if without == Some(FinderStep::IdleGaps) {
        return (positions, in_phase);
    }
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frames::Window;
    use crate::stats::Random;
    use crate::trace::Metadata;

    const RATE_HZ: f64 = 50e3;

    fn found(power: impl Fn(usize) -> f32, samples: usize, mark: usize) -> Found {
        let power: Vec<f32> = (0..samples).map(power).collect();
        let trace = Trace::new(vec![1.0; samples], power, RATE_HZ, 0.0, Metadata::default()).unwrap();
        let marks = Marks {
            starts_s: vec![mark as f64 / RATE_HZ],
            window: Window { pre_s: 1e-3, post_s: 4e-3 },
            end_s: trace.end_s(),
        };
        find_auto(&trace, &marks, &FinderOptions::default()).unwrap()
    }

    fn noise(sample: usize) -> f32 {
        Random::new(1, 0).between(sample as u64, [-0.5, 0.5]) as f32
    }

    #[test]
    fn a_mark_whose_like_does_not_come_back_is_tracked_if_frames_are_plainly_there() {
        // After one of idle, each frame of 400 samples is busy for six segments of 50, whose levels go their
        // own ways from frame to frame.
        let power = |sample: usize| {
            let (frame, segment) = ((sample / 400) as f32, sample % 400 / 50);
            let level = 3.0 + 2.0 * (0.1 * frame + 2.1 * segment as f32).sin();
            0.1 * noise(sample) + if sample >= 400 && segment < 6 { level } else { 0.5 }
        };
        let found = found(power, 400 * 60, 400 * 30);
        assert_eq!((found.method, found.starts.len()), (FinderMethod::Tracking, 59));
    }

    #[test]
    fn four_frames_of_similar_passes_are_four() {
        // After one of idle, each frame is of four passes, unevenly apart, whose levels differ as much as
        // frames do.
        let power = |sample: usize| {
            let (frame, at) = (sample / 1600, sample % 1600);
            let pass = [0, 480, 700, 1040].partition_point(|&from| from <= at) - 1;
            let level = 3.0 + 0.8 * noise(10 * frame + pass);
            let busy = at - [0, 480, 700, 1040][pass] < [440, 180, 300, 260][pass];
            0.1 * noise(sample) + if frame > 0 && busy { level } else { 0.5 }
        };
        let found = found(power, 1600 * 5, 3200);
        assert_eq!((found.method, found.starts.len()), (FinderMethod::Tracking, 4));
    }

    #[test]
    fn a_mark_in_noise_stays_alone() {
        for level in [0.1, 1.0] {
            let found = found(|sample| 2.0 + level * noise(sample), 100_000, 50_000);
            assert_eq!((found.method, found.starts.len()), (FinderMethod::SumOfSquares, 1));
        }
    }

    #[test]
    fn a_lone_frame_stays_alone() {
        let power = |sample: usize| {
            let busy = (50_000..50_400).contains(&sample);
            0.1 * noise(sample) + if busy { 3.0 + (sample as f32 / 17.0).sin() } else { 0.5 }
        };
        assert_eq!(found(power, 100_000, 50_000).starts.len(), 1);
    }

    #[test]
    fn scale_and_level_do_not_matter_and_the_unlike_has_none() {
        let a: Vec<f64> = (0..100).map(|i| f64::from(i * 37 % 11)).collect();
        let scaled: Vec<f64> = a.iter().map(|x| 3.0 + 0.1 * x).collect();
        let turned: Vec<f64> = a.iter().map(|x| -x).collect();
        assert!((correlation(&a, &scaled) - 1.0).abs() < 1e-12);
        assert!((correlation(&a, &turned) + 1.0).abs() < 1e-12);
        assert_eq!(correlation(&a, &[2.0; 100]), 0.0);
        let other: Vec<f64> = (0..100).map(|i| f64::from(i * i * 53 % 17)).collect();
        assert!(correlation(&a, &other).abs() < 0.3);
    }
}
