//! White noise of any density: uniform samples of the region below the density, projected (thesis, Paper VI,
//! section 5, "Adaptive Sampling", Fig. 12).
//!
//! The region is bounded by columns over cells, each as high as the density's bound there. A candidate is a
//! uniform point of the columns, and is accepted if it is below the density. The columns correspond to the
//! rasterized primitives of the figure, and the test to its pixel shader.

use std::f64::consts::TAU;
use std::path::Path;

use glam::Vec3;
use pipeline::Lane;
use pipeline::texture::{LUMINANCE, srgb8_to_linear};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::Stream;

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
    /// The GPU refuses the pass.
    #[error(transparent)]
    Pass(#[from] pipeline::PassError),
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
pub(super) struct Columns<'a, const D: usize> {
    density: &'a dyn Density<D>,
    across: u64,
    /// Height of each column.
    pub(super) heights: Vec<f64>,
    /// Cumulative heights.
    sums: Vec<f64>,
}

impl<'a, const D: usize> Columns<'a, D> {
    pub(super) fn new(density: &'a dyn Density<D>, across: u32) -> Result<Self, WhiteError> {
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
pub(super) fn low<const D: usize>(number: u64, across: u64) -> [f64; D] {
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

/// A density, up to a factor.
pub trait Density<const D: usize>: Sync {
    /// Density at a point of the unit cube, at least zero.
    fn at(&self, point: &[f64; D]) -> f64;

    /// Upper bound of the density in a box.
    fn upper_bound(&self, low: &[f64; D], high: &[f64; D]) -> f64;
}

/// A density that a shader can compute.
pub trait Shaded<const D: usize>: Density<D> {
    /// The density at a point, with operations that the lane counts.
    fn on(&self, lane: &Lane, point: &[f64; D]) -> f64;
}

/// Named densities of any dimension.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum NamedDensity {
    /// Constant.
    Constant,
    /// Mean of the coordinates.
    Ramp,
    /// Gaussian about the middle, with a standard deviation of 0.15.
    #[default]
    Gauss,
    /// Three periods along each axis: the product of `(1 + cos(6 pi x)) / 2`.
    Waves,
}

/// Twice the variance of the Gaussian.
const SPREAD: f64 = 2.0 * 0.15 * 0.15;
/// Periods per unit of length.
const WAVES: f64 = 3.0;
/// Allowance for rounding, as a factor.
const ROUNDING: f64 = 1.0 + 1e-12;

fn wave(lane: &Lane, x: f64) -> f64 {
    lane.madd(0.5, lane.cos(lane.mul(TAU * WAVES, x)), 0.5)
}

impl NamedDensity {
    /// All densities with their names.
    pub const ALL: [(&'static str, Self); 4] =
        [("constant", Self::Constant), ("ramp", Self::Ramp), ("gauss", Self::Gauss), ("waves", Self::Waves)];

    /// The density with a name.
    pub fn by_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|(known, _)| *known == name).map(|(_, density)| density)
    }
}

impl<const D: usize> Density<D> for NamedDensity {
    fn at(&self, point: &[f64; D]) -> f64 {
        self.on(&Lane::default(), point)
    }

    fn upper_bound(&self, low: &[f64; D], high: &[f64; D]) -> f64 {
        let near = |k: usize| match self {
            Self::Constant | Self::Ramp => high[k],
            Self::Gauss => 0.5_f64.clamp(low[k], high[k]),
            // The maximum of the wave if it is in the interval, otherwise an end.
            Self::Waves => {
                let crest = (low[k] * WAVES).ceil() / WAVES;
                let wave = |x: f64| wave(&Lane::default(), x);
                let ends = if wave(low[k]) > wave(high[k]) { low[k] } else { high[k] };
                if crest <= high[k] { crest } else { ends }
            }
        };
        let highest: [f64; D] = std::array::from_fn(near);
        ROUNDING * self.at(&highest)
    }
}

impl<const D: usize> Shaded<D> for NamedDensity {
    fn on(&self, lane: &Lane, point: &[f64; D]) -> f64 {
        match self {
            Self::Constant => 1.0,
            Self::Ramp => lane.div(point.iter().fold(0.0, |sum, x| lane.add(sum, *x)), D as f64),
            Self::Gauss => {
                let square = point.iter().fold(0.0, |sum, x| {
                    let away = lane.sub(*x, 0.5);
                    lane.madd(away, away, sum)
                });
                lane.exp(lane.div(-square, SPREAD))
            }
            Self::Waves => point.iter().fold(1.0, |product, &x| lane.mul(product, wave(lane, x))),
        }
    }
}

/// Luminance of an image in linear light, constant over each pixel; the top row is at y = 1.
#[derive(Clone, Debug, PartialEq)]
pub struct ImageDensity {
    width: usize,
    height: usize,
    /// Row by row from the top left.
    luminance: Vec<f64>,
}

/// Reason why an image cannot be a density.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{file}: {message}")]
pub struct DensityError {
    file: String,
    message: String,
}

impl ImageDensity {
    /// Loads a PNG or JPEG file.
    ///
    /// # Errors
    /// [`DensityError`] if it cannot be read or decoded.
    pub fn load(path: &Path) -> Result<Self, DensityError> {
        let refused = |message: String| DensityError { file: path.display().to_string(), message };
        let unread = |error: std::io::Error| refused(format!("cannot read it: {error}; check the path"));
        let unknown = |error| refused(format!("unrecognized image format ({error}); give a PNG or JPEG"));
        let picture =
            image::ImageReader::open(path).map_err(unread)?.with_guessed_format().map_err(unread)?;
        let picture = picture.decode().map_err(unknown)?.into_rgb8();
        let (width, height) = (picture.width() as usize, picture.height() as usize);
        let luminance = |rgb: [u8; 3]| f64::from(Vec3::from(rgb.map(srgb8_to_linear)).dot(LUMINANCE));
        Self::new(width, height, picture.pixels().map(|pixel| luminance(pixel.0)).collect()).ok_or_else(
            || {
                refused(
                    "the image is black throughout, so the density is zero; give an image with bright parts"
                        .to_owned(),
                )
            },
        )
    }

    /// An image of `width` by `height` values, row by row from the top left; `None` unless all are finite and
    /// at least zero, and some are positive.
    pub fn new(width: usize, height: usize, luminance: Vec<f64>) -> Option<Self> {
        let fits = width * height == luminance.len() && luminance.iter().all(|l| *l >= 0.0 && l.is_finite());
        (fits && luminance.iter().any(|l| *l > 0.0)).then_some(Self { width, height, luminance })
    }

    fn pixel(&self, [x, y]: [f64; 2]) -> [usize; 2] {
        let along = |at: f64, count: usize| ((at * count as f64) as usize).min(count - 1);
        [along(x, self.width), along(1.0 - y, self.height)]
    }
}

impl Density<2> for ImageDensity {
    fn at(&self, point: &[f64; 2]) -> f64 {
        let [column, row] = self.pixel(*point);
        self.luminance[row * self.width + column]
    }

    fn upper_bound(&self, low: &[f64; 2], high: &[f64; 2]) -> f64 {
        let ([left, bottom], [right, top]) = (self.pixel(*low), self.pixel(*high));
        let row = |row: usize| &self.luminance[row * self.width..][left..=right];
        // Rounding may move a point across a pixel border at the edge of the box.
        let top = top.saturating_sub(1);
        (top..=bottom).flat_map(row).fold(0.0, |upper_bound, &l| f64::max(upper_bound, l))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::points::quality::{ChiSquare, chi_square};

    fn spec(count: usize, seed: u64) -> WhiteSpec {
        WhiteSpec { count, seed, across: 16, numbers: Numbers::Independent }
    }

    fn fit<const D: usize>(density: &dyn Density<D>, spec: &WhiteSpec, cells: u64) -> ChiSquare {
        let points = white_noise(density, spec).unwrap().points;
        chi_square(&counts(&points, cells), &shares(density, cells, 8))
    }

    #[test]
    fn bounds_are_conservative_in_every_dimension() {
        fn holds<const D: usize>() {
            let stream = Stream::new(1, D as u64);
            for (name, density) in NamedDensity::ALL {
                for number in 0..2000 {
                    let at = |k: usize| stream.unit(number * 12 + k as u64);
                    let low: [f64; D] = std::array::from_fn(|k| 0.9 * at(k));
                    let side = 0.4 * at(4);
                    let high = low.map(|low| (low + side).min(1.0));
                    let point = std::array::from_fn(|k| low[k] + (high[k] - low[k]) * at(5 + k));
                    assert!(
                        Density::<D>::at(&density, &point) <= density.upper_bound(&low, &high),
                        "{name} {point:?}"
                    );
                }
            }
        }
        holds::<1>();
        holds::<2>();
        holds::<3>();
        holds::<4>();
    }

    #[test]
    fn points_follow_every_density_in_one_to_four_dimensions() {
        for (name, density) in NamedDensity::ALL {
            let fits = [
                fit::<1>(&density, &spec(20_000, 1), 50),
                fit::<2>(&density, &spec(20_000, 1), 20),
                fit::<3>(&density, &spec(20_000, 1), 8),
                fit::<4>(&density, &WhiteSpec { across: 6, ..spec(20_000, 1) }, 4),
            ];
            for (dimensions, fit) in (1..).zip(fits) {
                assert!(fit.p > 0.001 && fit.p < 0.999, "{name} {dimensions}D: {fit:?}");
            }
        }
    }

    #[test]
    fn another_density_is_rejected() {
        let points = white_noise::<2>(&NamedDensity::Ramp, &spec(20_000, 1)).unwrap().points;
        let wrong = chi_square(&counts(&points, 20), &shares::<2>(&NamedDensity::Constant, 20, 4));
        assert!(wrong.p < 1e-9, "{wrong:?}");
    }

    #[test]
    fn low_discrepancy_fits_too_well() {
        let even = WhiteSpec { numbers: Numbers::LowDiscrepancy, across: 1, ..spec(20_000, 1) };
        assert!(fit::<1>(&NamedDensity::Constant, &even, 50).p > 0.999);
        assert!(fit::<2>(&NamedDensity::Constant, &even, 20).p > 0.999);
    }

    #[test]
    fn columns_save_candidates() {
        let plain =
            white_noise::<2>(&NamedDensity::Gauss, &WhiteSpec { across: 1, ..spec(5000, 1) }).unwrap();
        let bounded =
            white_noise::<2>(&NamedDensity::Gauss, &WhiteSpec { across: 64, ..spec(5000, 1) }).unwrap();
        // Without columns the share of accepted candidates is 2 pi 0.15^2; with them nearly all are accepted.
        let share = 5000.0 / plain.candidates as f64;
        assert!((share - 0.1413).abs() < 0.01, "{share}");
        assert!(bounded.candidates < 6000, "{}", bounded.candidates);
    }

    #[test]
    fn the_result_does_not_depend_on_threads() {
        let with = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| white_noise::<3>(&NamedDensity::Waves, &spec(30_000, 5)).unwrap())
        };
        assert_eq!(with(1), with(3));
    }

    #[test]
    fn invalid_densities_are_refused() {
        assert_eq!(ImageDensity::new(2, 1, vec![0.0, 0.0]), None);
        assert_eq!(ImageDensity::new(2, 2, vec![1.0]), None);
        let half = ImageDensity::new(2, 1, vec![0.0, 1.0]).unwrap();
        let points = white_noise::<2>(&half, &spec(1000, 1)).unwrap().points;
        assert!(points.iter().all(|[x, _]| *x >= 0.5));
        let wide = WhiteSpec { across: 4097, ..spec(1, 1) };
        assert_eq!(white_noise::<2>(&NamedDensity::Ramp, &wide), Err(WhiteError::Columns(4097)));
    }
}
