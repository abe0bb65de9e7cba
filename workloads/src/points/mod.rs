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
pub mod volume;
pub mod white;

use pipeline::random::{mix, unit};
use pipeline::{Gpu, Lane};
use warnings::{Code, Warning};

use drawn::{AXES, Cell, Kept, Lattice, MAX_MEAN, Within, draw};
use poisson::{Domain, PoissonError, PoissonSpec, check_room, closer};
use white::{Columns, Shaded, WhiteError, low, shares};

const GOLDEN: u64 = 0x9E37_79B9_7F4A_7C15;

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

/// Plain dart throwing until `misses` in a row (Cook 1986).
///
/// # Errors
/// As [`crate::points::poisson::poisson_disk`].
pub fn plain_darts<const D: usize>(spec: &PoissonSpec, misses: u64) -> Result<Vec<[f64; D]>, PoissonError> {
    let (mut cells, stream) = (Cells::new(spec)?, Stream::new(spec.seed, 0x914E));
    let (mut missed, mut number) = (0, 0);
    while missed < misses {
        let at = std::array::from_fn(|k| rounded_down(stream.unit(number + k as u64)));
        number += D as u64;
        let free = cells.is_free(&at);
        missed = if free { 0 } else { missed + 1 };
        if free {
            cells.add(at);
        }
    }
    Ok(cells.points)
}

/// The next lower multiple of 2^-52.
fn rounded_down(x: f64) -> f64 {
    let whole = (1_u64 << 52) as f64;
    (x * whole).floor() / whole
}

/// Bridson's method (2007). Starts from a random point and tries `candidates` positions between one and two
/// radii from a random active point, uniform by volume. The first free one becomes a point; if none is free,
/// the active point retires.
///
/// # Errors
/// As [`crate::points::poisson::poisson_disk`].
pub fn bridson<const D: usize>(spec: &PoissonSpec, candidates: u32) -> Result<Vec<[f64; D]>, PoissonError> {
    let (mut cells, stream) = (Cells::new(spec)?, Stream::new(spec.seed, 0xB51D));
    let mut number = D as u64;
    cells.add(std::array::from_fn(|k| rounded_down(stream.unit(k as u64))));
    let mut active = vec![0_usize];
    while !active.is_empty() {
        let chosen = stream.below(number, active.len() as u64) as usize;
        let from = cells.points[active[chosen]];
        number += 1;
        let found = (0..candidates).find_map(|_| {
            let at = around(&from, spec, stream, &mut number)?;
            cells.is_free(&at).then_some(at)
        });
        match found {
            Some(at) => {
                active.push(cells.points.len());
                cells.add(at);
            }
            None => _ = active.swap_remove(chosen),
        }
    }
    Ok(cells.points)
}

/// A random position in the shell around a point, if it is in the domain.
fn around<const D: usize>(
    from: &[f64; D],
    spec: &PoissonSpec,
    stream: Stream,
    number: &mut u64,
) -> Option<[f64; D]> {
    let away: [f64; D] = loop {
        let place: [f64; D] = std::array::from_fn(|k| 4.0 * stream.unit(*number + k as u64) - 2.0);
        *number += D as u64;
        let square: f64 = place.iter().map(|x| x * x).sum();
        if (1.0..4.0).contains(&square) {
            break place;
        }
    };
    let at: [f64; D] = std::array::from_fn(|k| from[k] + away[k] * spec.radius);
    match spec.domain {
        Domain::Torus => Some(at.map(|x| rounded_down(x.rem_euclid(1.0)).min(1.0 - f64::EPSILON))),
        Domain::Box => at.iter().all(|x| (0.0..1.0).contains(x)).then(|| at.map(rounded_down)),
    }
}

/// Grid of cells with at most one point each.
pub(super) struct Cells<const D: usize> {
    spec: PoissonSpec,
    across: i64,
    index: Vec<u32>,
    pub points: Vec<[f64; D]>,
}

impl<const D: usize> Cells<D> {
    pub fn new(spec: &PoissonSpec) -> Result<Self, PoissonError> {
        let least = 1e-9;
        if !(spec.radius >= least && spec.radius <= 0.5) {
            return Err(PoissonError::Radius { radius: spec.radius, least, one: f64::INFINITY });
        }
        let across = ((D as f64).sqrt() / spec.radius).ceil();
        let cells = across.powi(D as i32);
        check_room(spec.radius, D, cells)?;
        Ok(Self {
            spec: *spec,
            across: across as i64,
            index: vec![u32::MAX; cells as usize],
            points: Vec::new(),
        })
    }

    fn cell(&self, at: &[f64; D]) -> [i64; D] {
        at.map(|x| ((x * self.across as f64) as i64).min(self.across - 1))
    }

    fn number(&self, cell: &[i64; D]) -> usize {
        (0..D).rev().fold(0, |number, k| number * self.across as usize + cell[k] as usize)
    }

    /// Whether no point is closer than the radius.
    pub fn is_free(&self, at: &[f64; D]) -> bool {
        let (cell, reach) = (self.cell(at), ((D as f64).sqrt().ceil() as i64 + 1).min(self.across / 2));
        let along = 2 * reach + 1;
        (0..along.pow(D as u32)).all(|number| {
            let mut near: [i64; D] =
                std::array::from_fn(|k| cell[k] + number / along.pow(k as u32) % along - reach);
            if self.spec.domain == Domain::Torus {
                near = near.map(|at| at.rem_euclid(self.across));
            } else if near.iter().any(|at| !(0..self.across).contains(at)) {
                return true;
            }
            let point = self.index[self.number(&near)];
            point == u32::MAX || !closer(&self.points[point as usize], at, self.spec.radius, self.spec.domain)
        })
    }

    pub fn add(&mut self, at: [f64; D]) {
        let number = self.number(&self.cell(&at));
        self.index[number] = self.points.len() as u32;
        self.points.push(at);
    }
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
        draw(gpu, "columns", &lifted.cells, &lifted.lattice, &lifted);
    let columns = lifted.cells.len();
    Ok(DrawnNoise { points: Lifted::<D>::projected(&points), candidates, fragments, columns })
}

#[cfg(test)]
mod tests {
    use super::poisson::{Domain, PoissonSpec, Spacing, ball, poisson_disk};
    use super::quality::{chi_square, closer_than, free_share, largest_hole};
    use super::white::{Named, counts};
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

    const SPEC: PoissonSpec =
        PoissonSpec { radius: 0.03, domain: Domain::Torus, seed: 1, spacing: Spacing::Double };

    #[test]
    fn both_keep_the_distance_and_leave_holes() {
        let density = |n: usize| n as f64 * ball(2) * 0.03 * 0.03;
        let plain = plain_darts::<2>(&SPEC, 300).unwrap();
        let near = bridson::<2>(&SPEC, 30).unwrap();
        for points in [&plain, &near] {
            assert_eq!(closer_than(points, 0.03, Domain::Torus), 0);
            assert!(largest_hole(points, Domain::Torus).radius > 0.03 * 1.0001);
        }
        assert!(density(plain.len()) < 0.547, "{}", density(plain.len()));
        assert!(free_share(&plain, 0.03, Domain::Torus, 20_000) > 0.0);
        let volume = bridson::<3>(&PoissonSpec { radius: 0.12, domain: Domain::Box, ..SPEC }, 30).unwrap();
        assert!(volume.len() > 200 && closer_than(&volume, 0.12, Domain::Box) == 0);
    }

    fn drawn<const D: usize>(density: Named, spec: &NoiseSpec) -> DrawnNoise<D> {
        let hardware = hardware();
        draw_noise(&density, spec, &mut Gpu::quiet(&hardware).unwrap()).unwrap()
    }

    fn on_host<const D: usize>(density: &Named, spec: &NoiseSpec) -> Vec<[f64; D]> {
        let lifted: Lifted<D> = Lifted::new(density, spec).unwrap();
        Lifted::<D>::projected(&drawn::on_host(&lifted.cells, &lifted.lattice, &lifted))
    }

    fn same<const D: usize>(across: u32, cells: u64) {
        for density in [Named::Constant, Named::Ramp, Named::Gauss, Named::Waves] {
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
            pool.install(|| drawn::<2>(Named::Gauss, &spec))
        };
        assert_eq!(with(1), with(3));
        assert_ne!(with(1).points, drawn::<2>(Named::Gauss, &NoiseSpec { seed: 2, ..spec }).points);
    }

    /// Neighbouring seeds once had the same cells in another order.
    #[test]
    fn neighbouring_seeds_share_no_place_within_a_column() {
        let places = |seed| {
            let spec = NoiseSpec { count: 2000.0, seed, across: 16 };
            let within = |point: &[f64; 1]| ((point[0] * 16.0).fract() * 1e10) as u64;
            let points = drawn::<1>(Named::Constant, &spec).points;
            points.iter().map(within).collect::<std::collections::HashSet<u64>>()
        };
        assert!(places(2).len() > 1000);
        assert!(places(2).is_disjoint(&places(3)));
    }

    #[test]
    fn too_many_columns_are_refused() {
        let hardware = hardware();
        let mut gpu = Gpu::quiet(&hardware).unwrap();
        for across in [0, 33] {
            let spec = NoiseSpec { count: 10.0, seed: 1, across };
            assert_eq!(draw_noise::<4>(&Named::Gauss, &spec, &mut gpu), Err(WhiteError::Columns(across)));
        }
    }
}
