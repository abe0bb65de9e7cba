//! Points of volumes (thesis, Paper VI, section 5, "The 5D Rasterizer as a Volumetric Sampler").
//!
//! - [`Torus`], [`Solid`]: what is sampled; both say exactly whether a point is inside.
//! - [`Bounds`]: *conservative mode*. The rasterizer bounds the third coordinate of a solid in every tile: for a [`Torus`] that is the time of moving
//!   triangles, for a [`Solid`] the depth of its surface. Random points of these bounds are tested.
//! - [`standard_mode`]: the samples of the rasterizer itself, kept where a moving triangle covers them and the solid does too (Fig. 9).

mod bounds;
mod solid;
mod standard;
mod torus;

pub use bounds::{Bounds, Sampled};
pub use solid::{Solid, SolidError};
pub use standard::{Covered, standard_mode};
pub use torus::Torus;

pub(super) use standard::{camera, place};

use super::random::Stream;

/// What can be sampled.
pub trait Inside: Sync {
    /// Whether a point is inside; `tile` is the tile of the bounds that it is in.
    fn contains(&self, point: &[f64; 3], tile: usize) -> bool;
}

#[cfg(test)]
mod tests;
