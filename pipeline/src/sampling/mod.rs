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
pub struct Timed {
    /// The sample.
    pub sample: Sample,
    /// The pixel in the block, row by row, times the samples per pixel, plus the index in the pixel.
    pub index: u16,
    /// The pixel in the block, row by row.
    pub pixel: u8,
}

impl Timed {
    /// Sorts samples by time; the index breaks ties.
    fn sort(samples: &mut [Self]) {
        // Times are not negative, so their bits sort as they do.
        samples.sort_unstable_by_key(|timed| (timed.sample.t.to_bits(), timed.index));
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
    fn block_by_time(&self, _px: u32, _py: u32) -> Option<&[Timed]> {
        None
    }

    /// Regions of the lens that contain the lens position of every sample; empty if nothing is known.
    fn lens_regions(&self) -> &[LensRegion] {
        &[]
    }
}
