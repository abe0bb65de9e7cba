//! Grid of cells that hold one point at most, with the tests whether a dart is free and a cell is covered.

use std::ops::ControlFlow;

use super::cells::{Cell, Cells, MAX_HALVES, Near, square_of_difference};
use super::{Domain, PoissonError, PoissonSpec, check_room};

/// Error bound of a squared distance near the radius in single precision, in squared cells. Positions are
/// within 5 of a cell, so a difference is off by less than 5e-7. Its square near the radius (at most 3 cells)
/// is off by 3e-6, and that of four axes by 6e-6.
const MARGIN: f32 = 1e-5;

/// A candidate for a point.
#[derive(Clone, Copy, Debug)]
pub(super) struct Dart<const D: usize> {
    /// Index of the cell in the padded arrays.
    pub slot: u32,
    /// Position in the cell, in cells.
    pub place: [f32; D],
    pub point: [f64; D],
}

/// The points so far. The padding holds copies across the border (torus) or empty cells (box).
pub(super) struct Grid<const D: usize> {
    pub radius: f64,
    pub domain: Domain,
    /// Cells along an axis.
    pub across: u64,
    /// Squared radius in squared cells.
    reach2: f64,
    cells: Cells<D>,
    pub points: Vec<[f64; D]>,
    /// Representable coordinates per unit of length, a power of two.
    ticks: f64,
    /// Distance of neighbouring representable coordinates.
    tick: f64,
}

impl<const D: usize> Grid<D> {
    pub fn new(spec: &PoissonSpec) -> Result<Self, PoissonError> {
        let root = (D as f64).sqrt();
        let tick = 1.0 / spec.spacing.per_unit();
        // Rounding to representable coordinates moves a point at most one tick out of its cell.
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

    /// Index of a cell in the padded arrays.
    #[inline]
    pub fn slot(&self, cell: [u64; D]) -> usize {
        self.cells.slot(cell)
    }

    /// Whether a cell has a point.
    #[inline]
    pub fn is_taken(&self, slot: usize) -> bool {
        self.cells.is_taken(slot)
    }

    /// Smallest squared distance from `at` in a cell to a point, in cells; any value below `enough` ends the
    /// search.
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

    /// Decides by the squared distance in single precision, or exactly if rounding could decide.
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

    /// Allocates room for the points near a cell.
    pub fn near(&self) -> Near<D> {
        Near::new(self.cells.neighbours())
    }

    /// Keeps the points whose disks may touch a cube in the cell.
    #[inline]
    pub fn narrow(&self, cell: &Near<D>, low: &[f64; D], side: f64, near: &mut Near<D>) {
        near.take_within(cell, &low.map(|low| low as f32), side as f32, self.reach2 as f32 + MARGIN);
    }

    /// Whether a dart is free of the points near its cell.
    #[inline]
    pub fn is_free_among(&self, near: &Near<D>, dart: &Dart<D>) -> bool {
        self.decide(near.nearest(&dart.place), dart)
    }

    /// Bit mask of the halves of a cube that a single disk covers with certainty. `low` and `side` are those
    /// of a half, in cells.
    #[inline]
    pub fn covers(&self, near: &Near<D>, low: &[f64; D], side: f64) -> u32 {
        let middle = |axis: usize, upper: u32| low[axis] + (f64::from(upper) + 0.5) * side;
        let middles = std::array::from_fn(|axis| [0, 1].map(|upper| middle(axis, upper) as f32));
        let least: [f32; MAX_HALVES] = near.of_halves(&middles, 0.5 * side as f32);
        let enough = self.reach2 as f32 - MARGIN;
        let mut covered = (0..1 << D).fold(0, |bits, half| bits | u32::from(least[half] < enough) << half);
        if 0.5 * side < MAX_FINE_HALF_SIDE {
            let roughly = covered;
            for half in (0..1_u32 << D).filter(|half| roughly >> half & 1 == 0) {
                let middle = std::array::from_fn(|axis| middle(axis, half >> axis & 1));
                covered |= u32::from(self.covers_finely(near.slot, &middle, 0.5 * side)) << half;
            }
        }
        covered
    }

    /// The same for one half, in double precision.
    fn covers_finely(&self, slot: usize, middle: &[f64; D], half: f64) -> bool {
        let enough = self.reach2 - self.across as f64 * 64.0 * f64::EPSILON;
        self.cells.any(slot, |cell, away| {
            let place = self.place(&self.points[cell.index as usize]);
            let apart = |k: usize| (place[k] + f64::from(away[k]) - middle[k]).abs() + half;
            (0..D).map(|k| apart(k) * apart(k)).sum::<f64>() < enough
        })
    }

    /// Position of a point in its cell.
    fn place(&self, point: &[f64; D]) -> [f64; D] {
        let across = self.across as f64;
        point.map(|x| x * across - self.cell_of(x) as f64)
    }

    /// Dart at `at` in a cell, in cells, rounded to representable coordinates.
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

    /// Dart at a point of the unit cube, rounded to representable coordinates.
    pub fn dart_at(&self, point: &[f64; D]) -> Dart<D> {
        let cell = point.map(|x| self.cell_of(x));
        let at = std::array::from_fn(|k| point[k] * self.across as f64 - cell[k] as f64);
        self.dart(cell, self.slot(cell), at)
    }

    fn cell_of(&self, x: f64) -> u64 {
        ((x * self.across as f64) as u64).min(self.across - 1)
    }

    /// Adds a point to its cell and to the copies across the border.
    pub fn insert(&mut self, dart: &Dart<D>) {
        let index = self.points.len() as u32;
        self.points.push(dart.point);
        let cell = Cell { place: dart.place, index };
        match self.domain {
            Domain::Torus => self.cells.set_copies(dart.slot as usize, cell),
            Domain::Box => self.cells.set(dart.slot as usize, cell),
        }
    }

    /// Representable points of a cube in a cell, with one more tick on each side; low corner and side in
    /// cells.
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

    /// Whether a cube of this level is no wider than a few representable coordinates.
    pub fn is_finest(&self, level: u32) -> bool {
        let side = self.ticks / (self.across as f64 * (1_u64 << level) as f64);
        side <= 4.0 || level + 1 >= FINEST_BITS
    }
}

/// Half side, in cells, below which double precision is worth its time.
const MAX_FINE_HALF_SIDE: f64 = 1.0 / 1024.0;

/// Coordinates are multiples of 2^-52, or of a coarser power of two.
pub(super) const FINEST_BITS: u32 = 52;

/// Whether two points are closer than `radius` (0 to 1/2), exactly. The squares of multiples of 2^-52 fit in
/// 128 bits.
pub fn closer<const D: usize>(a: &[f64; D], b: &[f64; D], radius: f64, domain: Domain) -> bool {
    let whole = 1_u64 << FINEST_BITS;
    let square = |k: usize| {
        let apart = ((a[k] - b[k]).abs() * whole as f64) as u64;
        let apart = if domain == Domain::Torus { apart.min(whole - apart) } else { apart };
        u128::from(apart) * u128::from(apart)
    };
    let sum: u128 = (0..D).map(square).sum();
    // radius = mantissa 2^exponent, and the sum is in units of 2^-104.
    let bits = radius.to_bits();
    let (mantissa, exponent) = ((bits & ((1 << 52) - 1)) | 1 << 52, (bits >> 52) as i32 - 1075);
    let shift = (-(2 * exponent + 2 * FINEST_BITS as i32)).max(0) as u32;
    sum.leading_zeros() >= shift && sum << shift < u128::from(mantissa) * u128::from(mantissa)
}

#[cfg(test)]
mod tests {
    use super::super::Spacing;
    use super::*;
    use crate::points::Stream;

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

    /// Compares with the distance of the farthest corner in double precision, for cubes of any size with a
    /// corner near the radius.
    #[test]
    fn coverage_is_conservative_and_tight() {
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
                let margin = if 0.5 * side < MAX_FINE_HALF_SIDE { 1e-9 } else { 4.0 * f64::from(MARGIN) };
                assert!(is_said || over > -margin, "level {level}: {over:e}");
                covered += u32::from(is_said);
            }
        }
        assert!((5_000..70_000).contains(&covered), "{covered}");
    }

    #[test]
    fn every_representable_point_of_a_cube_is_listed() {
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

    #[test]
    fn the_comparison_is_exact_to_the_last_bit() {
        let tick = 1.0 / (1_u64 << 52) as f64;
        for radius in [0.3, 0.5, 0.001, 1.0 / 3.0, 1e-6, 0.25] {
            let across = (radius / tick).ceil() * tick;
            let at = |x: f64| [[0.0, 0.5], [x, 0.5]];
            let [a, b] = at(across);
            assert!(!closer(&a, &b, radius, Domain::Box), "{radius}");
            let [a, b] = at(across - tick);
            assert!(closer(&a, &b, radius, Domain::Box) == (across - tick < radius), "{radius}");
        }
        // A 3-4-5 triangle: a point exactly at the radius is not closer.
        assert!(!closer(&[0.0, 0.0], &[0.1875, 0.25], 0.3125, Domain::Box));
        assert!(closer(&[0.0, 0.0], &[0.1875, 0.25 - tick], 0.3125, Domain::Box));
    }

    #[test]
    fn a_torus_has_no_border() {
        assert!(closer(&[0.001, 0.5], &[0.999, 0.5], 0.01, Domain::Torus));
        assert!(!closer(&[0.001, 0.5], &[0.999, 0.5], 0.01, Domain::Box));
    }
}
