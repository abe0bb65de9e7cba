//! Conservative mode: the tiles that a moving, defocused triangle may touch, with intervals of time, lens
//! position and depth, without sample tests (thesis, Paper VI, section 2).
//!
//! For every tile, of any size, the caller's closure gets a [`Touch`]: the intervals `u^ v^ t^ z^`.
//! Guarantees:
//!
//! - a tile that the exact triangle touches at any `(u, v, t)` is reported, borders of tiles, lens and
//!   shutter included;
//! - `u^`, `v^`, `t^` and `z^` contain every lens position, time and depth at which it does;
//! - triangles without area (points, segments) and triangles that reach behind the camera are included.
//!
//! *Precision.* The tile tests and depth planes are those of standard mode ([`traversal`](crate::traversal),
//! [`depth`](crate::depth)). They take `f32`, so a triangle is rounded before them, relative to the middle of the
//! tiles, and the error is carried as inflation together with that of inexact input
//! ([`MovingTriangle::uncertain`]). For an exact triangle the sides of a tile move out by at most 2^-21 of the terms of
//! a vertex as seen, half the extent of the tiles included: 0.002 tiles across a grid of 2048. Times and lens positions
//! are rounded outward to `f32`. [`Rasterizer::in_doubles`] runs the same tests on `f64`, where the sides move out by 2^-45 of
//! the terms.
//!
//! ```
//! use pipeline::conservative::{Grid, MovingTriangle, Rasterizer, View};
//!
//! let corners = [[0.5, 0.5, 2.0], [3.5, 0.5, 2.0], [0.5, 1.5, 4.0]];
//! let triangle = MovingTriangle::new(corners, corners).unwrap();
//! let grid = Grid { origin: [0.0, 0.0], tile: [1.0; 2], columns: 8, rows: 8 };
//! let mut tiles = Vec::new();
//! Rasterizer::new(View::orthographic()).rasterize(&triangle, &grid, |tile, touch| tiles.push((tile, touch.z)));
//! // Four in the first row, two in the second, and one that is touched at its corner (2, 1).
//! assert_eq!(tiles.len(), 7);
//! ```

mod rasterizer;
mod triangle;
mod view;

pub use rasterizer::{Grid, Rasterizer, TileLoop};
pub use triangle::MovingTriangle;
pub use view::{Rect, Region, Touch, View};
