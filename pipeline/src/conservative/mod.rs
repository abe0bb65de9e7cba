//! Conservative mode: which tiles a moving, defocused triangle may touch, when, from where on the lens and how deep, without
//! testing a sample (thesis, Paper VI, section 2).
//!
//! For every tile, of any size, the caller's closure is handed a [`Touch`]: the intervals `u^ v^ t^ z^`. What is promised:
//!
//! - a tile that the exact triangle touches at any `(u, v, t)` is reported, borders of tiles, lens and shutter included;
//! - `u^`, `v^`, `t^` and `z^` hold every place, time and depth at which it does;
//! - triangles without area (points, segments) count, as do those that reach behind the camera.
//!
//! *Precision at the door.* Input is `f64` and so is all arithmetic here, on coordinates recentred at the tile; each test allows for
//! the rounding of its own, a few parts in 2^48 of the magnitudes that entered it. Rounding outward to `f32` instead would widen
//! a triangle by a part in 2^24 of its distance from the origin, a whole pixel at 1e7, and would need a bound to be carried
//! beside every number; the mode runs per tile, not per sample, so the wider type is affordable. A bound on input that is not exact
//! ([`MovingTriangle::uncertain`]) is carried as inflation; none is taken to be less than [`LEAST_UNCERTAINTY`], which pays for products
//! that are too small to be numbers.
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
mod region;
mod seen;
mod sides;
mod triangle;
mod view;

pub use rasterizer::{Grid, Rasterizer};
pub use region::{Rect, Region, Touch};
pub use triangle::{LEAST_UNCERTAINTY, MovingTriangle, Prepared};
pub use view::View;
