//! The templates, and the distance to the nearest of them at every offset.

use super::FEATURES;
use crate::frames::profile::Correlator;
use core::ops::Range;

/// Most templates added in one round.
const MAX_NEW_PER_ROUND: usize = 6;
/// Neighbours of a new template must resemble it by this much more (in correlation) than any template does.
const MIN_SIMILARITY_GAIN: f64 = 0.08;
/// Largest deviation between the gaps before and after a new template, as a share.
const MAX_GAP_DEVIATION: f64 = 0.1;
/// Added to the norm of every window, as a share of the deviation of the whole trace: steady windows then
/// resemble nothing.
const NORM_FLOOR: f64 = 1e-3;

/// Core of a window: this share of its length after the start and a quarter of that before it, where the
/// first frame after a pause differs from all others. Farther away, changes of content or clock move more.
const CORE_SHARE: f64 = 0.1;
/// Weight of a sample of the core beyond the 1 of every sample: with the core an eighth of the window, two
/// fifths of all weight.
const CORE_WEIGHT: f64 = 5.0;

/// The templates' distances to the trace.
pub(super) struct Templates {
    width: usize,
    /// The part of the window about the start, which counts more.
    core: Range<usize>,
    /// Power less its mean over the trace, W.
    signal: Vec<f64>,
    /// Mean of each window.
    mean: Vec<f64>,
    /// Norm of each window about its mean.
    norm: Vec<f64>,
    floor: f64,
    /// One less the weighted correlation coefficient with the nearest template, at every offset.
    pub shape: Vec<f64>,
    /// Weighted summed squared difference to the nearest template, W^2, at every offset.
    pub squares_w2: Vec<f64>,
    /// Starts that templates were made of.
    pub own: Vec<usize>,
}

impl Templates {
    /// The windows at `marks` are the first templates.
    pub fn new(power: &[f64], width: usize, anchor: usize, marks: &[usize]) -> Self {
        let centre = power.iter().sum::<f64>() / power.len() as f64;
        let signal: Vec<f64> = power.iter().map(|watts| watts - centre).collect();
        let half = ((CORE_SHARE * width as f64) as usize).max(1);
        let core = anchor.saturating_sub(half / 4)..(anchor + half).min(width);
        let (mean, norm) = windows(&signal, width, &core);
        let total: f64 = signal.iter().map(|x| x * x).sum();
        let floor = NORM_FLOOR * libm::sqrt(total / signal.len() as f64 * width as f64) + f64::MIN_POSITIVE;
        let (shape, squares_w2) = (vec![2.0; mean.len()], vec![f64::INFINITY; mean.len()]);
        let mut templates =
            Self { width, core, signal, mean, norm, floor, shape, squares_w2, own: Vec::new() };
        for &mark in marks {
            templates.add(&[mark]);
        }
        templates
    }

    /// Adds the mean of the windows at `starts` as a template.
    fn add(&mut self, starts: &[usize]) {
        let width = weight(self.width, &self.core);
        let mut template = vec![0.0; self.width];
        for &start in starts {
            for (sum, value) in template.iter_mut().zip(&self.signal[start..]) {
                *sum += value / starts.len() as f64;
            }
        }
        let weighted =
            |of: &[f64]| of.iter().sum::<f64>() + CORE_WEIGHT * of[self.core.clone()].iter().sum::<f64>();
        let mean = weighted(&template) / width;
        template.iter_mut().for_each(|x| *x -= mean);
        let squares: Vec<f64> = template.iter().map(|x| x * x).collect();
        let norm = libm::sqrt(weighted(&squares)) + f64::MIN_POSITIVE;
        template.iter_mut().for_each(|x| *x /= norm);
        template[self.core.clone()].iter_mut().for_each(|x| *x *= 1.0 + CORE_WEIGHT);
        for (k, c) in Correlator::new(&template).correlate(&self.signal).into_iter().enumerate() {
            let offset = self.mean[k] - mean;
            let squares =
                self.norm[k] * self.norm[k] + norm * norm - 2.0 * c * norm + width * offset * offset;
            self.shape[k] = self.shape[k].min(1.0 - c / (self.norm[k] + self.floor));
            self.squares_w2[k] = self.squares_w2[k].min(squares.max(0.0));
        }
        self.own.extend(starts);
    }

    /// The logarithms of the two distances.
    pub fn features(&self, offset: usize) -> [f64; FEATURES] {
        let least_w2 = 1e3 * self.floor * self.floor;
        [libm::log(self.shape[offset].max(1e-4)), libm::log(self.squares_w2[offset].max(least_w2))]
    }

    /// Weighted correlation coefficient of two windows of the trace.
    pub fn similarity(&self, a: usize, b: usize) -> f64 {
        let (x, y) = (&self.signal[a..a + self.width], &self.signal[b..b + self.width]);
        let inner = dot(x, y) + CORE_WEIGHT * dot(&x[self.core.clone()], &y[self.core.clone()]);
        let about = inner - weight(self.width, &self.core) * self.mean[a] * self.mean[b];
        about / ((self.norm[a] + self.floor) * (self.norm[b] + self.floor))
    }

    /// Adds templates: starts at an even period that their neighbours resemble more than any template does.
    pub fn learn(&mut self, starts: &[usize]) {
        for _ in 0..MAX_NEW_PER_ROUND {
            let novelty = |three: &[usize]| {
                let uneven = libm::log((three[2] - three[1]) as f64 / (three[1] - three[0]) as f64).abs()
                    > MAX_GAP_DEVIATION;
                let similarity =
                    f64::min(self.similarity(three[0], three[1]), self.similarity(three[1], three[2]));
                if uneven { f64::NEG_INFINITY } else { similarity - (1.0 - self.shape[three[1]]) }
            };
            let newest = starts.windows(3).map(|three| (novelty(three), three));
            match newest.max_by(|a, b| a.0.total_cmp(&b.0)) {
                Some((novelty, three)) if novelty > MIN_SIMILARITY_GAIN => self.add(three),
                _ => return,
            }
        }
    }
}

fn dot(x: &[f64], y: &[f64]) -> f64 {
    let mut lanes = [0.0; 8];
    let (x8, y8) = (x.chunks_exact(8), y.chunks_exact(8));
    let rest: f64 = x8.remainder().iter().zip(y8.remainder()).map(|(p, q)| p * q).sum();
    for (p, q) in x8.zip(y8) {
        for (lane, (p, q)) in lanes.iter_mut().zip(p.iter().zip(q)) {
            *lane += p * q;
        }
    }
    lanes.iter().sum::<f64>() + rest
}

/// The sum of all weights of a window.
fn weight(width: usize, core: &Range<usize>) -> f64 {
    width as f64 + CORE_WEIGHT * core.len() as f64
}

/// Weighted mean and norm about the mean of every window, by running sums.
fn windows(signal: &[f64], width: usize, core: &Range<usize>) -> (Vec<f64>, Vec<f64>) {
    let weight = weight(width, core);
    let squares: Vec<f64> = signal.iter().map(|x| x * x).collect();
    let (means, powers) = (boxes(signal, width, core), boxes(&squares, width, core));
    let norms =
        means.iter().zip(&powers).map(|(sum, squares)| libm::sqrt((squares - sum * sum / weight).max(0.0)));
    let norms = norms.collect();
    (means.into_iter().map(|sum| sum / weight).collect(), norms)
}

/// The weighted sum of every window.
fn boxes(of: &[f64], width: usize, core: &Range<usize>) -> Vec<f64> {
    let count = of.len() - width + 1;
    let mut sum = of[..width].iter().sum::<f64>() + CORE_WEIGHT * of[core.clone()].iter().sum::<f64>();
    let mut sums = Vec::with_capacity(count);
    for first in 0..count {
        sums.push(sum);
        if let Some(next) = of.get(first + width) {
            sum += next - of[first] + CORE_WEIGHT * (of[first + core.end] - of[first + core.start]);
        }
    }
    sums
}
