//! Tile tests: which tiles can hold a sample that sees the triangle, and in which part of u, v, t space.
//!
//! A test may keep too much and never too little: it evaluates what the sample test evaluates, at the corners of the
//! tile, and allows for the rounding of both.

mod box5;
mod cost;
mod edge_bounds;
mod edges;
mod facing;
mod lens_lines;
mod number;
mod quadratic;
mod screen;
mod side_planes;
pub mod small;
#[cfg(test)]
mod testing;
mod time_interval;
mod timeline;
mod view;

pub use box5::{Box5, TileRect};
pub use cost::{
    edge_bound_madds, edge_madds, facing_madds, lens_line_madds, lens_line_setup_madds, screen_setup_madds,
    side_madds,
};
pub use edge_bounds::EdgeBounds;
pub use edges::Edges;
pub use facing::Facing;
pub use lens_lines::LensLines;
pub use number::Number;
pub use quadratic::{Pieces, Quadratic};
pub use screen::{SCREEN_GAIN_MADDS, Screen, screen_madds};
pub use side_planes::{narrow, narrow_counted};
pub use time_interval::{TimeIntervals, time_interval, time_interval_over};
pub use timeline::{Faces, Piece, Timeline};
pub use view::View;
