//! Traversal: tile tests, which bound the lens positions and times at which a tile may contain a sample that
//! sees the triangle.
//!
//! A test is conservative: it may keep too much but never too little. It evaluates the expressions of the
//! sample test at the corners of the tile, with an allowance for the rounding of both.
//!
//! Both modes of the pipeline run these tests. They take vertices in `f32` that may be off by half of
//! [`slack`](crate::setup::Triangle::slack): in standard mode by the rounding of the sample test, in conservative mode by
//! that of the input ([`conservative`](crate::conservative)).

mod cost;
mod edges;
mod facing;
mod lens;
mod number;
mod region;
mod screen;
mod side_planes;
pub mod thresholds;
mod time_interval;

pub use cost::{
    edge_bound_madds, edge_madds, facing_madds, lens_line_madds, lens_line_setup_madds, screen_setup_madds,
    side_madds,
};
pub use edges::{EdgeBounds, Edges};
pub use facing::Facing;
pub use lens::{LensLines, LensSpan, LensSpans};
#[cfg(test)]
pub(crate) use number::counted;
pub use number::{Coordinate, Number, Pieces, Quadratic, Scalar};
pub use region::{Box5, Faces, Piece, TileRect, TimePieces, View};
pub use screen::{SCREEN_GAIN_MADDS, Screen, screen_madds};
pub use side_planes::{narrow, narrow_by_sides, narrow_counted, narrow_near};
pub use time_interval::{TimeIntervals, time_interval, time_interval_counted};

#[cfg(test)]
mod testing;
