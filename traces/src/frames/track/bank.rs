//! Templates and the nearest of them at every offset.

use super::chain::Chain;
use super::Candidate;
use super::evidence::FEATURES;
use crate::frames::correlate::Correlator;

pub(in crate::frames) struct Bank {
    width: usize,
    signal: Vec<f64>,
    mean: Vec<f64>,
    norm: Vec<f64>,
    /// 1 - correlation coefficient, least over the templates.
    pub shape: Vec<f64>,
    /// Summed squared difference, least over the templates.
    pub squares: Vec<f64>,
    centre: f64,
    floor: f64,
    templates: usize,
}

impl Bank {
    pub fn new(power: &[f64], width: usize) -> Self {
        let centre = power.iter().sum::<f64>() / power.len() as f64;
        let signal: Vec<f64> = power.iter().map(|p| p - centre).collect();
        let count = power.len() - width + 1;
        let (mut mean, mut norm) = (Vec::with_capacity(count), Vec::with_capacity(count));
        let (mut s1, mut s2) = (signal[..width].iter().sum::<f64>(), signal[..width].iter().map(|x| x * x).sum::<f64>());
        for k in 0..count {
            mean.push(s1 / width as f64);
            norm.push((s2 - s1 * s1 / width as f64).max(0.0).sqrt());
            if k + width < signal.len() {
                s1 += signal[k + width] - signal[k];
                s2 += signal[k + width] * signal[k + width] - signal[k] * signal[k];
            }
        }
        let total = signal.iter().map(|x| x * x).sum::<f64>() / signal.len() as f64;
        Self { width, shape: vec![2.0; count], squares: vec![f64::INFINITY; count], signal, mean, norm, centre, floor: 1e-3 * total.sqrt() * (width as f64).sqrt(), templates: 0 }
    }

    pub fn add(&mut self, template: &[f64]) {
        let width = self.width as f64;
        let template: Vec<f64> = template.iter().map(|p| p - self.centre).collect();
        let mean = template.iter().sum::<f64>() / width;
        let unit: Vec<f64> = template.iter().map(|p| p - mean).collect();
        let norm = unit.iter().map(|x| x * x).sum::<f64>().sqrt().max(1e-300);
        let unit: Vec<f64> = unit.iter().map(|x| x / norm).collect();
        let correlation = Correlator::new(&unit).correlate(&self.signal);
        for (k, c) in correlation.into_iter().enumerate() {
            let shape = 1.0 - c / (self.norm[k] + self.floor);
            let squares = self.norm[k] * self.norm[k] + norm * norm - 2.0 * c * norm + width * (self.mean[k] - mean) * (self.mean[k] - mean);
            self.shape[k] = self.shape[k].min(shape);
            self.squares[k] = self.squares[k].min(squares.max(0.0));
        }
        self.templates += 1;
    }

    pub fn features(&self, offset: usize) -> [f64; FEATURES] {
        [libm::log(self.shape[offset].max(1e-4)), libm::log(self.squares[offset].max(1e-3 * self.floor * self.floor * 1e6))]
    }

    /// Correlation coefficient of two windows of the trace.
    pub fn alike(&self, a: usize, b: usize) -> f64 {
        let (x, y) = (&self.signal[a..a + self.width], &self.signal[b..b + self.width]);
        let mut lanes = [0.0; 8];
        for (p, q) in x.chunks_exact(8).zip(y.chunks_exact(8)) {
            for i in 0..8 { lanes[i] += p[i] * q[i]; }
        }
        let rest = self.width / 8 * 8;
        let dot = lanes.iter().sum::<f64>() + x[rest..].iter().zip(&y[rest..]).map(|(p, q)| p * q).sum::<f64>();
        (dot - self.width as f64 * self.mean[a] * self.mean[b]) / ((self.norm[a] + self.floor) * (self.norm[b] + self.floor))
    }

    pub fn learn(&mut self, power: &[f64], candidates: &[Candidate], chain: &Chain, many: usize) -> Vec<usize> {
        let knob = |name: &str, default: f64| std::env::var(name).ok().and_then(|v| v.parse().ok()).unwrap_or(default);
        let mut added = Vec::new();
        for _ in 0..many {
            let nodes = &chain.nodes;
            let offset = |n: usize| candidates[nodes[n]].offset;
            // The surest in time but least like the templates.
            let mut best: (f64, usize) = (knob("NEW", 0.08), usize::MAX);
            for n in 1..nodes.len().saturating_sub(1) {
                let (before, after) = ((offset(n) - offset(n - 1)) as f64, (offset(n + 1) - offset(n)) as f64);
                if libm::log(after / before).abs() > 0.1 { continue; }
                let (a, b) = (self.alike(offset(n - 1), offset(n)), self.alike(offset(n), offset(n + 1)));
                let own = 1.0 - self.shape[offset(n)];
                // neighbours resemble it more than any template does
                let gain = a.min(b) - own;
                if gain > best.0 { best = (gain, n); }
            }
            if best.1 == usize::MAX { break; }
            let n = best.1;
            let mean: Vec<f64> = (0..self.width).map(|j| {
                (power[offset(n) + j] + power[offset(n - 1) + j] + power[offset(n + 1) + j]) / 3.0
            }).collect();
            self.add(&mean);
            added.push(offset(n));
        }
        added
    }
}
