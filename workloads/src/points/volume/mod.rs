//! Uniform points in volumes (thesis, Paper VI, section 5, "The 5D Rasterizer as a Volumetric Sampler").
//!
//! - [`Torus`], [`Solid`]: volumes with an exact inside test.
//! - [`Bounds`]: *conservative mode*. The rasterizer bounds the third coordinate of a volume in every tile:
//!   the time of moving triangles for a [`Torus`], the depth of the surface for a [`Solid`]. Random points of
//!   these bounds are tested.
//! - [`standard_mode`]: samples of the rasterizer that a moving triangle covers and that are inside the
//!   volume (Fig. 9).

mod bounds;
mod solid;
mod torus;

pub use bounds::{Bounds, Sampled};
pub use solid::{Solid, SolidError};
pub use torus::{Covered, Torus, standard_mode};

pub(super) use torus::{camera, place};

use super::random::Stream;

/// A volume with an inside test.
pub trait Inside: Sync {
    /// Whether a point is inside; `tile` is the point's tile of the bounds.
    fn contains(&self, point: &[f64; 3], tile: usize) -> bool;
}

#[cfg(test)]
mod tests;
