//! Maximal Poisson disk points by dart throwing over uncovered regions (thesis, Paper VI, section 5,
//! "Accelerated Dart Throwing").
//!
//! Space is divided into cells that can hold one point at most. Cells that may still be *uncovered* form a
//! list. Darts are thrown at these cells with uniform density, and become points if they are free. Then each
//! cell is halved along every axis, and cells that a disk covers are dropped, until none remains. The flat
//! list of equal cells follows Ebeida, Mitchell, Patney, Davidson and Owens 2012, "A Simple Algorithm for
//! Maximal Poisson-Disk Sampling in High Dimensions"; the tree before it is Gamito and Maddock 2009. The
//! cells of a level have one size and contain all free space, so **every accepted dart is uniform over the
//! free space**. The points are those of plain dart throwing without end (random sequential adsorption).
//!
//! Distances between cells are compared in single precision. If rounding could decide, they are compared
//! exactly, for the coordinates that are returned. Cells only a few representable coordinates wide are tested
//! coordinate by coordinate. Those that then have uncovered space contain no representable point, and are
//! counted ([`PoissonDisk::thin_regions`]).
//!
//! The paper rasterizes the cells to make candidates, as [`super::job`] does. Here a candidate is made by
//! choosing a cell.

mod cells;
mod grid;
mod uncovered;

use crate::points::Stream;
use grid::{Dart, Grid};
use uncovered::{DartProcess, Place, ThrownDarts, UncoveredCells};

pub use grid::closer;
pub use uncovered::Cube;

/// Boundary of the unit square or cube.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Domain {
    /// Periodic: opposite sides are joined.
    #[default]
    Torus,
    /// Open: nothing lies beyond.
    Box,
}

/// Representable coordinates.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Spacing {
    /// Multiples of 2^-52, the largest ulp of an `f64` in the unit interval.
    #[default]
    Double,
    /// Multiples of 2^-24, the same for `f32`.
    Single,
    /// Multiples of 2^-n, n at most 52: coarser coordinates, for experiments.
    Bits(u32),
}

impl Spacing {
    /// Representable coordinates per unit of length.
    pub fn per_unit(self) -> f64 {
        match self {
            Self::Double => (1_u64 << grid::FINEST_BITS) as f64,
            Self::Single => (1_u64 << 24) as f64,
            Self::Bits(bits) => (1_u64 << bits.min(grid::FINEST_BITS)) as f64,
        }
    }
}

/// Parameters of Poisson disk points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PoissonSpec {
    /// Minimum distance of points, and largest distance of any position from its nearest point. At most 0.5,
    /// or at least [`span`].
    pub radius: f64,
    /// Boundary of the unit square or cube.
    pub domain: Domain,
    /// Seed of the points.
    pub seed: u64,
    /// Representable coordinates.
    pub spacing: Spacing,
}

/// Reason why points cannot be made.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum PoissonError {
    /// The radius is out of range.
    #[error("r is {}; it has to be {least:.1e} to 0.5, or from {one:.3} on for a single point", short(*.radius))]
    Radius {
        /// The given radius.
        radius: f64,
        /// The least radius for the precision of the coordinates.
        least: f64,
        /// The radius from which one point covers the domain.
        one: f64,
    },
    /// Too many points for memory and run time.
    #[error(
        "that would be about {points:.1e} points; choose a larger r, at least {least:.1e}, or fewer points, at most {most:.1e}"
    )]
    TooMany {
        /// Expected number of points.
        points: f64,
        /// A radius that works.
        least: f64,
        /// Largest number of points, approximately.
        most: f64,
    },
}

/// A number in short notation, without long runs of zeros.
fn short(number: f64) -> String {
    let plain = number == 0.0 || !number.is_finite() || (1e-4..1e6).contains(&number.abs());
    if plain { number.to_string() } else { format!("{number:e}") }
}

/// Maximal Poisson disk points.
#[derive(Clone, Debug, PartialEq)]
pub struct PoissonDisk<const D: usize> {
    /// Points in the unit cube, in the order of acceptance.
    pub points: Vec<[f64; D]>,
    /// Darts thrown.
    pub darts: u64,
    /// Uncovered cells over all levels.
    pub uncovered: u64,
    /// Levels of halving.
    pub levels: u32,
    /// Remaining uncovered cells without a representable point.
    pub thin_regions: u64,
}

/// Share of space that disks of diameter r cover at saturation (random sequential adsorption). In one
/// dimension it is Renyi's constant (1958), in two and three the values of `docs/guide/sampling.md`, in four
/// that of Torquato, Uche and Stillinger (2006).
pub fn saturation(dimensions: usize) -> f64 {
    match dimensions {
        1 => 0.7476,
        2 => 0.547,
        3 => 0.384,
        _ => 0.260,
    }
}

/// Volume of a ball of diameter 1.
pub fn ball(dimensions: usize) -> f64 {
    use std::f64::consts::PI;
    match dimensions {
        1 => 1.0,
        2 => PI / 4.0,
        3 => PI / 6.0,
        _ => PI * PI / 32.0,
    }
}

/// Sides of a box with borders hold as many points as those of a torus that are longer by this, in r, as a
/// disk at the border is partly outside: 2 - 1 / 0.7476 = 0.66 on a line (Rényi 1958), 0.57 to 0.65 as
/// counted for 10 to 1000 points in 2D and 3D.
const BORDER: f64 = 0.6;

/// Radius at which about `count` points saturate the unit cube.
pub fn radius_for(count: f64, dimensions: usize, domain: Domain) -> f64 {
    let on_torus = (saturation(dimensions) / (ball(dimensions) * count)).powf(1.0 / dimensions as f64);
    match domain {
        Domain::Torus => on_torus,
        // r = on_torus (1 + BORDER r)
        Domain::Box => on_torus / (1.0 - BORDER * on_torus).max(f64::MIN_POSITIVE),
    }
}

/// Radius from which one point covers the unit cube.
pub fn span(dimensions: usize, domain: Domain) -> f64 {
    let root = (dimensions as f64).sqrt();
    if domain == Domain::Torus { 0.5 * root } else { root }
}

/// Most cells in memory.
const MAX_CELLS: f64 = (1_u64 << 28) as f64;
/// Most points, which take some minutes.
const MAX_POINTS: f64 = (1_u64 << 25) as f64;

/// Checks the number of cells and points.
///
/// # Errors
/// [`PoissonError::TooMany`].
pub(super) fn check_room(radius: f64, dimensions: usize, cells: f64) -> Result<(), PoissonError> {
    let volume = radius.powi(dimensions as i32);
    let points = saturation(dimensions) / (ball(dimensions) * volume);
    let over = (cells / MAX_CELLS).max(points / MAX_POINTS);
    if over <= 1.0 {
        return Ok(());
    }
    // Padding costs relatively more for fewer cells, and the printed value must work.
    let most = 0.8 * points / over;
    Err(PoissonError::TooMany { points, least: 1.05 * radius_for(most, dimensions, Domain::Torus), most })
}

#[cfg(test)]
mod tests;

/// Darts per uncovered cell of the first level.
pub(in crate::points) const DARTS_PER_FIRST_CELL: f64 = 0.9;
/// Darts per uncovered cell of later levels.
pub(in crate::points) const DARTS_PER_LATER_CELL: f64 = 0.6;

/// Maximal Poisson disk points. The result does not depend on the number of threads.
///
/// # Errors
/// [`PoissonError`] for a radius out of range, or too many points for memory.
pub fn poisson_disk<const D: usize>(spec: &PoissonSpec) -> Result<PoissonDisk<D>, PoissonError> {
    poisson_disk_with_progress(spec, &mut |_| ())
}

/// The same, with calls of `progress` with the number of points so far.
///
/// # Errors
/// As [`poisson_disk`].
pub fn poisson_disk_with_progress<const D: usize>(
    spec: &PoissonSpec,
    progress: &mut dyn FnMut(usize),
) -> Result<PoissonDisk<D>, PoissonError> {
    if spec.radius >= span(D, spec.domain) && spec.radius.is_finite() {
        return Ok(one_point(spec));
    }
    let mut throwing = Throwing::new(spec, progress)?;
    let uncovered = UncoveredCells::all(&throwing.grid);
    throwing.first(&uncovered);
    Ok(throwing.finish(uncovered))
}

/// A single random point that covers the domain.
fn one_point<const D: usize>(spec: &PoissonSpec) -> PoissonDisk<D> {
    let (stream, ticks) = (Stream::new(spec.seed, 0), spec.spacing.per_unit());
    let point = std::array::from_fn(|k| (stream.unit(k as u64) * ticks).floor() / ticks);
    PoissonDisk { points: vec![point], darts: 1, uncovered: 1, levels: 0, thin_regions: 0 }
}

/// The same, with the darts of the first `rounds` levels from `draw`. It is given the uncovered cells and
/// returns points of the unit cube, uniform over these cells, in random order. Also returns the number of
/// points that they became.
///
/// # Errors
/// Errors of `draw`; the inner result has those of [`poisson_disk`].
#[allow(clippy::type_complexity, reason = "the failures of two parties")]
pub fn poisson_disk_drawn<const D: usize, E>(
    spec: &PoissonSpec,
    rounds: u32,
    mut draw: impl FnMut(&[Cube<D>]) -> Result<Vec<[f64; D]>, E>,
) -> Result<Result<(PoissonDisk<D>, usize), PoissonError>, E> {
    let progress = &mut |_| ();
    let mut throwing = match Throwing::new(spec, progress) {
        Ok(throwing) => throwing,
        Err(error) => return Ok(Err(error)),
    };
    let mut uncovered = UncoveredCells::all(&throwing.grid);
    for _ in 0..rounds {
        if uncovered.cells.is_empty() || uncovered.is_full(&throwing.grid) || throwing.is_last(&uncovered) {
            break;
        }
        for point in draw(&uncovered.cubes(&throwing.grid))? {
            throwing.darts += 1;
            throwing.keep(&throwing.grid.dart_at(&point));
        }
        throwing.uncovered += uncovered.cells.len() as u64;
        uncovered = uncovered.halved(&throwing.grid, &DartProcess::new(Stream::new(0, 0), 0.0)).0;
    }
    let drawn = throwing.grid.points.len();
    Ok(Ok((throwing.finish(uncovered), drawn)))
}

/// State of dart throwing.
struct Throwing<'a, const D: usize> {
    grid: Grid<D>,
    progress: &'a mut dyn FnMut(usize),
    seed: u64,
    darts: u64,
    uncovered: u64,
}

impl<'a, const D: usize> Throwing<'a, D> {
    fn new(spec: &PoissonSpec, progress: &'a mut dyn FnMut(usize)) -> Result<Self, PoissonError> {
        const { assert!(D >= 1 && D <= 4) };
        let least = 64.0 / spec.spacing.per_unit();
        if !(spec.radius >= least && spec.radius <= 0.5) {
            let one = span(D, spec.domain);
            return Err(PoissonError::Radius { radius: spec.radius, least, one });
        }
        Ok(Self { grid: Grid::new(spec)?, progress, seed: spec.seed, darts: 0, uncovered: 0 })
    }

    /// Runs level after level until no uncovered cell remains.
    fn finish(mut self, mut uncovered: UncoveredCells<u32, D>) -> PoissonDisk<D> {
        while !uncovered.cells.is_empty() && !uncovered.is_full(&self.grid) && !self.is_last(&uncovered) {
            uncovered = self.level(&uncovered);
        }
        let mut uncovered = uncovered.widen();
        while !uncovered.cells.is_empty() && !self.is_last(&uncovered) {
            uncovered = self.level(&uncovered);
        }
        let thin_regions = self.test_representable_points(&uncovered);
        let Self { grid, darts, uncovered: all, .. } = self;
        PoissonDisk { points: grid.points, darts, uncovered: all, levels: uncovered.level, thin_regions }
    }

    fn is_last<P>(&self, uncovered: &UncoveredCells<P, D>) -> bool {
        self.grid.is_finest(uncovered.level)
    }

    /// Throws at all cells of the grid, one dart at a time, since nearly all of them are free.
    fn first(&mut self, uncovered: &UncoveredCells<u32, D>) {
        let count = (DARTS_PER_FIRST_CELL * uncovered.cells.len() as f64).ceil() as u64;
        let stream = Stream::new(self.seed, 0);
        self.darts += count;
        for number in 0..count {
            if let Some(dart) = uncovered.dart(&self.grid, stream, number) {
                self.keep(&dart);
            }
            self.report(number);
        }
    }

    /// Halves the uncovered cells and throws at the remaining ones.
    fn level<P: Place>(&mut self, uncovered: &UncoveredCells<P, D>) -> UncoveredCells<P, D> {
        let stream = Stream::new(self.seed, u64::from(uncovered.level) + 1);
        let (remaining, ThrownDarts { mut free, darts }) =
            uncovered.halved(&self.grid, &DartProcess::new(stream, DARTS_PER_LATER_CELL));
        self.uncovered += uncovered.cells.len() as u64;
        self.darts += darts;
        free.sort_unstable_by_key(|drop| drop.time);
        for (number, drop) in (0..).zip(&free) {
            self.keep(&drop.dart);
            self.report(number);
        }
        remaining
    }

    /// Reports the number of points at intervals.
    #[inline]
    fn report(&mut self, dart: u64) {
        if dart.is_multiple_of(1 << 16) {
            (self.progress)(self.grid.points.len());
        }
    }

    /// Adds a dart as a point if it is free.
    #[inline]
    fn keep(&mut self, dart: &Dart<D>) -> bool {
        let free = !self.grid.is_taken(dart.slot as usize) && self.grid.is_free(dart);
        if free {
            self.grid.insert(dart);
        }
        free
    }

    /// Tests every representable point of the remaining cells. Returns the number of cells without a free
    /// one.
    fn test_representable_points(&mut self, uncovered: &UncoveredCells<u64, D>) -> u64 {
        let mut thin = 0;
        for number in 0..uncovered.cells.len() {
            let darts = uncovered.lattice(&self.grid, number);
            let stayed = darts.iter().filter(|dart| self.keep(dart)).count();
            thin += u64::from(stayed == 0);
        }
        thin
    }
}
