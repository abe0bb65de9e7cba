//! What a tile remembers.

use super::{BoxGrid, DepthBoxes};
use crate::sampling::TileSamples;

/// The stored samples of one tile.
#[derive(Clone, Debug)]
pub struct DepthTile {
    /// Depth of the nearest hit of each sample, infinite where there is none.
    pub depth: Vec<f32>,
    /// Triangle of the nearest hit, [`Self::NOTHING`] where there is none.
    pub triangle: Vec<u32>,
    /// The farthest and nearest depths.
    pub boxes: DepthBoxes,
}

impl DepthTile {
    /// The triangle of a sample that sees none.
    pub const NOTHING: u32 = u32::MAX;

    /// A cleared tile of `samples`.
    pub fn cleared(grid: BoxGrid, samples: &TileSamples) -> Self {
        Self {
            depth: vec![f32::INFINITY; samples.len],
            triangle: vec![Self::NOTHING; samples.len],
            boxes: DepthBoxes::cleared(grid, samples),
        }
    }

    /// Notes that the depths in `slots` were written. Returns how many boxes have a new nearest depth.
    pub fn wrote(&mut self, slots: &[u16]) -> u32 {
        self.boxes.write(&self.depth, slots)
    }

    /// Brings the farthest depths up to date. Returns how many boxes were not.
    pub fn renew(&mut self) -> u32 {
        self.boxes.renew(&self.depth)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::traversal::Box5;

    #[test]
    #[allow(clippy::field_reassign_with_default, reason = "the other fields are private")]
    fn a_tile_is_as_far_as_its_farthest_sample() {
        let mut samples = TileSamples::default();
        samples.len = 2;
        let mut tile = DepthTile::cleared(BoxGrid::new([1; 3], false).unwrap(), &samples);
        let whole = Box5::whole(false);
        let farthest = |tile: &mut DepthTile| (tile.renew(), tile.boxes.farthest(&whole));
        assert_eq!(farthest(&mut tile), (0, f32::INFINITY));
        tile.depth[0] = 3.0;
        assert_eq!(tile.wrote(&[0]), 1);
        assert_eq!((farthest(&mut tile), tile.boxes.nearest(&whole)), ((1, f32::INFINITY), 3.0));
        tile.depth[1] = 5.0;
        assert_eq!(tile.wrote(&[1]), 0, "farther than the nearest");
        assert_eq!(farthest(&mut tile), (1, 5.0));
        assert_eq!((farthest(&mut tile), tile.boxes.nearest(&whole)), ((0, 5.0), 3.0));
    }
}
