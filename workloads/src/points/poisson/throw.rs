//! Dart throwing, level by level.

use super::grid::{Dart, Grid};
use super::uncovered::{Cube, DartProcess, Place, ThrownDarts, UncoveredCells};
use super::{PoissonDisk, PoissonError, PoissonSpec, span};
use crate::points::Stream;

/// Darts per uncovered cell of the first level.
const DARTS_PER_FIRST_CELL: f64 = 0.9;
/// Darts per uncovered cell of later levels.
const DARTS_PER_LATER_CELL: f64 = 0.6;

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

#[cfg(test)]
mod tests {
    use super::super::{Domain, Spacing};
    use super::*;

    /// The first accepted dart of a level is the one with the earliest time.
    #[test]
    fn darts_of_a_level_are_accepted_in_order_of_time() {
        const SEEDS: u64 = 2000;
        let first = |seed| {
            let spec = PoissonSpec { radius: 0.2, domain: Domain::Torus, seed, spacing: Spacing::Double };
            let progress: &mut dyn FnMut(usize) = &mut |_| ();
            let mut throwing = Throwing::<2>::new(&spec, progress).unwrap();
            let uncovered = UncoveredCells::all(&throwing.grid);
            throwing.level(&uncovered);
            throwing.grid.points[0]
        };
        let mut mean = [0.0; 2];
        for [x, y] in (0..SEEDS).map(first) {
            mean = [mean[0] + x / SEEDS as f64, mean[1] + y / SEEDS as f64];
        }
        // The standard error of the mean is 0.0065.
        assert!(mean.iter().all(|mean| (mean - 0.5).abs() < 0.026), "{mean:?}");
    }

    #[test]
    fn cells_without_a_free_point_are_counted_and_others_filled() {
        let spec = PoissonSpec { radius: 0.25, domain: Domain::Box, seed: 1, spacing: Spacing::Single };
        let progress: &mut dyn FnMut(usize) = &mut |_| ();
        let mut throwing = Throwing::<2>::new(&spec, progress).unwrap();
        let middle = throwing.grid.dart_at(&[0.5, 0.5]);
        assert!(throwing.keep(&middle) && !throwing.keep(&middle));
        let level = 20;
        let at = |x: f64| (x * throwing.grid.across as f64 * f64::from(1 << level)) as u64;
        let cells = vec![[at(0.51); 2], [at(0.6); 2], [at(0.1); 2]];
        assert_eq!(throwing.test_representable_points(&UncoveredCells { level, cells }), 2);
        assert_eq!(throwing.grid.points.len(), 2);
    }
}
