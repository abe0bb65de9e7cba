//! Points in cells so small that each holds one at most, and the two questions that are asked of them.

use super::exact::{FINEST_BITS, closer};
use super::near::{FAR, LANES, Near, Row, rows, smallest};
use super::{Domain, PoissonError, PoissonSpec};

/// What single precision may lose of a squared distance near the radius, in squared cells: places are within 5 of a cell, so a
/// difference is off by less than 5e-7, its square near the radius (at most 3 cells) by 3e-6, and that of four axes by 6e-6.
const MARGIN: f32 = 1e-5;
/// Cells that memory is taken for at most.
const MOST_CELLS: f64 = (1_u64 << 28) as f64;

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
    /// Cells of padding on each side.
    pad: u64,
    strides: [u64; D],
    lanes: [f32; LANES],
    rows: Vec<Row<D>>,
    /// Where in its cell the point of each is, by axis.
    places: [Vec<f32>; D],
    /// Which point it is.
    index: Vec<u32>,
    pub points: Vec<[f64; D]>,
    /// Lattice points to a unit of length.
    ticks: f64,
}

impl<const D: usize> Grid<D> {
    pub fn new(spec: &PoissonSpec) -> Result<Self, PoissonError> {
        let root = (D as f64).sqrt();
        let tick = 1.0 / spec.spacing.per_unit();
        // Rounding to the lattice takes a point at most a tick out of its cell.
        let across = (root / (spec.radius * (1.0 - 1e-9) - 2.0 * tick * root)).ceil();
        let ratio = spec.radius * across;
        let pad = (ratio + 1.0).ceil() - 1.0;
        let length = across + 2.0 * pad;
        if length.powi(D as i32) > MOST_CELLS {
            return Err(PoissonError::TooMany { cells: length.powi(D as i32), most: MOST_CELLS });
        }
        let (across, pad, length) = (across as u64, pad as u64, length as u64);
        let strides = std::array::from_fn(|axis| length.pow(axis as u32));
        let cells = length.pow(D as u32) as usize;
        Ok(Self {
            radius: spec.radius,
            domain: spec.domain,
            across,
            reach2: ratio * ratio,
            pad,
            strides,
            lanes: std::array::from_fn(|lane| lane as f32 - pad as f32),
            rows: rows(pad as i64, &strides, ratio),
            places: std::array::from_fn(|_| vec![FAR; cells + LANES]),
            index: vec![u32::MAX; cells],
            points: Vec::new(),
            ticks: spec.spacing.per_unit(),
        })
    }

    /// The place of a cell in the padded arrays.
    pub fn slot(&self, cell: [u64; D]) -> usize {
        (0..D).map(|axis| (cell[axis] + self.pad) * self.strides[axis]).sum::<u64>() as usize
    }

    /// Whether a cell has a point.
    pub fn is_taken(&self, slot: usize) -> bool {
        self.places[0][slot] != FAR
    }

    /// The smallest squared distance from `at` in a cell to a point, or less than `enough`, in cells.
    #[inline]
    fn nearest(&self, slot: usize, at: &[f32; D], enough: f32) -> f32 {
        let mut least = [f32::INFINITY; LANES];
        for row in &self.rows {
            let first = (slot as isize + row.offset) as usize;
            let mut sums = [0.0_f32; LANES];
            for axis in 0..D {
                let places = &self.places[axis][first..first + LANES];
                let from = at[axis] - row.away[axis];
                for lane in 0..LANES {
                    let from = if axis == 0 { at[0] - self.lanes[lane] } else { from };
                    let apart = places[lane] - from;
                    sums[lane] += apart * apart;
                }
            }
            for lane in 0..LANES {
                least[lane] = if sums[lane] < least[lane] { sums[lane] } else { least[lane] };
            }
            if D > 2 && smallest(least) < enough {
                break;
            }
        }
        smallest(least)
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
        let mut near = self.neighbours(dart.slot as usize);
        !near.any(|(point, _)| closer(&self.points[point as usize], &dart.point, self.radius, self.domain))
    }

    /// Collects the points whose disks may touch a cell.
    pub fn gather(&self, slot: usize, near: &mut Near<D>) {
        near.slot = slot;
        let (mut count, reach2) = (0, self.reach2 as f32 + MARGIN);
        let room = self.rows.len() * LANES + LANES;
        near.places.iter_mut().for_each(|places| places.resize(room, FAR));
        for row in &self.rows {
            let first = (slot as isize + row.offset) as usize;
            for lane in 0..=2 * self.pad as usize {
                let mut gap2 = 0.0;
                for axis in 0..D {
                    let away = if axis == 0 { self.lanes[lane] } else { row.away[axis] };
                    let place = self.places[axis][first + lane] + away;
                    near.places[axis][count] = place;
                    let gap = place - place.clamp(0.0, 1.0);
                    gap2 += gap * gap;
                }
                count += usize::from(gap2 < reach2);
            }
        }
        let padded = count.next_multiple_of(LANES);
        near.places.iter_mut().for_each(|places| places[count..padded].fill(FAR));
        near.padded = padded;
    }

    /// Whether a dart is free, by the points near its cell.
    #[inline]
    pub fn is_free_among(&self, near: &Near<D>, dart: &Dart<D>) -> bool {
        self.decide(near.nearest(&dart.place, 0.0), dart)
    }

    /// Whether one disk surely covers a cube in the cell of `near`: middle and half a side, in cells.
    #[inline]
    pub fn covers(&self, near: &Near<D>, middle: &[f64; D], half: f64) -> bool {
        let at = middle.map(|at| at as f32);
        near.nearest(&at, half as f32) < self.reach2 as f32 - MARGIN
            || half < FINE && self.covers_finely(near.slot, middle, half)
    }

    /// The same in double precision.
    fn covers_finely(&self, slot: usize, middle: &[f64; D], half: f64) -> bool {
        let enough = self.reach2 - self.across as f64 * 64.0 * f64::EPSILON;
        self.neighbours(slot).any(|(point, away)| {
            let place = self.place(&self.points[point as usize]);
            let apart = |k: usize| (place[k] + away[k] as f64 - middle[k]).abs() + half;
            (0..D).map(|k| apart(k) * apart(k)).sum::<f64>() < enough
        })
    }

    /// Where in its cell a point is.
    fn place(&self, point: &[f64; D]) -> [f64; D] {
        let across = self.across as f64;
        point.map(|x| x * across - self.cell_of(x) as f64)
    }

    /// The points in the neighbourhood of a cell, with the cells that they are away.
    fn neighbours(&self, slot: usize) -> impl Iterator<Item = (u32, [f32; D])> {
        let rows = self.rows.iter().flat_map(move |row| {
            (0..=2 * self.pad as usize).map(move |lane| {
                let mut away = row.away;
                away[0] = self.lanes[lane];
                (self.index[(slot as isize + row.offset) as usize + lane], away)
            })
        });
        rows.filter(|(point, _)| *point != u32::MAX)
    }

    /// The dart at `at`, cells and parts of one along each axis, moved to the lattice.
    #[inline]
    pub fn dart(&self, cell: [u64; D], slot: usize, at: [f64; D]) -> Dart<D> {
        let across = self.across as f64;
        let point: [f64; D] = std::array::from_fn(|k| {
            let tick = ((cell[k] as f64 + at[k]) / across * self.ticks) as i64 as f64;
            tick.min(self.ticks - 1.0) / self.ticks
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
        self.set(dart.slot as usize, dart, index);
        if self.domain == Domain::Torus {
            self.copies(dart, index);
        }
    }

    fn set(&mut self, slot: usize, dart: &Dart<D>, index: u32) {
        for axis in 0..D {
            self.places[axis][slot] = dart.place[axis];
        }
        self.index[slot] = index;
    }

    fn copies(&mut self, dart: &Dart<D>, index: u32) {
        let (pad, across) = (self.pad, self.across);
        let length = across + 2 * pad;
        let padded: [u64; D] = std::array::from_fn(|k| u64::from(dart.slot) / self.strides[k] % length);
        if padded.iter().all(|&at| at >= 2 * pad && at + 2 * pad < length) {
            return;
        }
        // Every multiple of the period that lies in the padded range, along each axis.
        let images = padded.map(|at| (at % across..length).step_by(across as usize).collect::<Vec<_>>());
        let count: usize = images.iter().map(Vec::len).product();
        for number in 0..count {
            let (mut rest, mut slot) = (number, 0);
            for axis in 0..D {
                slot += images[axis][rest % images[axis].len()] * self.strides[axis];
                rest /= images[axis].len();
            }
            self.set(slot as usize, dart, index);
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
