//! Level after level: throw, halve.

use super::grid::{Dart, Grid};
use super::rain::Rain;
use super::voids::{Place, Voids};
use super::{PoissonDisk, PoissonError, PoissonSpec};
use crate::points::random::Stream;

/// Darts for each void of the first level, and of the others.
const FIRST: f64 = 0.9;
const LATER: f64 = 0.6;

/// Points with no two closer than the radius, to which none can be added. The same for any number of threads.
///
/// # Errors
/// [`PoissonError`] when the radius cannot be or memory would not do.
pub fn poisson_disk<const D: usize>(spec: &PoissonSpec) -> Result<PoissonDisk<D>, PoissonError> {
    const { assert!(D >= 1 && D <= 4) };
    let least = 64.0 / spec.spacing.per_unit();
    if !(spec.radius >= least && spec.radius <= 0.5) {
        return Err(PoissonError::Radius { radius: spec.radius, least });
    }
    let mut throwing = Throwing { grid: Grid::new(spec)?, seed: spec.seed, darts: 0, voids: 0 };
    let mut voids = Voids::everything(&throwing.grid);
    throwing.first(&voids);
    while !voids.cells.is_empty() && !voids.is_full(&throwing.grid) && !throwing.is_last(&voids) {
        voids = throwing.level(&voids);
    }
    let mut voids = voids.widen();
    while !voids.cells.is_empty() && !throwing.is_last(&voids) {
        voids = throwing.level(&voids);
    }
    let thin_voids = throwing.number_by_number(&voids);
    let Throwing { grid, darts, voids: all, .. } = throwing;
    Ok(PoissonDisk { points: grid.points, darts, voids: all, levels: voids.level, thin_voids })
}

/// What has been thrown so far.
struct Throwing<const D: usize> {
    grid: Grid<D>,
    seed: u64,
    darts: u64,
    voids: u64,
}

impl<const D: usize> Throwing<D> {
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
        }
    }

    /// Halves voids and throws at what is left of them.
    fn level<P: Place>(&mut self, voids: &Voids<P, D>) -> Voids<P, D> {
        let stream = Stream::new(self.seed, u64::from(voids.level) + 1);
        let (left, mut drops) = voids.halved(&self.grid, &Rain::new(stream, LATER));
        self.voids += voids.cells.len() as u64;
        drops.sort_unstable_by_key(|drop| drop.time);
        for drop in &drops {
            self.keep(&drop.dart);
        }
        left
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
