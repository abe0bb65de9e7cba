//! Cells in rows, some with a point, and the neighbourhood of each.

use std::ops::ControlFlow;

/// What is known of a cell that has a point.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cell<const D: usize> {
    /// Where in the cell it is.
    pub place: [f32; D],
    /// Which point it is.
    pub index: u32,
}

/// A square or cube of cells, padded on each side. Which of them have a point is kept as bits, since few do: a neighbourhood is a few
/// words, and only cells with a point are read.
pub(super) struct Cells<const D: usize> {
    /// Cells of padding on each side.
    pad: u64,
    /// Cells along an axis, padding included.
    length: u64,
    strides: [u64; D],
    /// The rows of cells that may reach into a cell: from a cell to the first of each, and so many of them in a word of bits.
    rows: Vec<isize>,
    rows_to_word: usize,
    /// For each bit of each word the cell that it stands for.
    steps: Vec<Step<D>>,
    /// A bit for each cell: whether it has a point.
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
        let rows_to_word = WORD / (2 * pad as usize + 1);
        Self {
            pad,
            length,
            strides,
            steps: steps(&rows, pad, rows_to_word),
            rows: rows.iter().map(|row| row.offset).collect(),
            rows_to_word,
            taken: vec![0; count / 8 + 4],
            cells: vec![Cell { place: [0.0; D], index: 0 }; count],
        }
    }

    /// How many there are, padding included.
    pub fn count(across: f64, reach: f64) -> f64 {
        (across + 2.0 * pad(reach) as f64).powi(D as i32)
    }

    /// How many cells at most have a point near a cell.
    pub fn neighbours(&self) -> usize {
        self.steps.len()
    }

    /// The place of a cell among all.
    #[inline]
    pub fn slot(&self, cell: [u64; D]) -> usize {
        (0..D).map(|axis| (cell[axis] + self.pad) * self.strides[axis]).sum::<u64>() as usize
    }

    /// Whether a cell has a point.
    #[inline]
    pub fn is_taken(&self, slot: usize) -> bool {
        self.taken[slot / 8] >> (slot % 8) & 1 != 0
    }

    /// Gives a cell its point.
    pub fn set(&mut self, slot: usize, cell: Cell<D>) {
        self.taken[slot / 8] |= 1 << (slot % 8);
        self.cells[slot] = cell;
    }

    /// Goes through the cells with a point about a cell, nearest rows first, each with how many cells it is away, until told to stop.
    #[inline]
    pub fn visit<B>(
        &self,
        slot: usize,
        mut each: impl FnMut(&Cell<D>, &[f32; D]) -> ControlFlow<B>,
    ) -> ControlFlow<B> {
        for (rows, steps) in self.rows.chunks(self.rows_to_word).zip(self.steps.chunks(WORD)) {
            let mut bits = self.taken_in(slot, rows);
            while bits != 0 {
                let step = &steps[bits.trailing_zeros() as usize];
                bits &= bits - 1;
                each(&self.cells[(slot as isize + step.offset) as usize], &step.away)?;
            }
        }
        ControlFlow::Continue(())
    }

    /// Whether something is so of any cell with a point about a cell.
    pub fn any(&self, slot: usize, is_so: impl Fn(&Cell<D>, &[f32; D]) -> bool) -> bool {
        let found = |cell: &Cell<D>, away: &[f32; D]| match is_so(cell, away) {
            true => ControlFlow::Break(()),
            false => ControlFlow::Continue(()),
        };
        self.visit(slot, found).is_break()
    }

    /// A bit for each cell of a few rows near a cell: whether it has a point.
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

    /// Gives the copies of a cell in the padding of a torus its point, and the cell itself.
    pub fn set_copies(&mut self, slot: usize, cell: Cell<D>) {
        let (pad, length) = (self.pad, self.length);
        let across = length - 2 * pad;
        let padded: [u64; D] = std::array::from_fn(|k| slot as u64 / self.strides[k] % length);
        if padded.iter().all(|&at| at >= 2 * pad && at + 2 * pad < length) {
            return self.set(slot, cell);
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
            self.set(slot as usize, cell);
        }
    }
}

/// Cells that words of bits stand for.
const WORD: usize = 64;

/// Cells on each side into which a disk about a point of a cell may reach.
fn pad(reach: f64) -> u64 {
    ((reach + 1.0).ceil() - 1.0) as u64
}

/// Neighbours in a row along the first axis.
#[derive(Clone, Copy, Debug)]
struct Row<const D: usize> {
    /// From a cell to the first of the row.
    offset: isize,
    /// Cells from a cell to the first of the row along each axis.
    away: [f32; D],
}

/// The rows that may reach into a cell, nearest first.
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

/// A cell near a cell.
#[derive(Clone, Copy, Debug)]
struct Step<const D: usize> {
    offset: isize,
    /// Cells to it along each axis.
    away: [f32; D],
}

/// The cells of rows, `rows_to_word` rows to a word.
fn steps<const D: usize>(rows: &[Row<D>], pad: u64, rows_to_word: usize) -> Vec<Step<D>> {
    let width = 2 * pad as usize + 1;
    let of_word = |rows: &[Row<D>]| {
        let step = |place: usize| {
            let (row, lane) = (&rows[(place / width).min(rows.len() - 1)], place % width);
            let mut away = row.away;
            away[0] += lane as f32;
            Step { offset: row.offset + lane as isize, away }
        };
        (0..WORD).map(step).collect::<Vec<_>>()
    };
    rows.chunks(rows_to_word).flat_map(of_word).collect()
}
