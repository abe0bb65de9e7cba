//! Segmentation: the whole trace as frames and pauses, by one hidden semi-Markov model that is learnt from it.
//!
//! Hidden semi-Markov models: Rabiner (1989), with durations of their own Ferguson (1980) and Yu (2010);
//! segment models: Ostendorf, Digalakis and Kimball (1996). Everything is learnt from the trace and the mark;
//! each term may come out to be worth nothing.
//!
//! # Appearance
//!
//! A start has a mean power `q_j` and a variance `v_j` at each sample `j` of the window about it; any other
//! place has the variance `v` of the trace. The log likelihood ratio of two normal populations with these
//! variances counts the squared distance of a sample by
//!
//! ```text
//! w_j = 1/v_j - 1/v    D = sum_j w_j (x_j - q_j)^2    s = -ln(1 + D / D0)    D0 = sum_j w_j v_j
//! ```
//!
//! so idle before the frame, the level of power and the shape of the first draws weigh as much as they are
//! the same in all frames, and draws that differ from frame to frame weigh nothing. The logarithm is that of
//! Student's t distribution: a frame with other content costs little more than the worst usual one.
//!
//! # Evidence
//!
//! Candidates are the local maxima of `s`. The *rival* of two neighbouring starts is the best candidate
//! between them. Starts and rivals are two normal populations of one variance (Fisher 1936), with medians
//! `m1` and `m0`: `l = (m1 - m0)/V (s - (m1 + m0)/2)`, at most 8 nats. Rivals and not all candidates: the
//! hard ones decide.
//!
//! # Sequence
//!
//! Durations have evidence between bounds, from the blocks of the trace nearby, from all of it, or none;
//! pauses may have any length. Sums over all sequences give the chance of each start and frame, the best
//! sequence the starts ([`chain`]).
//!
//! # Learning
//!
//! Expectation and maximization (Dempster, Laird and Rubin 1977) has as many fixed points as there are parts
//! of frames that repeat. So it begins from several sets of starts: those most like one of five parts of the
//! mark's window, and the proposals of other methods. A criterion without truth chooses among the results:
//!
//! ```text
//! J(s) = sum_k E_k clip((min(s_k, s_k+1) - rival_k) / spread of s, -2, 4) / sum of E
//! ```
//!
//! with `E_k` the work of frame `k` above the lowest power. A missed start becomes a rival and spoils the
//! margin of a long frame; a false one has a low `s` itself. J counts with the appearance learnt, with the
//! part of the mark that it is greatest with, and in the mean over these parts: what has drifted from the
//! mark gains nothing in the latter two.
//!
//! # Confidence
//!
//! The chance of a frame is its mean over all results, each weighted by `exp(J / 0.05)`: where others that
//! are nearly as good have other frames, it is low.

mod chain;

use super::marks::Placement;
use super::matched::noise_variance;
use super::profile::{Correlator, spaced_minima};
use crate::stats::upper_median;
use chain::{Durations, Path, solve};
use rayon::prelude::*;

/// Parts of the window that the first sets of starts are found by, as shares of it before and after the mark.
const VIEWS: [[f64; 2]; 5] = [[1.0, 1.0], [1.0, 0.25], [0.5, 0.125], [0.2, 0.25], [2.0, 1.0]];
/// Shares of the candidates that are no starts, of the first sets.
const OTHERS: [f64; 12] = [0.5, 0.6, 0.7, 0.75, 0.8, 0.84, 0.87, 0.9, 0.92, 0.94, 0.96, 0.98];
/// Rounds of learning from what was found.
const ROUNDS: usize = 3;
/// Chains between two of them.
const CHAINS: usize = 2;
/// Greatest evidence of a candidate's likeness, and that of a mark, nats.
const MAX_EVIDENCE: f64 = 8.0;
const MARK_EVIDENCE: f64 = 25.0;
/// Candidates with less evidence are left out: no duration makes up for that, nats.
const MIN_EVIDENCE: f64 = -6.0;
/// Fewest starts and rivals that give a scale.
const MIN_EXAMPLES: usize = 3;
/// Least and greatest margin, in deviations.
const MARGINS: [f64; 2] = [-2.0, 4.0];
/// A start found is at a maximum of the mark's own likeness within this share of a window; a rival is this
/// far from both ends.
const SAME: f64 = 0.04;
const APART: f64 = 0.3;
/// Difference of the criterion by which a result is as likely as another to one part in e.
const TEMPERATURE: f64 = 0.05;

/// A segmentation of the trace.
#[derive(Clone, Debug, Default)]
pub(super) struct Segmentation {
    /// Starts, in samples of the trace.
    pub starts: Vec<f64>,
    /// Confidence of each start, and of each frame between two of them.
    pub start_confidence: Vec<f64>,
    pub frame_confidence: Vec<f64>,
    /// Which of the proposals it is, unchanged.
    pub proposal: Option<usize>,
}

/// A set of starts that has been judged.
#[derive(Clone)]
struct Run {
    starts: Vec<usize>,
    start_chance: Vec<f64>,
    frame_chance: Vec<f64>,
    judged: f64,
    proposal: Option<usize>,
}

/// The segmentation that the criterion prefers: one of the model's own, or one of the proposals (starts of
/// other methods, in samples).
pub(super) fn segment(power: &[f64], placement: &Placement, proposals: &[Vec<f64>]) -> Segmentation {
    let model = Model::new(Grid::new(power, placement));
    let mut runs: Vec<Run> = (0..VIEWS.len()).into_par_iter().map(|view| model.of_view(view)).collect();
    let grid = |starts: &Vec<f64>| -> Vec<usize> {
        let place = |start: &f64| libm::round(start / model.grid.step as f64) as usize;
        starts.iter().map(place).map(|at| at.min(model.grid.power_w.len() - 1)).collect()
    };
    let proposed: Vec<[Run; 2]> = (0..proposals.len())
        .into_par_iter()
        .map(|index| model.of_proposal(index, grid(&proposals[index])))
        .collect();
    runs.extend(proposed.into_iter().flatten());
    let Some(best) = runs.iter().reduce(|a, b| if b.judged > a.judged { b } else { a }).cloned() else {
        return Segmentation::default();
    };
    let (start_confidence, frame_confidence) = model.confidence(&best, &runs);
    let starts = match best.proposal {
        Some(index) => proposals[index].clone(),
        None => best.starts.iter().map(|start| (*start * model.grid.step) as f64).collect(),
    };
    Segmentation { starts, start_confidence, frame_confidence, proposal: best.proposal }
}

/// The trace and its likeness to the mark.
struct Model {
    grid: Grid,
    /// Likeness to parts of the mark's window.
    views: Vec<Likeness>,
}

impl Model {
    fn new(grid: Grid) -> Self {
        let views = VIEWS.par_iter().map(|shares| grid.likeness(&grid.marked(*shares))).collect();
        Self { grid, views }
    }

    /// From the starts most like a part of the mark's window: as many as the criterion prefers.
    fn of_view(&self, view: usize) -> Run {
        let likeness = &self.views[view];
        let unmarked = |index: &usize| !self.grid.marks.contains(&likeness.candidates[*index]);
        let mut sorted: Vec<usize> = (0..likeness.at.len()).filter(unmarked).collect();
        sorted.sort_by(|a, b| likeness.at[*a].total_cmp(&likeness.at[*b]));
        let sets = OTHERS.iter().map(|share| {
            let first = (share * sorted.len() as f64) as usize;
            let mut set = sorted[first..].to_vec();
            set.extend((0..likeness.at.len()).filter(|index| !unmarked(index)));
            set.sort_unstable();
            set
        });
        let judged = sets.map(|set| (self.margin(likeness, &set), set));
        let best = judged.reduce(|a, b| if b.0 > a.0 { b } else { a });
        let (chosen, path) = self.chain(likeness, best.map(|best| best.1).unwrap_or_default());
        self.learn(self.run(likeness, &chosen, path))
    }

    /// A proposal as it is, and what is learnt from it.
    fn of_proposal(&self, index: usize, starts: Vec<usize>) -> [Run; 2] {
        let likeness = self.grid.likeness(&self.grid.learn(starts.iter().map(|start| (*start, 1.0))));
        let set: Vec<usize> = starts.iter().map(|start| likeness.nearest(*start)).collect();
        let (chosen, path) = self.chain(&likeness, set.clone());
        let start_chance: Vec<f64> = set.iter().map(|index| path.starts[*index]).collect();
        let frame_chance = start_chance.windows(2).map(|two| two[0].min(two[1])).collect();
        let judged = self.judge(&likeness, &set, &starts);
        let own = Run { judged, start_chance, frame_chance, starts, proposal: Some(index) };
        [own, self.learn(self.run(&likeness, &chosen, path))]
    }

    /// The best of some rounds of learning from the starts found.
    fn learn(&self, first: Run) -> Run {
        let mut best = first.clone();
        let mut last = first;
        for _ in 0..ROUNDS {
            let examples = last.starts.iter().copied().zip(last.start_chance.iter().copied());
            let likeness = self.grid.likeness(&self.grid.learn(examples));
            let mut set: Vec<usize> = last.starts.iter().map(|start| likeness.nearest(*start)).collect();
            set.dedup();
            let (chosen, path) = self.chain(&likeness, set);
            last = self.run(&likeness, &chosen, path);
            if last.judged > best.judged {
                best = last.clone();
            }
        }
        best
    }

    fn run(&self, likeness: &Likeness, chosen: &[usize], path: Path) -> Run {
        let starts: Vec<usize> = chosen.iter().map(|index| likeness.candidates[*index]).collect();
        let judged = self.judge(likeness, chosen, &starts);
        let start_chance = chosen.iter().map(|index| path.starts[*index]).collect();
        Run { starts, judged, start_chance, frame_chance: path.frames, proposal: None }
    }

    /// Chains of a set, whose durations and contrast are learnt from the one before.
    fn chain(&self, likeness: &Likeness, mut chosen: Vec<usize>) -> (Vec<usize>, Path) {
        let time = |index: usize| likeness.candidates[index] as f64 / self.grid.length();
        let mut path = Path::default();
        for _ in 0..CHAINS {
            let evidence = self.evidence(likeness, &chosen);
            let durations = Durations::learn(&chosen.iter().map(|index| time(*index)).collect::<Vec<f64>>());
            let kept: Vec<usize> =
                (0..evidence.len()).filter(|index| evidence[*index] > MIN_EVIDENCE).collect();
            let times: Vec<f64> = kept.iter().map(|index| time(*index)).collect();
            let weights: Vec<f64> = kept.iter().map(|index| evidence[*index]).collect();
            path = solve(&times, &weights, &durations);
            chosen = path.chosen.iter().map(|at| kept[*at]).collect();
            let mut all = vec![0.0; evidence.len()];
            kept.iter().zip(&path.starts).for_each(|(index, chance)| all[*index] = *chance);
            path.starts = all;
        }
        (chosen, path)
    }

    /// The best candidate left out between two neighbours.
    fn rivals<'a>(&self, at: &'a [f64], chosen: &'a [usize]) -> impl Iterator<Item = Option<f64>> + 'a {
        chosen.windows(2).map(|two| at[two[0] + 1..two[1].max(two[0] + 1)].iter().copied().reduce(f64::max))
    }

    /// Log ratio of two normal populations of equal variance, the chosen and their rivals, within bounds.
    fn evidence(&self, likeness: &Likeness, chosen: &[usize]) -> Vec<f64> {
        let at = &likeness.at;
        let rivals: Vec<f64> = self.rivals(at, chosen).flatten().collect();
        let starts: Vec<f64> = chosen.iter().map(|index| at[*index]).collect();
        let [high, low] = [&starts, &rivals].map(|of| upper_median(&mut of.clone()));
        let (slope, middle) = if starts.len().min(rivals.len()) < MIN_EXAMPLES {
            (4.0, high - 0.75)
        } else {
            let apart = (high - low).max(0.1);
            let high = low + apart;
            let variance = |of: &[f64], median: f64| {
                let square = |x: &f64| ((x - median) * (x - median)).min(4.0 * apart * apart);
                of.iter().map(square).sum::<f64>() / of.len() as f64
            };
            let both = 0.5 * (variance(&starts, high) + variance(&rivals, low)) + 0.01 * apart * apart;
            (apart / both, 0.5 * (high + low))
        };
        let of = |(at, place): (&f64, &usize)| match self.grid.marks.contains(place) {
            true => MARK_EVIDENCE,
            false => (slope * (at - middle)).clamp(-MAX_EVIDENCE, MAX_EVIDENCE),
        };
        at.iter().zip(&likeness.candidates).map(of).collect()
    }

    /// By how much the chosen are more like a start than what lies between them, weighted by work.
    fn margin(&self, likeness: &Likeness, chosen: &[usize]) -> f64 {
        let at = &likeness.at;
        let place = |index: usize| likeness.candidates[index];
        let of = chosen.windows(2).zip(self.rivals(at, chosen)).map(|(two, rival)| {
            let least = at[two[0]].min(at[two[1]]);
            ([place(two[0]), place(two[1])], rival.map_or(0.0, |rival| (least - rival) / likeness.spread))
        });
        self.by_work(of)
    }

    /// The same for starts anywhere, with a view of the mark.
    fn margin_alone(&self, view: &Likeness, starts: &[usize]) -> f64 {
        let [same, apart] = [SAME, APART].map(|share| (share * self.grid.length()) as usize);
        let of = starts.windows(2).map(|two| {
            let least = view.near(two[0], same).min(view.near(two[1], same));
            let rival = view.most(two[0] + apart, two[1].saturating_sub(apart));
            ([two[0], two[1]], rival.map_or(0.0, |rival| (least - rival) / view.spread))
        });
        self.by_work(of)
    }

    fn by_work(&self, margins: impl Iterator<Item = ([usize; 2], f64)>) -> f64 {
        let work = &self.grid.work;
        let of = |([from, to], margin): ([usize; 2], f64)| {
            margin.clamp(MARGINS[0], MARGINS[1]) * (work[to] - work[from])
        };
        margins.map(of).sum::<f64>() / work.last().copied().unwrap_or(1.0).max(f64::MIN_POSITIVE)
    }

    /// The criterion without truth.
    fn judge(&self, likeness: &Likeness, chosen: &[usize], starts: &[usize]) -> f64 {
        if starts.len() < MIN_EXAMPLES {
            return MARGINS[0];
        }
        let alone: Vec<f64> = self.views.iter().map(|view| self.margin_alone(view, starts)).collect();
        let most = alone.iter().copied().fold(MARGINS[0], f64::max);
        self.margin(likeness, chosen) + most + alone.iter().sum::<f64>() / alone.len() as f64
    }

    /// Chances of the starts and frames of a run, in the mean over all runs by their likelihood.
    fn confidence(&self, best: &Run, runs: &[Run]) -> (Vec<f64>, Vec<f64>) {
        let mut starts = vec![0.0; best.starts.len()];
        let mut frames = vec![0.0; best.starts.len().saturating_sub(1)];
        let mut total = 0.0;
        let reach = self.grid.min_distance() / 2;
        for run in runs {
            let weight = libm::exp((run.judged - best.judged) / TEMPERATURE);
            total += weight;
            let beside = |start: &usize| {
                let after = run.starts.partition_point(|other| other < start);
                let near = [after.checked_sub(1), Some(after).filter(|after| *after < run.starts.len())];
                let near = near.into_iter().flatten().min_by_key(|at| run.starts[*at].abs_diff(*start));
                near.filter(|at| run.starts[*at].abs_diff(*start) <= reach)
            };
            let beside: Vec<Option<usize>> = best.starts.iter().map(beside).collect();
            for (sum, at) in starts.iter_mut().zip(&beside) {
                *sum += weight * at.map_or(0.0, |at| run.start_chance[at]);
            }
            for (sum, two) in frames.iter_mut().zip(beside.windows(2)) {
                if let [Some(a), Some(b)] = two
                    && *b == a + 1
                {
                    *sum += weight * run.frame_chance[*a];
                }
            }
        }
        starts.iter_mut().chain(&mut frames).for_each(|sum| *sum /= total);
        (starts, frames)
    }
}

/// Samples of a window after averaging; all costs grow with them.
const WINDOW_SAMPLES: usize = 100;
/// Candidates are at least this share of a window apart.
const MIN_DISTANCE: f64 = 0.125;
/// Variance that any sample of a start has beyond the noise, as a share of that of the trace.
const MIN_VARIANCE: f64 = 0.005;
/// Variance of a sample of a start before any is seen, as a share of that of the trace, and how many starts
/// that counts as.
const PRIOR: (f64, f64) = (0.3, 3.0);
/// Weight of a mark among the starts that are learnt from.
const MARK_WEIGHT: f64 = 2.0;

/// Power, less its mean, averaged to about [`WINDOW_SAMPLES`] a window.
struct Grid {
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
struct Appearance {
    before: usize,
    mean_w: Vec<f64>,
    weight: Vec<f64>,
    /// Mean of the weighted squared distance of a start.
    usual: f64,
}

/// How near every sample is to an appearance, and the local maxima of that.
struct Likeness {
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

#[cfg(test)]
mod tests {
    use crate::energy::{TOLERANCE_S, pairs};
    use crate::frames::{FinderMethod, FinderOptions, Marks, default_window, find_with};
    use crate::synth::HELD_OUT_DEVICES;

    #[test]
    fn runs_of_frames_lone_frames_and_pauses_are_found_by_what_all_frames_begin_with() {
        let device = HELD_OUT_DEVICES.iter().find(|device| device.name == "on demand").unwrap();
        let scene = device.scene(80, 3).unwrap();
        let trace = scene.record(&device.recorder(3)).unwrap();
        let truth_s: Vec<f64> = scene.truth.iter().map(|frame| frame.start_s).collect();
        // Frames from the end mark on are not searched for.
        let (end_s, truth_s) = (truth_s[70], &truth_s[..70]);
        let marks = Marks::one(truth_s[32], default_window(0.0, trace.rate_hz()), end_s);
        let options = FinderOptions { method: FinderMethod::Segments, without: None };
        let found = find_with(&trace, &marks, &options).unwrap();
        let found_s: Vec<f64> = found.starts.iter().map(|start| start.time_s).collect();
        let paired = pairs(&found_s, truth_s, TOLERANCE_S).len();
        assert!(2 * paired >= 19 * (found_s.len() + truth_s.len()) / 20, "{paired} of {}", found_s.len());
        assert_eq!(found.starts.iter().filter(|start| start.marked).count(), 1);
        assert!(found.frames.iter().filter(|frame| frame.confidence > 0.5).count() > 50);
    }
}
