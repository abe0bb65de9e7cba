//! Samples of a bin, divided into cells and packets with their bounding boxes before any triangle is known.

use rayon::prelude::*;

use crate::geometry::{Camera, Clip, Projection, Shear, Viewport};
use crate::sample_test::SampleRows;
use crate::sampling::{Sample, SampleSource};
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
const EMPTY_RANGE: [f32; 2] = [f32::INFINITY, f32::NEG_INFINITY];

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

/// A sample on its way into a packet.
#[derive(Clone, Copy, Debug, Default)]
struct SampleEntry {
    x: f32,
    y: f32,
    u: f32,
    v: f32,
    t: f32,
    sample_index: u32,
}

impl SampleEntry {
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

/// Sorter of the samples of a bin.
pub(super) struct Sorter<'a> {
    pub viewport: Viewport,
    pub source: &'a dyn SampleSource,
    pub shear: &'a Shear,
    pub hierarchy: &'a Hierarchy,
    pub clip: Clip,
}

impl Sorter<'_> {
    /// Samples of the bin whose first pixel is `origin`.
    pub fn bin(&self, origin: [u32; 2]) -> BinSamples {
        let mut bin = BinSamples::default();
        self.fill(&mut bin, origin);
        bin
    }

    /// The same into the memory of another bin.
    pub fn fill(&self, bin: &mut BinSamples, origin: [u32; 2]) {
        let ([across, down], cells) = (self.hierarchy.blocks(), self.hierarchy.cells());
        let blocks = (across * down) as usize;
        bin.reset(origin, self.viewport, [blocks, cells]);
        let (mut samples, mut pixel) =
            (Vec::new(), vec![Sample::default(); self.source.per_pixel() as usize]);
        for block in 0..blocks {
            let [column, row] = [block as u32 % across, block as u32 / across];
            let first = [column * self.hierarchy.block_px[0], row * self.hierarchy.block_px[1]];
            self.gather(origin, first, &mut pixel, &mut samples);
            self.split_cells(bin, block * cells, cells, &mut samples, self.hierarchy.cell_axes);
        }
        bin.finish();
    }

    /// Samples of the pixels of a block that are in the image.
    fn gather(
        &self,
        origin: [u32; 2],
        first: [u32; 2],
        pixel: &mut [Sample],
        samples: &mut Vec<SampleEntry>,
    ) {
        let (viewport, [width, height]) = (self.viewport, self.hierarchy.block_px);
        let image = self.clip.in_image(viewport);
        samples.clear();
        for (row, column) in (0..height).flat_map(|row| (0..width).map(move |column| (row, column))) {
            let [bx, by] = [first[0] + column, first[1] + row];
            let [px, py] = [origin[0] + bx, origin[1] + by];
            if px >= viewport.width() || py >= viewport.height() {
                continue;
            }
            self.source.pixel_into(px, py, pixel);
            let sample_index = (by * self.hierarchy.bin_px + bx) * pixel.len() as u32;
            let entries = pixel.iter().zip(sample_index..).map(|(s, sample_index)| SampleEntry {
                x: Viewport::edge(px, viewport.width()) + s.x,
                y: Viewport::edge(py, viewport.height()) + s.y,
                u: s.u,
                v: s.v,
                t: s.t,
                sample_index,
            });
            samples.extend(entries.filter(|entry| self.is_drawn(entry, image)));
        }
    }

    /// Whether a sample is between the clip planes, with a range of image coordinates.
    fn is_drawn(&self, sample: &SampleEntry, image: Option<[[f32; 2]; 2]>) -> bool {
        let within = |at: f32, [lo, hi]: [f32; 2]| (lo..=hi).contains(&at);
        self.clip.holds([sample.u, sample.v], sample.t)
            && image.is_none_or(|[x, y]| within(sample.x, x) && within(sample.y, y))
    }

    /// Halve `samples` along each axis, down to cells.
    fn split_cells(
        &self,
        bin: &mut BinSamples,
        first: usize,
        count: usize,
        samples: &mut [SampleEntry],
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

    fn cell(&self, bin: &mut BinSamples, block_cell: usize, samples: &mut [SampleEntry]) {
        let (block, cell) = (block_cell / self.hierarchy.cells(), block_cell % self.hierarchy.cells());
        for sample in &*samples {
            bin.blocks[block / LANES].include(block % LANES, sample.x, sample.y);
            for (range, at) in bin.rect.iter_mut().zip([sample.x, sample.y]) {
                *range = [range[0].min(at), range[1].max(at)];
            }
            bin.cells.u.include(cell, sample.u);
            bin.cells.v.include(cell, sample.v);
            bin.cells.t.include(cell, sample.t);
        }
        self.split_packets(bin, block_cell, 0, LANES, samples, &Hierarchy::PACKET_AXES);
    }

    /// Halve the samples of a cell along each axis, down to packets. Full packets come first, so few lanes
    /// are wasted.
    fn split_packets(
        &self,
        bin: &mut BinSamples,
        block_cell: usize,
        first: usize,
        count: usize,
        samples: &mut [SampleEntry],
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

    fn packet(&self, bin: &mut BinSamples, block_cell: usize, lane_in_cell: usize, samples: &[SampleEntry]) {
        let number = block_cell * LANES + lane_in_cell;
        let packet = &mut bin.packets[number];
        let boxes = &mut bin.boxes[block_cell];
        for (lane, s) in samples.iter().enumerate() {
            bin.sample_indices[number][lane] = s.sample_index;
            for (axis, (at, lens)) in [(s.x, s.u), (s.y, s.v)].into_iter().enumerate() {
                [packet.slope[axis].0[lane], packet.lens[axis].0[lane]] = self.shear.ray(axis, at, lens);
            }
            packet.t.0[lane] = s.t;
            boxes.include(lane_in_cell, s.x, s.y);
        }
    }
}

/// The `count` samples lowest along the axis, and the rest. Ties are decided by index, so the division is a
/// function of the samples alone.
fn halve(samples: &mut [SampleEntry], axis: Axis, count: usize) -> (&mut [SampleEntry], &mut [SampleEntry]) {
    if count > 0 && count < samples.len() {
        samples.select_nth_unstable_by(count, |a, b| {
            a.along(axis).total_cmp(&b.along(axis)).then(a.sample_index.cmp(&b.sample_index))
        });
    }
    samples.split_at_mut(count)
}

/// A dimension along which samples are divided.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Axis {
    X,
    Y,
    U,
    V,
    T,
}

/// Hierarchy of bins, blocks, cells and packets. A *packet* is sixteen samples that are tested together. A
/// *cell* is a box of lens and time, as equal for all blocks of a bin as the samples allow, with at most
/// sixteen packets in a block. A *block* is a rectangle of pixels. A *bin* is a square of blocks that one
/// worker rasterizes, small enough for its samples and depths to stay in the L2 cache of the host.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Hierarchy {
    /// Axes that divide a block into cells, each by halving.
    pub cell_axes: &'static [Axis],
    /// Size of a block in pixels.
    pub block_px: [u32; 2],
    /// Side of a bin in pixels.
    pub bin_px: u32,
}

impl Hierarchy {
    /// Axes that divide a cell into packets.
    pub const PACKET_AXES: [Axis; 4] = [Axis::Y, Axis::X, Axis::Y, Axis::X];
    /// Target number of samples in a bin.
    const BIN_SAMPLES: u32 = 1 << 16;

    /// Hierarchy for `per_pixel` samples in the dimensions in use; only these are divided.
    pub fn new(per_pixel: u32, moving: bool, lens: bool) -> Self {
        let cell_axes: &[Axis] = match (moving, lens) {
            (false, false) => &[],
            (true, false) => &[Axis::T; 4],
            (false, true) => &[Axis::U, Axis::V, Axis::U, Axis::V],
            (true, true) => &[Axis::T, Axis::T, Axis::T, Axis::U],
        };
        let block_samples = ((LANES * LANES) as u32) << cell_axes.len();
        let mut block_px = [1, 1];
        let mut bin_px = 1;
        while 2 * block_px[0] * block_px[1] * per_pixel <= block_samples {
            // Wider first, so that a block is one or two squares.
            let axis = usize::from(block_px[0] > block_px[1]);
            block_px[axis] *= 2;
        }
        while 4 * bin_px * bin_px * per_pixel <= Self::BIN_SAMPLES {
            bin_px *= 2;
        }
        Self { cell_axes, block_px, bin_px: bin_px.max(block_px[0]) }
    }

    /// Cells of a block, 1 to 16.
    pub fn cells(&self) -> usize {
        1 << self.cell_axes.len()
    }

    /// Blocks of a bin, across and down.
    pub fn blocks(&self) -> [u32; 2] {
        self.block_px.map(|side| self.bin_px / side)
    }
}

/// Samples of an image, divided in the dimensions in use and ready to be tested against triangles.
#[derive(Clone, Debug)]
pub struct SampleLayout {
    pub(super) viewport: Viewport,
    pub(super) per_pixel: u32,
    pub(super) projection: Projection,
    pub(super) hierarchy: Hierarchy,
    pub(super) bins: Vec<BinSamples>,
}

impl SampleLayout {
    /// Sort the samples of `source` for the view of `camera` in `viewport`. `moving` says whether triangles
    /// may move; otherwise time is not divided. Samples outside the clip planes of the camera see nothing.
    /// `None` for an orthographic camera, which the engine does not support.
    pub fn new(camera: &Camera, viewport: Viewport, source: &dyn SampleSource, moving: bool) -> Option<Self> {
        let mut layout = Self::unsorted(camera, viewport, source.per_pixel(), moving)?;
        let sorter = layout.sorter(source, camera.clip());
        let bins = (0..layout.bin_count()).into_par_iter().map(|bin| sorter.bin(layout.origin(bin)));
        layout.bins = bins.collect();
        Some(layout)
    }

    /// The layout of an image without its samples, which are sorted bin by bin.
    pub(super) fn unsorted(
        camera: &Camera,
        viewport: Viewport,
        per_pixel: u32,
        moving: bool,
    ) -> Option<Self> {
        if camera.is_orthographic() {
            return None;
        }
        let projection = Projection::new(camera, viewport);
        let hierarchy = Hierarchy::new(per_pixel, moving, !projection.shear.is_none());
        Some(Self { viewport, per_pixel, projection, hierarchy, bins: Vec::new() })
    }

    /// Sorter of its samples.
    pub(super) fn sorter<'a>(&'a self, source: &'a dyn SampleSource, clip: Clip) -> Sorter<'a> {
        Sorter {
            viewport: self.viewport,
            source,
            shear: &self.projection.shear,
            hierarchy: &self.hierarchy,
            clip,
        }
    }

    /// Bins of the image.
    pub(super) fn bin_count(&self) -> u32 {
        self.viewport.width().div_ceil(self.hierarchy.bin_px)
            * self.viewport.height().div_ceil(self.hierarchy.bin_px)
    }

    /// First pixel of a bin.
    pub(super) fn origin(&self, bin: u32) -> [u32; 2] {
        let across = self.viewport.width().div_ceil(self.hierarchy.bin_px);
        [bin % across * self.hierarchy.bin_px, bin / across * self.hierarchy.bin_px]
    }

    /// Number of samples of the image.
    pub fn samples(&self) -> usize {
        self.viewport.pixels() * self.per_pixel as usize
    }

    /// Index in the image of the sample with index `sample_index` of a bin, if it exists.
    pub(super) fn in_image(&self, bin: &BinSamples, sample_index: u32) -> Option<usize> {
        if sample_index == BinSamples::NO_SAMPLE {
            return None;
        }
        let (pixel, index) = (sample_index / self.per_pixel, sample_index % self.per_pixel);
        let [x, y] =
            [bin.origin[0] + pixel % self.hierarchy.bin_px, bin.origin[1] + pixel / self.hierarchy.bin_px];
        let pixel = y as usize * self.viewport.width() as usize + x as usize;
        Some(pixel * self.per_pixel as usize + index as usize)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_fill_their_packets_and_bins_their_blocks() {
        for per_pixel in 1..=256 {
            for (moving, lens) in [(false, false), (true, false), (false, true), (true, true)] {
                let hierarchy = Hierarchy::new(per_pixel, moving, lens);
                let samples = hierarchy.block_px[0] * hierarchy.block_px[1] * per_pixel;
                let room = (hierarchy.cells() * LANES * LANES) as u32;
                assert!(samples <= room && (2 * samples > room || samples == per_pixel), "{hierarchy:?}");
                assert!(hierarchy.blocks().iter().all(|&count| count >= 1), "{hierarchy:?}");
                assert_eq!(hierarchy.blocks()[0] * hierarchy.block_px[0], hierarchy.bin_px);
                assert_eq!(hierarchy.blocks()[1] * hierarchy.block_px[1], hierarchy.bin_px);
            }
        }
    }

    #[test]
    fn sixteen_samples_in_five_dimensions() {
        let hierarchy = Hierarchy::new(16, true, true);
        assert_eq!((hierarchy.block_px, hierarchy.bin_px, hierarchy.cells()), ([16, 16], 64, 16));
    }
}
