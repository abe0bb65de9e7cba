//! Sampling: samples, their sources, and sample tables over the image, the lens and the shutter.

mod lens;
mod pattern;
mod table;

use crate::geometry::{Shear, Viewport};
pub use lens::{LensRegion, LensRegions, LensShape};
pub use pattern::{HashedSamples, Pattern};
pub use table::{SampleSpec, SampleTable, SampleTableError};

/// One sample of a pixel.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sample {
    /// Position in the pixel, [0, 1).
    pub x: f32,
    /// Position in the pixel, [0, 1), downwards.
    pub y: f32,
    /// Lens position, [-1, 1].
    pub u: f32,
    /// Lens position, [-1, 1], upwards.
    pub v: f32,
    /// Time, [0, 1) over the shutter.
    pub t: f32,
}

impl Sample {
    /// Whether it is in its pixel, in the square of the lens and in the shutter.
    pub fn is_in_range(&self) -> bool {
        let unit = 0.0..1.0;
        let lens = -1.0..=1.0;
        [self.x, self.y, self.t].iter().all(|c| unit.contains(c))
            && [self.u, self.v].iter().all(|c| lens.contains(c))
    }
}

/// A sample of a block of pixels.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Timed {
    sample: Sample,
    /// The pixel in the block, row by row, times the samples per pixel, plus the index in the pixel.
    index: u16,
    /// The pixel in the block, row by row.
    pixel: u8,
}

/// Samples of a block of pixels as arrays, sorted by time; the index breaks ties.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TimedBlock {
    /// Position in the pixel, by axis.
    within: [Vec<f32>; 2],
    /// Column and row of the pixel.
    at: [Vec<f32>; 2],
    /// Lens position, by axis.
    lens: [Vec<f32>; 2],
    t: Vec<f32>,
    /// The pixel, row by row.
    pixel: Vec<u8>,
    /// The pixel times the samples per pixel, plus the index in the pixel.
    index: Vec<u16>,
}

impl TimedBlock {
    /// The block of 8x8 pixels whose samples are `of_pixel`, which gets pixels row by row. Each has 1 to 256.
    pub fn new<'a>(of_pixel: impl Fn(u32) -> &'a [Sample]) -> Self {
        let side = SampleTable::SHIFT_PX;
        let timed = |pixel: u32| {
            let samples = of_pixel(pixel);
            let first = pixel * samples.len() as u32;
            let timed = move |(index, sample): (u32, &Sample)| Timed {
                sample: *sample,
                index: index as u16,
                pixel: pixel as u8,
            };
            (first..).zip(samples).map(timed)
        };
        let mut block = Self::default();
        block.fill(&mut (0..side * side).flat_map(timed).collect::<Vec<_>>(), side);
        block
    }

    /// The `samples` of a block of `side_px` pixels squared, in the memory of another block.
    fn fill(&mut self, samples: &mut [Timed], side_px: u32) {
        fn refill<T>(into: &mut Vec<T>, values: impl Iterator<Item = T>) {
            into.clear();
            into.extend(values);
        }
        // Times are not negative, so their bits sort as they do.
        samples.sort_unstable_by_key(|timed| (timed.sample.t.to_bits(), timed.index));
        let all = || samples.iter().map(|timed| timed.sample);
        let pixels = || samples.iter().map(|timed| u32::from(timed.pixel));
        let [x, y] = &mut self.within;
        refill(x, all().map(|s| s.x));
        refill(y, all().map(|s| s.y));
        let [column, row] = &mut self.at;
        refill(column, pixels().map(|pixel| (pixel % side_px) as f32));
        refill(row, pixels().map(|pixel| (pixel / side_px) as f32));
        let [u, v] = &mut self.lens;
        refill(u, all().map(|s| s.u));
        refill(v, all().map(|s| s.v));
        refill(&mut self.t, all().map(|s| s.t));
        refill(&mut self.pixel, samples.iter().map(|timed| timed.pixel));
        refill(&mut self.index, samples.iter().map(|timed| timed.index));
    }
}

/// Source of samples. A sample is a pure function of the source, the pixel and the index; workers request the
/// same samples repeatedly.
pub trait SampleSource: Send + Sync + std::fmt::Debug {
    /// Samples per pixel, 1 to 256.
    fn per_pixel(&self) -> u32;

    /// Write the [`Self::per_pixel`] samples of pixel (`px`, `py`) into `into`.
    fn pixel_into(&self, px: u32, py: u32, into: &mut [Sample]);

    /// Samples of the block of 8x8 pixels that starts at (`px`, `py`), sorted by time, if the source has them.
    fn block_by_time(&self, _px: u32, _py: u32) -> Option<&TimedBlock> {
        None
    }

    /// Regions of the lens that contain the lens position of every sample; empty if nothing is known.
    fn lens_regions(&self) -> &[LensRegion] {
        &[]
    }
}

/// Samples of one tile as arrays, sorted by time so that a time interval is a contiguous range. Arrays are
/// padded to whole blocks of [`TileSamples::LANES`]; the time of padding is outside all intervals.
#[derive(Clone, Debug, Default)]
pub struct TileSamples {
    /// Samples without padding.
    pub len: usize,
    /// Image position in pixels from the centre of the image.
    pub x: Vec<f32>,
    /// Image position in pixels from the centre of the image, downwards.
    pub y: Vec<f32>,
    /// Image position from the middle of the part of the tile in the image, as the sample table of the
    /// hardware keeps it.
    pub from_middle: [Vec<f32>; 2],
    /// Lens position.
    pub u: Vec<f32>,
    /// Lens position.
    pub v: Vec<f32>,
    /// Time over the shutter.
    pub t: Vec<f32>,
    /// Depth-independent offset of a vertex: `u s.x` and `v s.y`, in an orthographic view `x + u s.x` and `y
    /// + v s.y`.
    pub lens: [Vec<f32>; 2],
    /// Factor of a vertex's depth: `x - u a.x` and `y - v a.y`, in an orthographic view `-u a.x` and `-v
    /// a.y`.
    pub slope: [Vec<f32>; 2],
    /// Whether the view is orthographic.
    pub parallel: bool,
    /// Pixel in the tile, row by row.
    pub pixel: Vec<u8>,
    order: Vec<u16>,
    /// Samples of a tile whose source has not sorted them.
    gathered: Vec<Timed>,
    sorted: TimedBlock,
    of_pixel: Vec<Sample>,
}

impl TileSamples {
    /// Samples tested together.
    pub const LANES: usize = 16;
    /// Time of padding.
    const PADDING_TIME: f32 = f32::INFINITY;

    /// Fill the arrays for the tile of `side_px` pixels (at most 8) whose first pixel is `(px, py)`. Pixels
    /// outside the viewport have no samples.
    pub fn fill(
        &mut self,
        source: &dyn SampleSource,
        viewport: Viewport,
        shear: &Shear,
        [px, py]: [u32; 2],
        side_px: u32,
    ) {
        let inside = [side_px.min(viewport.width() - px), side_px.min(viewport.height() - py)];
        let is_block = [SampleTable::SHIFT_PX; 2] == inside && side_px == SampleTable::SHIFT_PX;
        if let Some(sorted) = source.block_by_time(px, py).filter(|_| is_block) {
            return self.fill_sorted(sorted, viewport, shear, ([px, py], inside));
        }
        self.gather(source, ([px, py], inside, side_px));
        let mut sorted = std::mem::take(&mut self.sorted);
        sorted.fill(&mut self.gathered, side_px);
        self.fill_sorted(&sorted, viewport, shear, ([px, py], inside));
        self.sorted = sorted;
    }

    /// Gathers the samples of a tile's pixels `inside` the image.
    fn gather(&mut self, source: &dyn SampleSource, ([px, py], inside, side_px): ([u32; 2], [u32; 2], u32)) {
        let per_pixel = source.per_pixel();
        self.of_pixel.resize(per_pixel as usize, Sample::default());
        self.gathered.clear();
        for pixel in 0..side_px * side_px {
            let [column, row] = [pixel % side_px, pixel / side_px];
            if column < inside[0] && row < inside[1] {
                source.pixel_into(px + column, py + row, &mut self.of_pixel);
                let timed = |(index, sample): (u32, &Sample)| {
                    let index = (pixel * per_pixel + index) as u16;
                    Timed { sample: *sample, index, pixel: pixel as u8 }
                };
                self.gathered.extend((0..).zip(&self.of_pixel).map(timed));
            }
        }
    }

    /// Fills the arrays with samples that are sorted by time. The first pixel of the tile and its pixels
    /// inside the image are given.
    fn fill_sorted(
        &mut self,
        sorted: &TimedBlock,
        viewport: Viewport,
        shear: &Shear,
        ([px, py], inside): ([u32; 2], [u32; 2]),
    ) {
        (self.len, self.parallel) = (sorted.t.len(), shear.parallel);
        self.resize(self.len.next_multiple_of(Self::LANES));
        let sides = [(px, inside[0], viewport.width()), (py, inside[1], viewport.height())];
        let middle = sides.map(|(first, count, side)| {
            0.5 * (Viewport::edge(first, side) + Viewport::edge(first + count, side))
        });
        self.place(sorted, sides.map(|(first, _, side)| Viewport::edge(first, side)));
        self.follow(shear, middle);
    }

    /// Fills the arrays that hold samples as they are, and the image positions, with the corner of the tile.
    fn place(&mut self, sorted: &TimedBlock, corner: [f32; 2]) {
        let Self { x, y, u, v, t, pixel, order, len, .. } = self;
        for (axis, into) in [x, y].into_iter().enumerate() {
            let places = sorted.at[axis].iter().zip(&sorted.within[axis]);
            // The corner of a pixel is exact.
            into.iter_mut().zip(places).for_each(|(into, (at, within))| *into = (corner[axis] + at) + within);
        }
        for (into, from) in [(u, &sorted.lens[0]), (v, &sorted.lens[1]), (t, &sorted.t)] {
            into[..*len].copy_from_slice(from);
        }
        pixel[..*len].copy_from_slice(&sorted.pixel);
        order.clone_from(&sorted.index);
    }

    /// Fills the arrays that follow from these.
    fn follow(&mut self, shear: &Shear, middle: [f32; 2]) {
        let Self { x, y, u, v, from_middle, slope, lens, len, .. } = self;
        for (axis, (at, places)) in [(x, u), (y, v)].into_iter().enumerate() {
            let (slope, lens) = (&mut slope[axis][..*len], &mut lens[axis][..*len]);
            let all = at[..*len].iter().zip(&places[..*len]).zip(slope).zip(lens).zip(&mut from_middle[axis]);
            for ((((at, place), slope), lens), from_middle) in all {
                *from_middle = at - middle[axis];
                [*slope, *lens] = shear.ray(axis, *at, *place);
            }
        }
    }

    /// Index in the whole image of the sample in `slot` of the tile of `side_px` pixels whose first pixel is
    /// `(px, py)`: `(y width + x) per_pixel + index`.
    pub fn in_image(
        &self,
        slot: usize,
        [px, py]: [u32; 2],
        side_px: u32,
        viewport: Viewport,
        per_pixel: u32,
    ) -> usize {
        let index = u32::from(self.order[slot]);
        let (pixel, sample) = (index / per_pixel, index % per_pixel);
        let [x, y] = [px + pixel % side_px, py + pixel / side_px].map(|c| c as usize);
        (y * viewport.width() as usize + x) * per_pixel as usize + sample as usize
    }

    /// Index in its pixel of the sample in `slot`, of `per_pixel`.
    pub fn in_pixel(&self, slot: usize, per_pixel: u32) -> u32 {
        u32::from(self.order[slot]) % per_pixel
    }

    /// Places of the samples, by slot: the pixel in the tile, row by row, times the samples per pixel, plus
    /// the index in the pixel.
    pub(crate) fn places(&self) -> &[u16] {
        &self.order
    }

    fn resize(&mut self, padded: usize) {
        let [lens_x, lens_y] = &mut self.lens;
        let [slope_x, slope_y] = &mut self.slope;
        let [near_x, near_y] = &mut self.from_middle;
        let of_image = [&mut self.x, &mut self.y, near_x, near_y, slope_x, slope_y];
        // What is beyond the samples stays or becomes padding; the samples are overwritten.
        let pads = |array: &mut Vec<f32>, len: usize, padding: f32| {
            array.resize(padded, padding);
            array[len..].fill(padding);
        };
        for array in of_image.into_iter().chain([&mut self.u, &mut self.v, lens_x, lens_y]) {
            pads(array, self.len, 0.0);
        }
        pads(&mut self.t, self.len, Self::PADDING_TIME);
        self.pixel.resize(padded, 0);
        self.pixel[self.len..].fill(0);
    }

    /// Range of samples with `lo <= t <= hi`.
    pub fn between(&self, lo: f32, hi: f32) -> std::ops::Range<usize> {
        let times = &self.t[..self.len];
        times.partition_point(|&t| t < lo)..times.partition_point(|&t| t <= hi)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampling::LensShape;

    #[test]
    fn a_tile_holds_each_sample_of_its_pixels_once() {
        let table = SampleTable::low_discrepancy(5, 1, LensShape::Disk).unwrap();
        let viewport = Viewport::new(20, 11).unwrap();
        let mut tile = TileSamples::default();
        tile.fill(&table, viewport, &Shear::default(), [16, 8], 8);
        assert_eq!(tile.len, 4 * 3 * 5);
        assert_eq!(tile.t.len() % TileSamples::LANES, 0);
        assert!(tile.t[..tile.len].is_sorted());
        for slot in 0..tile.len {
            let (column, row) = (16 + u32::from(tile.pixel[slot]) % 8, 8 + u32::from(tile.pixel[slot]) / 8);
            let here = table.pixel(column, row);
            assert!(here.iter().any(|s| s.t == tile.t[slot] && column as f32 - 10.0 + s.x == tile.x[slot]));
        }
    }

    #[test]
    fn a_time_interval_is_a_run() {
        let table = SampleTable::low_discrepancy(8, 1, LensShape::Disk).unwrap();
        let mut tile = TileSamples::default();
        tile.fill(&table, Viewport::new(64, 64).unwrap(), &Shear::default(), [8, 8], 8);
        let run = tile.between(0.25, 0.5);
        let inside = tile.t[..tile.len].iter().filter(|t| (0.25..=0.5).contains(*t)).count();
        assert_eq!(run.len(), inside);
        assert!(tile.t[run].iter().all(|t| (0.25..=0.5).contains(t)));
    }
}
