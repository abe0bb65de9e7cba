//! The semi-Markov chain over candidates: evidence of durations, forward and backward sums, best path.

/// Shortest and longest frame with a duration of its own, in windows; a longer one is a pause.
const LENGTHS: [f64; 2] = [0.45, 80.0];
/// Bins of the logarithm of durations.
const BINS: usize = 240;
/// Kernel of their density, in log duration.
const KERNEL: f64 = 0.03;
/// Frames in a block with durations of its own.
const BLOCK_FRAMES: f64 = 8.0;
/// Weights of the blocks beside one, by how far away they are.
const BESIDE: [f64; 3] = [1.0, 0.6, 0.3];
/// Least and greatest evidence of a duration, nats.
const TIMING_LIMITS: [f64; 2] = [-3.75, 2.5];
/// Rounds of expectation and maximization of the three shares.
const SHARE_ROUNDS: usize = 8;
/// Candidates looked back at.
const MAX_BACK: usize = 64;
/// Evidence of a pause beyond the longest frame, nats.
const PAUSE_EVIDENCE: f64 = -4.6;

/// Evidence of a frame's duration against a flat density of its logarithm.
pub struct Durations {
    first: f64,
    block: f64,
    /// By block and bin, nats.
    evidence: Vec<Vec<f64>>,
}

fn step() -> f64 {
    libm::log(LENGTHS[1] / LENGTHS[0]) / BINS as f64
}

fn bin(duration: f64) -> Option<usize> {
    let place = libm::log(duration / LENGTHS[0]) / step();
    (place >= 0.0 && place < BINS as f64).then_some(place as usize)
}

fn normalized(mut density: Vec<f64>) -> Vec<f64> {
    let sum: f64 = density.iter().sum();
    density.iter_mut().for_each(|x| *x /= sum);
    density
}

impl Durations {
    /// Every duration is as likely.
    pub fn flat() -> Self {
        Self { first: 0.0, block: f64::INFINITY, evidence: vec![vec![0.0; BINS]] }
    }

    /// From the times of starts, in windows, in order.
    pub fn learn(times: &[f64]) -> Self {
        let lengths: Vec<(f64, usize)> =
            times.windows(2).filter_map(|two| Some((two[0], bin(two[1] - two[0])?))).collect();
        if lengths.len() < 4 {
            return Self::flat();
        }
        let (first, last) = (lengths[0].0, lengths[lengths.len() - 1].0);
        let block = BLOCK_FRAMES * (last - first) / lengths.len() as f64;
        let count = ((last - first) / block) as usize + 1;
        let place = |time: f64| (((time - first) / block) as usize).min(count - 1);
        let reach = (4.0 * KERNEL / step()) as usize;
        let mut own = vec![vec![0.0; BINS]; count];
        for &(time, bin) in &lengths {
            let to = &mut own[place(time)];
            for near in bin.saturating_sub(reach)..(bin + reach + 1).min(BINS) {
                let off = near.abs_diff(bin) as f64 * step() / KERNEL;
                to[near] += libm::exp(-0.5 * off * off) * step() / KERNEL / 2.5066;
            }
        }
        let flat = 1.0 / BINS as f64;
        let mut total = vec![0.5 * flat; BINS];
        own.iter().for_each(|of| total.iter_mut().zip(of).for_each(|(sum, x)| *sum += x));
        // The own block is left out: the shares are honest.
        let parts: Vec<[Vec<f64>; 2]> = (0..count)
            .map(|here| {
                let mut near = vec![0.5 * flat; BINS];
                for (distance, weight) in (1..).zip(BESIDE) {
                    for side in [here.checked_sub(distance), Some(here + distance)].into_iter().flatten() {
                        let of = own.get(side).into_iter().flatten();
                        near.iter_mut().zip(of).for_each(|(sum, x)| *sum += weight * x);
                    }
                }
                let others = total.iter().zip(&own[here]).map(|(all, own)| (all - own).max(0.5 * flat));
                [normalized(near), normalized(others.collect())]
            })
            .collect();
        let mut shares = [0.4, 0.4, 0.2];
        for _ in 0..SHARE_ROUNDS {
            let mut sums = [0.5, 0.5, 1.0];
            for &(time, bin) in &lengths {
                let [near, all] = &parts[place(time)];
                let each = [shares[0] * near[bin], shares[1] * all[bin], shares[2] * flat];
                let sum: f64 = each.iter().sum();
                sums.iter_mut().zip(each).for_each(|(to, x)| *to += x / sum);
            }
            let sum: f64 = sums.iter().sum();
            shares = sums.map(|x| x / sum);
        }
        let of = |near: &f64, all: &f64| {
            let ratio = (shares[0] * near + shares[1] * all) / flat + shares[2];
            libm::log(ratio).clamp(TIMING_LIMITS[0], TIMING_LIMITS[1])
        };
        let evidence =
            parts.iter().map(|[near, all]| near.iter().zip(all).map(|(near, all)| of(near, all)).collect());
        Self { first, block, evidence: evidence.collect() }
    }

    /// Evidence of a frame from a time on, so long.
    pub fn evidence(&self, time: f64, duration: f64) -> f64 {
        let block = (((time - self.first) / self.block).max(0.0) as usize).min(self.evidence.len() - 1);
        bin(duration).map_or(PAUSE_EVIDENCE, |bin| self.evidence[block][bin])
    }
}

/// The best sequence of candidates.
#[derive(Clone, Debug, Default)]
pub struct Path {
    /// Which candidates.
    pub chosen: Vec<usize>,
    /// Posterior of each of them as a start.
    pub starts: Vec<f64>,
    /// Posterior of each as a start that the next one follows; one less than there are starts.
    pub frames: Vec<f64>,
    /// Posterior of all candidates.
    pub all: Vec<f64>,
}

fn log_add(a: f64, b: f64) -> f64 {
    let (low, high) = if a < b { (a, b) } else { (b, a) };
    if low == f64::NEG_INFINITY { high } else { high + libm::log1p(libm::exp(low - high)) }
}

fn log_sum(values: &[f64]) -> f64 {
    let most = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    if most == f64::NEG_INFINITY {
        return most;
    }
    most + libm::log(values.iter().map(|value| libm::exp(value - most)).sum::<f64>())
}

/// The best path and the posteriors, from times in windows and the evidence of each candidate in nats.
pub fn solve(times: &[f64], weights: &[f64], durations: &Durations) -> Path {
    let count = times.len();
    if count == 0 {
        return Path::default();
    }
    // Candidates that may precede each one, and the evidence of the durations.
    let before: Vec<(usize, Vec<f64>)> = (0..count)
        .map(|to| {
            let from = to.saturating_sub(MAX_BACK);
            let until = from + times[from..to].partition_point(|time| times[to] - time >= LENGTHS[0]);
            (from, times[from..until].iter().map(|time| durations.evidence(*time, times[to] - time)).collect())
        })
        .collect();
    let (mut forward, mut best) = (vec![0.0; count], vec![0.0; count]);
    let mut previous = vec![None; count];
    let (mut far, mut far_best) = (f64::NEG_INFINITY, (f64::NEG_INFINITY, None));
    for (to, (from, timing)) in before.iter().enumerate() {
        if let Some(gone) = from.checked_sub(1) {
            far = log_add(far, forward[gone]);
            if best[gone] > far_best.0 {
                far_best = (best[gone], Some(gone));
            }
        }
        let sums: Vec<f64> = timing.iter().zip(&forward[*from..]).map(|(a, b)| a + b).collect();
        forward[to] = weights[to] + log_add(log_add(0.0, far + PAUSE_EVIDENCE), log_sum(&sums));
        let mut most = (0.0, None);
        if far_best.0 + PAUSE_EVIDENCE > most.0 {
            most = (far_best.0 + PAUSE_EVIDENCE, far_best.1);
        }
        for (index, timing) in timing.iter().enumerate() {
            if timing + best[from + index] > most.0 {
                most = (timing + best[from + index], Some(from + index));
            }
        }
        best[to] = weights[to] + most.0;
        previous[to] = most.1;
    }
    let total = log_sum(&forward);
    let mut backward = vec![0.0; count];
    let mut far = f64::NEG_INFINITY;
    let mut passed = count;
    for to in (0..count).rev() {
        // Successors beyond the reach of this candidate.
        while passed > 0 && before[passed - 1].0 > to {
            passed -= 1;
            far = log_add(far, weights[passed] + backward[passed]);
        }
        backward[to] = log_add(backward[to], far + PAUSE_EVIDENCE);
        let (from, timing) = &before[to];
        let here = weights[to] + backward[to];
        for (index, timing) in timing.iter().enumerate() {
            backward[from + index] = log_add(backward[from + index], timing + here);
        }
    }
    let all: Vec<f64> =
        forward.iter().zip(&backward).map(|(a, b)| libm::exp((a + b - total).min(0.0))).collect();
    let last = (0..count).max_by(|a, b| best[*a].total_cmp(&best[*b]));
    let mut chosen: Vec<usize> = core::iter::successors(last, |at| previous[*at]).collect();
    chosen.reverse();
    let frame = |ends: &[usize]| {
        let (from, timing) = &before[ends[1]];
        let timing = ends[0].checked_sub(*from).and_then(|at| timing.get(at)).copied();
        let here = weights[ends[1]] + backward[ends[1]];
        libm::exp((forward[ends[0]] + timing.unwrap_or(PAUSE_EVIDENCE) + here - total).min(0.0))
    };
    let frames = chosen.windows(2).map(frame).collect();
    let starts = chosen.iter().map(|&at| all[at]).collect();
    Path { chosen, starts, frames, all }
}
