//! Starts by distance to the marked windows alone: minima and a threshold, in one pass over samples that need
//! not be in memory.
//!
//! Offsets are [screened](screen) by a transform in f32; the distance of every minimum, its place finer than
//! a sample and the energy up to there are computed in f64 while its samples are in memory. No step depends
//! on the number of threads. The first frame of a free-running recording is searched separately: nothing was
//! drawn before it, so the part of the window before the mark differs.

mod pass;
mod screen;

use super::assess::{conclude_at, confidence};
use super::marks::{MarkError, Marks, Placed, flat_mark};
use super::periodicity::regularity;
use super::profile::summed_squared_difference;
use super::subsample::align;
use super::threshold::{Threshold, choose};
use super::{FinderMethod, Found, FrameStart, marked_start};
use crate::clock::SampleClock;
use crate::stats::{PairSum, mean, upper_median};
use crate::trace::Trace;
use core::convert::Infallible;
use core::ops::Range;
use multiversion::multiversion;
use pass::Candidate;
pub(crate) use pass::{Gathered, MatchPlan, Samples};
use rayon::prelude::*;

/// How far, in samples, refinement may move a start from the lowest offset of the profile.
const MAX_REFINEMENT_SAMPLES: usize = 2;
/// Most values that a median over the whole trace is taken from.
const MAX_MEDIAN_VALUES: usize = 65_536;
/// Farthest the first frame may begin before the first start found, in median gaps.
const MAX_LEAD_GAPS: f64 = 1.6;
/// A match leaves less than this share of the contrast between the template and steady power.
const MAX_MATCH_SHARE: f64 = 0.5;

/// Frames, and the sums of power (W) before the start of each and before the end of the last.
pub(crate) struct Matched {
    pub found: Found,
    pub sums_w: Vec<PairSum>,
    pub clock: SampleClock,
    pub total_w: PairSum,
}

/// The samples of a trace in memory.
struct InMemory<'a>(&'a Trace);

impl Samples for InMemory<'_> {
    type Error = Infallible;

    fn append(
        &mut self,
        from: u64,
        voltage_v: &mut Vec<f32>,
        current_a: &mut Vec<f32>,
    ) -> Result<usize, Infallible> {
        let from = from as usize;
        let to = self.0.samples().min(from + pass::PIECE_SAMPLES);
        voltage_v.extend_from_slice(&self.0.voltage_v()[from..to]);
        current_a.extend_from_slice(&self.0.current_a()[from..to]);
        Ok(to - from)
    }

    fn check_finite(&self, _: u64, _: &[f32], _: &[f32]) -> Result<(), Infallible> {
        // A trace has finite samples alone.
        Ok(())
    }
}

/// Frames of a trace in memory. `method` says by which distance: that of squares, or the normalized one.
pub(super) fn find_matched(trace: &Trace, marks: &Marks, method: FinderMethod) -> Result<Found, MarkError> {
    let placement = marks.place(trace)?;
    let samples = trace.samples() as u64;
    let clock = SampleClock { start_s: trace.start_s(), rate_hz: trace.rate_hz(), samples: Some(samples) };
    let window = |mark: &Placed| -> Vec<f64> {
        let places = mark.first..mark.first + placement.samples;
        let powers = trace.voltage_v()[places.clone()].iter().zip(&trace.current_a()[places]);
        powers.map(|(&volts, &amperes)| f64::from(volts) * f64::from(amperes)).collect()
    };
    let windows = placement.marks.iter().map(window).collect();
    let plan = MatchPlan::new(clock, placement, windows, marks, method);
    let Ok(gathered) = plan.gather(&mut InMemory(trace));
    Ok(plan.conclude(marks, gathered).found)
}

/// A start and the sum of powers (W) before it.
type Summed = (FrameStart, PairSum);

impl MatchPlan {
    /// From minima to frames.
    pub fn conclude(&self, marks: &Marks, mut gathered: Gathered) -> Matched {
        let clock = SampleClock { samples: Some(gathered.samples), ..self.clock };
        let trace_end_s = clock.time_s(gathered.samples as f64);
        let marks = Marks { end_s: marks.end_s.min(trace_end_s), ..marks.clone() };
        let sigma_w = noise_deviation(upper_median(&mut gathered.steps_w));
        let threshold = self.threshold(&mut gathered, sigma_w);
        let mut starts = self.marked(&gathered);
        let of = confidence(&threshold);
        let below = gathered.candidates.par_iter().filter(|c| c.distance_w2 < threshold.value_w2);
        starts.par_extend(below.map(|candidate| self.start(candidate, of(candidate.distance_w2))));
        drop(std::mem::take(&mut gathered.candidates));
        starts.sort_by(|a, b| a.0.time_s.total_cmp(&b.0.time_s));
        starts.dedup_by(|later, earlier| later.0.time_s <= earlier.0.time_s);
        if let Some(first) = self.start_after_idle(&threshold, &starts, &mut gathered) {
            starts.insert(0, first);
        }
        let tolerance_s = 0.5 * self.spacing as f64 / clock.rate_hz;
        starts.retain(|(start, _)| start.marked || start.time_s < marks.end_s - tolerance_s);
        let end_w = gathered.sums_w.last().copied().flatten().unwrap_or(gathered.total_w);
        let sums_w = starts.iter().map(|(_, sum)| *sum).chain([end_w]).collect();
        let starts = starts.into_iter().map(|(start, _)| start).collect();
        let mut found = conclude_at(clock.rate_hz, &marks, &self.placement, starts, threshold);
        let windows = self.placement.marks.iter().zip(&self.templates);
        let windows = windows.map(|(mark, template)| (mark.mark_s, template.watts.as_slice()));
        found.warnings.extend(flat_mark(windows, sigma_w));
        found.method = self.method;
        Matched { found, sums_w, clock, total_w: gathered.total_w }
    }

    /// By what was gathered, in which noise has a deviation of `sigma_w`.
    fn threshold(&self, gathered: &mut Gathered, sigma_w: f64) -> Threshold {
        let candidates = &gathered.candidates;
        let distances: Vec<f64> = candidates.par_iter().map(|candidate| candidate.distance_w2).collect();
        let noise_w2 = 2.0 * self.placement.samples as f64 * sigma_w * sigma_w;
        let background_w2 = upper_median(&mut gathered.distances_w2);
        let span = match (candidates.first(), candidates.last()) {
            (Some(first), Some(last)) => (last.offset - first.offset) as usize,
            _ => 0,
        };
        choose(&distances, background_w2, noise_w2, self.misalignment_w2(), |value_w2| {
            let below = distances.iter().zip(candidates).filter(|(distance_w2, _)| **distance_w2 < value_w2);
            let mut offsets: Vec<usize> = below.map(|(_, candidate)| candidate.offset as usize).collect();
            for mark in &self.placement.marks {
                offsets.insert(offsets.partition_point(|offset| *offset < mark.first), mark.first);
            }
            regularity(&offsets, span)
        })
    }

    /// The largest distance of a marked window to itself half a sample on, W^2, in between taken to be linear.
    fn misalignment_w2(&self) -> f64 {
        let half_step = |template: &Template| -> f64 {
            template.watts.windows(2).map(|pair| 0.25 * (pair[1] - pair[0]) * (pair[1] - pair[0])).sum()
        };
        self.templates.iter().map(half_step).fold(0.0, f64::max)
    }

    fn marked(&self, gathered: &Gathered) -> Vec<Summed> {
        let start = |(mark, sum): (&Placed, &Option<PairSum>)| (marked_start(mark), sum.unwrap_or_default());
        self.placement.marks.iter().zip(&gathered.sums_w).map(start).collect()
    }

    fn start(&self, candidate: &Candidate, confidence: f64) -> Summed {
        let mark = &self.placement.marks[candidate.mark as usize];
        let time_s = mark.mark_s + (candidate.aligned - mark.first as f64) / self.clock.rate_hz;
        let start = FrameStart { time_s, distance_w2: candidate.distance_w2, confidence, marked: false };
        (start, candidate.sum_w)
    }

    /// One more start before the first one found, in what was kept of the beginning, matched only by what
    /// follows the mark, with the threshold (and the reported distance) in proportion to the compared part.
    /// `None` if nothing there is near enough.
    fn start_after_idle(
        &self,
        threshold: &Threshold,
        starts: &[Summed],
        gathered: &mut Gathered,
    ) -> Option<Summed> {
        let first = self.clock.position(starts.first()?.0.time_s);
        let from = (first - MAX_LEAD_GAPS * median_gap_s(starts)? * self.clock.rate_hz).max(0.0) as usize;
        let to = (first - self.spacing as f64).max(0.0) as usize;
        let head = &mut gathered.head;
        head.add_up();
        let reach = (to + self.placement.samples).min(head.len());
        let power: Vec<f64> = (0..reach).map(|place| head.power_w(place)).collect();
        let found = self.placement.marks.iter().zip(&self.templates).filter_map(|(mark, template)| {
            let lead = libm::round(mark.anchor) as usize;
            let (before, after) = template.watts.split_at(lead);
            let profile = summed_squared_difference(power.get(from..to + after.len())?, after);
            let (near, &distance) = profile.iter().enumerate().min_by(|a, b| a.1.total_cmp(b.1))?;
            let distance_w2 = distance * template.watts.len() as f64 / after.len() as f64;
            let aligned = align(&power, after, from + near, MAX_REFINEMENT_SAMPLES);
            let inside = near > 0 && near + 1 < profile.len();
            let stands_out = distance < MAX_MATCH_SHARE * contrast_w2(before, after);
            (inside && stands_out && distance_w2 < threshold.value_w2)
                .then_some((aligned + mark.anchor - lead as f64, distance_w2))
        });
        let (position, distance_w2) = found.min_by(|a, b| a.1.total_cmp(&b.1))?;
        let time_s = self.clock.time_s(position);
        let start =
            FrameStart { time_s, distance_w2, confidence: confidence(threshold)(distance_w2), marked: false };
        Some((start, head.sum_to(position)))
    }
}

/// How much what follows the mark differs from the steady power before it, W^2: where that is nothing, idle
/// alone resembles it. Unbounded where the window has nothing before the mark.
fn contrast_w2(before: &[f64], after: &[f64]) -> f64 {
    if before.is_empty() {
        return f64::INFINITY;
    }
    let before = before.iter().sum::<f64>() / before.len() as f64;
    after.iter().map(|power| (power - before) * (power - before)).sum()
}

/// The median distance between neighbours, s; `None` for fewer than two starts.
fn median_gap_s(starts: &[Summed]) -> Option<f64> {
    let mut gaps: Vec<f64> = starts.windows(2).map(|pair| pair[1].0.time_s - pair[0].0.time_s).collect();
    (!gaps.is_empty()).then(|| upper_median(&mut gaps))
}

/// Variance of the sensor noise, W^2, from the median step between neighbours: steps of the signal, being
/// rare, hardly move it.
pub(super) fn noise_variance(power: &[f64]) -> f64 {
    let count = power.len().saturating_sub(1);
    let steps = power.windows(2).map(|pair| (pair[1] - pair[0]).abs());
    let mut picked: Vec<f64> = steps.step_by(count.div_ceil(MAX_MEDIAN_VALUES).max(1)).collect();
    let sigma = noise_deviation(upper_median(&mut picked));
    sigma * sigma
}

/// The deviation of white Gaussian noise whose steps from sample to sample have this median: it is `0.6745
/// sqrt(2) sigma`.
pub(crate) fn noise_deviation(median_step: f64) -> f64 {
    median_step / (0.674_489_75 * core::f64::consts::SQRT_2)
}

/// Least norm of a window, as a share of the template's: steady power then resembles nothing.
const MIN_NORM_SHARE: f64 = 0.05;

/// The powers about a mark, and how others are compared with them.
struct Template {
    pub watts: Vec<f64>,
    pub mean_w: f64,
    /// By the z-normalized distance (Goldin and Kanellakis 1995; Mueen's MASS), `2 |q|^2 (1 - r)` in W^2,
    /// with `r` the correlation coefficient and `|q|` the norm about the mean; else by the summed squared
    /// difference.
    pub normalized: bool,
}

impl Template {
    pub fn new(watts: Vec<f64>, normalized: bool) -> Self {
        Self { mean_w: mean(&watts), watts, normalized }
    }

    /// The distance of at least as many powers, W^2.
    pub fn distance_w2(&self, power_w: &[f64]) -> f64 {
        let [sum, squares, inner] = if self.normalized {
            sums(power_w, &self.watts, self.mean_w)
        } else {
            return difference(power_w, &self.watts);
        };
        let own = sums(&self.watts, &self.watts, self.mean_w)[2];
        let norm = libm::sqrt(own);
        let about = libm::sqrt((squares - sum * sum / self.watts.len() as f64).max(0.0));
        let r = inner / (about.max(MIN_NORM_SHARE * norm) * norm).max(f64::MIN_POSITIVE);
        2.0 * own * (1.0 - r).max(0.0)
    }
}

/// Summed squared difference of powers and a template, in eight lanes: always the same order, whatever
/// vectors there are.
#[multiversion(targets("x86_64+avx2"))]
fn difference(power_w: &[f64], template: &[f64]) -> f64 {
    let mut lanes = [0.0; 8];
    let whole = template.len() / 8 * 8;
    for (t, power) in template[..whole].chunks_exact(8).zip(power_w.chunks_exact(8)) {
        for lane in 0..8 {
            let difference = power[lane] - t[lane];
            lanes[lane] += difference * difference;
        }
    }
    let rest = template.iter().zip(power_w).skip(whole).map(|(t, power)| (power - t) * (power - t));
    lanes.iter().sum::<f64>() + rest.sum::<f64>()
}

/// Of powers less a mean: their sum, their squares, and their product with a template less the same mean.
fn sums(power_w: &[f64], template: &[f64], mean_w: f64) -> [f64; 3] {
    template.iter().zip(power_w).fold([0.0; 3], |[sum, squares, inner], (t, power)| {
        let power = power - mean_w;
        [sum + power, squares + power * power, inner + power * (t - mean_w)]
    })
}

/// Samples per stored sum.
const BLOCK: usize = 256;

/// A segment of samples with running sums of power, for energies to any place in it.
#[derive(Default)]
struct Piece {
    /// Number of the first sample, a multiple of [`BLOCK`].
    pub base: u64,
    pub voltage_v: Vec<f32>,
    pub current_a: Vec<f32>,
    /// Sum of powers (W) before each block, and before the end of the last whole one.
    prefix_w: Vec<PairSum>,
}

impl Piece {
    pub fn len(&self) -> usize {
        self.voltage_v.len()
    }

    /// Number of the sample after the last.
    pub fn end(&self) -> u64 {
        self.base + self.len() as u64
    }

    /// Power of a sample by its place in the piece, W.
    pub fn power_w(&self, place: usize) -> f64 {
        f64::from(self.voltage_v[place]) * f64::from(self.current_a[place])
    }

    /// Brings the sums up to date with samples that were appended.
    pub fn add_up(&mut self) {
        if self.prefix_w.is_empty() {
            self.prefix_w.push(PairSum::default());
        }
        let done = self.prefix_w.len() - 1;
        let whole = self.len() / BLOCK;
        for block in done..whole {
            let sum_w = self.sum_w(block * BLOCK..(block + 1) * BLOCK);
            self.prefix_w.push(self.prefix_w[block].plus(sum_w));
        }
    }

    /// Sum of powers (W) of all samples up to a position in the file, the last by fraction.
    pub fn sum_to(&self, position: f64) -> PairSum {
        let place = (position - self.base as f64).clamp(0.0, self.len() as f64);
        let whole = (place as usize).min(self.len());
        let block = (whole / BLOCK).min(self.prefix_w.len() - 1);
        let sum = self.prefix_w[block].plus(self.sum_w(block * BLOCK..whole));
        if whole < self.len() { sum.plus_product(self.power_w(whole), place - whole as f64) } else { sum }
    }

    fn sum_w(&self, places: Range<usize>) -> f64 {
        sum_of_powers(&self.voltage_v[places.clone()], &self.current_a[places])
    }

    /// Takes over the end of another piece, from a sample on, rounded down to a whole block.
    pub fn begin_with(&mut self, other: &Self, sample: u64) {
        let blocks = (sample.saturating_sub(other.base) as usize / BLOCK).min(other.prefix_w.len() - 1);
        let take_over = |mine: &mut Vec<f32>, theirs: &[f32]| {
            mine.clear();
            mine.extend_from_slice(&theirs[blocks * BLOCK..]);
        };
        take_over(&mut self.voltage_v, &other.voltage_v);
        take_over(&mut self.current_a, &other.current_a);
        self.prefix_w.clear();
        self.prefix_w.extend_from_slice(&other.prefix_w[blocks..]);
        self.base = other.base + (blocks * BLOCK) as u64;
    }
}

/// Sum of the powers of some samples, in eight lanes: always the same order.
#[multiversion(targets("x86_64+avx2"))]
fn sum_of_powers(voltage_v: &[f32], current_a: &[f32]) -> f64 {
    let mut lanes = [0.0; 8];
    let (v, i) = (voltage_v.chunks_exact(8), current_a.chunks_exact(8));
    let rest = v.remainder().iter().zip(i.remainder()).map(|(&v, &i)| f64::from(v) * f64::from(i));
    let rest: f64 = rest.sum();
    for (v, i) in v.zip(i) {
        for lane in 0..8 {
            lanes[lane] += f64::from(v[lane]) * f64::from(i[lane]);
        }
    }
    lanes.iter().sum::<f64>() + rest
}

/// Powers of some samples, W.
#[multiversion(targets("x86_64+avx2"))]
fn powers(voltage_v: &[f32], current_a: &[f32], into: &mut Vec<f64>) {
    into.clear();
    into.extend(voltage_v.iter().zip(current_a).map(|(&v, &i)| f64::from(v) * f64::from(i)));
}
