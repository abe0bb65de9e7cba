//! Depth: the depth interval of a triangle over a box, and the stored depths of a tile for culling.
//!
//! - [`plane`]: moving planes that bound a triangle from one side, the mathematics of the depth interval,
//! - [`DepthBound`] and [`Bounder`]: the interval of all depths that the sample test computes in a tile,
//! - [`DepthBoxes`]: farthest and nearest stored depth of a tile, by boxes of lens and time,
//! - [`DepthTile`]: the stored samples,
//! - [`Pyramid`]: farthest stored depths of larger and larger tiles, for occlusion queries.

mod bound;
mod boxes;
mod grid;

mod number;
pub mod plane;
mod pyramid;

pub use bound::{Bounder, DepthBound, interval_madds, set_up_madds, vertex_range};
pub use boxes::{DepthBoxes, DepthTile, Visible};
pub use grid::{BoxGrid, DepthSpec};
pub use number::Real;
pub(crate) use number::{Numbers, cross};
pub use pyramid::Pyramid;
