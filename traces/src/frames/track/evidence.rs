//! How much more likely a candidate is a start than not: two normal populations.

use super::Candidate;

pub(super) const FEATURES: usize = 2;
/// No single candidate says more than this, in nats.
const CAP: f64 = 10.0;

#[derive(Clone, Debug)]
pub(super) struct Evidence {
    direction: [f64; FEATURES],
    middle: f64,
}

impl Evidence {
    pub fn learn(candidates: &[Candidate], chosen: &[bool]) -> Self {
        let class = |want: bool| -> Vec<[f64; FEATURES]> { candidates.iter().zip(chosen).filter(|(_, c)| **c == want).map(|(c, _)| c.features).collect() };
        let (yes, no) = (class(true), class(false));
        let (m1, m0) = (mean(&yes), mean(&no));
        let mut s = [[0.0; 2]; 2];
        let mut count = 0.0;
        for (set, m) in [(&yes, m1), (&no, m0)] {
            // Each class counts alike.
            let w = 1.0 / set.len().max(1) as f64;
            for f in set {
                let d = [f[0] - m[0], f[1] - m[1]];
                for i in 0..2 { for j in 0..2 { s[i][j] += w * d[i] * d[j]; } }
            }
            count += if set.is_empty() { 0.0 } else { 1.0 };
        }
        for row in &mut s { for v in row { *v /= f64::max(count, 1.0); } }
        for i in 0..2 { s[i][i] += 0.01; }
        let det = s[0][0] * s[1][1] - s[0][1] * s[1][0];
        let d = [m1[0] - m0[0], m1[1] - m0[1]];
        let mut direction = [(s[1][1] * d[0] - s[0][1] * d[1]) / det, (s[0][0] * d[1] - s[1][0] * d[0]) / det];
        // Nearer is never less likely.
        if direction[0] > 0.0 || direction[1] > 0.0 {
            let single = [d[0] / s[0][0], d[1] / s[1][1]];
            let i = usize::from(d[1] * single[1] > d[0] * single[0]);
            direction = [0.0; 2];
            direction[i] = single[i].min(0.0);
        }
        let middle = (0..2).map(|i| direction[i] * 0.5 * (m1[i] + m0[i])).sum();
        Self { direction, middle }
    }

    pub fn weights(&self, candidates: &[Candidate], marks: &[usize]) -> Vec<f64> {
        candidates.iter().map(|c| {
            if marks.contains(&c.offset) { return 1e3; }
            let value: f64 = self.direction.iter().zip(&c.features).map(|(a, b)| a * b).sum::<f64>() - self.middle;
            value.clamp(-CAP, CAP)
        }).collect()
    }
}

fn mean(set: &[[f64; FEATURES]]) -> [f64; FEATURES] {
    let mut m = [0.0; FEATURES];
    for f in set { for i in 0..FEATURES { m[i] += f[i] / set.len() as f64; } }
    m
}
