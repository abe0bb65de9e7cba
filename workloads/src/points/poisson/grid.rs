//! Points in cells so small that each holds one at most, and the two questions that are asked of them.

use std::ops::ControlFlow;

use super::cells::{Cell, Cells};
use super::exact::{FINEST_BITS, closer};
use super::near::{MOST_HALVES, Near, square_of_difference};
use super::{Domain, PoissonError, PoissonSpec, check_room};

/// What single precision may lose of a squared distance near the radius, in squared cells: places are within 5 of a cell, so a
/// difference is off by less than 5e-7, its square near the radius (at most 3 cells) by 3e-6, and that of four axes by 6e-6.
const MARGIN: f32 = 1e-5;

/// A place that may become a point.
#[derive(Clone, Copy, Debug)]
pub(super) struct Dart<const D: usize> {
    /// The cell, as a place in the padded arrays.
    pub slot: u32,
    /// Where in the cell, in cells.
    pub place: [f32; D],
    pub point: [f64; D],
}

/// The points so far. Cells are padded by copies of those across the border (torus) or by empty ones (box).
pub(super) struct Grid<const D: usize> {
    pub radius: f64,
    pub domain: Domain,
    /// Cells along an axis.
    pub across: u64,
    /// Squared radius in squared cells.
    reach2: f64,
    cells: Cells<D>,
    pub points: Vec<[f64; D]>,
    /// Lattice points to a unit of length, a power of two, and from one to the next.
    ticks: f64,
    tick: f64,
}

impl<const D: usize> Grid<D> {
    pub fn new(spec: &PoissonSpec) -> Result<Self, PoissonError> {
        let root = (D as f64).sqrt();
        let tick = 1.0 / spec.spacing.per_unit();
        // Rounding to the lattice takes a point at most a tick out of its cell.
        let across = (root / (spec.radius * (1.0 - 1e-9) - 2.0 * tick * root)).ceil();
        let ratio = spec.radius * across;
        check_room(spec.radius, D, Cells::<D>::count(across, ratio))?;
        Ok(Self {
            radius: spec.radius,
            domain: spec.domain,
            across: across as u64,
            reach2: ratio * ratio,
            cells: Cells::new(across as u64, ratio),
            points: Vec::new(),
            ticks: spec.spacing.per_unit(),
            tick,
        })
    }

    /// The place of a cell in the padded arrays.
    #[inline]
    pub fn slot(&self, cell: [u64; D]) -> usize {
        self.cells.slot(cell)
    }

    /// Whether a cell has a point.
    #[inline]
    pub fn is_taken(&self, slot: usize) -> bool {
        self.cells.is_taken(slot)
    }

    /// The smallest squared distance from `at` in a cell to a point, or less than `enough`, in cells.
    #[inline]
    fn nearest(&self, slot: usize, at: &[f32; D], enough: f32) -> f32 {
        let mut least = f32::INFINITY;
        let _ = self.cells.visit(slot, |cell, away| {
            let from = std::array::from_fn(|axis| at[axis] - away[axis]);
            let apart2 = square_of_difference(&cell.place, &from);
            least = if apart2 < least { apart2 } else { least };
            if least < enough { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        });
        least
    }

    /// Whether a dart is at least the radius away from all points, exactly.
    #[inline]
    pub fn is_free(&self, dart: &Dart<D>) -> bool {
        let reach2 = self.reach2 as f32;
        let least = self.nearest(dart.slot as usize, &dart.place, reach2 - MARGIN);
        self.decide(least, dart)
    }

    /// Whether a dart is free by its squared distance in single precision and, where that cannot tell, exactly.
    #[inline]
    fn decide(&self, least: f32, dart: &Dart<D>) -> bool {
        let reach2 = self.reach2 as f32;
        if least < reach2 - MARGIN || least > reach2 + MARGIN {
            return least > reach2;
        }
        let closer =
            |cell: &Cell<D>| closer(&self.points[cell.index as usize], &dart.point, self.radius, self.domain);
        !self.cells.any(dart.slot as usize, |cell, _| closer(cell))
    }

    /// Collects the points near a cell: all whose disks may touch it, and some more.
    pub fn gather(&self, slot: usize, near: &mut Near<D>) {
        near.clear(slot);
        let _ = self.cells.visit::<()>(slot, |cell, away| {
            near.push(&std::array::from_fn(|axis| cell.place[axis] + away[axis]));
            ControlFlow::Continue(())
        });
    }

    /// Room for the points near a cell.
    pub fn near(&self) -> Near<D> {
        Near::new(self.cells.neighbours())
    }

    /// Keeps those of the points near a cell whose disks may touch a cube in it.
    #[inline]
    pub fn narrow(&self, cell: &Near<D>, low: &[f64; D], side: f64, near: &mut Near<D>) {
        near.take_within(cell, &low.map(|low| low as f32), side as f32, self.reach2 as f32 + MARGIN);
    }

    /// Whether a dart is free, by the points near its cell.
    #[inline]
    pub fn is_free_among(&self, near: &Near<D>, dart: &Dart<D>) -> bool {
        self.decide(near.nearest(&dart.place), dart)
    }

    /// Which halves along each axis of a cube in the cell of `near` one disk surely covers: a bit for each, by low corner and side of
    /// a half, in cells.
    #[inline]
    pub fn covers(&self, near: &Near<D>, low: &[f64; D], side: f64) -> u32 {
        let middle = |axis: usize, upper: u32| low[axis] + (f64::from(upper) + 0.5) * side;
        let middles = std::array::from_fn(|axis| [0, 1].map(|upper| middle(axis, upper) as f32));
        let least: [f32; MOST_HALVES] = near.of_halves(&middles, 0.5 * side as f32);
        let enough = self.reach2 as f32 - MARGIN;
        let mut covered = (0..1 << D).fold(0, |bits, half| bits | u32::from(least[half] < enough) << half);
        if 0.5 * side < FINE {
            let roughly = covered;
            for half in (0..1_u32 << D).filter(|half| roughly >> half & 1 == 0) {
                let middle = std::array::from_fn(|axis| middle(axis, half >> axis & 1));
                covered |= u32::from(self.covers_finely(near.slot, &middle, 0.5 * side)) << half;
            }
        }
        covered
    }

    /// Whether one does by double precision: middle and half a side.
    fn covers_finely(&self, slot: usize, middle: &[f64; D], half: f64) -> bool {
        let enough = self.reach2 - self.across as f64 * 64.0 * f64::EPSILON;
        self.cells.any(slot, |cell, away| {
            let place = self.place(&self.points[cell.index as usize]);
            let apart = |k: usize| (place[k] + f64::from(away[k]) - middle[k]).abs() + half;
            (0..D).map(|k| apart(k) * apart(k)).sum::<f64>() < enough
        })
    }

    /// Where in its cell a point is.
    fn place(&self, point: &[f64; D]) -> [f64; D] {
        let across = self.across as f64;
        point.map(|x| x * across - self.cell_of(x) as f64)
    }

    /// The dart at `at`, cells and parts of one along each axis, moved to the lattice.
    #[inline]
    pub fn dart(&self, cell: [u64; D], slot: usize, at: [f64; D]) -> Dart<D> {
        let across = self.across as f64;
        let point: [f64; D] = std::array::from_fn(|k| {
            let tick = ((cell[k] as f64 + at[k]) / across * self.ticks) as i64 as f64;
            tick.min(self.ticks - 1.0) * self.tick
        });
        let place = std::array::from_fn(|k| (point[k] * across - cell[k] as f64) as f32);
        Dart { slot: slot as u32, place, point }
    }

    /// The dart at a point of the unit cube, moved to the lattice.
    pub fn dart_at(&self, point: &[f64; D]) -> Dart<D> {
        let cell = point.map(|x| self.cell_of(x));
        let at = std::array::from_fn(|k| point[k] * self.across as f64 - cell[k] as f64);
        self.dart(cell, self.slot(cell), at)
    }

    fn cell_of(&self, x: f64) -> u64 {
        ((x * self.across as f64) as u64).min(self.across - 1)
    }

    /// Adds a point to its cell and to the copies of that across the border.
    pub fn insert(&mut self, dart: &Dart<D>) {
        let index = self.points.len() as u32;
        self.points.push(dart.point);
        let cell = Cell { place: dart.place, index };
        match self.domain {
            Domain::Torus => self.cells.set_copies(dart.slot as usize, cell),
            Domain::Box => self.cells.set(dart.slot as usize, cell),
        }
    }

    /// The lattice points of a cube in a cell (low corner and side in cells), with a tick more on each side.
    pub fn lattice(&self, cell: [u64; D], low: [f64; D], side: f64) -> Vec<Dart<D>> {
        let tick = self.across as f64 / self.ticks;
        let along = (side / tick).ceil() as u64 + 2;
        let count = along.pow(D as u32);
        let at = |number: u64| {
            std::array::from_fn(|k| {
                let step = number / along.pow(k as u32) % along;
                (low[k] + (step as f64 - 1.0) * tick).clamp(0.0, 1.0)
            })
        };
        (0..count).map(|number| self.dart(cell, self.slot(cell), at(number))).collect()
    }

    /// Whether a cube of this level is no wider than a few lattice points.
    pub fn is_finest(&self, level: u32) -> bool {
        let side = self.ticks / (self.across as f64 * (1_u64 << level) as f64);
        side <= 4.0 || level + 1 >= FINEST_BITS
    }
}

/// Half a side of a cube from which on double precision is worth its time, in cells.
const FINE: f64 = 1.0 / 1024.0;

#[cfg(test)]
mod tests {
    use super::super::Spacing;
    use super::*;
    use crate::points::random::Stream;

    fn grid(radius: f64, domain: Domain, spacing: Spacing) -> Grid<2> {
        Grid::new(&PoissonSpec { radius, domain, seed: 1, spacing }).unwrap()
    }

    #[test]
    fn a_dart_at_the_radius_is_free_and_one_a_tick_nearer_is_not() {
        let tick = 1.0 / Spacing::Double.per_unit();
        for domain in [Domain::Torus, Domain::Box] {
            let mut grid = grid(0.25, domain, Spacing::Double);
            grid.insert(&grid.dart_at(&[0.5, 0.5]));
            for sign in [-1.0, 1.0] {
                let free = |from: f64| grid.is_free(&grid.dart_at(&[0.5 + sign * from, 0.5]));
                assert!(free(0.25) && free(0.25 + tick) && !free(0.25 - tick), "{domain:?} {sign}");
            }
        }
    }

    /// Against the distance of the farthest corner in double precision, for cubes of any size whose corner is about at the radius.
    #[test]
    fn what_is_said_to_be_covered_is_and_what_is_not_nearly_is_not() {
        let mut grid = grid(0.03, Domain::Box, Spacing::Double);
        let point = grid.dart_at(&[0.5031, 0.4987]);
        grid.insert(&point);
        let (across, stream) = (grid.across as f64, Stream::new(7, 0));
        let (mut covered, mut all, mut near) = (0, grid.near(), grid.near());
        for number in 0..20_000_u64 {
            let turn = stream.of(number);
            let (angle, level) = (turn.unit(0) * std::f64::consts::TAU, 1 + turn.below(1, 30) as u32);
            let off = (turn.unit(2) - 0.5) * 10.0_f64.powf(-9.0 * turn.unit(3));
            let place = [angle.cos(), angle.sin()].map(|c| c * grid.reach2.sqrt() * (1.0 + off));
            let at: [f64; 2] = std::array::from_fn(|k| point.point[k] * across + place[k]);
            let (cell, side) = (at.map(|x| x as u64), 1.0 / (1_u64 << level) as f64);
            let low: [f64; 2] =
                std::array::from_fn(|k| ((at[k] - cell[k] as f64) / (2.0 * side)).floor() * 2.0 * side);
            grid.gather(grid.slot(cell), &mut all);
            grid.narrow(&all, &low, 2.0 * side, &mut near);
            let said = grid.covers(&near, &low, side);
            for half in 0..4_u32 {
                let far2: f64 = (0..2)
                    .map(|k| {
                        let low = cell[k] as f64 + low[k] + f64::from(half >> k & 1) * side;
                        let from = point.point[k] * across;
                        (low - from).abs().max((low + side - from).abs()).powi(2)
                    })
                    .sum();
                let (is_said, over) = (said >> half & 1 != 0, far2 - grid.reach2);
                assert!(!is_said || over < 1e-12, "level {level}: {over:e}");
                let margin = if 0.5 * side < FINE { 1e-9 } else { 4.0 * f64::from(MARGIN) };
                assert!(is_said || over > -margin, "level {level}: {over:e}");
                covered += u32::from(is_said);
            }
        }
        assert!((5_000..70_000).contains(&covered), "{covered}");
    }

    #[test]
    fn no_number_of_a_cube_is_left_out() {
        let grid = grid(0.001, Domain::Box, Spacing::Single);
        let (across, ticks, side) = (grid.across as f64, grid.ticks, 3.3 * grid.across as f64 / grid.ticks);
        let stream = Stream::new(1, 1);
        for number in 0..200 {
            let cell = [stream.below(4 * number, grid.across), stream.below(4 * number + 1, grid.across)];
            let low = [2, 3].map(|at| stream.unit(4 * number + at) * (1.0 - side));
            let found: Vec<_> = grid.lattice(cell, low, side).iter().map(|dart| dart.point).collect();
            let numbers = |k: usize| {
                let [from, to] = [low[k], low[k] + side].map(|at| (cell[k] as f64 + at) / across * ticks);
                (from.ceil() as u64..=to.floor() as u64).map(|tick| tick as f64 / ticks)
            };
            for x in numbers(0) {
                assert!(numbers(1).all(|y| found.contains(&[x, y])), "{cell:?} {low:?}");
            }
            assert!(numbers(0).count() >= 3);
        }
    }
}
