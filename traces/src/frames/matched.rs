//! Starts by distance to the marked windows alone: threshold and local minima.
//!
//! The first frame of a free-running recording is searched separately: nothing was drawn before it, so the
//! part of the window before the mark differs.

use super::assess;
use super::assess::confidence;
use super::marks::{MarkError, Marks, Placement, flat_mark_of};
use super::periodicity::regularity;
use super::profile::{normalized, spaced_minima, squares, summed_squared_difference};
use super::subsample::align;
use super::threshold::{Threshold, choose};
use super::{FinderMethod, Found, FrameStart, marked_starts, spacing};
use crate::stats::upper_median;
use crate::trace::Trace;

/// How far, in samples, refinement may move a start from the lowest offset of the profile.
pub(super) const MAX_REFINEMENT_SAMPLES: usize = 2;
/// Most values that a median over the whole trace is taken from.
const MAX_MEDIAN_VALUES: usize = 65_536;

/// A local minimum of the profile.
#[derive(Clone, Copy, Debug)]
struct Candidate {
    offset: usize,
    distance_w2: f64,
}

/// Everything about a trace that single starts are found with.
pub(super) struct Matcher<'a> {
    pub trace: &'a Trace,
    pub power: &'a [f64],
    pub placement: &'a Placement,
    pub threshold: &'a Threshold,
}

impl Matcher<'_> {
    /// The start at a candidate, finer than a sample.
    fn start_near(&self, candidate: &Candidate, mark: usize, confidence: impl Fn(f64) -> f64) -> FrameStart {
        let mark = &self.placement.marks[mark];
        let template = &self.power[mark.first..mark.first + self.placement.samples];
        let aligned = align(self.power, template, candidate.offset, MAX_REFINEMENT_SAMPLES);
        FrameStart {
            time_s: mark.mark_s + (aligned - mark.first as f64) * self.trace.period_s(),
            distance_w2: candidate.distance_w2,
            confidence: confidence(candidate.distance_w2),
            marked: false,
        }
    }
}

/// [`Matcher::start_after_idle`] for samples that are not all of a trace.
pub(crate) fn start_after_idle(
    trace: &Trace,
    power: &[f64],
    placement: &Placement,
    threshold: &Threshold,
    starts: &[FrameStart],
    spacing: usize,
) -> Option<FrameStart> {
    Matcher { trace, power, placement, threshold }.start_after_idle(starts, spacing)
}

/// `method` says by which distance: that of squares, or the normalized one.
pub(super) fn find_matched(trace: &Trace, marks: &Marks, method: FinderMethod) -> Result<Found, MarkError> {
    let measure = if method == FinderMethod::Normalized { normalized } else { squares };
    let placement = marks.place(trace)?;
    let power: Vec<f64> = trace.powers_w().collect();
    let (profile, nearest) = nearest_profile(&power, &placement, measure);
    let spacing = spacing(placement.samples);
    let candidates = candidates(&profile, &placement, spacing);
    let distances: Vec<f64> = candidates.iter().map(|candidate| candidate.distance_w2).collect();
    let noise = noise_variance(&power);
    let noise_w2 = 2.0 * placement.samples as f64 * noise;
    let background_w2 = median_of(profile.iter().copied(), profile.len());
    let threshold =
        choose(&distances, background_w2, noise_w2, misalignment_w2(&power, &placement), |value_w2| {
            evenness(&candidates, &placement, value_w2)
        });

    let mut starts = marked_starts(&placement, &profile);
    let matcher = Matcher { trace, power: &power, placement: &placement, threshold: &threshold };
    let confidence = confidence(&threshold);
    for candidate in candidates.iter().filter(|candidate| candidate.distance_w2 < threshold.value_w2) {
        let mark = nearest.get(candidate.offset).copied().unwrap_or(0);
        starts.push(matcher.start_near(candidate, mark, &confidence));
    }
    starts.sort_by(|a, b| a.time_s.total_cmp(&b.time_s));
    starts.dedup_by(|later, earlier| later.time_s <= earlier.time_s);
    if let Some(first) = matcher.start_after_idle(&starts, spacing) {
        starts.insert(0, first);
    }
    let end_tolerance_s = 0.5 * spacing as f64 * trace.period_s();
    starts.retain(|start| start.marked || start.time_s < marks.end_s - end_tolerance_s);
    let mut found = assess::conclude(trace, marks, &placement, starts, threshold);
    found.warnings.extend(flat_mark_of(&power, &placement, libm::sqrt(noise)));
    Ok(Found { method, ..found })
}

/// The minima that could be starts, without the marks and their surroundings.
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

/// The smallest distance to any mark's window at each offset, and with several marks which one it was.
fn nearest_profile(
    power: &[f64],
    placement: &Placement,
    measure: fn(&[f64], &[f64]) -> Vec<f64>,
) -> (Vec<f64>, Vec<usize>) {
    let template = |first: usize| &power[first..first + placement.samples];
    let mut profile = placement.marks.first().map_or(Vec::new(), |mark| measure(power, template(mark.first)));
    let mut nearest = Vec::new();
    for (index, mark) in placement.marks.iter().enumerate().skip(1) {
        nearest.resize(profile.len(), 0);
        let other = measure(power, template(mark.first));
        for ((lowest, which), value) in profile.iter_mut().zip(&mut nearest).zip(other) {
            if value < *lowest {
                (*lowest, *which) = (value, index);
            }
        }
    }
    (profile, nearest)
}

/// The largest distance of a marked window to itself half a sample on, W^2, in between taken to be linear.
pub(crate) fn misalignment_w2(power: &[f64], placement: &Placement) -> f64 {
    let windows = placement.marks.iter().map(|mark| &power[mark.first..mark.first + placement.samples]);
    let half_steps =
        windows.map(|window| window.windows(2).map(|pair| 0.25 * (pair[1] - pair[0]).powi(2)).sum());
    half_steps.fold(0.0, f64::max)
}

/// Variance of the sensor noise, W^2, from the median step between neighbours: `median |p[i+1] - p[i]|` is
/// `0.6745 sqrt(2) sigma` for white Gaussian noise, and steps of the signal, being rare, hardly move a
/// median.
pub(super) fn noise_variance(power: &[f64]) -> f64 {
    let steps = power.windows(2).map(|pair| (pair[1] - pair[0]).abs());
    let sigma = noise_deviation(median_of(steps, power.len().saturating_sub(1)));
    sigma * sigma
}

/// The deviation of white Gaussian noise whose steps from sample to sample have this median.
pub(crate) fn noise_deviation(median_step: f64) -> f64 {
    median_step / (0.674_489_75 * core::f64::consts::SQRT_2)
}

/// The (upper) median of at most [`MAX_MEDIAN_VALUES`] of `count` values, evenly picked; 0 for none.
fn median_of(values: impl Iterator<Item = f64>, count: usize) -> f64 {
    let mut picked: Vec<f64> = values.step_by(count.div_ceil(MAX_MEDIAN_VALUES).max(1)).collect();
    upper_median(&mut picked)
}

/// Farthest the first frame may begin before the first start found, in median gaps.
const MAX_LEAD_GAPS: f64 = 1.6;
/// A match leaves less than this share of the contrast between the template and steady power.
const MAX_MATCH_SHARE: f64 = 0.5;

impl Matcher<'_> {
    /// One more start before the first one found, matched only by what follows the mark, with the threshold
    /// (and the reported distance) in proportion to the compared part. `None` if nothing there is near
    /// enough.
    pub(super) fn start_after_idle(&self, starts: &[FrameStart], spacing: usize) -> Option<FrameStart> {
        let gap_s = median_gap_s(starts)?;
        let first = self.trace.position(starts.first()?.time_s);
        let from = (first - MAX_LEAD_GAPS * gap_s * self.trace.rate_hz()).max(0.0) as usize;
        let to = (first - spacing as f64).max(0.0) as usize;
        let lead = |mark: &super::marks::Placed| libm::round(mark.anchor) as usize;
        let found = self.placement.marks.iter().filter_map(|mark| {
            let template = &self.power[mark.first + lead(mark)..mark.first + self.placement.samples];
            let segment = self.power.get(from..to + template.len())?;
            let profile = summed_squared_difference(segment, template);
            let (near, &distance) = profile.iter().enumerate().min_by(|a, b| a.1.total_cmp(b.1))?;
            let distance_w2 = distance * self.placement.samples as f64 / template.len() as f64;
            let offset = align(self.power, template, from + near, MAX_REFINEMENT_SAMPLES)
                - (mark.first + lead(mark)) as f64;
            let time_s = mark.mark_s + offset * self.trace.period_s();
            let inside = near > 0 && near + 1 < profile.len();
            let stands_out = distance < MAX_MATCH_SHARE * self.contrast_w2(mark.first, lead(mark), template);
            (inside && stands_out && distance_w2 < self.threshold.value_w2).then_some((time_s, distance_w2))
        });
        let (time_s, distance_w2) = found.min_by(|a, b| a.1.total_cmp(&b.1))?;
        Some(FrameStart {
            time_s,
            distance_w2,
            confidence: confidence(self.threshold)(distance_w2),
            marked: false,
        })
    }

    /// How much what follows the mark differs from the steady power before it, W^2: where that is nothing,
    /// idle alone resembles it. Unbounded where the window has nothing before the mark.
    fn contrast_w2(&self, first: usize, lead: usize, template: &[f64]) -> f64 {
        if lead == 0 {
            return f64::INFINITY;
        }
        let before = self.power[first..first + lead].iter().sum::<f64>() / lead as f64;
        template.iter().map(|power| (power - before) * (power - before)).sum()
    }
}

/// The median distance between neighbours, s; `None` for fewer than two starts.
fn median_gap_s(starts: &[FrameStart]) -> Option<f64> {
    let mut gaps: Vec<f64> = starts.windows(2).map(|pair| pair[1].time_s - pair[0].time_s).collect();
    (!gaps.is_empty()).then(|| upper_median(&mut gaps))
}
