//! Samples of a bin in packets, with their bounding boxes, and tests of blocks and packets against these
//! boxes.

use crate::geometry::Viewport;
use crate::sample_test::SampleRows;
use crate::simd::{LANES, Row};

/// Samples of one bin. Packets are numbered by block, cell and position in the cell.
#[derive(Clone, Debug, Default)]
pub(super) struct BinSamples {
    /// First pixel.
    pub origin: [u32; 2],
    /// Image coordinate y of the first pixel.
    pub top: f32,
    /// Ranges of its sample positions in x and y.
    pub rect: [[f32; 2]; 2],
    /// Box of lens and time of each cell.
    pub cells: CellBoxes,
    /// Screen box of each block, in groups of sixteen blocks.
    pub blocks: Vec<Boxes>,
    /// Screen box of each packet, by block and cell.
    pub boxes: Vec<Boxes>,
    /// Index in the bin of the sample of each packet and lane: pixel by pixel in rows, times samples per
    /// pixel, plus index.
    pub sample_indices: Vec<[u32; LANES]>,
    /// Packets with fewer samples than lanes.
    pub partial: Vec<u32>,
    /// Samples of each packet.
    pub packets: Vec<Packet>,
}

/// Sixteen samples in the layout of the sample test. Unused dimensions are zero, and their rows are not read.
#[derive(Clone, Copy, Debug)]
pub(super) struct Packet {
    pub slope: [Row; 2],
    pub lens: [Row; 2],
    pub t: Row,
}

/// By cell: lowest, middle and highest value of an axis, and the largest distance from the middle to either
/// end.
#[derive(Clone, Debug)]
pub(super) struct CellRange {
    pub lo: Row,
    pub hi: Row,
    pub middle: Row,
    pub half: Row,
}

/// Boxes of lens and time of the cells.
#[derive(Clone, Debug, Default)]
pub(super) struct CellBoxes {
    pub u: CellRange,
    pub v: CellRange,
    pub t: CellRange,
}

/// By packet of a cell, or by block: lowest and highest x and y of its samples. Lowest is above highest
/// without samples.
#[derive(Clone, Copy, Debug)]
pub(super) struct Boxes {
    pub x: [Row; 2],
    pub y: [Row; 2],
}

/// Empty range.
pub(super) const EMPTY_RANGE: [f32; 2] = [f32::INFINITY, f32::NEG_INFINITY];

impl BinSamples {
    /// Index of a lane without a sample.
    pub const NO_SAMPLE: u32 = u32::MAX;

    /// An empty bin with numbers of blocks and cells, in the memory of another one.
    pub fn reset(&mut self, origin: [u32; 2], viewport: Viewport, [blocks, cells]: [usize; 2]) {
        fn refill<T: Clone>(all: &mut Vec<T>, count: usize, value: T) {
            all.clear();
            all.resize(count, value);
        }
        (self.origin, self.top) = (origin, Viewport::edge(origin[1], viewport.height()));
        (self.rect, self.cells) = ([EMPTY_RANGE; 2], CellBoxes::default());
        refill(&mut self.blocks, blocks.div_ceil(LANES), Boxes::nothing());
        refill(&mut self.boxes, blocks * cells, Boxes::nothing());
        refill(&mut self.sample_indices, blocks * cells * LANES, [Self::NO_SAMPLE; LANES]);
        refill(&mut self.packets, blocks * cells * LANES, Packet::NOWHERE);
    }

    /// Widens the boxes around packet number `turn` of a cell in a block by the ranges of its samples in x and y.
    pub fn include(
        &mut self,
        (block, cell): (usize, usize),
        turn: usize,
        cells: usize,
        box_of: [[f32; 2]; 2],
    ) {
        for end in 0..2 {
            let [x, y] = box_of.map(|range| range[end]);
            self.blocks[block / LANES].include(block % LANES, x, y);
            self.boxes[block * cells + cell].include(turn, x, y);
            for (range, at) in self.rect.iter_mut().zip([x, y]) {
                *range = [range[0].min(at), range[1].max(at)];
            }
        }
    }

    /// Computes what follows from the samples.
    pub fn finish(&mut self) {
        self.cells.finish();
        self.finish_partial();
    }

    /// The same without the boxes of the cells.
    pub fn finish_partial(&mut self) {
        let packets = (0..).zip(&self.sample_indices);
        let partial = packets.filter(|(_, samples)| samples.contains(&Self::NO_SAMPLE));
        self.partial.clear();
        self.partial.extend(partial.map(|(at, _)| at));
    }
}

impl Packet {
    /// No samples: infinitely far away, where all edge functions are NaN.
    pub const NOWHERE: Self = {
        const FAR: Row = Row::splat(f32::INFINITY);
        const ZERO: Row = Row::splat(0.0);
        Self { slope: [FAR; 2], lens: [ZERO; 2], t: ZERO }
    };

    /// Leaves a lane without a sample.
    pub fn clear(&mut self, lane: usize) {
        for axis in 0..2 {
            self.slope[axis].0[lane] = Self::NOWHERE.slope[axis].0[lane];
            self.lens[axis].0[lane] = Self::NOWHERE.lens[axis].0[lane];
        }
        self.t.0[lane] = Self::NOWHERE.t.0[lane];
    }

    #[inline(always)]
    pub fn rows(&self) -> SampleRows<'_> {
        SampleRows {
            slope: [&self.slope[0].0, &self.slope[1].0],
            lens: [&self.lens[0].0, &self.lens[1].0],
            t: &self.t.0,
        }
    }
}

impl Boxes {
    pub fn nothing() -> Self {
        let range = EMPTY_RANGE.map(Row::splat);
        Self { x: range, y: range }
    }

    pub fn include(&mut self, lane: usize, x: f32, y: f32) {
        for (range, at) in [(&mut self.x, x), (&mut self.y, y)] {
            range[0].0[lane] = range[0].0[lane].min(at);
            range[1].0[lane] = range[1].0[lane].max(at);
        }
    }
}

impl Default for CellRange {
    fn default() -> Self {
        let zero = Row::splat(0.0);
        Self { lo: Row::splat(EMPTY_RANGE[0]), hi: Row::splat(EMPTY_RANGE[1]), middle: zero, half: zero }
    }
}

impl CellRange {
    pub fn include(&mut self, cell: usize, at: f32) {
        self.lo.0[cell] = self.lo.0[cell].min(at);
        self.hi.0[cell] = self.hi.0[cell].max(at);
    }

    /// Compute the middles; a cell without samples becomes the point zero.
    fn finish(&mut self) {
        for cell in 0..LANES {
            let (lo, hi) = (&mut self.lo.0[cell], &mut self.hi.0[cell]);
            if *lo > *hi {
                (*lo, *hi) = (0.0, 0.0);
            }
            let middle = 0.5 * (*lo + *hi);
            self.middle.0[cell] = middle;
            // Rounded up, as the differences may round down.
            self.half.0[cell] = (*hi - middle).max(middle - *lo) * (1.0 + 4.0 * f32::EPSILON);
        }
    }
}

impl CellBoxes {
    /// Compute the middles.
    pub fn finish(&mut self) {
        for range in [&mut self.u, &mut self.v, &mut self.t] {
            range.finish();
        }
    }
}
