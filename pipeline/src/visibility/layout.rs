//! Samples sorted into packets: what can be done before any triangle is known.

use rayon::prelude::*;

use super::plan::{Axis, Plan};
use crate::geometry::{Camera, Projection, Shear, Viewport};
use crate::sample_test::block::SampleRows;
use crate::sampling::{Sample, SampleSource};
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
    rows: Vec<Row>,
    stride: Stride,
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
struct Stride {
    moving: bool,
    lens: bool,
}

impl Stride {
    fn rows(self) -> usize {
        2 + usize::from(self.moving) + 2 * usize::from(self.lens)
    }
}

/// A sample on its way into a packet.
#[derive(Clone, Copy, Debug, Default)]
struct Placed {
    x: f32,
    y: f32,
    u: f32,
    v: f32,
    t: f32,
    place: u32,
}

impl Placed {
    fn along(&self, axis: Axis) -> f32 {
        match axis {
            Axis::X => self.x,
            Axis::Y => self.y,
            Axis::U => self.u,
            Axis::V => self.v,
            Axis::T => self.t,
        }
    }
}

/// The place of samples in a dimension that is not in use.
static NOWHERE: Row = Row::splat(0.0);

const NOTHING: [f32; 2] = [f32::INFINITY, f32::NEG_INFINITY];

impl SampleLayout {
    /// Sorts the samples of `source` for what `camera` sees in `viewport`. `moving` says whether triangles may move; where
    /// none does, time is not divided.
    pub fn new(camera: &Camera, viewport: Viewport, source: &dyn SampleSource, moving: bool) -> Self {
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
        Self { viewport, per_pixel, projection, plan, bins }
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

    /// The largest |X| and |Y| of the image.
    pub(super) fn half_px(&self) -> [f32; 2] {
        [0.5 * self.viewport.width() as f32, 0.5 * self.viewport.height() as f32]
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

/// Sorts the samples of a bin.
struct Sorter<'a> {
    viewport: Viewport,
    source: &'a dyn SampleSource,
    shear: &'a Shear,
    plan: &'a Plan,
    moving: bool,
}

impl Sorter<'_> {
    fn bin(&self, origin: [u32; 2]) -> BinSamples {
        let [across, down] = self.plan.blocks();
        let (blocks, cells) = ((across * down) as usize, self.plan.cells());
        let stride = Stride { moving: self.moving, lens: !self.shear.is_none() };
        let mut bin = BinSamples {
            origin,
            corner: [
                Viewport::edge(origin[0], self.viewport.width()),
                Viewport::edge(origin[1], self.viewport.height()),
            ],
            rect: [NOTHING; 2],
            cells: CellBoxes { u: CellRange::nothing(), v: CellRange::nothing(), t: CellRange::nothing() },
            boxes: vec![PacketBoxes::nothing(); blocks * cells],
            places: vec![[BinSamples::NO_SAMPLE; LANES]; blocks * cells * LANES],
            // What is not a sample is infinitely far away, where all edge functions are NaN.
            rows: vec![Row::splat(f32::INFINITY); blocks * cells * LANES * stride.rows()],
            stride,
        };
        let (mut samples, mut pixel) =
            (Vec::new(), vec![Sample::default(); self.source.per_pixel() as usize]);
        for block in 0..blocks {
            let [column, row] = [block as u32 % across, block as u32 / across];
            let first = [column * self.plan.block_px[0], row * self.plan.block_px[1]];
            self.gather(origin, first, &mut pixel, &mut samples);
            self.split_cells(&mut bin, block * cells, cells, &mut samples, self.plan.cell_axes);
        }
        bin.cells.finish();
        bin
    }

    /// The samples of the pixels of a block that lie in the image.
    fn gather(&self, origin: [u32; 2], first: [u32; 2], pixel: &mut [Sample], samples: &mut Vec<Placed>) {
        let (viewport, [width, height]) = (self.viewport, self.plan.block_px);
        samples.clear();
        for (row, column) in (0..height).flat_map(|row| (0..width).map(move |column| (row, column))) {
            let [bx, by] = [first[0] + column, first[1] + row];
            let [px, py] = [origin[0] + bx, origin[1] + by];
            if px >= viewport.width() || py >= viewport.height() {
                continue;
            }
            self.source.pixel_into(px, py, pixel);
            let place = (by * self.plan.bin_px + bx) * pixel.len() as u32;
            samples.extend(pixel.iter().zip(place..).map(|(s, place)| Placed {
                x: Viewport::edge(px, viewport.width()) + s.x,
                y: Viewport::edge(py, viewport.height()) + s.y,
                u: s.u,
                v: s.v,
                t: s.t,
                place,
            }));
        }
    }

    /// Halves `samples` along each axis, down to cells.
    fn split_cells(
        &self,
        bin: &mut BinSamples,
        first: usize,
        count: usize,
        samples: &mut [Placed],
        axes: &[Axis],
    ) {
        let Some((&axis, rest)) = axes.split_first() else {
            self.cell(bin, first, samples);
            return;
        };
        let (low, high) = halve(samples, axis, samples.len().div_ceil(2));
        self.split_cells(bin, first, count / 2, low, rest);
        self.split_cells(bin, first + count / 2, count / 2, high, rest);
    }

    fn cell(&self, bin: &mut BinSamples, block_cell: usize, samples: &mut [Placed]) {
        let cell = block_cell % self.plan.cells();
        for sample in &*samples {
            for (range, at) in bin.rect.iter_mut().zip([sample.x, sample.y]) {
                *range = [range[0].min(at), range[1].max(at)];
            }
            bin.cells.u.include(cell, sample.u);
            bin.cells.v.include(cell, sample.v);
            bin.cells.t.include(cell, sample.t);
        }
        self.split_packets(bin, block_cell, 0, LANES, samples, &Plan::PACKET_AXES);
    }

    /// Halves the samples of a cell along each axis, down to packets; full ones first, so that few are tested in vain.
    fn split_packets(
        &self,
        bin: &mut BinSamples,
        block_cell: usize,
        first: usize,
        count: usize,
        samples: &mut [Placed],
        axes: &[Axis],
    ) {
        if samples.is_empty() {
            return;
        }
        let Some((&axis, rest)) = axes.split_first() else {
            self.packet(bin, block_cell, first, samples);
            return;
        };
        let half = samples.len().div_ceil(2).next_multiple_of(LANES).min(samples.len());
        let (low, high) = halve(samples, axis, half);
        self.split_packets(bin, block_cell, first, count / 2, low, rest);
        self.split_packets(bin, block_cell, first + count / 2, count / 2, high, rest);
    }

    fn packet(&self, bin: &mut BinSamples, block_cell: usize, lane_in_cell: usize, samples: &[Placed]) {
        let (packet, stride) = (block_cell * LANES + lane_in_cell, bin.stride);
        let rows = &mut bin.rows[packet * stride.rows()..(packet + 1) * stride.rows()];
        let boxes = &mut bin.boxes[block_cell];
        for (lane, s) in samples.iter().enumerate() {
            bin.places[packet][lane] = s.place;
            rows[0].0[lane] = s.x - s.u * self.shear.a[0];
            rows[1].0[lane] = s.y - s.v * self.shear.a[1];
            if stride.moving {
                rows[2].0[lane] = s.t;
            }
            if stride.lens {
                let last = stride.rows() - 2;
                rows[last].0[lane] = s.u * self.shear.s[0];
                rows[last + 1].0[lane] = s.v * self.shear.s[1];
            }
            for (range, at) in [(&mut boxes.x, s.x), (&mut boxes.y, s.y)] {
                range[0].0[lane_in_cell] = range[0].0[lane_in_cell].min(at);
                range[1].0[lane_in_cell] = range[1].0[lane_in_cell].max(at);
            }
        }
    }
}

/// The samples lowest along the axis, `count` of them, and the rest. Ties go by place, so that the division is a function of the
/// samples alone.
fn halve(samples: &mut [Placed], axis: Axis, count: usize) -> (&mut [Placed], &mut [Placed]) {
    if count > 0 && count < samples.len() {
        samples.select_nth_unstable_by(count, |a, b| {
            a.along(axis).total_cmp(&b.along(axis)).then(a.place.cmp(&b.place))
        });
    }
    samples.split_at_mut(count)
}

impl PacketBoxes {
    fn nothing() -> Self {
        let range = NOTHING.map(Row::splat);
        Self { x: range, y: range }
    }
}

impl CellRange {
    fn nothing() -> Self {
        let zero = Row::splat(0.0);
        Self { lo: Row::splat(NOTHING[0]), hi: Row::splat(NOTHING[1]), middle: zero, half: zero }
    }

    fn include(&mut self, cell: usize, at: f32) {
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
    fn finish(&mut self) {
        for range in [&mut self.u, &mut self.v, &mut self.t] {
            range.finish();
        }
    }
}
