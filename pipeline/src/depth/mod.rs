//! Depth: the interval of a triangle over a box, and what a tile remembers for culling.
//!
//! - [`plane`]: planes that move with a triangle and keep it on one side, the mathematics of the bound,
//! - [`DepthBound`] and [`Bounder`]: the interval that holds every depth the sample test computes in a tile,
//! - [`DepthBoxes`]: the farthest and nearest stored depth of a tile, by boxes of lens and time,
//! - [`DepthTile`]: the stored samples.

mod bound;
mod boxes;
mod grid;

mod number;
pub mod plane;
mod rounding;
mod tile;

pub use bound::{Bounder, DepthBound, interval_madds, set_up_madds, vertex_range};
pub use boxes::{DepthBoxes, Visible};
pub use grid::{BoxGrid, DepthSpec};
pub use number::Real;
pub(crate) use number::{down, up};
pub use tile::DepthTile;
