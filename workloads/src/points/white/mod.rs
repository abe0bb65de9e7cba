//! White noise of any density: uniform samples of the region below the density, projected (thesis, Paper VI,
//! section 5, "Adaptive Sampling", Fig. 12).
//!
//! The region is bounded by columns over cells, each as high as the density's bound there. A candidate is a
//! uniform point of the columns, and is accepted if it is below the density. The columns correspond to the
//! rasterized primitives of the figure, and the test to its pixel shader.

mod density;

pub use density::{Density, ImageDensity, ImageError, Named};

use rayon::prelude::*;

use super::random::Stream;

/// Random numbers of the candidates.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Numbers {
    /// Independent numbers.
    #[default]
    Independent,
    /// Low discrepancy: a Kronecker sequence with the generalized golden ratio (Roberts 2018), shifted by the
    /// seed. Points then follow the density *too well* for white noise.
    LowDiscrepancy,
}

/// Points, and the number of candidates.
#[derive(Clone, Debug, PartialEq)]
pub struct White<const D: usize> {
    /// Points of the unit cube.
    pub points: Vec<[f64; D]>,
    /// Candidates tested.
    pub candidates: u64,
}

/// Parameters of white noise.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WhiteSpec {
    /// Number of points.
    pub count: usize,
    /// Seed of the points.
    pub seed: u64,
    /// Columns along an axis, 1 to 4096, at most 2^24 in all; 1 is plain rejection.
    pub across: u32,
    /// Random numbers of the candidates.
    pub numbers: Numbers,
}

/// A good number of columns along an axis.
pub fn columns_for(dimensions: usize) -> u32 {
    [1024, 256, 32, 12][dimensions.clamp(1, 4) - 1]
}

/// Reason why points cannot be made.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum WhiteError {
    /// The density is zero everywhere, or not finite.
    #[error(
        "the density is zero or not a finite number everywhere that was looked at; there is nothing to sample"
    )]
    Nothing,
    /// Too many columns.
    #[error("{0} columns along an axis: they have to be 1 to 4096, and all together at most 16777216")]
    Columns(u32),
}

/// Candidates per parallel task.
const CHUNK: u64 = 1 << 14;
/// Most candidates per point.
const MAX_CANDIDATES_PER_POINT: u64 = 1 << 20;

/// Independent points that follow a density. The result does not depend on the number of threads.
///
/// # Errors
/// [`WhiteError`].
pub fn white_noise<const D: usize>(
    density: &dyn Density<D>,
    spec: &WhiteSpec,
) -> Result<White<D>, WhiteError> {
    let columns = Columns::new(density, spec.across)?;
    let sequence = Sequence::new(spec, D + 2);
    let (mut points, mut candidates) = (Vec::with_capacity(spec.count), 0);
    while points.len() < spec.count {
        if candidates > MAX_CANDIDATES_PER_POINT * spec.count as u64 {
            return Err(WhiteError::Nothing);
        }
        let chunks = rayon::current_num_threads() as u64;
        let firsts: Vec<u64> = (0..chunks).map(|chunk| candidates + chunk * CHUNK).collect();
        let test = |&first: &u64| {
            let kept = (first..first + CHUNK).filter_map(|n| Some((n, columns.candidate(&sequence, n)?)));
            kept.collect::<Vec<_>>()
        };
        let found: Vec<Vec<_>> = firsts.par_iter().map(test).collect();
        candidates += chunks * CHUNK;
        let missing = spec.count - points.len();
        let taken: Vec<_> = found.into_iter().flatten().take(missing).collect();
        points.extend(taken.iter().map(|(_, point)| *point));
        if let Some((last, _)) = taken.last().filter(|_| points.len() == spec.count) {
            candidates = last + 1;
        }
    }
    Ok(White { points, candidates })
}

/// Upper bounds of a density over equal cells.
struct Columns<'a, const D: usize> {
    density: &'a dyn Density<D>,
    across: u64,
    /// Height of each column.
    heights: Vec<f64>,
    /// Cumulative heights.
    sums: Vec<f64>,
}

impl<'a, const D: usize> Columns<'a, D> {
    fn new(density: &'a dyn Density<D>, across: u32) -> Result<Self, WhiteError> {
        let wide = u64::from(across);
        let count = wide.checked_pow(D as u32).filter(|&count| (1..=1 << 24).contains(&count));
        let count = count.filter(|_| across <= 4096).ok_or(WhiteError::Columns(across))?;
        let side = 1.0 / f64::from(across);
        let height = |number: u64| {
            let low: [f64; D] = low(number, wide);
            density.upper_bound(&low, &low.map(|low| low + side))
        };
        let heights: Vec<f64> = (0..count).into_par_iter().map(height).collect();
        let mut sum = 0.0;
        let sums: Vec<f64> = heights.iter().map(|height| (sum += height, sum).1).collect();
        let usable = sum > 0.0 && sum.is_finite() && heights.iter().all(|height| *height >= 0.0);
        if usable { Ok(Self { density, across: wide, heights, sums }) } else { Err(WhiteError::Nothing) }
    }

    /// Candidate `number`, if it is below the density.
    fn candidate(&self, sequence: &Sequence, number: u64) -> Option<[f64; D]> {
        let whole = self.sums[self.sums.len() - 1];
        let chosen = sequence.unit(number, 0) * whole;
        let column = self.sums.partition_point(|sum| *sum <= chosen).min(self.sums.len() - 1);
        let low: [f64; D] = low(column as u64, self.across);
        let side = 1.0 / self.across as f64;
        let point =
            std::array::from_fn(|k| (low[k] + side * sequence.unit(number, k + 1)).min(1.0 - f64::EPSILON));
        (sequence.unit(number, D + 1) * self.heights[column] < self.density.at(&point)).then_some(point)
    }
}

/// Low corner of a cell.
fn low<const D: usize>(number: u64, across: u64) -> [f64; D] {
    std::array::from_fn(|k| (number / across.pow(k as u32) % across) as f64 / across as f64)
}

/// Random numbers of the candidates.
struct Sequence {
    stream: Stream,
    numbers: Numbers,
    dimensions: usize,
    /// Steps of the Kronecker sequence, by dimension.
    steps: Vec<f64>,
}

impl Sequence {
    fn new(spec: &WhiteSpec, dimensions: usize) -> Self {
        // The positive root of x^(d+1) = x + 1 by fixed-point iteration.
        let root = (0..64).fold(1.5_f64, |x, _| libm::pow(1.0 + x, 1.0 / (dimensions as f64 + 1.0)));
        let steps = (1..=dimensions).map(|k| libm::pow(root, -(k as f64))).collect();
        Self { stream: Stream::new(spec.seed, 0x3A17), numbers: spec.numbers, dimensions, steps }
    }

    fn unit(&self, number: u64, dimension: usize) -> f64 {
        match self.numbers {
            Numbers::Independent => self.stream.unit(number * self.dimensions as u64 + dimension as u64),
            Numbers::LowDiscrepancy => {
                (self.stream.unit(dimension as u64) + (number + 1) as f64 * self.steps[dimension]).fract()
            }
        }
    }
}

/// Number of points in each of `across^D` equal cells, the first axis fastest.
pub fn counts<const D: usize>(points: &[[f64; D]], across: u64) -> Vec<u64> {
    let mut counts = vec![0; across.pow(D as u32) as usize];
    for point in points {
        let cell = |k: usize| ((point[k] * across as f64) as u64).min(across - 1);
        counts[(0..D).rev().fold(0, |number, k| number * across + cell(k)) as usize] += 1;
    }
    counts
}

/// Integral of a density over each of `across^D` equal cells, by the midpoints of `fine^D` parts of each.
pub fn shares<const D: usize>(density: &dyn Density<D>, across: u64, fine: u64) -> Vec<f64> {
    let part = |cell: u64, number: u64| {
        let (cell, within): ([f64; D], [f64; D]) = (low(cell, across), low(number, fine));
        let middle = 0.5 / fine as f64;
        let at: [f64; D] = std::array::from_fn(|k| cell[k] + (within[k] + middle) / across as f64);
        density.at(&at)
    };
    let share = |cell: u64| (0..fine.pow(D as u32)).map(|number| part(cell, number)).sum();
    (0..across.pow(D as u32)).into_par_iter().map(share).collect()
}

#[cfg(test)]
mod tests;
