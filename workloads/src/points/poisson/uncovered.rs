//! Uncovered regions: cells of one size per level that may contain free space, and the darts thrown at them.

use rayon::prelude::*;

use super::grid::{Dart, Grid};
use crate::points::Stream;

/// Integer type of a cell's coordinate along an axis.
pub(super) trait Place: Copy + Send + Sync {
    fn new(at: u64) -> Self;
    fn get(self) -> u64;
}

impl Place for u32 {
    fn new(at: u64) -> Self {
        at as Self
    }
    fn get(self) -> u64 {
        u64::from(self)
    }
}

impl Place for u64 {
    fn new(at: u64) -> Self {
        at
    }
    fn get(self) -> u64 {
        self
    }
}

/// A cube that may contain free space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cube<const D: usize> {
    /// Low corner in the unit cube.
    pub low: [f64; D],
    /// Side.
    pub side: f64,
}

/// Remaining cells of a level.
pub(super) struct UncoveredCells<P, const D: usize> {
    pub level: u32,
    pub cells: Vec<[P; D]>,
}

/// Cells per parallel task.
const CHUNK: usize = 4096;

/// Cell of the grid that contains a cell of a level, and the low corner in it.
fn split<P: Place, const D: usize>(cell: &[P; D], level: u32) -> ([u64; D], [f64; D]) {
    let side = 1.0 / (1_u64 << level) as f64;
    let within = (1_u64 << level) - 1;
    (cell.map(|at| at.get() >> level), cell.map(|at| (at.get() & within) as f64 * side))
}

impl<const D: usize> UncoveredCells<u32, D> {
    /// All cells of the grid.
    pub fn all(grid: &Grid<D>) -> Self {
        let count = grid.across.pow(D as u32);
        let cell =
            |number: u64| std::array::from_fn(|k| (number / grid.across.pow(k as u32) % grid.across) as u32);
        Self { level: 0, cells: (0..count).map(cell).collect() }
    }

    /// Whether the next level exceeds 32 bits per coordinate.
    pub fn is_full(&self, grid: &Grid<D>) -> bool {
        grid.across << (self.level + 1) > u64::from(u32::MAX)
    }

    /// Converts the coordinates to 64 bits.
    pub fn widen(self) -> UncoveredCells<u64, D> {
        let cells = self.cells.into_iter().map(|cell| cell.map(u64::from)).collect();
        UncoveredCells { level: self.level, cells }
    }
}

impl<P: Place, const D: usize> UncoveredCells<P, D> {
    /// Dart `number` of a stream, in a uniformly chosen cell; `None` if the cell has a point.
    #[inline]
    pub fn dart(&self, grid: &Grid<D>, stream: Stream, number: u64) -> Option<Dart<D>> {
        let at = number * (D as u64 + 1);
        let chosen = stream.below(at, self.cells.len() as u64) as usize;
        let (cell, low) = split(&self.cells[chosen], self.level);
        let slot = grid.slot(cell);
        if grid.is_taken(slot) {
            return None;
        }
        let side = 1.0 / (1_u64 << self.level) as f64;
        let place = std::array::from_fn(|k| low[k] + stream.unit(at + 1 + k as u64) * side);
        Some(grid.dart(cell, slot, place))
    }

    /// Halves the cells: keeps those that have no point and that no single disk covers, and throws darts at
    /// them.
    pub fn halved(&self, grid: &Grid<D>, process: &DartProcess) -> (Self, ThrownDarts<D>) {
        let parts: Vec<_> =
            self.cells.par_chunks(CHUNK).map(|cells| self.part(grid, process, cells)).collect();
        let mut remaining = Vec::with_capacity(parts.iter().map(|(cells, _)| cells.len()).sum());
        let mut thrown = ThrownDarts::default();
        for (cells, part) in parts {
            remaining.extend(cells);
            thrown.free.extend(part.free);
            thrown.darts += part.darts;
        }
        (Self { level: self.level + 1, cells: remaining }, thrown)
    }

    fn part(&self, grid: &Grid<D>, process: &DartProcess, cells: &[[P; D]]) -> (Vec<[P; D]>, ThrownDarts<D>) {
        let (mut remaining, mut thrown) = (Vec::with_capacity(cells.len()), ThrownDarts::default());
        let (mut of_cell, mut near) = (grid.near(), grid.near());
        let side = 1.0 / (2_u64 << self.level) as f64;
        for parent in cells {
            let (cell, low) = split(parent, self.level);
            let slot = grid.slot(cell);
            if grid.is_taken(slot) {
                continue;
            }
            if !of_cell.is_of(slot) {
                grid.gather(slot, &mut of_cell);
            }
            grid.narrow(&of_cell, &low, 2.0 * side, &mut near);
            let covered = grid.covers(&near, &low, side);
            for half in (0..1_u64 << D).filter(|half| covered >> half & 1 == 0) {
                let upper = |k: usize| half >> k & 1;
                let low: [f64; D] = std::array::from_fn(|k| low[k] + upper(k) as f64 * side);
                let child = std::array::from_fn(|k| 2 * parent[k].get() + upper(k));
                remaining.push(child.map(P::new));
                process.on(child, side, |time, within| {
                    thrown.darts += 1;
                    let dart = grid.dart(cell, slot, std::array::from_fn(|k| low[k] + within[k]));
                    if grid.is_free_among(&near, &dart) {
                        thrown.free.push(TimedDart { time, dart });
                    }
                });
            }
        }
        (remaining, thrown)
    }

    /// The cells as cubes in the unit cube.
    pub fn cubes(&self, grid: &Grid<D>) -> Vec<Cube<D>> {
        let side = 1.0 / (grid.across << self.level) as f64;
        let cube = |cell: &[P; D]| Cube { low: cell.map(|at| at.get() as f64 * side), side };
        self.cells.iter().map(cube).collect()
    }

    /// All representable points of a cell.
    pub fn lattice(&self, grid: &Grid<D>, number: usize) -> Vec<Dart<D>> {
        let (cell, low) = split(&self.cells[number], self.level);
        grid.lattice(cell, low, 1.0 / (1_u64 << self.level) as f64)
    }
}

/// A dart and its time.
#[derive(Clone, Copy, Debug)]
pub(super) struct TimedDart<const D: usize> {
    pub time: u64,
    pub dart: Dart<D>,
}

/// The darts thrown at many cells.
#[derive(Debug)]
pub(super) struct ThrownDarts<const D: usize> {
    /// Darts that are free of the earlier points, unsorted.
    pub free: Vec<TimedDart<D>>,
    /// Number of all darts thrown.
    pub darts: u64,
}

impl<const D: usize> Default for ThrownDarts<D> {
    fn default() -> Self {
        Self { free: Vec::new(), darts: 0 }
    }
}

/// Most darts per cell. The probability of more is below 2^-64.
const MAX_DARTS_PER_CELL: usize = 24;

/// Poisson process of darts on the cells of a level.
pub(super) struct DartProcess {
    stream: Stream,
    /// Cumulative Poisson probabilities, scaled to 64 bits.
    cumulative: [u64; MAX_DARTS_PER_CELL],
}

impl DartProcess {
    /// A process with `mean` darts per cell, at most 1.
    pub fn new(stream: Stream, mean: f64) -> Self {
        let (mut one, mut sum, mut cumulative) = ((-mean).exp(), 0.0, [0; MAX_DARTS_PER_CELL]);
        for (count, word) in cumulative.iter_mut().enumerate() {
            sum += one;
            one *= mean / (count + 1) as f64;
            // The cast saturates.
            *word = (sum * 2.0_f64.powi(64)) as u64;
        }
        Self { stream, cumulative }
    }

    /// Passes the darts of a cell to `each`: time, and position along each axis, up to `side`.
    #[inline]
    pub fn on<const D: usize>(&self, cell: [u64; D], side: f64, mut each: impl FnMut(u64, [f64; D])) {
        let own = cell.iter().fold(self.stream, |stream, &at| stream.of(at));
        let word = own.word(0);
        let mut count = 0;
        while count + 1 < MAX_DARTS_PER_CELL && word >= self.cumulative[count] {
            let at = 1 + count as u64 * (D as u64 + 1);
            each(own.word(at), std::array::from_fn(|k| own.unit(at + 1 + k as u64) * side));
            count += 1;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_number_of_darts_is_poisson_distributed() {
        let process = DartProcess::new(Stream::new(3, 0), 0.7);
        let mut counts = [0.0; 4];
        for cell in 0..100_000 {
            let mut count = 0;
            process.on([cell, 5], 0.25, |_, within| {
                count += 1;
                assert!(within.iter().all(|at| (0.0..0.25).contains(at)));
            });
            counts[count.min(3)] += 1e-5;
        }
        let none = (-0.7_f64).exp();
        for (found, expected) in counts.into_iter().zip([none, 0.7 * none, 0.245 * none]) {
            assert!((found - expected).abs() < 0.006, "{counts:?}");
        }
    }
}
