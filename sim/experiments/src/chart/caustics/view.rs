//! The water of the figures, and how it is looked at.

use glam::DVec3;
use workloads::caustics::Eye;
use workloads::caustics::generator::Ocean;

use crate::study::StudyError;

/// Side and depth of the water and its longest waves, in metres.
pub(crate) const SIDE_M: f64 = 16.0;
pub(crate) const DEPTH_M: f64 = 5.0;
pub(crate) const WAVE_M: f64 = 4.0;
/// The slope of the paper's ocean is not given; this is a fresh breeze (Cox and Munk 1954 have 0.15 at some 4 m/s).
pub(crate) const SLOPE: f64 = 0.15;
/// Decides what the waves are like.
const SEED: u64 = 1;
/// Pixels along a side of the squares that are compared: next to a focus single pixels have no bound.
pub(super) const SQUARE_PX: u32 = 8;

pub(crate) fn water(cells: u32, slope: f64) -> Ocean {
    Ocean::new(cells, SIDE_M, DEPTH_M, [WAVE_M, slope], SEED)
}

/// All of the water from the side, a little above and askew.
pub(crate) fn aside(size: [u32; 2]) -> Result<Eye, StudyError> {
    aside_of(DEPTH_M, size)
}

/// The same for water of another depth.
pub(crate) fn aside_of(depth_m: f64, size: [u32; 2]) -> Result<Eye, StudyError> {
    from_the_side(DVec3::new(0.6, -0.5 * depth_m, 0.3), 6.5, size)
}

/// Water about `middle`, `reach` metres up and down.
pub(super) fn from_the_side(middle: DVec3, reach: f64, size: [u32; 2]) -> Result<Eye, StudyError> {
    let from = middle + 80.0 * DVec3::new(0.3, 0.35, 1.0).normalize();
    eye([from, middle, DVec3::Y], reach, size)
}

/// The middle of the floor from above.
pub(crate) fn above(side: u32) -> Result<Eye, StudyError> {
    eye([10.0 * DVec3::Y, DVec3::ZERO, DVec3::NEG_Z], 0.3 * SIDE_M, [side; 2])
}

fn eye(place: [DVec3; 3], reach: f64, size: [u32; 2]) -> Result<Eye, StudyError> {
    Eye::new(place, reach, size).ok_or_else(|| StudyError::Pipeline("a view without extent".to_owned()))
}
