//! White noise of any density: the region below the density is sampled evenly and projected (thesis, Paper VI, section 5,
//! "Adaptive Sampling", Fig. 12).
//!
//! The region is bounded by columns over cells, each as high as the density may be there. A candidate is an even point of these
//! columns; it stays where it is below the density. The columns are the rasterized primitives of the figure, and the test is its pixel
//! shader.

mod density;
mod image;

pub use density::{Density, Named};
pub use image::{ImageDensity, ImageError};

use rayon::prelude::*;

use super::random::Stream;

/// Where candidates come from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Numbers {
    /// Independent of each other.
    #[default]
    Independent,
    /// Even by construction: a Kronecker sequence with the generalized golden ratio (Roberts 2018), moved by the seed. Points then
    /// follow the density *too well* for white noise.
    LowDiscrepancy,
}

/// Points, and what they cost.
#[derive(Clone, Debug, PartialEq)]
pub struct White<const D: usize> {
    /// Points of the unit cube.
    pub points: Vec<[f64; D]>,
    /// Candidates looked at.
    pub candidates: u64,
}

/// What is asked for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WhiteSpec {
    /// How many points.
    pub count: usize,
    /// Other points by another seed.
    pub seed: u64,
    /// Columns along an axis, 1 to 4096, together at most 2^24; 1 is plain rejection.
    pub across: u32,
    /// Where candidates come from.
    pub numbers: Numbers,
}

/// Columns along an axis that are a good choice.
pub fn columns_for(dimensions: usize) -> u32 {
    [1024, 256, 32, 12][dimensions.clamp(1, 4) - 1]
}

/// Why there are no points.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum WhiteError {
    /// The density is zero everywhere, or not a number.
    #[error(
        "the density is zero or not a finite number everywhere that was looked at; there is nothing to sample"
    )]
    Nothing,
    /// Too many columns.
    #[error("{0} columns along an axis: they have to be 1 to 4096, and all together at most 16777216")]
    Columns(u32),
}

/// So many candidates are looked at by one worker.
const CHUNK: u64 = 1 << 14;
/// Candidates for a point before it is given up.
const MOST_EACH: u64 = 1 << 20;

/// Points that follow a density. The same for any number of threads.
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
        if candidates > MOST_EACH * spec.count as u64 {
            return Err(WhiteError::Nothing);
        }
        let chunks = rayon::current_num_threads() as u64;
        let firsts: Vec<u64> = (0..chunks).map(|chunk| candidates + chunk * CHUNK).collect();
        let look = |&first: &u64| {
            let kept = (first..first + CHUNK).filter_map(|n| Some((n, columns.candidate(&sequence, n)?)));
            kept.collect::<Vec<_>>()
        };
        let found: Vec<Vec<_>> = firsts.par_iter().map(look).collect();
        candidates += chunks * CHUNK;
        let missing = spec.count - points.len();
        let some: Vec<_> = found.into_iter().flatten().take(missing).collect();
        points.extend(some.iter().map(|(_, point)| *point));
        if let Some((last, _)) = some.last().filter(|_| points.len() == spec.count) {
            candidates = last + 1;
        }
    }
    Ok(White { points, candidates })
}

/// Bounds of a density over equal cells.
struct Columns<'a, const D: usize> {
    density: &'a dyn Density<D>,
    across: u64,
    /// Height of each.
    heights: Vec<f64>,
    /// Sum of the heights up to each, itself included.
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
            density.most(&low, &low.map(|low| low + side))
        };
        let heights: Vec<f64> = (0..count).into_par_iter().map(height).collect();
        let mut sum = 0.0;
        let sums: Vec<f64> = heights.iter().map(|height| (sum += height, sum).1).collect();
        let usable = sum > 0.0 && sum.is_finite() && heights.iter().all(|height| *height >= 0.0);
        if usable { Ok(Self { density, across: wide, heights, sums }) } else { Err(WhiteError::Nothing) }
    }

    /// Candidate `number`, where it is below the density.
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

/// The low corner of a cell.
fn low<const D: usize>(number: u64, across: u64) -> [f64; D] {
    std::array::from_fn(|k| (number / across.pow(k as u32) % across) as f64 / across as f64)
}

/// The numbers of candidates.
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

/// How many points are in each of `across^D` equal cells, the first axis fastest.
pub fn counts<const D: usize>(points: &[[f64; D]], across: u64) -> Vec<u64> {
    let mut counts = vec![0; across.pow(D as u32) as usize];
    for point in points {
        let cell = |k: usize| ((point[k] * across as f64) as u64).min(across - 1);
        counts[(0..D).rev().fold(0, |number, k| number * across + cell(k)) as usize] += 1;
    }
    counts
}

/// The integral of a density over each of `across^D` equal cells, by the midpoints of `fine^D` parts of each.
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
