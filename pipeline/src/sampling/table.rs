//! Programmable sample table, tiled over the image, and its description.

use serde::{Deserialize, Serialize};

use super::{LensRegion, LensRegions, LensShape, Pattern, Sample, SampleSource, TimedBlock};
use crate::random::word;

/// Samples of a square block of pixels. The block repeats over the image. Each copy is shifted cyclically by
/// an offset hashed from the seed, so a sample is a pure function of (seed, pixel, index).
#[derive(Clone, Debug)]
pub struct SampleTable {
    per_pixel: u32,
    seed: u64,
    samples: Vec<Sample>,
    regions: Vec<LensRegion>,
    /// The blocks of [`Self::SHIFT_PX`] pixels squared.
    by_time: Vec<TimedBlock>,
}

/// Why a sample table is invalid.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum SampleTableError {
    /// The number of samples per pixel is out of range.
    #[error("{0} samples per pixel; it has to be 1 to {max}", max = SampleTable::MAX_PER_PIXEL)]
    PerPixel(u32),
    /// The number of samples does not fill the block.
    #[error("{found} samples for a block of {expected}")]
    Length {
        /// Samples given.
        found: usize,
        /// Samples of a block.
        expected: usize,
    },
    /// A sample is outside pixel, lens or shutter.
    #[error("sample {0} of the block lies outside [0, 1) in x, y or t, or outside [-1, 1] in u or v")]
    Range(usize),
    /// The samples of a pixel cannot be divided evenly among the regions.
    #[error("{per_pixel} samples per pixel for {regions} regions of the lens; take a multiple of {regions}")]
    Shares {
        /// Samples per pixel.
        per_pixel: u32,
        /// Regions of the lens.
        regions: u32,
    },
    /// The list of lens regions is empty, too long, or has invalid or overlapping regions.
    #[error("the regions of the lens have to be 1 to 256 rectangles within -1 and 1 that do not overlap")]
    Regions,
    /// A fixed set of points is invalid.
    #[error("a fixed set has 1 to 65536 points, u and v within -1 and 1, t from 0 to below 1")]
    Points,
    /// There is no multisample pattern with this number of samples.
    #[error("{0} samples per pixel; multisample patterns have 1, 2, 4, 8 or 16")]
    Multisample(u32),
    /// The number of iris blades is out of range.
    #[error("{0} blades; an iris has 3 to 64")]
    Blades(u32),
    /// Given points are lens positions, which cannot be divided among regions.
    #[error("given points and multisample patterns are lens samples as they are: leave `regions` out")]
    GivenRegions,
}

impl SampleTable {
    /// Side of the block in pixels.
    pub const SIDE_PX: u32 = 64;
    /// Copies are shifted by multiples of this many pixels, the largest tile, so the samples of a tile stay
    /// together.
    pub const SHIFT_PX: u32 = 8;
    /// Largest number of samples per pixel.
    pub const MAX_PER_PIXEL: u32 = 256;

    /// The default table: each pixel has the first `per_pixel` points of a five-dimensional Sobol sequence,
    /// Owen scrambled by pixel, with `u, v` mapped to the aperture.
    ///
    /// # Errors
    /// [`SampleTableError`] if `per_pixel` is zero or above [`Self::MAX_PER_PIXEL`].
    pub fn low_discrepancy(per_pixel: u32, seed: u64, shape: LensShape) -> Result<Self, SampleTableError> {
        Self::new(&SampleSpec { lens: shape, ..SampleSpec::default() }, per_pixel, seed)
    }

    /// The table described by `spec`, with `per_pixel` samples per pixel. Every region of the lens has its
    /// own range of the pattern's samples.
    ///
    /// # Errors
    /// [`SampleTableError`] if `per_pixel` is out of range or not divisible among the regions, or if the
    /// description is invalid.
    pub fn new(spec: &SampleSpec, per_pixel: u32, seed: u64) -> Result<Self, SampleTableError> {
        if !(1..=Self::MAX_PER_PIXEL).contains(&per_pixel) {
            return Err(SampleTableError::PerPixel(per_pixel));
        }
        if !spec.pattern.is_sane() {
            return Err(SampleTableError::Points);
        }
        if !spec.pattern.has(per_pixel) {
            return Err(SampleTableError::Multisample(per_pixel));
        }
        if let LensShape::Polygon { blades, .. } = spec.lens
            && !LensShape::BLADES.contains(&blades)
        {
            return Err(SampleTableError::Blades(blades));
        }
        let regions = spec.regions.rectangles().ok_or(SampleTableError::Regions)?;
        if spec.pattern.is_on_lens() && regions != [LensRegion::WHOLE] {
            return Err(SampleTableError::GivenRegions);
        }
        let count = regions.len() as u32;
        if !per_pixel.is_multiple_of(count) {
            return Err(SampleTableError::Shares { per_pixel, regions: count });
        }
        let mut samples = vec![Sample::default(); (Self::SIDE_PX * Self::SIDE_PX * per_pixel) as usize];
        for (pixel, of_pixel) in (0_u32..).zip(samples.chunks_exact_mut(per_pixel as usize)) {
            let at = [pixel % Self::SIDE_PX, pixel / Self::SIDE_PX];
            let runs = of_pixel.chunks_exact_mut((per_pixel / count) as usize);
            for ((region, run), number) in regions.iter().zip(runs).zip(0_u64..) {
                // The first region keeps the seed, so a lens of one region equals an undivided lens.
                let seed = if number == 0 { seed } else { word(seed, u64::MAX, number) };
                spec.pattern.fill(seed, at, Self::SIDE_PX, run);
                if !spec.pattern.is_on_lens() {
                    run.iter_mut().for_each(|s| [s.u, s.v] = region.map(spec.lens.map([s.u, s.v])));
                }
            }
        }
        Ok(Self { regions, ..Self::programmed(per_pixel, seed, samples)? })
    }

    /// A table of given samples: `per_pixel` for each pixel of a block of [`Self::SIDE_PX`] pixels squared,
    /// row by row.
    ///
    /// # Errors
    /// [`SampleTableError`] if `per_pixel` is zero or above [`Self::MAX_PER_PIXEL`], the block is not filled, or a
    /// sample is out of range.
    pub fn programmed(per_pixel: u32, seed: u64, samples: Vec<Sample>) -> Result<Self, SampleTableError> {
        if !(1..=Self::MAX_PER_PIXEL).contains(&per_pixel) {
            return Err(SampleTableError::PerPixel(per_pixel));
        }
        let expected = (Self::SIDE_PX * Self::SIDE_PX * per_pixel) as usize;
        if samples.len() != expected {
            return Err(SampleTableError::Length { found: samples.len(), expected });
        }
        if let Some(outside) = samples.iter().position(|sample| !sample.is_in_range()) {
            return Err(SampleTableError::Range(outside));
        }
        let regions = vec![LensRegion::WHOLE];
        let mut table = Self { per_pixel, seed, samples, regions, by_time: Vec::new() };
        table.by_time = table.sorted_blocks();
        Ok(table)
    }

    fn sorted_blocks(&self) -> Vec<TimedBlock> {
        let (blocks, side) = (Self::SIDE_PX / Self::SHIFT_PX, Self::SHIFT_PX);
        let block = |block: u32| {
            let (x0, y0) = (block % blocks * side, block / blocks * side);
            TimedBlock::new(|pixel| self.of_pixel([x0 + pixel % side, y0 + pixel / side]))
        };
        (0..blocks * blocks).map(block).collect()
    }

    /// Samples per pixel.
    pub fn per_pixel(&self) -> u32 {
        self.per_pixel
    }

    /// Samples of pixel (`px`, `py`), in table order.
    pub fn pixel(&self, px: u32, py: u32) -> &[Sample] {
        self.of_pixel(self.block_pixel(px, py))
    }

    /// Samples of a pixel of the table.
    fn of_pixel(&self, [x, y]: [u32; 2]) -> &[Sample] {
        let first = ((y * Self::SIDE_PX + x) * self.per_pixel) as usize;
        &self.samples[first..first + self.per_pixel as usize]
    }

    /// Regions of the lens, in order; an undivided lens is one region.
    pub fn regions(&self) -> &[LensRegion] {
        &self.regions
    }

    /// Pixel of the block for pixel (`px`, `py`) of the image.
    fn block_pixel(&self, px: u32, py: u32) -> [u32; 2] {
        let copy = word(self.seed, u64::from(px / Self::SIDE_PX), u64::from(py / Self::SIDE_PX));
        let turn = |bits: u64, at: u32| {
            (at + bits as u32 % Self::SIDE_PX / Self::SHIFT_PX * Self::SHIFT_PX) % Self::SIDE_PX
        };
        [turn(copy & 0xFFFF, px), turn((copy >> 16) & 0xFFFF, py)]
    }
}

impl SampleSource for SampleTable {
    fn per_pixel(&self) -> u32 {
        self.per_pixel
    }

    fn pixel_into(&self, px: u32, py: u32, into: &mut [Sample]) {
        into.copy_from_slice(self.pixel(px, py));
    }

    fn block_by_time(&self, px: u32, py: u32) -> Option<&TimedBlock> {
        let [x, y] = self.block_pixel(px, py);
        self.by_time
            .get((y / Self::SHIFT_PX * (Self::SIDE_PX / Self::SHIFT_PX) + x / Self::SHIFT_PX) as usize)
    }

    fn lens_regions(&self) -> &[LensRegion] {
        &self.regions
    }
}

/// Description of a sample table, as in a RON file. Missing fields have the values of the default table.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SampleSpec {
    /// Distribution of the samples of a pixel.
    pub pattern: Pattern,
    /// Shape of the aperture, or of each region's.
    pub lens: LensShape,
    /// Division of the lens.
    pub regions: LensRegions,
}

/// Named tables with a description each.
const NAMED: [(&str, &str); 6] = [
    ("owen", "Sobol points, Owen scrambled by pixel; the default"),
    ("sobol", "Sobol points as they are, the same in every pixel"),
    ("random", "independent uniform numbers"),
    ("jittered", "a random point in each cell of pixel, lens and shutter"),
    ("interleaved", "64 places on lens and in time, shared by all pixels"),
    ("msaa", "standard positions of 1, 2, 4, 8 or 16 samples, without lens and shutter"),
];

impl SampleSpec {
    /// Named tables with a description each, one line long.
    pub fn names() -> impl Iterator<Item = (&'static str, &'static str)> {
        NAMED.into_iter()
    }

    /// The table called `name`.
    pub fn named(name: &str) -> Option<Self> {
        let pattern = match name {
            "owen" => Pattern::Owen,
            "sobol" => Pattern::Sobol,
            "random" => Pattern::Random,
            "jittered" => Pattern::Jittered,
            "interleaved" => Pattern::Interleaved { points: 64 },
            "msaa" => Pattern::Multisample,
            _ => return None,
        };
        Some(Self { pattern, ..Self::default() })
    }
}

#[cfg(test)]
mod tests {
    use super::super::SampleTable;
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

    /// Each row and each column of sixteenths holds one sample at most, so edges near an axis are resolved evenly.
    #[test]
    fn multisample_positions_share_no_row_and_no_column() {
        for per_pixel in [1, 2, 4, 8, 16] {
            let table = SampleTable::new(&SampleSpec::named("msaa").unwrap(), per_pixel, 1).unwrap();
            assert_eq!(table.pixel(3, 70), table.pixel(0, 0));
            let samples = table.pixel(0, 0);
            for axis in [|s: &Sample| s.x, |s: &Sample| s.y] {
                let mut places: Vec<_> = samples.iter().map(|s| (axis(s) * 16.0) as u32).collect();
                places.sort_unstable();
                places.dedup();
                assert_eq!(places.len(), per_pixel as usize);
            }
            assert!(samples.iter().all(|s| [s.u, s.v, s.t] == [0.0, 0.0, 0.5]));
        }
    }

    #[test]
    fn a_pixel_needs_a_sample() {
        assert_eq!(
            SampleTable::low_discrepancy(0, 1, LensShape::Disk).unwrap_err(),
            SampleTableError::PerPixel(0)
        );
        assert_eq!(
            SampleTable::low_discrepancy(257, 1, LensShape::Disk).unwrap_err(),
            SampleTableError::PerPixel(257)
        );
    }

    #[test]
    fn each_region_has_its_run_of_samples_and_no_other() {
        use super::super::LensRegions;
        for regions in [LensRegions::Across(2), LensRegions::Grid(2, 2), LensRegions::Across(8)] {
            for lens in [LensShape::Square, LensShape::Disk] {
                let spec = SampleSpec { lens, regions: regions.clone(), ..SampleSpec::default() };
                let table = SampleTable::new(&spec, 16, 5).unwrap();
                let each = 16 / table.regions().len();
                for (px, py) in [(0, 0), (70, 9)] {
                    for (index, s) in (0_u32..).zip(table.pixel(px, py)) {
                        let region = index as usize / each;
                        let holds = table.regions().iter().map(|r| r.contains([s.u, s.v]));
                        assert_eq!(holds.clone().position(|h| h), Some(region), "{s:?} of {regions:?}");
                    }
                }
            }
        }
    }

    #[test]
    fn the_samples_of_each_region_are_stratified_in_time() {
        use super::super::LensRegions;
        let spec = SampleSpec { regions: LensRegions::Across(2), ..SampleSpec::default() };
        let table = SampleTable::new(&spec, 16, 5).unwrap();
        for run in table.pixel(9, 33).chunks_exact(8) {
            let mut strata: Vec<_> = run.iter().map(|s| (s.t * 8.0) as u32).collect();
            strata.sort_unstable();
            assert_eq!(strata, (0..8).collect::<Vec<_>>());
        }
    }

    #[test]
    fn samples_that_cannot_be_shared_out_are_refused() {
        use super::super::{LensRegions, Pattern};
        let three = SampleSpec { regions: LensRegions::Across(3), ..SampleSpec::default() };
        assert_eq!(
            SampleTable::new(&three, 8, 1).unwrap_err(),
            SampleTableError::Shares { per_pixel: 8, regions: 3 }
        );
        let pattern = Pattern::Given { points: vec![(0.0, 0.0, 0.0)] };
        assert_eq!(
            SampleTable::new(&SampleSpec { pattern, ..three }, 9, 1).unwrap_err(),
            SampleTableError::GivenRegions
        );
        let none = SampleSpec { pattern: Pattern::Interleaved { points: 0 }, ..SampleSpec::default() };
        assert_eq!(SampleTable::new(&none, 9, 1).unwrap_err(), SampleTableError::Points);
    }

    #[test]
    fn every_name_makes_a_table() {
        for (name, _) in SampleSpec::names() {
            let table = SampleTable::new(&SampleSpec::named(name).unwrap(), 8, 1).unwrap();
            assert_eq!(table.per_pixel(), 8, "{name}");
        }
        let msaa = SampleSpec::named("msaa").unwrap();
        assert_eq!(SampleTable::new(&msaa, 6, 1).unwrap_err(), SampleTableError::Multisample(6));
        assert_eq!(SampleSpec::named("owen"), Some(SampleSpec::default()));
        assert_eq!(SampleSpec::named("sobel"), None);
    }
}
