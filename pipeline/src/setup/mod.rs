//! Triangle set-up: everything known of a triangle before any tile is visited.

mod bounds;
mod triangle;

pub(crate) use bounds::distribute;
pub use bounds::{PixelRect, bounds};
pub(crate) use triangle::cross;
pub use triangle::{Corner, Outcome, Triangle, is_flat, madds, set_up};
