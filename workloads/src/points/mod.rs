//! Random points in squares, cubes, volumes and densities (thesis, Paper VI, section 5).
//!
//! - [`poisson`]: maximal Poisson disk points, by dart throwing over uncovered regions.
//! - [`volume`]: uniform points in volumes bounded by moving triangles, and in closed surfaces.
//! - [`white`]: independent points that follow a density, in one to four dimensions.
//! - [`draw_noise`]: the same, from columns that are drawn, one dimension higher.
//! - [`job`]: all three drawn on the modelled hardware, as a workload.
//! - [`quality`]: minimum distance, holes, spectra, chi-square; [`thin_regions_warning`]: when precision
//!   limits the result.
//!
//! Other methods of making points with a minimum distance, for comparison with [`poisson`]:
//!
//! - [`plain_darts`]: dart throwing until too many misses in a row (Cook 1986); not maximal, and slower and
//!   slower.
//! - [`bridson`]: candidates around existing points (Bridson 2007, "Fast Poisson Disk Sampling in Arbitrary
//!   Dimensions"; the method of scipy); fast, not maximal, and with another distribution than dart throwing.
//!
//! *White noise* of any density from drawn columns (thesis, Paper VI, section 5, "Adaptive White Noise", Fig.
//! 12): the density is lifted by a dimension: columns over equal cells bound the region below it. They are
//! tessellated into triangles (1D), prisms (2D), and simploids of four and five dimensions (3D, 4D), drawn in
//! conservative mode, and the shader keeps the random candidates below the density. Without their height they
//! are the points.
//!
//! | D | axes of the domain | height |
//! |---|---|---|
//! | 1 | x | y |
//! | 2 | x, y | t |
//! | 3 | x, y, u | t |
//! | 4 | x, y, u, v | t |

mod drawn;
pub mod job;
pub mod poisson;
pub mod quality;
mod rivals;
pub mod volume;
pub mod white;

use pipeline::random::{GOLDEN, mix, unit};
use pipeline::{Gpu, Lane};
use warnings::{Code, Warning};

use drawn::{AXES, Cell, Kept, Lattice, MAX_MEAN, Within, draw};
pub use rivals::{bridson, plain_darts};
use white::{Columns, Shaded, WhiteError, low, shares};

/// A sequence of random words with random access: SplitMix64 (Steele, Lea, Flood 2014) with its own start.
#[derive(Clone, Copy, Debug)]
struct Stream(u64);

impl Stream {
    /// Stream of a seed for one purpose.
    pub fn new(seed: u64, purpose: u64) -> Self {
        Self(mix(mix(seed.wrapping_add(GOLDEN)) ^ mix(GOLDEN.wrapping_mul(purpose.wrapping_add(2)))))
    }

    /// Sub-stream for one of many items.
    #[inline]
    pub fn of(self, number: u64) -> Self {
        Self(mix(self.0 ^ mix(number.wrapping_add(GOLDEN))))
    }

    /// Word at a position.
    #[inline]
    pub fn word(self, at: u64) -> u64 {
        mix(self.0.wrapping_add(GOLDEN.wrapping_mul(at.wrapping_add(1))))
    }

    /// Number in [0, 1), a multiple of 2^-53.
    #[inline]
    pub fn unit(self, at: u64) -> f64 {
        unit(self.word(at))
    }

    /// Integer below `count`.
    #[inline]
    pub fn below(self, at: u64, count: u64) -> u64 {
        ((u128::from(self.word(at)) * u128::from(count)) >> 64) as u64
    }
}

/// Thin uncovered regions per point above which a warning is given.
pub const MAX_THIN_PER_POINT: f64 = 0.01;

/// Warns if dart throwing left many uncovered regions without a representable point.
pub fn thin_regions_warning(points: usize, thin_regions: u64) -> Option<Warning> {
    let per_point = thin_regions as f64 / points.max(1) as f64;
    (per_point > MAX_THIN_PER_POINT).then(|| {
        Warning::new(
            Code::PointsThinRegions,
            format!(
                "{thin_regions} uncovered regions among {points} points contain no number of the coordinates' format (more than one per {:.0} \
                 points): no point can be written there, so places farther than r from all points remain; use double \
                 precision or a larger r",
                1.0 / MAX_THIN_PER_POINT
            ),
        )
    })
}

/// Parameters of drawn noise.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NoiseSpec {
    /// Points on average; their number is Poisson distributed.
    pub count: f64,
    /// Seed of the points.
    pub seed: u64,
    /// Columns along an axis, 1 to 4096, at most 2^20 in all.
    pub across: u32,
}

/// Points, and the work that made them.
#[derive(Clone, Debug, PartialEq)]
pub struct DrawnNoise<const D: usize> {
    /// Points of the unit cube, in random order.
    pub points: Vec<[f64; D]>,
    /// Candidates that were made.
    pub candidates: u64,
    /// Runs of the shader: pairs of a simploid and a tile that it may touch.
    pub fragments: u64,
    /// Columns that were drawn.
    pub columns: usize,
}

/// Candidates in a cell of the lattice on average, at most: half of what a cell can have.
const MEAN: f64 = 0.5 * MAX_MEAN;
/// Most columns that are drawn.
const MAX_COLUMNS: u64 = 1 << 20;
/// Parts of a column along an axis over which the density is integrated.
const FINE: u64 = 4;

/// Axis of each dimension of the domain, and that of the height.
fn axes(dimensions: usize) -> (&'static [usize], usize) {
    match dimensions {
        1 => (&[0], 1),
        2 => (&[0, 1], 2),
        3 => (&[0, 1, 3], 2),
        _ => (&[0, 1, 3, 4], 2),
    }
}

/// The lifted density: columns, the lattice of candidates, and the test.
struct Lifted<'a, const D: usize> {
    density: &'a dyn Shaded<D>,
    cells: Vec<Cell>,
    lattice: Lattice,
    /// Density at height 1.
    highest: f64,
}

impl<'a, const D: usize> Lifted<'a, D> {
    fn new(density: &'a dyn Shaded<D>, spec: &NoiseSpec) -> Result<Self, WhiteError> {
        let columns = u64::from(spec.across).checked_pow(D as u32);
        if columns.is_none_or(|columns| columns > MAX_COLUMNS) {
            return Err(WhiteError::Columns(spec.across));
        }
        let bounds = Columns::new(density, spec.across)?;
        let highest = bounds.heights.iter().copied().fold(0.0, f64::max);
        let (domain, up) = axes(D);
        let wide = u64::from(spec.across);
        let cell = |(number, height): (u64, &f64)| {
            let first: [f64; D] = low(number, wide);
            let last: [f64; D] = std::array::from_fn(|k| {
                ((number / wide.pow(k as u32) % wide) + 1) as f64 / f64::from(spec.across)
            });
            let mut cell = Cell::WHOLE;
            for (k, &axis) in domain.iter().enumerate() {
                (cell.low[axis], cell.high[axis]) = (first[k], last[k]);
            }
            cell.high[up] = height / highest;
            cell
        };
        let cells = (0..).zip(&bounds.heights).filter(|(_, height)| **height > 0.0).map(cell).collect();
        // Share of the lifted cube that is below the density.
        let parts = wide.min(MAX_INTEGRAL) * FINE;
        let integral = shares(density, wide.min(MAX_INTEGRAL), FINE).iter().sum::<f64>()
            / (parts as f64).powi(D as i32)
            / highest;
        let candidates = spec.count / integral;
        let slabs = (candidates / bounds.heights.len() as f64 / MEAN).ceil().max(1.0);
        let mut across = [1; AXES];
        domain.iter().for_each(|&axis| across[axis] = spec.across);
        across[up] = slabs as u32;
        let mean = candidates / bounds.heights.len() as f64 / slabs;
        let used = [domain, &[up]].concat();
        let lattice = Lattice::new(across, &used, mean, spec.seed).ok_or(WhiteError::Nothing)?;
        Ok(Self { density, cells, lattice, highest })
    }

    fn projected(points: &[[f64; AXES]]) -> Vec<[f64; D]> {
        let (domain, _) = axes(D);
        points.iter().map(|point| std::array::from_fn(|k| point[domain[k]])).collect()
    }
}

/// Most cells along an axis over which the density is integrated.
const MAX_INTEGRAL: u64 = 16;

impl<const D: usize> Within for Lifted<'_, D> {
    fn contains(&self, lane: &Lane, point: &[f64; AXES]) -> bool {
        let (domain, up) = axes(D);
        let at = std::array::from_fn(|k| point[domain[k]]);
        lane.branch(lane.mul(point[up], self.highest) < self.density.on(lane, &at))
    }
}

/// Draws the columns in a pass of `gpu` and returns the points below the density.
///
/// # Errors
/// [`WhiteError`].
pub fn draw_noise<const D: usize>(
    density: &dyn Shaded<D>,
    spec: &NoiseSpec,
    gpu: &mut Gpu<'_>,
) -> Result<DrawnNoise<D>, WhiteError> {
    let lifted = Lifted::new(density, spec)?;
    let Kept { points, candidates, fragments, .. } =
        draw(gpu, "columns", &lifted.cells, &lifted.lattice, &lifted)?;
    let columns = lifted.cells.len();
    Ok(DrawnNoise { points: Lifted::<D>::projected(&points), candidates, fragments, columns })
}

#[cfg(test)]
mod tests {
    use super::poisson::{Domain, PoissonSpec, Spacing, poisson_disk};
    use super::quality::chi_square;
    use super::white::{NamedDensity, counts};
    use super::*;
    use crate::job::testing::hardware;

    #[test]
    fn numbers_are_uniform_and_streams_independent() {
        let (one, other) = (Stream::new(1, 0), Stream::new(1, 1));
        let mean = (0..10_000).map(|at| one.unit(at)).sum::<f64>() / 1e4;
        assert!((mean - 0.5).abs() < 0.01, "{mean}");
        let both: f64 = (0..10_000).map(|at| (one.unit(at) - 0.5) * (other.unit(at) - 0.5)).sum();
        assert!(both.abs() / 1e4 < 0.005, "{both}");
        assert!((0..10_000).all(|at| one.below(at, 7) < 7));
    }

    #[test]
    fn coarse_coordinates_are_warned_about_and_fine_ones_are_not() {
        let warned = |bits| {
            let spec =
                PoissonSpec { radius: 0.03, domain: Domain::Torus, seed: 1, spacing: Spacing::Bits(bits) };
            let found = poisson_disk::<2>(&spec).unwrap();
            thin_regions_warning(found.points.len(), found.thin_regions).is_some()
        };
        assert!(warned(12) && !warned(24) && !warned(52));
        assert!(thin_regions_warning(0, 0).is_none());
    }

    fn drawn<const D: usize>(density: NamedDensity, spec: &NoiseSpec) -> DrawnNoise<D> {
        let hardware = hardware();
        draw_noise(&density, spec, &mut Gpu::without_packets(&hardware).unwrap()).unwrap()
    }

    fn on_host<const D: usize>(density: &NamedDensity, spec: &NoiseSpec) -> Vec<[f64; D]> {
        let lifted: Lifted<D> = Lifted::new(density, spec).unwrap();
        Lifted::<D>::projected(&drawn::on_host(&lifted.cells, &lifted.lattice, &lifted))
    }

    fn same<const D: usize>(across: u32, cells: u64) {
        for density in [NamedDensity::Constant, NamedDensity::Ramp, NamedDensity::Gauss, NamedDensity::Waves]
        {
            let spec = NoiseSpec { count: 3000.0, seed: 7, across };
            let found = drawn::<D>(density, &spec);
            assert_eq!(found.points, on_host::<D>(&density, &spec), "{D} {density:?}");
            // The number is Poisson distributed: five standard deviations.
            assert!(
                (found.points.len() as f64 - 3000.0).abs() < 280.0,
                "{D} {density:?} {}",
                found.points.len()
            );
            let fit = chi_square(&counts(&found.points, cells), &shares::<D>(&density, cells, 8));
            assert!(fit.p > 1e-4 && fit.p < 1.0 - 1e-4, "{D} {density:?} {fit:?}");
            assert!(found.fragments > 0 && found.candidates >= found.points.len() as u64);
        }
    }

    #[test]
    fn drawn_points_are_those_of_the_host_in_every_dimension() {
        same::<1>(37, 16);
        same::<2>(12, 5);
        same::<2>(64, 5);
        same::<3>(5, 3);
        same::<4>(3, 2);
    }

    #[test]
    fn seeds_differ_and_threads_do_not() {
        let spec = NoiseSpec { count: 500.0, seed: 1, across: 8 };
        let with = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| drawn::<2>(NamedDensity::Gauss, &spec))
        };
        assert_eq!(with(1), with(3));
        assert_ne!(with(1).points, drawn::<2>(NamedDensity::Gauss, &NoiseSpec { seed: 2, ..spec }).points);
    }

    /// Neighbouring seeds once had the same cells in another order.
    #[test]
    fn neighbouring_seeds_share_no_place_within_a_column() {
        let places = |seed| {
            let spec = NoiseSpec { count: 2000.0, seed, across: 16 };
            let within = |point: &[f64; 1]| ((point[0] * 16.0).fract() * 1e10) as u64;
            let points = drawn::<1>(NamedDensity::Constant, &spec).points;
            points.iter().map(within).collect::<std::collections::HashSet<u64>>()
        };
        assert!(places(2).len() > 1000);
        assert!(places(2).is_disjoint(&places(3)));
    }

    #[test]
    fn too_many_columns_are_refused() {
        let hardware = hardware();
        let mut gpu = Gpu::without_packets(&hardware).unwrap();
        for across in [0, 33] {
            let spec = NoiseSpec { count: 10.0, seed: 1, across };
            assert_eq!(
                draw_noise::<4>(&NamedDensity::Gauss, &spec, &mut gpu),
                Err(WhiteError::Columns(across))
            );
        }
    }
}
