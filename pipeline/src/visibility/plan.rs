//! How the samples of the image are divided before any triangle is known.

use crate::simd::LANES;

/// A dimension along which samples are divided.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Axis {
    X,
    Y,
    U,
    V,
    T,
}

/// Bins of blocks of cells of packets. A *packet* is sixteen samples that are tested together; a *cell* is a box of lens and
/// time, the same for all blocks of a bin as nearly as the samples allow, with at most sixteen packets in a block; a *block* is a
/// rectangle of pixels; a *bin* is a square of blocks that one worker rasterizes, small enough for its samples and their
/// depths to stay in the second-level cache.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Plan {
    /// The axes that divide a block into cells, each by halves.
    pub cell_axes: &'static [Axis],
    /// Size of a block in pixels.
    pub block_px: [u32; 2],
    /// Side of a bin in pixels.
    pub bin_px: u32,
}

impl Plan {
    /// The axes that divide a cell into packets.
    pub const PACKET_AXES: [Axis; 4] = [Axis::Y, Axis::X, Axis::Y, Axis::X];
    /// What a bin should hold.
    const BIN_SAMPLES: u32 = 1 << 16;

    /// The plan for `per_pixel` samples in the dimensions in use: only those are divided.
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
            // Wider first, so that a block is a square or two.
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_fill_their_packets_and_bins_their_blocks() {
        for per_pixel in 1..=256 {
            for (moving, lens) in [(false, false), (true, false), (false, true), (true, true)] {
                let plan = Plan::new(per_pixel, moving, lens);
                let samples = plan.block_px[0] * plan.block_px[1] * per_pixel;
                let room = (plan.cells() * LANES * LANES) as u32;
                assert!(samples <= room && (2 * samples > room || samples == per_pixel), "{plan:?}");
                assert!(plan.blocks().iter().all(|&count| count >= 1), "{plan:?}");
                assert_eq!(plan.blocks()[0] * plan.block_px[0], plan.bin_px);
                assert_eq!(plan.blocks()[1] * plan.block_px[1], plan.bin_px);
            }
        }
    }

    #[test]
    fn sixteen_samples_in_five_dimensions() {
        let plan = Plan::new(16, true, true);
        assert_eq!((plan.block_px, plan.bin_px, plan.cells()), ([16, 16], 64, 16));
    }
}
