//! A programmable table of samples, tiled over the image.

use super::hash::word;
use super::sobol::{owen, sobol};
use super::{LensShape, SampleSource};

/// One sample of a pixel.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sample {
    /// Position within the pixel, [0, 1).
    pub x: f32,
    /// Position within the pixel, [0, 1), downwards.
    pub y: f32,
    /// Lens position, [-1, 1].
    pub u: f32,
    /// Lens position, [-1, 1], upwards.
    pub v: f32,
    /// Time, [0, 1) over the shutter.
    pub t: f32,
}

impl Sample {
    /// Whether it lies in its pixel, in the square of the lens and in the shutter.
    pub fn is_in_range(&self) -> bool {
        let unit = 0.0..1.0;
        let lens = -1.0..=1.0;
        [self.x, self.y, self.t].iter().all(|c| unit.contains(c))
            && [self.u, self.v].iter().all(|c| lens.contains(c))
    }
}

/// Samples for a square block of pixels. The block repeats over the image, each copy turned round in itself by an
/// offset hashed from the seed, so that a sample is a pure function of (seed, pixel, index).
#[derive(Clone, Debug)]
pub struct SampleTable {
    per_pixel: u32,
    seed: u64,
    samples: Vec<Sample>,
    /// For each block of [`Self::TURN_PX`] pixels squared, its samples by time: the pixel in the block times
    /// `per_pixel` plus the index in the pixel.
    by_time: Vec<u16>,
}

/// Why a sample table cannot be built.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum TableError {
    /// Too few or too many samples in a pixel.
    #[error("{0} samples per pixel; it has to be 1 to {max}", max = SampleTable::MAX_PER_PIXEL)]
    PerPixel(u32),
    /// The block is not filled.
    #[error("{found} samples for a block of {expected}")]
    Length {
        /// Samples given.
        found: usize,
        /// Samples of a block.
        expected: usize,
    },
    /// A sample lies outside pixel, lens or shutter.
    #[error("sample {0} of the block lies outside [0, 1) in x, y or t, or outside [-1, 1] in u or v")]
    Range(usize),
}

impl SampleTable {
    /// Side of the block in pixels.
    pub const SIDE_PX: u32 = 64;
    /// Copies are turned by multiples of this many pixels, the largest tile, so that the samples of a tile keep
    /// together.
    pub const TURN_PX: u32 = 8;
    /// The most samples a pixel may have.
    pub const MAX_PER_PIXEL: u32 = 256;

    /// The default table: in each pixel the first `per_pixel` points of a five-dimensional Sobol sequence, Owen
    /// scrambled by pixel, with `u, v` mapped to the aperture.
    ///
    /// # Errors
    /// When `per_pixel` is zero or above [`Self::MAX_PER_PIXEL`].
    pub fn low_discrepancy(per_pixel: u32, seed: u64, shape: LensShape) -> Result<Self, TableError> {
        if !(1..=Self::MAX_PER_PIXEL).contains(&per_pixel) {
            return Err(TableError::PerPixel(per_pixel));
        }
        let pixels = Self::SIDE_PX * Self::SIDE_PX;
        let samples = (0..pixels)
            .flat_map(|pixel| (0..per_pixel).map(move |index| scrambled(seed, pixel, index, shape)))
            .collect();
        Self::programmed(per_pixel, seed, samples)
    }

    /// A table of one's own: `per_pixel` samples for each pixel of a block of [`Self::SIDE_PX`] pixels squared, row by row.
    ///
    /// # Errors
    /// When `per_pixel` is zero or above [`Self::MAX_PER_PIXEL`], the block is not filled, or a sample is out of range.
    pub fn programmed(per_pixel: u32, seed: u64, samples: Vec<Sample>) -> Result<Self, TableError> {
        if !(1..=Self::MAX_PER_PIXEL).contains(&per_pixel) {
            return Err(TableError::PerPixel(per_pixel));
        }
        let expected = (Self::SIDE_PX * Self::SIDE_PX * per_pixel) as usize;
        if samples.len() != expected {
            return Err(TableError::Length { found: samples.len(), expected });
        }
        if let Some(outside) = samples.iter().position(|sample| !sample.is_in_range()) {
            return Err(TableError::Range(outside));
        }
        let mut table = Self { per_pixel, seed, samples, by_time: Vec::new() };
        table.by_time = table.sorted_blocks();
        Ok(table)
    }

    fn sorted_blocks(&self) -> Vec<u16> {
        let blocks = Self::SIDE_PX / Self::TURN_PX;
        let per_block = Self::TURN_PX * Self::TURN_PX * self.per_pixel;
        let mut sorted = Vec::with_capacity(self.samples.len());
        for block in 0..blocks * blocks {
            let (x0, y0) = (block % blocks * Self::TURN_PX, block / blocks * Self::TURN_PX);
            let mut order: Vec<u16> = (0..per_block).map(|index| index as u16).collect();
            // Times are not negative, so their bits sort as they do; the index breaks ties.
            order.sort_by_key(|&index| {
                let (pixel, sample) = (u32::from(index) / self.per_pixel, u32::from(index) % self.per_pixel);
                let (x, y) = (x0 + pixel % Self::TURN_PX, y0 + pixel / Self::TURN_PX);
                self.samples[((y * Self::SIDE_PX + x) * self.per_pixel + sample) as usize].t.to_bits()
            });
            sorted.extend(order);
        }
        sorted
    }

    /// Samples in each pixel.
    pub fn per_pixel(&self) -> u32 {
        self.per_pixel
    }

    /// The samples of pixel (`px`, `py`), in table order.
    pub fn pixel(&self, px: u32, py: u32) -> &[Sample] {
        let (x, y) = self.place(px, py);
        let first = ((y * Self::SIDE_PX + x) * self.per_pixel) as usize;
        &self.samples[first..first + self.per_pixel as usize]
    }

    /// Where in the block pixel (`px`, `py`) looks.
    fn place(&self, px: u32, py: u32) -> (u32, u32) {
        let copy = word(self.seed, u64::from(px / Self::SIDE_PX), u64::from(py / Self::SIDE_PX));
        let turn = |bits: u64, at: u32| {
            (at + bits as u32 % Self::SIDE_PX / Self::TURN_PX * Self::TURN_PX) % Self::SIDE_PX
        };
        (turn(copy & 0xFFFF, px), turn((copy >> 16) & 0xFFFF, py))
    }
}

impl SampleSource for SampleTable {
    fn per_pixel(&self) -> u32 {
        self.per_pixel
    }

    fn pixel_into(&self, px: u32, py: u32, into: &mut [Sample]) {
        into.copy_from_slice(self.pixel(px, py));
    }

    fn block_by_time(&self, px: u32, py: u32) -> Option<&[u16]> {
        let (x, y) = self.place(px, py);
        let block = y / Self::TURN_PX * (Self::SIDE_PX / Self::TURN_PX) + x / Self::TURN_PX;
        let per_block = (Self::TURN_PX * Self::TURN_PX * self.per_pixel) as usize;
        self.by_time.chunks_exact(per_block).nth(block as usize)
    }
}

fn scrambled(seed: u64, pixel: u32, index: u32, shape: LensShape) -> Sample {
    let [x, y, u, v, t] = [0, 1, 2, 3, 4].map(|dim| {
        let bits = owen(sobol(index, dim), word(seed, u64::from(pixel), dim as u64) as u32);
        // 24 bits, so that the fraction is exact in f32 and below one.
        (bits >> 8) as f32 / 16_777_216.0
    });
    let [u, v] = shape.map([u, v]);
    Sample { x, y, u, v, t }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_are_in_range_and_pure() {
        let table = SampleTable::low_discrepancy(8, 7, LensShape::Disk).unwrap();
        let again = SampleTable::low_discrepancy(8, 7, LensShape::Disk).unwrap();
        for (px, py) in [(0, 0), (63, 63), (64, 0), (1279, 719)] {
            assert_eq!(table.pixel(px, py), again.pixel(px, py));
            for s in table.pixel(px, py) {
                assert!([s.x, s.y, s.t].iter().all(|c| (0.0..1.0).contains(c)));
                assert!(s.u * s.u + s.v * s.v <= 1.000_001);
            }
        }
    }

    #[test]
    fn time_is_stratified_in_every_pixel() {
        let table = SampleTable::low_discrepancy(16, 3, LensShape::Square).unwrap();
        let mut strata: Vec<_> = table.pixel(17, 5).iter().map(|s| (s.t * 16.0) as u32).collect();
        strata.sort_unstable();
        assert_eq!(strata, (0..16).collect::<Vec<_>>());
    }

    #[test]
    fn a_pixel_needs_a_sample() {
        assert_eq!(SampleTable::low_discrepancy(0, 1, LensShape::Disk).unwrap_err(), TableError::PerPixel(0));
        assert_eq!(
            SampleTable::low_discrepancy(257, 1, LensShape::Disk).unwrap_err(),
            TableError::PerPixel(257)
        );
    }
}
