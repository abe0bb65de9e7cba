//! Cells of the grid with at most one point each, the neighbourhood of a cell, and the points near it.

use std::ops::ControlFlow;

/// A cell with a point.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cell<const D: usize> {
    /// Position in the cell.
    pub place: [f32; D],
    /// Index of the point.
    pub index: u32,
}

/// A square or cube of cells, padded on each side. A bit mask marks the cells with a point, as few have one.
/// A neighbourhood is a few words, and only cells with a point are read.
pub(super) struct Cells<const D: usize> {
    /// Cells of padding on each side.
    pad: u64,
    /// Cells along an axis, padding included.
    length: u64,
    strides: [u64; D],
    /// Rows of cells whose disks may reach into a cell, as offsets from the cell to the first of each row.
    rows: Vec<isize>,
    /// Rows per word of the bit mask.
    rows_per_word: usize,
    /// Offset of the cell of each bit of each word.
    steps: Vec<Step<D>>,
    /// A bit per cell: whether it has a point.
    taken: Vec<u8>,
    cells: Vec<Cell<D>>,
}

impl<const D: usize> Cells<D> {
    /// `across` cells along each axis; disks reach over `reach` of them.
    pub fn new(across: u64, reach: f64) -> Self {
        let pad = pad(reach);
        let length = across + 2 * pad;
        let strides = std::array::from_fn(|axis| length.pow(axis as u32));
        let count = length.pow(D as u32) as usize;
        let rows = rows(pad as i64, &strides, reach);
        let rows_per_word = CELLS_PER_WORD / (2 * pad as usize + 1);
        Self {
            pad,
            length,
            strides,
            steps: steps(&rows, pad, rows_per_word),
            rows: rows.iter().map(|row| row.offset).collect(),
            rows_per_word,
            taken: vec![0; count / 8 + 4],
            cells: vec![Cell { place: [0.0; D], index: 0 }; count],
        }
    }

    /// Number of cells, padding included.
    pub fn count(across: f64, reach: f64) -> f64 {
        (across + 2.0 * pad(reach) as f64).powi(D as i32)
    }

    /// Most cells with a point near a cell.
    pub fn neighbours(&self) -> usize {
        self.steps.len()
    }

    /// Index of a cell.
    #[inline]
    pub fn slot(&self, cell: [u64; D]) -> usize {
        (0..D).map(|axis| (cell[axis] + self.pad) * self.strides[axis]).sum::<u64>() as usize
    }

    /// Whether a cell has a point.
    #[inline]
    pub fn is_taken(&self, slot: usize) -> bool {
        self.taken[slot / 8] >> (slot % 8) & 1 != 0
    }

    /// Sets the point of a cell.
    pub fn set(&mut self, slot: usize, cell: Cell<D>) {
        self.taken[slot / 8] |= 1 << (slot % 8);
        self.cells[slot] = cell;
    }

    /// Visits the cells with a point near a cell, nearest rows first, with their offsets in cells, until
    /// `each` breaks.
    #[inline]
    pub fn visit<B>(
        &self,
        slot: usize,
        mut each: impl FnMut(&Cell<D>, &[f32; D]) -> ControlFlow<B>,
    ) -> ControlFlow<B> {
        for (rows, steps) in self.rows.chunks(self.rows_per_word).zip(self.steps.chunks(CELLS_PER_WORD)) {
            let mut bits = self.taken_in(slot, rows);
            while bits != 0 {
                let step = &steps[bits.trailing_zeros() as usize];
                bits &= bits - 1;
                each(&self.cells[(slot as isize + step.offset) as usize], &step.away)?;
            }
        }
        ControlFlow::Continue(())
    }

    /// Whether a predicate holds for any cell with a point near a cell.
    pub fn any(&self, slot: usize, is_so: impl Fn(&Cell<D>, &[f32; D]) -> bool) -> bool {
        let found = |cell: &Cell<D>, away: &[f32; D]| match is_so(cell, away) {
            true => ControlFlow::Break(()),
            false => ControlFlow::Continue(()),
        };
        self.visit(slot, found).is_break()
    }

    /// A bit per cell of a few rows near a cell: whether it has a point.
    #[inline]
    fn taken_in(&self, slot: usize, rows: &[isize]) -> u64 {
        let width = 2 * self.pad + 1;
        let mask = (1_u64 << width) - 1;
        let mut bits = 0;
        for (offset, shift) in rows.iter().zip((0..).step_by(width as usize)) {
            let first = (slot as isize + offset) as usize;
            let two = [self.taken[first / 8], self.taken[first / 8 + 1]];
            bits |= (u64::from(u16::from_le_bytes(two)) >> (first % 8) & mask) << shift;
        }
        bits
    }

    /// Sets the point of a cell and of its copies in the padding of a torus.
    pub fn set_copies(&mut self, slot: usize, cell: Cell<D>) {
        let (pad, length) = (self.pad, self.length);
        let across = length - 2 * pad;
        let padded: [u64; D] = std::array::from_fn(|k| slot as u64 / self.strides[k] % length);
        if padded.iter().all(|&at| at >= 2 * pad && at + 2 * pad < length) {
            return self.set(slot, cell);
        }
        // All periodic images in the padded range, along each axis.
        let images = padded.map(|at| (at % across..length).step_by(across as usize).collect::<Vec<_>>());
        let count: usize = images.iter().map(Vec::len).product();
        for number in 0..count {
            let (mut rest, mut slot) = (number, 0);
            for axis in 0..D {
                slot += images[axis][rest % images[axis].len()] * self.strides[axis];
                rest /= images[axis].len();
            }
            self.set(slot as usize, cell);
        }
    }
}

/// Cells per word of the bit mask.
const CELLS_PER_WORD: usize = 64;

/// Cells on each side that a disk may reach from a point of a cell.
fn pad(reach: f64) -> u64 {
    ((reach + 1.0).ceil() - 1.0) as u64
}

/// Neighbours in a row along the first axis.
#[derive(Clone, Copy, Debug)]
struct Row<const D: usize> {
    /// Offset from a cell to the first of the row.
    offset: isize,
    /// The same along each axis, in cells.
    away: [f32; D],
}

/// Rows that may reach into a cell, nearest first.
fn rows<const D: usize>(pad: i64, strides: &[u64; D], reach: f64) -> Vec<Row<D>> {
    let along = 2 * pad + 1;
    let row = |number: i64| {
        let away: [i64; D] = std::array::from_fn(|axis| match axis {
            0 => -pad,
            _ => number / along.pow(axis as u32 - 1) % along - pad,
        });
        let gap = |at: i64| (at.abs() - 1).max(0) as f64;
        let apart: f64 = away[1..].iter().map(|&at| gap(at) * gap(at)).sum();
        let size: i64 = away[1..].iter().map(|at| at * at).sum();
        let offset = (0..D).map(|axis| away[axis] * strides[axis] as i64).sum::<i64>() as isize;
        (apart, size, Row { offset, away: away.map(|at| at as f32) })
    };
    let mut all: Vec<_> = (0..along.pow(D as u32 - 1)).map(row).collect();
    all.retain(|(apart, _, _)| *apart < reach * reach);
    all.sort_by_key(|(_, size, _)| *size);
    all.into_iter().map(|(_, _, row)| row).collect()
}

/// A neighbour of a cell.
#[derive(Clone, Copy, Debug)]
struct Step<const D: usize> {
    offset: isize,
    /// Offset along each axis, in cells.
    away: [f32; D],
}

/// The cells of rows, with `rows_per_word` rows per word.
fn steps<const D: usize>(rows: &[Row<D>], pad: u64, rows_per_word: usize) -> Vec<Step<D>> {
    let width = 2 * pad as usize + 1;
    let of_word = |rows: &[Row<D>]| {
        let step = |place: usize| {
            let (row, lane) = (&rows[(place / width).min(rows.len() - 1)], place % width);
            let mut away = row.away;
            away[0] += lane as f32;
            Step { offset: row.offset + lane as isize, away }
        };
        (0..CELLS_PER_WORD).map(step).collect::<Vec<_>>()
    };
    rows.chunks(rows_per_word).flat_map(of_word).collect()
}

/// Points per vector.
const LANES: usize = 8;
/// Points per word of the bit mask.
const POINTS_PER_WORD: usize = 64;
/// A position too far away to matter.
const FAR: f32 = 1e9;

/// The points near a cell, or those of them whose disks may touch a cube in it.
pub(super) struct Near<const D: usize> {
    pub slot: usize,
    /// Positions relative to the low corner of the cell, in cells, by axis; padded to whole words.
    places: [Vec<f32>; D],
    count: usize,
}

/// Most cubes that a cube is halved into.
pub(super) const MAX_HALVES: usize = 16;

impl<const D: usize> Near<D> {
    /// Empty, with room for so many points.
    pub fn new(room: usize) -> Self {
        let room = room.next_multiple_of(POINTS_PER_WORD) + POINTS_PER_WORD;
        Self { slot: usize::MAX, places: std::array::from_fn(|_| vec![FAR; room]), count: 0 }
    }

    /// Whether the points are those near this cell.
    pub fn is_of(&self, slot: usize) -> bool {
        self.slot == slot
    }

    /// Removes all points and sets another cell.
    pub fn clear(&mut self, slot: usize) {
        (self.slot, self.count) = (slot, 0);
    }

    /// Adds a point.
    #[inline]
    pub fn push(&mut self, place: &[f32; D]) {
        for (places, at) in self.places.iter_mut().zip(place) {
            places[self.count] = *at;
        }
        self.count += 1;
    }

    /// Takes the points of `all` whose squared distance from a cube is below `reach2`.
    #[inline]
    pub fn take_within(&mut self, all: &Self, low: &[f32; D], side: f32, reach2: f32) {
        self.clear(all.slot);
        for first in (0..all.count).step_by(POINTS_PER_WORD) {
            let count = (all.count - first).min(POINTS_PER_WORD);
            let mut bits = 0;
            for block in (0..count).step_by(LANES) {
                bits |= u64::from(all.within(first + block, low, side, reach2)) << block;
            }
            bits &= u64::MAX >> (POINTS_PER_WORD - count);
            while bits != 0 {
                let from = first + bits.trailing_zeros() as usize;
                bits &= bits - 1;
                self.push(&std::array::from_fn(|axis| all.places[axis][from]));
            }
        }
    }

    /// Bit mask of the points of a block within that distance of a cube.
    #[inline]
    fn within(&self, first: usize, low: &[f32; D], side: f32, reach2: f32) -> u8 {
        let mut sums = [0.0_f32; LANES];
        for (places, low) in self.places.iter().zip(low) {
            let places = &places[first..first + LANES];
            for lane in 0..LANES {
                let within = places[lane] - low;
                let gap = larger(larger(-within, within - side), 0.0);
                sums[lane] += gap * gap;
            }
        }
        (0..LANES).fold(0, |bits, lane| bits | u8::from(sums[lane] < reach2) << lane)
    }

    /// Smallest squared distance from a point to the farthest corner of each half of a cube, from the middles
    /// of lower and upper halves and half their side. Bits of the index select the upper half of an axis.
    #[inline]
    pub fn of_halves(&self, middles: &[[f32; 2]; D], half: f32) -> [f32; MAX_HALVES] {
        let mut least = [f32::INFINITY; MAX_HALVES];
        for point in 0..self.count {
            let mut sums = [0.0_f32; MAX_HALVES];
            for axis in 0..D {
                let [lower, upper] = middles[axis].map(|middle| {
                    let apart = (self.places[axis][point] - middle).abs() + half;
                    apart * apart
                });
                for corner in 0..1 << axis {
                    sums[corner + (1 << axis)] = sums[corner] + upper;
                    sums[corner] += lower;
                }
            }
            for corner in 0..1 << D {
                least[corner] = if sums[corner] < least[corner] { sums[corner] } else { least[corner] };
            }
        }
        least
    }

    /// Smallest squared distance from a position to a point.
    #[inline]
    pub fn nearest(&self, at: &[f32; D]) -> f32 {
        (0..self.count).fold(f32::INFINITY, |least, point| {
            let apart2 = square_of_difference(&std::array::from_fn(|axis| self.places[axis][point]), at);
            if apart2 < least { apart2 } else { least }
        })
    }
}

/// Maximum of two numbers that are not NaN; compiles to one instruction.
#[inline]
fn larger(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

/// Squared distance of two positions.
#[inline]
pub(super) fn square_of_difference<const D: usize>(a: &[f32; D], b: &[f32; D]) -> f32 {
    (0..D).fold(0.0, |sum, axis| {
        let apart = a[axis] - b[axis];
        sum + apart * apart
    })
}
