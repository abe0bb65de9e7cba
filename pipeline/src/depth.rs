//! Depth: the interval of a triangle over a box, and what a tile remembers for culling.

use crate::setup::Triangle;

/// Multiply-adds of [`nearest`]: three vertices at both ends of the time interval.
pub const fn interval_madds(moving: bool) -> u32 {
    if moving { 6 } else { 0 }
}

/// The smallest depth of `triangle` for times within `t`. Depth at a sample is a convex combination kept within the
/// range of the vertices, which move monotonically, so the ends of the interval are the extremes, rounding and all.
pub fn nearest(triangle: &Triangle, t: [f32; 2]) -> f32 {
    let depths = triangle.corners.iter().flat_map(|corner| t.map(|t| corner.at(t)[2]));
    depths.fold(f32::INFINITY, f32::min)
}

/// The stored samples of one tile.
#[derive(Clone, Debug, Default)]
pub struct DepthTile {
    /// Depth of the nearest hit of each sample, infinite where there is none.
    pub depth: Vec<f32>,
    /// Triangle of the nearest hit, [`Self::NOTHING`] where there is none.
    pub triangle: Vec<u32>,
    farthest: f32,
    stale: bool,
}

impl DepthTile {
    /// The triangle of a sample that sees none.
    pub const NOTHING: u32 = u32::MAX;

    /// A cleared tile of `samples` samples.
    pub fn cleared(samples: usize) -> Self {
        Self {
            depth: vec![f32::INFINITY; samples],
            triangle: vec![Self::NOTHING; samples],
            farthest: f32::INFINITY,
            stale: false,
        }
    }

    /// Notes that depths were written.
    pub fn touch(&mut self) {
        self.stale = true;
    }

    /// The largest stored depth, and whether it had to be found anew.
    pub fn farthest(&mut self) -> (f32, bool) {
        let updated = std::mem::take(&mut self.stale);
        if updated {
            self.farthest = self.depth.iter().copied().fold(f32::NEG_INFINITY, f32::max);
        }
        (self.farthest, updated)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_tile_is_as_far_as_its_farthest_sample() {
        let mut tile = DepthTile::cleared(2);
        assert_eq!(tile.farthest(), (f32::INFINITY, false));
        tile.depth[0] = 3.0;
        tile.touch();
        assert_eq!(tile.farthest(), (f32::INFINITY, true));
        tile.depth[1] = 5.0;
        tile.touch();
        assert_eq!(tile.farthest(), (5.0, true));
        assert_eq!(tile.farthest(), (5.0, false));
    }
}
