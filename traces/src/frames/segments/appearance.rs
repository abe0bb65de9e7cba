//! What power looks like about a start, and how near every sample is to that.

use super::super::marks::Placement;
use super::super::matched::noise_variance;
use super::super::profile::{Correlator, spaced_minima};

/// Samples of a window after averaging; all costs grow with them.
const WINDOW_SAMPLES: usize = 100;
/// Candidates are at least this share of a window apart.
const MIN_DISTANCE: f64 = 0.125;
/// Variance that any sample of a start has beyond the noise, as a share of that of the trace.
const MIN_VARIANCE: f64 = 0.005;
/// Variance of a sample of a start before any is seen, as a share of that of the trace, and how many starts that counts as.
const PRIOR: (f64, f64) = (0.3, 3.0);
/// Weight of a mark among the starts that are learnt from.
const MARK_WEIGHT: f64 = 2.0;

/// Power, less its mean, averaged to about [`WINDOW_SAMPLES`] a window.
pub(super) struct Grid {
    pub power_w: Vec<f64>,
    squares: Vec<f64>,
    /// Samples of the trace in one of the grid.
    pub step: usize,
    /// Work above the lowest power before each sample.
    pub work: Vec<f64>,
    pub marks: Vec<usize>,
    /// Samples of a window before and after the start.
    pub window: [usize; 2],
    variance: f64,
    noise: f64,
}

/// The appearance of a start: mean power and weight of each sample about it.
#[derive(Clone, Debug)]
pub(super) struct Appearance {
    before: usize,
    mean_w: Vec<f64>,
    weight: Vec<f64>,
    /// Mean of the weighted squared distance of a start.
    usual: f64,
}

/// How near every sample is to an appearance, and the local maxima of that.
pub(super) struct Likeness {
    pub all: Vec<f64>,
    pub candidates: Vec<usize>,
    pub at: Vec<f64>,
    /// Standard deviation over the candidates.
    pub spread: f64,
}

impl Grid {
    pub fn new(power: &[f64], placement: &Placement) -> Self {
        let step = (placement.samples / WINDOW_SAMPLES).max(1);
        let mean_of = |of: &[f64]| of.iter().sum::<f64>() / of.len().max(1) as f64;
        let mut power_w: Vec<f64> = power.chunks_exact(step).map(mean_of).collect();
        let mean_w = mean_of(&power_w);
        power_w.iter_mut().for_each(|watts| *watts -= mean_w);
        let squares: Vec<f64> = power_w.iter().map(|watts| watts * watts).collect();
        let place = |position: f64| libm::round(position / step as f64) as usize;
        let starts = placement.marks.iter().map(|mark| place(mark.first as f64 + mark.anchor));
        let marks: Vec<usize> = starts.map(|start| start.min(power_w.len().saturating_sub(1))).collect();
        let before = placement.marks.first().map_or(0, |mark| place(mark.anchor));
        let after = (placement.samples / step).saturating_sub(before).max(1);
        let (variance, noise) = (mean_of(&squares), noise_variance(&power_w));
        Self { work: work(&power_w), squares, step, marks, window: [before, after], variance, noise, power_w }
    }

    /// Length of the window.
    pub fn length(&self) -> f64 {
        (self.window[0] + self.window[1]) as f64
    }

    /// Least distance of candidates, in samples.
    pub fn min_distance(&self) -> usize {
        ((MIN_DISTANCE * self.length()) as usize).max(2)
    }

    /// A part of the window of the first mark; shares of it before and after the mark.
    pub fn marked(&self, shares: [f64; 2]) -> Appearance {
        let [before, after] =
            [0, 1].map(|side| libm::round(shares[side] * self.window[side] as f64) as usize);
        let mark = self.marks[0];
        let before = before.min(mark);
        let mean_w = self.power_w[mark - before..self.power_w.len().min(mark + after)].to_vec();
        let weight = vec![1.0 / mean_w.len() as f64; mean_w.len()];
        Appearance { before, mean_w, weight, usual: self.noise + MIN_VARIANCE * self.variance }
    }

    /// Learnt from starts, of which each counts with a weight, and from the marks.
    pub fn learn(&self, starts: impl IntoIterator<Item = (usize, f64)>) -> Appearance {
        let [before, after] = self.window;
        let marks = self.marks.iter().map(|mark| (*mark, MARK_WEIGHT));
        let inside = |start: &(usize, f64)| start.0 >= before && start.0 + after <= self.power_w.len();
        let mut moments = vec![[0.0; 2]; before + after];
        let mut total = 0.0;
        for (start, weight) in starts.into_iter().chain(marks).filter(inside) {
            total += weight;
            for (sums, watts) in moments.iter_mut().zip(&self.power_w[start - before..start + after]) {
                *sums = [sums[0] + weight * watts, sums[1] + weight * watts * watts];
            }
        }
        let mean_w: Vec<f64> = moments.iter().map(|sums| sums[0] / f64::max(total, 1.0)).collect();
        let variance = |(sums, mean): (&[f64; 2], &f64)| {
            let seen = (sums[1] - total * mean * mean).max(0.0) + PRIOR.1 * PRIOR.0 * self.variance;
            seen / (total + PRIOR.1) + self.noise + MIN_VARIANCE * self.variance
        };
        let variances: Vec<f64> = moments.iter().zip(&mean_w).map(variance).collect();
        let any = self.variance + self.noise;
        let weight: Vec<f64> = variances.iter().map(|own| (1.0 / own - 1.0 / any).max(0.0)).collect();
        let usual: f64 = weight.iter().zip(&variances).map(|(weight, own)| weight * own).sum();
        Appearance { before, mean_w, weight, usual: usual.max(f64::MIN_POSITIVE) }
    }

    /// `-ln(1 + D / D0)` of the weighted squared distance `D` of every sample as a start.
    pub fn likeness(&self, appearance: &Appearance) -> Likeness {
        let Appearance { before, mean_w, weight, usual } = appearance;
        let linear: Vec<f64> = mean_w.iter().zip(weight).map(|(mean, weight)| mean * weight).collect();
        let own: f64 = linear.iter().zip(mean_w).map(|(linear, mean)| linear * mean).sum();
        let squares = Correlator::new(weight).correlate(&self.squares);
        let products = Correlator::new(&linear).correlate(&self.power_w);
        let near = squares
            .iter()
            .zip(&products)
            .map(|(square, product)| -libm::log1p((square - 2.0 * product + own).max(0.0) / usual));
        let near: Vec<f64> = near.collect();
        let least = near.iter().copied().fold(0.0, f64::min);
        let mut all = vec![least; self.power_w.len()];
        all[*before..before + near.len()].copy_from_slice(&near);
        self.with_candidates(all)
    }

    fn with_candidates(&self, all: Vec<f64>) -> Likeness {
        let far: Vec<f64> = all.iter().map(|near| -near).collect();
        let mut candidates = spaced_minima(&far, self.min_distance());
        candidates.retain(|at| self.marks.iter().all(|mark| mark.abs_diff(*at) >= self.min_distance()));
        candidates.extend(&self.marks);
        candidates.sort_unstable();
        candidates.dedup();
        let at: Vec<f64> = candidates.iter().map(|place| all[*place]).collect();
        let spread = crate::stats::moments(&at).deviation + 1e-9;
        Likeness { all, candidates, at, spread }
    }
}

fn work(power_w: &[f64]) -> Vec<f64> {
    let mut sorted = power_w.to_vec();
    let low = sorted.len() / 50;
    let low_w = if sorted.is_empty() { 0.0 } else { crate::stats::nth_smallest(&mut sorted, low) };
    let add = |sum: &mut f64, watts: &f64| {
        *sum += (watts - low_w).max(0.0);
        Some(*sum)
    };
    core::iter::once(0.0).chain(power_w.iter().scan(0.0, add)).collect()
}

impl Likeness {
    /// The greatest within a distance of a place.
    pub fn near(&self, place: usize, distance: usize) -> f64 {
        self.most(place.saturating_sub(distance), place + distance + 1).unwrap_or(f64::NEG_INFINITY)
    }

    /// The greatest in a range; `None` if that is empty.
    pub fn most(&self, from: usize, to: usize) -> Option<f64> {
        self.all.get(from..to.min(self.all.len()))?.iter().copied().reduce(f64::max)
    }

    /// The candidate nearest to a place.
    pub fn nearest(&self, place: usize) -> usize {
        let after = self.candidates.partition_point(|candidate| *candidate < place);
        let beside = [after.saturating_sub(1), after.min(self.candidates.len().saturating_sub(1))];
        if self.candidates[beside[0]].abs_diff(place) <= self.candidates[beside[1]].abs_diff(place) {
            beside[0]
        } else {
            beside[1]
        }
    }
}
