//! The finder, step by step.

use super::correlate::squares;
use super::flags::Flags;
use super::marks::{MarkError, Marks, Placed, Placement, Window};
use super::method::Method;
use super::minima::spaced_minima;
use super::register::register;
use super::regularity::regularity;
use super::threshold::{Threshold, choose};
use super::track::{Start, track};
use super::{assess, refine};
use crate::median::median;
use crate::trace::Trace;
use crate::warning::Warning;

/// How far, in samples, refinement may move a start from the lowest offset of the profile.
pub(super) const REACH: usize = 2;
/// With fewer starts than this there is too little to learn from: [`Method::Auto`] keeps the sum of squares.
const FEW: usize = 16;
/// Traces of more samples are tracked by [`Method::Auto`] only where the sum of squares is in doubt.
const LONG: usize = 1 << 24;
/// How many values a median over the whole trace is taken from.
const MEDIAN_OF: usize = 65_536;

/// One frame start.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FrameStart {
    /// When, s; finer than a sample.
    pub time_s: f64,
    /// Summed squared difference to the nearest marked window, W^2.
    pub distance_w2: f64,
    /// 1 where it is as near as the matches are on average, 0 where it is as far as the rest.
    pub confidence: f64,
    /// Whether this is one of the marks; its time is then the mark's, to the last bit.
    pub marked: bool,
}

/// One frame: from its start to the next start, or to the end mark.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FrameSpan {
    /// Start, s.
    pub start_s: f64,
    /// End, s.
    pub end_s: f64,
    /// The lower confidence of its two ends (of its start for the last frame).
    pub confidence: f64,
    /// What is remarkable about it.
    pub flags: Flags,
}

/// What the finder found.
#[derive(Clone, Debug, PartialEq)]
pub struct Found {
    /// The starts, in order.
    pub starts: Vec<FrameStart>,
    /// The frames between them; as many as there are starts.
    pub frames: Vec<FrameSpan>,
    /// Where the last frame ends, s.
    pub end_s: f64,
    /// How it was found.
    pub method: Method,
    /// The window as compared, after cutting, s.
    pub window: Window,
    /// Which minima were taken, and why.
    pub threshold: Threshold,
    /// Where the result stands on weak ground.
    pub warnings: Vec<Warning>,
}

/// A local minimum of the profile.
#[derive(Clone, Copy, Debug)]
struct Candidate {
    offset: usize,
    distance_w2: f64,
}

/// Everything about a trace that single starts are found with.
pub(super) struct View<'a> {
    pub trace: &'a Trace,
    pub power: &'a [f64],
    pub placement: &'a Placement,
    pub threshold: &'a Threshold,
}

impl View<'_> {
    /// The start at a candidate, finer than a sample.
    fn start_near(&self, candidate: &Candidate, mark: usize) -> FrameStart {
        let mark = &self.placement.marks[mark];
        let template = &self.power[mark.first..mark.first + self.placement.samples];
        let aligned = refine::align(self.power, template, candidate.offset, REACH);
        FrameStart {
            time_s: mark.mark_s + (aligned - mark.first as f64) * self.trace.period_s(),
            distance_w2: candidate.distance_w2,
            confidence: assess::confidence(candidate.distance_w2, self.threshold),
            marked: false,
        }
    }
}

/// [`View::start_after_idle`] for samples that are not all of a trace.
pub(crate) fn start_after_idle(
    trace: &Trace,
    power: &[f64],
    placement: &Placement,
    threshold: &Threshold,
    starts: &[FrameStart],
    spacing: usize,
) -> Option<FrameStart> {
    View { trace, power, placement, threshold }.start_after_idle(starts, spacing)
}

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
        Method::SumOfSquares => find_squares(trace, marks),
        Method::Tracking => find_tracked(trace, marks),
        Method::Auto => {
            let found = find_squares(trace, marks)?;
            let few = found.starts.len() < FEW;
            let long_and_clear = trace.samples() > LONG && found.threshold.clarity() >= 1.0;
            if few || long_and_clear { Ok(found) } else { find_tracked(trace, marks) }
        }
    }
}

/// By the sequence of starts that fits best.
fn find_tracked(trace: &Trace, marks: &Marks) -> Result<Found, MarkError> {
    let placement = marks.place(trace)?;
    let power: Vec<f64> = trace.powers_w().collect();
    let tracked = track(&power, &placement);
    let offsets: Vec<usize> = tracked.starts.iter().map(|start| start.offset).collect();
    let marked: Vec<Option<&Placed>> =
        offsets.iter().map(|offset| placement.marks.iter().find(|mark| mark.first == *offset)).collect();
    let fixed: Vec<bool> = marked.iter().map(Option::is_some).collect();
    let anchor = placement.marks.first().map_or(0.0, |mark| mark.anchor);
    let positions = register(&power, &offsets, &fixed, libm::round(anchor) as usize, placement.samples);
    let start = |((start, position), marked): ((&Start, f64), &Option<&Placed>)| FrameStart {
        time_s: marked.map_or(trace.start_s() + (position + anchor) * trace.period_s(), |mark| mark.mark_s),
        distance_w2: start.distance_w2,
        confidence: start.confidence,
        marked: marked.is_some(),
    };
    let mut starts: Vec<FrameStart> = tracked.starts.iter().zip(positions).zip(&marked).map(start).collect();
    starts.dedup_by(|later, earlier| later.time_s <= earlier.time_s && !later.marked);
    let end_tolerance_s = 0.5 * spacing(placement.samples) as f64 * trace.period_s();
    starts.retain(|start| start.marked || start.time_s < marks.end_s - end_tolerance_s);
    let nothing = choose(&[], 0.0, 0.0, 0.0, |_| 0.0);
    let mut found = assess::conclude(trace, marks, &placement, starts, nothing);
    found.method = Method::Tracking;
    Ok(found)
}

fn find_squares(trace: &Trace, marks: &Marks) -> Result<Found, MarkError> {
    let placement = marks.place(trace)?;
    let power: Vec<f64> = trace.powers_w().collect();
    let (profile, nearest) = nearest_profile(&power, &placement);
    let spacing = spacing(placement.samples);
    let candidates = candidates(&profile, &placement, spacing);
    let distances: Vec<f64> = candidates.iter().map(|candidate| candidate.distance_w2).collect();
    let noise_w2 = 2.0 * placement.samples as f64 * noise_variance(&power);
    let background_w2 = median_of(profile.iter().copied(), profile.len());
    let threshold =
        choose(&distances, background_w2, noise_w2, misalignment_w2(&power, &placement), |value_w2| {
            evenness(&candidates, &placement, value_w2)
        });

    let mut starts = marked_starts(&placement, &profile);
    let view = View { trace, power: &power, placement: &placement, threshold: &threshold };
    for candidate in candidates.iter().filter(|candidate| candidate.distance_w2 < threshold.value_w2) {
        starts.push(view.start_near(candidate, nearest.get(candidate.offset).copied().unwrap_or(0)));
    }
    starts.sort_by(|a, b| a.time_s.total_cmp(&b.time_s));
    starts.dedup_by(|later, earlier| later.time_s <= earlier.time_s);
    if let Some(first) = view.start_after_idle(&starts, spacing) {
        starts.insert(0, first);
    }
    let end_tolerance_s = 0.5 * spacing as f64 * trace.period_s();
    starts.retain(|start| start.marked || start.time_s < marks.end_s - end_tolerance_s);
    Ok(assess::conclude(trace, marks, &placement, starts, threshold))
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

/// The minima that could be starts, the marks and their surroundings left out.
fn candidates(profile: &[f64], placement: &Placement, spacing: usize) -> Vec<Candidate> {
    let beside_marks =
        |offset: &usize| placement.marks.iter().all(|mark| mark.first.abs_diff(*offset) >= spacing);
    spaced_minima(profile, spacing)
        .into_iter()
        .filter(beside_marks)
        .map(|offset| Candidate { offset, distance_w2: profile[offset] })
        .collect()
}

/// How evenly the starts are spaced if the threshold is `value_w2`.
fn evenness(candidates: &[Candidate], placement: &Placement, value_w2: f64) -> f64 {
    let below = candidates
        .iter()
        .filter(|candidate| candidate.distance_w2 < value_w2)
        .map(|candidate| candidate.offset);
    let mut offsets: Vec<usize> = below.chain(placement.marks.iter().map(|mark| mark.first)).collect();
    offsets.sort_unstable();
    let span =
        candidates.last().map_or(0, |last| last.offset) - candidates.first().map_or(0, |first| first.offset);
    regularity(&offsets, span)
}

/// The least distance between two frame starts, in samples: half the window, as no frame is shorter than that.
fn spacing(window_samples: usize) -> usize {
    (window_samples / 2).max(1)
}

/// The smallest distance to any mark's window at each offset, and with several marks which one it was.
fn nearest_profile(power: &[f64], placement: &Placement) -> (Vec<f64>, Vec<usize>) {
    let template = |first: usize| &power[first..first + placement.samples];
    let mut profile = placement.marks.first().map_or(Vec::new(), |mark| squares(power, template(mark.first)));
    let mut nearest = Vec::new();
    for (index, mark) in placement.marks.iter().enumerate().skip(1) {
        nearest.resize(profile.len(), 0);
        let other = squares(power, template(mark.first));
        for ((lowest, which), value) in profile.iter_mut().zip(&mut nearest).zip(other) {
            if value < *lowest {
                (*lowest, *which) = (value, index);
            }
        }
    }
    (profile, nearest)
}

fn marked_starts(placement: &Placement, profile: &[f64]) -> Vec<FrameStart> {
    let start = |mark: &Placed| FrameStart {
        time_s: mark.mark_s,
        distance_w2: profile.get(mark.first).copied().unwrap_or(0.0),
        confidence: 1.0,
        marked: true,
    };
    placement.marks.iter().map(start).collect()
}

/// The largest distance of a marked window to itself half a sample on, W^2, in between taken to be linear.
pub(crate) fn misalignment_w2(power: &[f64], placement: &Placement) -> f64 {
    let windows = placement.marks.iter().map(|mark| &power[mark.first..mark.first + placement.samples]);
    let half_steps =
        windows.map(|window| window.windows(2).map(|pair| 0.25 * (pair[1] - pair[0]).powi(2)).sum());
    half_steps.fold(0.0, f64::max)
}

/// Variance of the sensor noise, W^2, from the median step between neighbours: `median |p[i+1] - p[i]|` is
/// `0.6745 sqrt(2) sigma` for white Gaussian noise, and steps of the signal, being rare, hardly move a median.
fn noise_variance(power: &[f64]) -> f64 {
    let steps = power.windows(2).map(|pair| (pair[1] - pair[0]).abs());
    let sigma = median_of(steps, power.len().saturating_sub(1)) / (0.674_489_75 * core::f64::consts::SQRT_2);
    sigma * sigma
}

/// The (upper) median of at most [`MEDIAN_OF`] of `count` values, evenly picked; 0 for none.
fn median_of(values: impl Iterator<Item = f64>, count: usize) -> f64 {
    let mut picked: Vec<f64> = values.step_by(count.div_ceil(MEDIAN_OF).max(1)).collect();
    median(&mut picked)
}
