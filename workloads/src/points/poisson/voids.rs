//! Voids: cells, of one size in each level, of which some part may still be free.

use rayon::prelude::*;

use super::grid::{Dart, Grid};
use super::rain::{Drop, Fallen, Rain};
use crate::points::random::Stream;

/// A number that says where a cell of a level is along an axis.
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

/// A cube of which some part may still be free.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cube<const D: usize> {
    /// Its low corner in the unit cube.
    pub low: [f64; D],
    /// Its side.
    pub side: f64,
}

/// The cells of a level that are left.
pub(super) struct Voids<P, const D: usize> {
    pub level: u32,
    pub cells: Vec<[P; D]>,
}

/// So many cells are looked at by one worker at a time.
const CHUNK: usize = 4096;

/// Where a cell of a level is: the cell of the grid, and its low corner in that.
fn split<P: Place, const D: usize>(cell: &[P; D], level: u32) -> ([u64; D], [f64; D]) {
    let side = 1.0 / (1_u64 << level) as f64;
    let within = (1_u64 << level) - 1;
    (cell.map(|at| at.get() >> level), cell.map(|at| (at.get() & within) as f64 * side))
}

impl<const D: usize> Voids<u32, D> {
    /// Every cell of the grid.
    pub fn everything(grid: &Grid<D>) -> Self {
        let count = grid.across.pow(D as u32);
        let cell =
            |number: u64| std::array::from_fn(|k| (number / grid.across.pow(k as u32) % grid.across) as u32);
        Self { level: 0, cells: (0..count).map(cell).collect() }
    }

    /// Whether the next level still fits.
    pub fn is_full(&self, grid: &Grid<D>) -> bool {
        grid.across << (self.level + 1) > u64::from(u32::MAX)
    }

    /// The same with room for all levels.
    pub fn widen(self) -> Voids<u64, D> {
        let cells = self.cells.into_iter().map(|cell| cell.map(u64::from)).collect();
        Voids { level: self.level, cells }
    }
}

impl<P: Place, const D: usize> Voids<P, D> {
    /// Dart `number` of a stream: a cell, every one as likely, and a place in it; none where a point is in the cell.
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

    /// The cells of the next level that no point is in and no single disk surely covers, and what falls on them.
    pub fn halved(&self, grid: &Grid<D>, rain: &Rain) -> (Self, Fallen<D>) {
        let parts: Vec<_> = self.cells.par_chunks(CHUNK).map(|cells| self.part(grid, rain, cells)).collect();
        let mut left = Vec::with_capacity(parts.iter().map(|(cells, _)| cells.len()).sum());
        let mut fallen = Fallen::default();
        for (cells, some) in parts {
            left.extend(cells);
            fallen.drops.extend(some.drops);
            fallen.darts += some.darts;
        }
        (Self { level: self.level + 1, cells: left }, fallen)
    }

    fn part(&self, grid: &Grid<D>, rain: &Rain, cells: &[[P; D]]) -> (Vec<[P; D]>, Fallen<D>) {
        let (mut left, mut fallen) = (Vec::with_capacity(cells.len()), Fallen::default());
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
                left.push(child.map(P::new));
                rain.on(child, side, |time, within| {
                    fallen.darts += 1;
                    let dart = grid.dart(cell, slot, std::array::from_fn(|k| low[k] + within[k]));
                    if grid.is_free_among(&near, &dart) {
                        fallen.drops.push(Drop { time, dart });
                    }
                });
            }
        }
        (left, fallen)
    }

    /// The cells in the unit cube.
    pub fn cubes(&self, grid: &Grid<D>) -> Vec<Cube<D>> {
        let side = 1.0 / (grid.across << self.level) as f64;
        let cube = |cell: &[P; D]| Cube { low: cell.map(|at| at.get() as f64 * side), side };
        self.cells.iter().map(cube).collect()
    }

    /// Every lattice point of a cell.
    pub fn lattice(&self, grid: &Grid<D>, number: usize) -> Vec<Dart<D>> {
        let (cell, low) = split(&self.cells[number], self.level);
        grid.lattice(cell, low, 1.0 / (1_u64 << self.level) as f64)
    }
}
