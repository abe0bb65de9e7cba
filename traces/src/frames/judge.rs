//! A criterion without truth: how well a set of starts fits the trace and the mark, by whichever method it was found.
//!
//! Of a right set every two neighbours resemble the mark more than anything between them does. A missed start lies
//! between its neighbours and resembles the mark as much as they do; a false start resembles it less. And starts are more
//! often evenly spaced than what merely resembles them. So, with the likeness `s` of starts to the mark and that of
//! the best candidate between two neighbours `k` and `k + 1`, their rival `r`,
//!
//! ```text
//! J = sum_k E_k clip(min(s_k, s_k+1) - r_k, -2, 4) / E + even time / time
//! ```
//!
//! `E` is the energy above idle, so work before the first and after the last start counts for nothing; the time is that
//! from the first start to the last. Likeness is `-ln` of the distance by squares over the window and by shape about the start, in
//! deviations over all candidates. Nothing in it is learnt from the set that is judged, so a wrong set cannot make itself look
//! right. `docs/finding.md` has what each term is worth on the witnesses.

use super::marks::Placement;
use super::matched::{nearest_profile, noise_variance};
use super::periodicity::even_coverage;
use super::profile::{normalized, spaced_minima, squares};
use crate::stats::{moments, nth_smallest};

/// Bounds of what one frame may say for or against a set, in deviations; bounds of 1 and 9 choose the same.
const BOUNDS: [f64; 2] = [-2.0, 4.0];
/// What is about the start: an eighth of the window before it, a fifth after, where frames differ least.
const ONSET: [f64; 2] = [1.0 / 8.0, 1.0 / 5.0];
/// Rivals are farther from a start than this share of the window: what is nearer is its own flank.
const FLANK: f64 = 0.36;
/// A start may be off its best alignment by this share of the window: two flanks of an edge.
const SLACK: f64 = 0.04;
/// Windows that differ by less than this share of the marked one's variance are equal.
const FLOOR: f64 = 1e-3;
/// This share of the samples is idle at least, and how many of them tell its power.
const IDLE_SHARE: f64 = 0.02;
const IDLE_SAMPLES: usize = 1 << 16;

/// A trace and a mark, ready to judge sets of starts.
pub(super) struct Judge {
    /// Likeness of the window at each offset to the mark, in deviations.
    likeness: Vec<f64>,
    /// Offsets of the candidates.
    candidates: Vec<usize>,
    /// Energy above idle up to each sample, W samples.
    work: Vec<f64>,
    flank: usize,
    slack: usize,
}

impl Judge {
    pub fn new(power: &[f64], placement: &Placement) -> Self {
        let width = placement.samples as f64;
        let flank = ((FLANK * width) as usize).max(2);
        let unlike = unlike(power, placement);
        let candidates = spaced_minima(&unlike, flank);
        let of_candidates: Vec<f64> = candidates.iter().map(|&offset| unlike[offset]).collect();
        let deviation = moments(&of_candidates).deviation.max(f64::MIN_POSITIVE);
        let likeness = unlike.into_iter().map(|unlike| -unlike / deviation).collect();
        Self { likeness, candidates, work: work(power), flank, slack: (SLACK * width) as usize }
    }

    /// The criterion `J` for starts whose windows begin at these offsets, in order.
    pub fn value(&self, offsets: &[usize]) -> f64 {
        let likeness: Vec<f64> = offsets.iter().map(|&offset| self.near(offset)).collect();
        let margins = offsets.windows(2).zip(likeness.windows(2)).map(|(two, alike)| {
            let less = alike[0].min(alike[1]);
            let margin = less - self.rival(two[0], two[1]).unwrap_or(less);
            margin.clamp(BOUNDS[0], BOUNDS[1]) * (self.worked(two[1]) - self.worked(two[0]))
        });
        let all = self.work.last().copied().unwrap_or(0.0).max(f64::MIN_POSITIVE);
        margins.sum::<f64>() / all + evenness(offsets)
    }

    /// The greatest likeness of a candidate well between two starts.
    fn rival(&self, start: usize, next: usize) -> Option<f64> {
        let place = |offset: usize| self.candidates.partition_point(|&other| other < offset);
        let between = place(start + self.flank)..place(next.saturating_sub(self.flank));
        self.candidates.get(between)?.iter().map(|&offset| self.likeness[offset]).reduce(f64::max)
    }

    /// The greatest likeness about an offset.
    fn near(&self, offset: usize) -> f64 {
        let last = self.likeness.len();
        let about = offset.saturating_sub(self.slack).min(last)..(offset + self.slack + 1).min(last);
        self.likeness[about].iter().copied().fold(f64::NEG_INFINITY, f64::max)
    }

    fn worked(&self, offset: usize) -> f64 {
        self.work.get(offset).copied().unwrap_or(0.0)
    }
}

/// The share of the time between the first and last start that is divided evenly.
fn evenness(offsets: &[usize]) -> f64 {
    let gaps: Vec<f64> = offsets.windows(2).map(|two| (two[1] - two[0]) as f64).collect();
    even_coverage(&gaps) / gaps.iter().sum::<f64>().max(f64::MIN_POSITIVE)
}

/// Mean of the logarithms of two distances to the nearest marked window at each offset, each as a share of the window's variance, with
/// what noise leaves.
fn unlike(power: &[f64], placement: &Placement) -> Vec<f64> {
    let noise_w2 = noise_variance(power);
    let onset = onset(placement);
    let shift = onset.marks.first().zip(placement.marks.first()).map_or(0, |(a, b)| a.first - b.first);
    let floored = |of: &Placement, measure: fn(&[f64], &[f64]) -> Vec<f64>| {
        let (profile, _) = nearest_profile(power, of, measure);
        let first = of.marks.first().map_or(0, |mark| mark.first);
        let deviation_w = moments(&power[first..first + of.samples]).deviation;
        let floor_w2 =
            of.samples as f64 * (FLOOR * deviation_w * deviation_w + noise_w2).max(f64::MIN_POSITIVE);
        profile.into_iter().map(move |distance_w2| libm::log(distance_w2 + floor_w2))
    };
    let about_start = floored(&onset, normalized).skip(shift);
    floored(placement, squares).zip(about_start).map(|(whole, start)| 0.5 * (whole + start)).collect()
}

/// The part of the windows about their starts.
fn onset(placement: &Placement) -> Placement {
    let width = placement.samples as f64;
    let lead = placement.marks.first().map_or(0.0, |mark| libm::round(mark.anchor));
    let before = libm::round(ONSET[0] * width).min(lead);
    let samples = ((before + ONSET[1] * width) as usize).max(4).min(placement.samples);
    let skipped = ((lead - before) as usize).min(placement.samples - samples);
    let mut onset = Placement { samples, ..placement.clone() };
    for mark in &mut onset.marks {
        mark.first += skipped;
        mark.anchor -= skipped as f64;
    }
    onset
}

/// Running sum of power above idle.
fn work(power: &[f64]) -> Vec<f64> {
    let step = power.len().div_ceil(IDLE_SAMPLES).max(1);
    let mut some: Vec<f64> = power.iter().step_by(step).copied().collect();
    let place = (IDLE_SHARE * some.len() as f64) as usize;
    let idle_w = if some.is_empty() { 0.0 } else { nth_smallest(&mut some, place) };
    let sum = |sum: &mut f64, watts: &f64| {
        *sum += (watts - idle_w).max(0.0);
        Some(*sum)
    };
    power.iter().scan(0.0, sum).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frames::{Marks, Window};
    use crate::random::Random;
    use crate::trace::{Metadata, Trace};

    /// 40 frames of 400 samples, busy for 300, with a lesser rise half-way; and a judge of the one at 20.
    fn judge() -> Judge {
        let noise = Random::new(3, 0);
        let watts = |i: usize| {
            let busy = match i % 400 {
                0..150 => 3.0 + (i % 400) as f64 / 100.0,
                200..350 => 3.5 + (i % 400 - 200) as f64 / 120.0,
                _ => 0.5,
            };
            (busy + 0.05 * noise.normals(i as u64).0) as f32
        };
        let trace =
            Trace::new(vec![1.0; 16_000], (0..16_000).map(watts).collect(), 50e3, 0.0, Metadata::default());
        let trace = trace.unwrap();
        let marks = Marks::one(0.16, Window { pre_s: 1e-3, post_s: 4e-3 }, trace.end_s());
        let power: Vec<f64> = trace.powers_w().collect();
        Judge::new(&power, &marks.place(&trace).unwrap())
    }

    fn every(step: usize, from: usize) -> Vec<usize> {
        (0..).map(|n| from + n * step).take_while(|offset| *offset < 15_700).collect()
    }

    #[test]
    fn the_right_set_is_worth_more_than_halves_doubles_rises_and_parts_of_it() {
        let judge = judge();
        let right = judge.value(&every(400, 350));
        assert!(right > 2.0, "{right}");
        for wrong in [every(800, 350), every(200, 350), every(400, 550), every(400, 430), every(399, 350)] {
            assert!(judge.value(&wrong) < right - 0.2, "{} of {wrong:?}", judge.value(&wrong));
        }
        let part = every(400, 350)[..20].to_vec();
        assert!(judge.value(&part) < right - 0.2);
        let missing: Vec<usize> = every(400, 350).into_iter().filter(|offset| *offset != 4350).collect();
        assert!(judge.value(&missing) < right);
    }

    #[test]
    fn one_start_or_none_is_worth_nothing() {
        let judge = judge();
        assert_eq!([judge.value(&[]), judge.value(&[350])], [0.0; 2]);
    }
}
