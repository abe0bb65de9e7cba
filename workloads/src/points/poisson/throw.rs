//! Level after level: throw, halve.

use super::grid::{Dart, Grid};
use super::rain::{Fallen, Rain};
use super::voids::{Cube, Place, Voids};
use super::{PoissonDisk, PoissonError, PoissonSpec, span};
use crate::points::random::Stream;

/// Darts for each void of the first level, and of the others.
const FIRST: f64 = 0.9;
const LATER: f64 = 0.6;

/// Points with no two closer than the radius, to which none can be added. The same for any number of threads.
///
/// # Errors
/// [`PoissonError`] when the radius cannot be or memory would not do.
pub fn poisson_disk<const D: usize>(spec: &PoissonSpec) -> Result<PoissonDisk<D>, PoissonError> {
    poisson_disk_telling(spec, &mut |_| ())
}

/// The same, telling now and then how many points there are.
///
/// # Errors
/// As [`poisson_disk`].
pub fn poisson_disk_telling<const D: usize>(
    spec: &PoissonSpec,
    tell: &mut dyn FnMut(usize),
) -> Result<PoissonDisk<D>, PoissonError> {
    if spec.radius >= span(D, spec.domain) && spec.radius.is_finite() {
        return Ok(one_point(spec));
    }
    let mut throwing = Throwing::new(spec, tell)?;
    let voids = Voids::everything(&throwing.grid);
    throwing.first(&voids);
    Ok(throwing.finish(voids))
}

/// Any place, where every other is too near to it.
fn one_point<const D: usize>(spec: &PoissonSpec) -> PoissonDisk<D> {
    let (stream, ticks) = (Stream::new(spec.seed, 0), spec.spacing.per_unit());
    let point = std::array::from_fn(|k| (stream.unit(k as u64) * ticks).floor() / ticks);
    PoissonDisk { points: vec![point], darts: 1, voids: 1, levels: 0, thin_voids: 0 }
}

/// The same where the darts of the first `rounds` levels come from elsewhere: `draw` is given the voids and returns points of the unit
/// cube, each uniform over all of the voids, in random order. Also how many points these made.
///
/// # Errors
/// Those of `draw`; inside, as [`poisson_disk`].
#[allow(clippy::type_complexity, reason = "the failures of two parties")]
pub fn poisson_disk_drawn<const D: usize, E>(
    spec: &PoissonSpec,
    rounds: u32,
    mut draw: impl FnMut(&[Cube<D>]) -> Result<Vec<[f64; D]>, E>,
) -> Result<Result<(PoissonDisk<D>, usize), PoissonError>, E> {
    let tell = &mut |_| ();
    let mut throwing = match Throwing::new(spec, tell) {
        Ok(throwing) => throwing,
        Err(error) => return Ok(Err(error)),
    };
    let mut voids = Voids::everything(&throwing.grid);
    for _ in 0..rounds {
        if voids.cells.is_empty() || voids.is_full(&throwing.grid) || throwing.is_last(&voids) {
            break;
        }
        for point in draw(&voids.cubes(&throwing.grid))? {
            throwing.darts += 1;
            throwing.keep(&throwing.grid.dart_at(&point));
        }
        throwing.voids += voids.cells.len() as u64;
        voids = voids.halved(&throwing.grid, &Rain::new(Stream::new(0, 0), 0.0)).0;
    }
    let drawn = throwing.grid.points.len();
    Ok(Ok((throwing.finish(voids), drawn)))
}

/// What has been thrown so far.
struct Throwing<'a, const D: usize> {
    grid: Grid<D>,
    tell: &'a mut dyn FnMut(usize),
    seed: u64,
    darts: u64,
    voids: u64,
}

impl<'a, const D: usize> Throwing<'a, D> {
    fn new(spec: &PoissonSpec, tell: &'a mut dyn FnMut(usize)) -> Result<Self, PoissonError> {
        const { assert!(D >= 1 && D <= 4) };
        let least = 64.0 / spec.spacing.per_unit();
        if !(spec.radius >= least && spec.radius <= 0.5) {
            let one = span(D, spec.domain);
            return Err(PoissonError::Radius { radius: spec.radius, least, one });
        }
        Ok(Self { grid: Grid::new(spec)?, tell, seed: spec.seed, darts: 0, voids: 0 })
    }

    /// Level after level until no void is left.
    fn finish(mut self, mut voids: Voids<u32, D>) -> PoissonDisk<D> {
        while !voids.cells.is_empty() && !voids.is_full(&self.grid) && !self.is_last(&voids) {
            voids = self.level(&voids);
        }
        let mut voids = voids.widen();
        while !voids.cells.is_empty() && !self.is_last(&voids) {
            voids = self.level(&voids);
        }
        let thin_voids = self.number_by_number(&voids);
        let Self { grid, darts, voids: all, .. } = self;
        PoissonDisk { points: grid.points, darts, voids: all, levels: voids.level, thin_voids }
    }

    fn is_last<P>(&self, voids: &Voids<P, D>) -> bool {
        self.grid.is_finest(voids.level)
    }

    /// Throws at the cells of the grid, one dart after the other: nothing is there yet that would leave few of them.
    fn first(&mut self, voids: &Voids<u32, D>) {
        let count = (FIRST * voids.cells.len() as f64).ceil() as u64;
        let stream = Stream::new(self.seed, 0);
        self.darts += count;
        for number in 0..count {
            if let Some(dart) = voids.dart(&self.grid, stream, number) {
                self.keep(&dart);
            }
            self.tell(number);
        }
    }

    /// Halves voids and throws at what is left of them.
    fn level<P: Place>(&mut self, voids: &Voids<P, D>) -> Voids<P, D> {
        let stream = Stream::new(self.seed, u64::from(voids.level) + 1);
        let (left, Fallen { mut drops, darts }) = voids.halved(&self.grid, &Rain::new(stream, LATER));
        self.voids += voids.cells.len() as u64;
        self.darts += darts;
        drops.sort_unstable_by_key(|drop| drop.time);
        for (number, drop) in (0..).zip(&drops) {
            self.keep(&drop.dart);
            self.tell(number);
        }
        left
    }

    /// Tells how many points there are, now and then.
    #[inline]
    fn tell(&mut self, dart: u64) {
        if dart.is_multiple_of(1 << 16) {
            (self.tell)(self.grid.points.len());
        }
    }

    /// Adds a dart where it is free.
    #[inline]
    fn keep(&mut self, dart: &Dart<D>) -> bool {
        let free = !self.grid.is_taken(dart.slot as usize) && self.grid.is_free(dart);
        if free {
            self.grid.insert(dart);
        }
        free
    }

    /// Tries every number in the voids that are left; the voids that then still may be free somewhere have no number there.
    fn number_by_number(&mut self, voids: &Voids<u64, D>) -> u64 {
        let mut thin = 0;
        for number in 0..voids.cells.len() {
            let darts = voids.lattice(&self.grid, number);
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

    /// The first dart of a level is that which falls first, wherever it falls.
    #[test]
    fn darts_of_a_level_stay_in_the_order_of_time() {
        const SEEDS: u64 = 2000;
        let first = |seed| {
            let spec = PoissonSpec { radius: 0.2, domain: Domain::Torus, seed, spacing: Spacing::Double };
            let tell: &mut dyn FnMut(usize) = &mut |_| ();
            let mut throwing = Throwing::<2>::new(&spec, tell).unwrap();
            let voids = Voids::everything(&throwing.grid);
            throwing.level(&voids);
            throwing.grid.points[0]
        };
        let mut mean = [0.0; 2];
        for [x, y] in (0..SEEDS).map(first) {
            mean = [mean[0] + x / SEEDS as f64, mean[1] + y / SEEDS as f64];
        }
        // The mean of uniform numbers is off by 0.0065 (one standard deviation).
        assert!(mean.iter().all(|mean| (mean - 0.5).abs() < 0.026), "{mean:?}");
    }

    #[test]
    fn voids_without_a_free_number_are_counted_and_the_others_filled() {
        let spec = PoissonSpec { radius: 0.25, domain: Domain::Box, seed: 1, spacing: Spacing::Single };
        let tell: &mut dyn FnMut(usize) = &mut |_| ();
        let mut throwing = Throwing::<2>::new(&spec, tell).unwrap();
        let middle = throwing.grid.dart_at(&[0.5, 0.5]);
        assert!(throwing.keep(&middle) && !throwing.keep(&middle));
        let level = 20;
        let at = |x: f64| (x * throwing.grid.across as f64 * f64::from(1 << level)) as u64;
        let cells = vec![[at(0.51); 2], [at(0.6); 2], [at(0.1); 2]];
        assert_eq!(throwing.number_by_number(&Voids { level, cells }), 2);
        assert_eq!(throwing.grid.points.len(), 2);
    }
}
