//! The chain of starts over candidates: evidence of durations, sums over all sequences, and the best one.
//!
//! Times and durations are in windows, evidence in nats. `l_j` is the evidence of candidate `j`, `h(t, d)`
//! that of a duration `d` after a start at `t`. Sums over all sequences up to `j`, and from `j` on (Rabiner
//! 1989; explicit durations: Ferguson 1980, Yu 2010):
//!
//! ```text
//! A_j = l_j + ln(1 + sum_i exp(A_i + h(t_i, t_j - t_i)))        Z = ln sum_j exp A_j
//! B_i = ln(1 + sum_j exp(h(t_i, t_j - t_i) + l_j + B_j))
//! P(j is a start) = exp(A_j + B_j - Z)      P(frame from i to j) = exp(A_i + h_ij + l_j + B_j - Z)
//! ```
//!
//! Sequences begin and end anywhere at no cost. The best one has the maximum in place of the sum (Viterbi 1967).

use core::f64::consts::TAU;

/// Shortest and longest duration with evidence of its own; a longer one is a pause.
const DURATIONS: [f64; 2] = [0.45, 80.0];
/// Bins of the logarithm of durations.
const BINS: usize = 240;
/// Deviation of the kernel of their density (Silverman 1986), in the logarithm.
const KERNEL: f64 = 0.03;
/// Mean frames in a block of the trace.
const BLOCK_FRAMES: f64 = 8.0;
/// Weights of the blocks beside one, by how far away they are.
const NEAR_WEIGHTS: [f64; 3] = [1.0, 0.6, 0.3];
/// Fewest durations that anything is learnt from.
const MIN_DURATIONS: usize = 4;
/// Rounds of expectation and maximization of the shares.
const SHARE_ROUNDS: usize = 8;
/// Least and greatest evidence of a duration: less than what a point at a fixed phase within frames could
/// gain by being as even as the starts.
const DURATION_EVIDENCE: [f64; 2] = [-3.75, 2.5];
/// Evidence of a pause beyond the longest duration, or beyond the candidates looked back at.
const PAUSE_EVIDENCE: f64 = -4.6;
/// Candidates looked back at.
const MAX_BACK: usize = 64;

/// Evidence of durations against a flat density of their logarithm. The density is a mixture of that of the
/// blocks of the trace nearby, that of all other blocks and a flat one. As the own block is left out, the
/// shares are honest: where there is no period the flat part takes all, and durations are worth nothing.
pub(super) struct Durations {
    first: f64,
    block: f64,
    /// By block and bin.
    evidence: Vec<Vec<f64>>,
}

/// Densities of one block: of the blocks nearby, and of all others.
type Parts = [Vec<f64>; 2];

const FLAT: f64 = 1.0 / BINS as f64;

fn bin_width() -> f64 {
    libm::log(DURATIONS[1] / DURATIONS[0]) / BINS as f64
}

fn bin(duration: f64) -> Option<usize> {
    let place = libm::log(duration / DURATIONS[0]) / bin_width();
    (place >= 0.0 && place < BINS as f64).then_some(place as usize)
}

impl Durations {
    /// From starts in order.
    pub fn learn(starts: &[f64]) -> Self {
        let durations: Vec<(f64, usize)> =
            starts.windows(2).filter_map(|two| Some((two[0], bin(two[1] - two[0])?))).collect();
        let (Some(&(first, _)), Some(&(last, _))) = (durations.first(), durations.last()) else {
            return Self::flat();
        };
        if durations.len() < MIN_DURATIONS {
            return Self::flat();
        }
        let block = BLOCK_FRAMES * (last - first) / durations.len() as f64;
        let blocks = ((last - first) / block) as usize + 1;
        let placed: Vec<(usize, usize)> = durations
            .into_iter()
            .map(|(time, bin)| ((((time - first) / block) as usize).min(blocks - 1), bin))
            .collect();
        let parts = parts(&placed, blocks);
        let shares = shares(&placed, &parts);
        let of = |(near, all): (&f64, &f64)| {
            let ratio = (shares[0] * near + shares[1] * all) / FLAT + shares[2];
            libm::log(ratio).clamp(DURATION_EVIDENCE[0], DURATION_EVIDENCE[1])
        };
        let evidence = parts.iter().map(|[near, all]| near.iter().zip(all).map(of).collect());
        Self { first, block, evidence: evidence.collect() }
    }

    /// Every duration is as likely.
    fn flat() -> Self {
        Self { first: 0.0, block: f64::INFINITY, evidence: vec![vec![0.0; BINS]] }
    }

    /// Evidence of a duration after a start.
    fn evidence(&self, start: f64, duration: f64) -> f64 {
        let block = (((start - self.first) / self.block).max(0.0) as usize).min(self.evidence.len() - 1);
        bin(duration).map_or(PAUSE_EVIDENCE, |bin| self.evidence[block][bin])
    }
}

/// Of each block.
fn parts(placed: &[(usize, usize)], blocks: usize) -> Vec<Parts> {
    let mut own = vec![vec![0.0; BINS]; blocks];
    let reach = (4.0 * KERNEL / bin_width()) as usize;
    for &(block, bin) in placed {
        let first = bin.saturating_sub(reach);
        for (near, evidence) in (first..bin + reach + 1).zip(&mut own[block][first..]) {
            let off = near.abs_diff(bin) as f64 * bin_width() / KERNEL;
            *evidence += libm::exp(-0.5 * off * off) * bin_width() / (KERNEL * libm::sqrt(TAU));
        }
    }
    let mut total = vec![0.5 * FLAT; BINS];
    own.iter().for_each(|of| add(&mut total, of, 1.0));
    let of_block = |block: usize| {
        let mut near = vec![0.5 * FLAT; BINS];
        for (distance, weight) in (1..).zip(NEAR_WEIGHTS) {
            let beside = [block.checked_sub(distance), Some(block + distance)];
            beside
                .into_iter()
                .flatten()
                .filter_map(|at| own.get(at))
                .for_each(|of| add(&mut near, of, weight));
        }
        let others = total.iter().zip(&own[block]).map(|(all, own)| (all - own).max(0.5 * FLAT));
        [normalized(near), normalized(others.collect())]
    };
    (0..blocks).map(of_block).collect()
}

fn add(to: &mut [f64], of: &[f64], weight: f64) {
    to.iter_mut().zip(of).for_each(|(sum, x)| *sum += weight * x);
}

fn normalized(mut density: Vec<f64>) -> Vec<f64> {
    let sum: f64 = density.iter().sum();
    density.iter_mut().for_each(|x| *x /= sum);
    density
}

/// Shares of the densities nearby, of all others and of the flat one, by expectation and maximization
/// (Dempster, Laird and Rubin 1977).
fn shares(placed: &[(usize, usize)], parts: &[Parts]) -> [f64; 3] {
    let mut shares = [0.4, 0.4, 0.2];
    for _ in 0..SHARE_ROUNDS {
        let mut sums = [0.5, 0.5, 1.0];
        for &(block, bin) in placed {
            let [near, all] = &parts[block];
            let each = [shares[0] * near[bin], shares[1] * all[bin], shares[2] * FLAT];
            let sum: f64 = each.iter().sum();
            sums.iter_mut().zip(each).for_each(|(to, x)| *to += x / sum);
        }
        let sum: f64 = sums.iter().sum();
        shares = sums.map(|x| x / sum);
    }
    shares
}

/// The best sequence of candidates.
#[derive(Clone, Debug, Default)]
pub(super) struct Path {
    /// Which candidates.
    pub chosen: Vec<usize>,
    /// Chance of each frame between two of them.
    pub frames: Vec<f64>,
    /// Chance of every candidate as a start.
    pub starts: Vec<f64>,
}

/// What may precede a candidate: the first of those before it, and the evidence of each duration from there on.
struct Before {
    first: usize,
    evidence: Vec<f64>,
}

/// The best path and the chances, from the times of candidates and their evidence.
pub(super) fn solve(times: &[f64], weights: &[f64], durations: &Durations) -> Path {
    let before: Vec<Before> = (0..times.len())
        .map(|to| {
            let first = to.saturating_sub(MAX_BACK);
            let until = first + times[first..to].partition_point(|time| times[to] - time >= DURATIONS[0]);
            let of = |time: &f64| durations.evidence(*time, times[to] - time);
            Before { first, evidence: times[first..until].iter().map(of).collect() }
        })
        .collect();
    let forward = forward(&before, weights);
    let backward = backward(&before, weights);
    let total = forward.iter().copied().fold(f64::NEG_INFINITY, log_add);
    let chance = |log: f64| libm::exp((log - total).min(0.0));
    let chosen = best(&before, weights);
    let frame = |ends: &[usize]| {
        let Before { first, evidence } = &before[ends[1]];
        let duration = ends[0].checked_sub(*first).and_then(|at| evidence.get(at)).unwrap_or(&PAUSE_EVIDENCE);
        chance(forward[ends[0]] + duration + weights[ends[1]] + backward[ends[1]])
    };
    let frames = chosen.windows(2).map(frame).collect();
    let starts = forward.iter().zip(&backward).map(|(a, b)| chance(a + b)).collect();
    Path { chosen, frames, starts }
}

fn forward(before: &[Before], weights: &[f64]) -> Vec<f64> {
    let mut sums: Vec<f64> = Vec::with_capacity(weights.len());
    let mut far = f64::NEG_INFINITY;
    for (Before { first, evidence }, weight) in before.iter().zip(weights) {
        far = first.checked_sub(1).map_or(far, |gone| log_add(far, sums[gone]));
        let near = log_sum(evidence.iter().zip(&sums[*first..]).map(|(a, b)| a + b));
        sums.push(weight + log_add(log_add(0.0, far + PAUSE_EVIDENCE), near));
    }
    sums
}

fn backward(before: &[Before], weights: &[f64]) -> Vec<f64> {
    let mut sums = vec![0.0; weights.len()];
    let (mut far, mut passed) = (f64::NEG_INFINITY, weights.len());
    for to in (0..weights.len()).rev() {
        // Those that look back less far than to this one.
        while passed > to + 1 && before[passed - 1].first > to {
            passed -= 1;
            far = log_add(far, weights[passed] + sums[passed]);
        }
        sums[to] = log_add(sums[to], far + PAUSE_EVIDENCE);
        let here = weights[to] + sums[to];
        let Before { first, evidence } = &before[to];
        for (sum, duration) in sums[*first..].iter_mut().zip(evidence) {
            *sum = log_add(*sum, duration + here);
        }
    }
    sums
}

fn best(before: &[Before], weights: &[f64]) -> Vec<usize> {
    let mut most: Vec<f64> = Vec::with_capacity(weights.len());
    let mut previous: Vec<Option<usize>> = Vec::with_capacity(weights.len());
    let mut far = (f64::NEG_INFINITY, None);
    for (Before { first, evidence }, weight) in before.iter().zip(weights) {
        if let Some(gone) = first.checked_sub(1).filter(|gone| most[*gone] > far.0) {
            far = (most[gone], Some(gone));
        }
        let mut here = (0.0, None);
        let near = evidence.iter().zip(*first..).map(|(duration, from)| (duration + most[from], Some(from)));
        for from in near.chain([(far.0 + PAUSE_EVIDENCE, far.1)]) {
            here = if from.0 > here.0 { from } else { here };
        }
        most.push(weight + here.0);
        previous.push(here.1);
    }
    let last = (0..most.len()).max_by(|a, b| most[*a].total_cmp(&most[*b]));
    let mut chosen: Vec<usize> = core::iter::successors(last, |at| previous[*at]).collect();
    chosen.reverse();
    chosen
}

fn log_add(a: f64, b: f64) -> f64 {
    let (low, high) = if a < b { (a, b) } else { (b, a) };
    if low == f64::NEG_INFINITY { high } else { high + libm::log1p(libm::exp(low - high)) }
}

fn log_sum(values: impl Iterator<Item = f64> + Clone) -> f64 {
    let most = values.clone().fold(f64::NEG_INFINITY, f64::max);
    if most == f64::NEG_INFINITY {
        return most;
    }
    most + libm::log(values.map(|value| libm::exp(value - most)).sum())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_even_duration_is_likelier_and_without_a_period_none_is() {
        let even: Vec<f64> = (0..60).map(|i| 3.0 * f64::from(i)).collect();
        let durations = Durations::learn(&even);
        assert_eq!(durations.evidence(30.0, 3.0), DURATION_EVIDENCE[1]);
        assert!(durations.evidence(30.0, 4.0) < -1.0);
        assert_eq!(durations.evidence(30.0, 500.0), PAUSE_EVIDENCE);
        let mut time = 0.0;
        let uneven: Vec<f64> = (0..60_u32)
            .map(|i| {
                time += libm::exp(f64::from(i * 37 % 59) / 59.0 * 4.0);
                time
            })
            .collect();
        let durations = Durations::learn(&uneven);
        assert!([1.5, 3.0, 7.0, 20.0].iter().all(|d| durations.evidence(30.0, *d).abs() < 0.1));
    }

    #[test]
    fn chances_and_the_best_path_are_those_of_all_sequences() {
        let times: Vec<f64> = [0.0, 1.0, 1.2, 2.0, 2.6, 3.1, 4.0].to_vec();
        let weights = [1.0, 2.0, -0.5, 0.7, -1.0, 0.3, 1.5];
        let durations = Durations::learn(&(0..30).map(f64::from).collect::<Vec<f64>>());
        let (mut total, mut starts, mut best) = (0.0, [0.0; 7], (0.0, 0));
        for set in 1..1_u32 << 7 {
            let chosen: Vec<usize> = (0..7).filter(|at| set & (1 << at) != 0).collect();
            let gap = |two: &[usize]| times[two[1]] - times[two[0]];
            if chosen.windows(2).any(|two| gap(two) < DURATIONS[0]) {
                continue;
            }
            let own: f64 = chosen.iter().map(|at| weights[*at]).sum();
            let between = chosen.windows(2).map(|two| durations.evidence(times[two[0]], gap(two)));
            let chance = (own + between.sum::<f64>()).exp();
            total += chance;
            chosen.iter().for_each(|at| starts[*at] += chance);
            best = if chance > best.0 { (chance, set) } else { best };
        }
        let path = solve(&times, &weights, &durations);
        for (got, sum) in path.starts.iter().zip(starts) {
            assert!((got - sum / total).abs() < 1e-12, "{got} {}", sum / total);
        }
        assert_eq!(path.chosen.iter().map(|at| 1 << at).sum::<u32>(), best.1);
    }

    #[test]
    fn a_pause_of_any_length_is_crossed() {
        let times: Vec<f64> = (0..40).map(|i| f64::from(i) + if i < 20 { 0.0 } else { 3000.0 }).collect();
        let path = solve(&times, &[4.0; 40], &Durations::learn(&times));
        assert_eq!(path.chosen.len(), 40);
        assert!(path.starts.iter().all(|chance| *chance > 0.9));
    }
}
