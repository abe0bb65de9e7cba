//! Samples sorted into packets: what can be done before any triangle is known.

use rayon::prelude::*;

use super::plan::Plan;
use super::sorter::Sorter;
use crate::geometry::{Camera, Projection, Viewport};
use crate::sample_test::block::SampleRows;
use crate::sampling::SampleSource;
use crate::simd::{LANES, Row};

/// The samples of an image, divided in the dimensions in use and ready to be tested against triangles.
#[derive(Clone, Debug)]
pub struct SampleLayout {
    pub(super) viewport: Viewport,
    pub(super) per_pixel: u32,
    pub(super) projection: Projection,
    pub(super) plan: Plan,
    pub(super) bins: Vec<BinSamples>,
}

/// The samples of one bin. Packets are counted by block, cell and place in the cell.
#[derive(Clone, Debug)]
pub(super) struct BinSamples {
    /// Its first pixel.
    pub origin: [u32; 2],
    /// The position of that on the image.
    pub corner: [f32; 2],
    /// The range of its sample positions in x and in y.
    pub rect: [[f32; 2]; 2],
    /// The box of lens and time of each cell.
    pub cells: CellBoxes,
    /// By block and cell, the box of each packet on the screen.
    pub boxes: Vec<PacketBoxes>,
    /// By packet and lane, the place of the sample in the bin: pixel by pixel in rows, times samples in a pixel, plus index.
    pub places: Vec<[u32; LANES]>,
    /// [`Stride`] rows for each packet.
    pub rows: Vec<Row>,
    pub stride: Stride,
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

/// By packet of a cell: lowest and highest x and y of its samples. Lowest above highest where it has none.
#[derive(Clone, Copy, Debug)]
pub(super) struct PacketBoxes {
    pub x: [Row; 2],
    pub y: [Row; 2],
}

/// Which rows a packet has: two slopes, the time if anything may move, two lens shears if there is a lens.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Stride {
    pub moving: bool,
    pub lens: bool,
}

impl Stride {
    pub fn rows(self) -> usize {
        2 + usize::from(self.moving) + 2 * usize::from(self.lens)
    }
}

/// The place of samples in a dimension that is not in use.
static NOWHERE: Row = Row::splat(0.0);

/// No range at all.
pub(super) const NOTHING: [f32; 2] = [f32::INFINITY, f32::NEG_INFINITY];

impl SampleLayout {
    /// Sorts the samples of `source` for what `camera` sees in `viewport`. `moving` says whether triangles may move; where
    /// none does, time is not divided. `None` for an orthographic camera, which the engine does not take.
    pub fn new(camera: &Camera, viewport: Viewport, source: &dyn SampleSource, moving: bool) -> Option<Self> {
        if camera.is_orthographic() {
            return None;
        }
        let projection = Projection::new(camera, viewport);
        let per_pixel = source.per_pixel();
        let plan = Plan::new(per_pixel, moving, !projection.shear.is_none());
        let across = viewport.width().div_ceil(plan.bin_px);
        let down = viewport.height().div_ceil(plan.bin_px);
        let bins = (0..across * down)
            .into_par_iter()
            .map(|bin| {
                let origin = [bin % across * plan.bin_px, bin / across * plan.bin_px];
                Sorter { viewport, source, shear: &projection.shear, plan: &plan, moving }.bin(origin)
            })
            .collect();
        Some(Self { viewport, per_pixel, projection, plan, bins })
    }

    /// Samples of the image.
    pub fn samples(&self) -> usize {
        self.viewport.pixels() * self.per_pixel as usize
    }

    /// Where the sample at `place` of a bin stands in the order of the image, if it is one.
    pub(super) fn in_image(&self, bin: &BinSamples, place: u32) -> Option<usize> {
        if place == BinSamples::NO_SAMPLE {
            return None;
        }
        let (pixel, index) = (place / self.per_pixel, place % self.per_pixel);
        let [x, y] = [bin.origin[0] + pixel % self.plan.bin_px, bin.origin[1] + pixel / self.plan.bin_px];
        let pixel = y as usize * self.viewport.width() as usize + x as usize;
        Some(pixel * self.per_pixel as usize + index as usize)
    }
}

impl BinSamples {
    /// The place of a lane that has no sample.
    pub const NO_SAMPLE: u32 = u32::MAX;

    /// The samples of a packet. In dimensions that are not in use they are all at zero.
    #[inline(always)]
    pub fn packet(&self, packet: usize) -> SampleRows<'_> {
        let stride = self.stride.rows();
        let rows = &self.rows[packet * stride..(packet + 1) * stride];
        let lens =
            if self.stride.lens { [&rows[stride - 2].0, &rows[stride - 1].0] } else { [&NOWHERE.0; 2] };
        let t = if self.stride.moving { &rows[2].0 } else { &NOWHERE.0 };
        SampleRows { slope: [&rows[0].0, &rows[1].0], lens, t }
    }
}

impl PacketBoxes {
    pub fn nothing() -> Self {
        let range = NOTHING.map(Row::splat);
        Self { x: range, y: range }
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
