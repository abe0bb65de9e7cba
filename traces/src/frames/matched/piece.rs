//! A segment of samples, with running sums.

use crate::stats::PairSum;
use core::ops::Range;
use multiversion::multiversion;

/// Samples per stored sum.
pub(super) const BLOCK: usize = 256;

/// A segment of samples with running sums of power, for energies to any place in it.
#[derive(Default)]
pub(super) struct Piece {
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
pub(super) fn powers(voltage_v: &[f32], current_a: &[f32], into: &mut Vec<f64>) {
    into.clear();
    into.extend(voltage_v.iter().zip(current_a).map(|(&v, &i)| f64::from(v) * f64::from(i)));
}
