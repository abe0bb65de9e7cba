//! The best sequence of starts.

use super::{Bank, Candidate};

#[derive(Clone, Debug, Default)]
pub(super) struct Chain {
    pub nodes: Vec<usize>,
    pub score: f64,
    pairing: Option<[f64; 3]>,
}

impl Chain {
    pub fn pairing(&self) -> Option<[f64; 3]> { self.pairing }
}

pub(super) struct Graph<'a> {
    candidates: &'a [Candidate],
    weights: &'a [f64],
    least: usize,
    most: usize,
}

const NONE: u32 = u32::MAX;

impl<'a> Graph<'a> {
    pub fn new(_bank: &Bank, candidates: &'a [Candidate], weights: &'a [f64], period: usize) -> Self {
        Self { candidates, weights, least: (period as f64 * 0.45) as usize, most: (period as f64 * 2.3) as usize }
    }

    pub fn best(&self, bank: &Bank, pair_scale: f64, _pairing: Option<[f64; 3]>) -> Chain {
        let knob = |name: &str, default: f64| std::env::var(name).ok().and_then(|v| v.parse().ok()).unwrap_or(default);
        let n = self.candidates.len();
        let offset = |i: usize| self.candidates[i].offset;
        // States (i, j), grouped by j.
        let mut first = vec![0_usize; n + 1];
        let mut pred_from = vec![0_usize; n];
        let (mut lo, mut hi) = (0, 0);
        for j in 0..n {
            while lo < n && offset(lo) + self.most < offset(j) { lo += 1; }
            while hi < j && offset(hi) + self.least <= offset(j) { hi += 1; }
            pred_from[j] = lo;
            first[j + 1] = first[j] + hi.saturating_sub(lo);
        }
        let total = first[n];
        let mut score = vec![0.0_f64; total];
        let mut back = vec![NONE; total];
        let mut likeness = vec![0.0_f32; total];
        for j in 0..n {
            for s in first[j]..first[j + 1] {
                let i = pred_from[j] + s - first[j];
                likeness[s] = libm::log((1.0 - bank.alike(offset(i), offset(j))).max(1e-4)) as f32;
            }
        }
        // Learn what likeness of successive starts is: weighted by evidence.
        let (mut yes, mut no) = ([0.0_f64; 3], [0.0_f64; 3]);
        for j in 0..n {
            for s in first[j]..first[j + 1] {
                let i = pred_from[j] + s - first[j];
                let l = f64::from(likeness[s]);
                let set = if self.weights[i] > 2.0 && self.weights[j] > 2.0 { &mut yes } else if self.weights[i] > 2.0 { &mut no } else { continue };
                set[0] += 1.0; set[1] += l; set[2] += l * l;
            }
        }
        let moments = |s: [f64; 3]| { let m = s[1] / s[0].max(1.0); (m, (s[2] / s[0].max(1.0) - m * m).max(0.01)) };
        let ((m1, v1), (m0, v0)) = (moments(yes), moments(no));
        let v = 0.5 * (v1 + v0);
        let slope = ((m1 - m0) / v).min(0.0);
        let pair_cap = knob("PAIRCAP", 4.0);
        let pair = |s: usize| pair_scale * (slope * (f64::from(likeness[s]) - 0.5 * (m1 + m0))).clamp(-pair_cap, pair_cap);
        let tight = knob("TIGHT", 0.04);
        let jump = libm::log(knob("JUMP", 0.03));
        let duration = |a: usize, b: usize| {
            let r = libm::log(b as f64 / a as f64).abs();
            (2.0 - r / tight).max(jump)
        };
        let break_cost = knob("BREAK", 12.0);
        // Prefix best by candidate.
        let mut prefix: Vec<(f64, u32)> = vec![(0.0, NONE); n + 1];
        let mut until = 0; // prefix index with offset <= o_i - least
        let mut entry = vec![(0.0, NONE); n];
        let mut last: Vec<u32> = Vec::with_capacity(total);
        for j in 0..n {
            while until < j && offset(until) + self.least <= offset(j) { until += 1; }
            // candidates 0..until have ended
            let before = prefix[until];
            entry[j] = if before.0 - break_cost > 0.0 { (before.0 - break_cost, before.1) } else { (0.0, NONE) };
            let mut best = prefix[j];
            for s in first[j]..first[j + 1] {
                let i = pred_from[j] + s - first[j];
                let gap = offset(j) - offset(i);
                let mut value = self.weights[i] + entry[i].0;
                let mut from = NONE;
                for t in first[i]..first[i + 1] {
                    let h = pred_from[i] + t - first[i];
                    let v = score[t] + duration(offset(i) - offset(h), gap);
                    if v > value { value = v; from = t as u32; }
                }
                score[s] = value + pair(s) + self.weights[j];
                back[s] = from;
                if score[s] > best.0 { best = (score[s], s as u32); }
                last.push(j as u32);
            }
            prefix[j + 1] = best;
        }
        // Trace back.
        let mut nodes = Vec::new();
        let mut state = prefix[n].1;
        while state != NONE {
            let s = state as usize;
            let j = last[s] as usize;
            let i = pred_from[j] + s - first[j];
            nodes.push(j);
            if back[s] == NONE {
                nodes.push(i);
                state = entry[i].1;
            } else {
                state = back[s];
            }
        }
        nodes.reverse();
        Chain { nodes, score: prefix[n].0, pairing: Some([slope, m1, m0]) }
    }
}
