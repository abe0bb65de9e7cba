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
//! *Precision.* Input and arithmetic are `f64`, with coordinates relative to the tile. Each test includes a
//! bound of its own rounding, a few parts in 2^48 of the magnitudes involved. Rounding to `f32` instead would
//! widen a triangle by 2^-24 of its distance from the origin, a whole pixel at 1e7, and would need an error
//! bound beside every number. The mode runs per tile, not per sample, so `f64` is affordable. The error of
//! inexact input ([`MovingTriangle::uncertain`]) is carried as inflation. It is at least [`MIN_UNCERTAINTY`],
//! which covers products that underflow.
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

mod edges;
mod rasterizer;
mod sides;
mod triangle;
mod view;

pub use rasterizer::{Grid, Rasterizer, TileLoop};
pub use triangle::{MIN_UNCERTAINTY, MovingTriangle, Prepared};
pub use view::{Rect, Region, Touch, View};
