//! The samples of a bin, in packets with the boxes about them.

use crate::sample_test::block::SampleRows;
use crate::simd::{LANES, Row};

/// The samples of one bin. Packets are counted by block, cell and place in the cell.
#[derive(Clone, Debug)]
pub(super) struct BinSamples {
    /// Its first pixel.
    pub origin: [u32; 2],
    /// The y of that on the image.
    pub top: f32,
    /// The range of its sample positions in x and in y.
    pub rect: [[f32; 2]; 2],
    /// The box of lens and time of each cell.
    pub cells: CellBoxes,
    /// By sixteen blocks, the box of each on the screen.
    pub blocks: Vec<Boxes>,
    /// By block and cell, the box of each packet on the screen.
    pub boxes: Vec<Boxes>,
    /// By packet and lane, the place of the sample in the bin: pixel by pixel in rows, times samples in a pixel, plus index.
    pub places: Vec<[u32; LANES]>,
    /// The packets with fewer samples than lanes.
    pub partial: Vec<u32>,
    /// The samples of each packet.
    pub packets: Vec<Packet>,
}

/// Sixteen samples as the sample test asks for them; zero in dimensions that are not in use, whose rows are not read.
#[derive(Clone, Copy, Debug)]
pub(super) struct Packet {
    pub slope: [Row; 2],
    pub lens: [Row; 2],
    pub t: Row,
}

/// By cell: the lowest, middle and highest of an axis, and how far from the middle either end may be.
#[derive(Clone, Debug)]
pub(super) struct CellRange {
    pub lo: Row,
    pub hi: Row,
    pub middle: Row,
    pub half: Row,
}

/// The boxes of lens and time of the cells.
#[derive(Clone, Debug)]
pub(super) struct CellBoxes {
    pub u: CellRange,
    pub v: CellRange,
    pub t: CellRange,
}

/// By packet of a cell, or by block: lowest and highest x and y of its samples. Lowest above highest where it has none.
#[derive(Clone, Copy, Debug)]
pub(super) struct Boxes {
    pub x: [Row; 2],
    pub y: [Row; 2],
}

/// No range at all.
pub(super) const NOTHING: [f32; 2] = [f32::INFINITY, f32::NEG_INFINITY];

impl BinSamples {
    /// The place of a lane that has no sample.
    pub const NO_SAMPLE: u32 = u32::MAX;
}

impl Packet {
    /// No samples: infinitely far away, where all edge functions are NaN.
    pub const NOWHERE: Self = {
        const FAR: Row = Row::splat(f32::INFINITY);
        const ZERO: Row = Row::splat(0.0);
        Self { slope: [FAR; 2], lens: [ZERO; 2], t: ZERO }
    };

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
        let range = NOTHING.map(Row::splat);
        Self { x: range, y: range }
    }

    pub fn include(&mut self, lane: usize, x: f32, y: f32) {
        for (range, at) in [(&mut self.x, x), (&mut self.y, y)] {
            range[0].0[lane] = range[0].0[lane].min(at);
            range[1].0[lane] = range[1].0[lane].max(at);
        }
    }
}

impl CellRange {
    pub fn nothing() -> Self {
        let zero = Row::splat(0.0);
        Self { lo: Row::splat(NOTHING[0]), hi: Row::splat(NOTHING[1]), middle: zero, half: zero }
    }

    pub fn include(&mut self, cell: usize, at: f32) {
        self.lo.0[cell] = self.lo.0[cell].min(at);
        self.hi.0[cell] = self.hi.0[cell].max(at);
    }

    /// Finds the middles; a cell without samples becomes the point zero.
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
    /// Finds the middles.
    pub fn finish(&mut self) {
        for range in [&mut self.u, &mut self.v, &mut self.t] {
            range.finish();
        }
    }
}
