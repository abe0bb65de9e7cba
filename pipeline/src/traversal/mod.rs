//! Tile tests: which tiles can hold a sample that sees the triangle, and in which part of u, v, t space.
//!
//! A test may keep too much and never too little: it evaluates what the sample test evaluates, at the corners of the
//! tile, and allows for the rounding of both.

mod box5;
mod edge_bounds;
mod side_planes;

pub use box5::{Box5, TileRect};
pub use edge_bounds::{EdgeBounds, Screen, screen_madds, tile_madds};
pub use side_planes::{madds, narrow};
