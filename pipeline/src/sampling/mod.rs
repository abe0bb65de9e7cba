//! Sampling: samples, their sources, and sample tables over the image, the lens and the shutter.

mod lens;
mod pattern;
mod table;
mod tile;

pub use lens::{LensRegion, LensRegions, LensShape};
pub use pattern::{HashedSamples, Pattern};
pub use table::{SampleSpec, SampleTable, TableError};
pub use tile::TileSamples;

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
#[derive(Clone, Debug, Default)]
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
