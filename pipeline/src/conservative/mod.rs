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

use crate::geometry::Shear;
use crate::traversal::{Box5, Coordinate};

pub use rasterizer::{Grid, Rasterizer, TileLoop};
pub use triangle::MovingTriangle;

/// A projection of points `[x, y, depth]`, in units of the tile borders (such as pixels).
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum View {
    /// A point appears at `(x + u (a_x w - s_x)) / w`, and likewise in y, with its depth `w`: a thin lens
    /// with the shear `s`, `a`, or a pinhole if these are zero. Points nearer than `near` (at least 0) are
    /// invisible.
    Perspective {
        /// Projection scale times lens radius.
        s: [f64; 2],
        /// `s` over the focus depth.
        a: [f64; 2],
        /// Smallest visible depth.
        near: f64,
    },
    /// A point appears at `x + u (a_x z - s_x)`, and likewise in y, with its depth `z`. Points nearer than
    /// `near` are invisible.
    Orthographic {
        /// Projection scale times lens radius.
        s: [f64; 2],
        /// `s` over the focus depth.
        a: [f64; 2],
        /// Smallest visible depth, possibly negative infinity.
        near: f64,
    },
}

impl View {
    /// Orthographic, for all depths and without a lens.
    pub fn orthographic() -> Self {
        Self::Orthographic { s: [0.0; 2], a: [0.0; 2], near: f64::NEG_INFINITY }
    }

    /// View of a camera of the standard mode.
    pub fn of(shear: &Shear, near: f32) -> Self {
        let [s, a] = [shear.s, shear.a].map(|part| part.map(f64::from));
        let near = f64::from(near);
        if shear.parallel { Self::Orthographic { s, a, near } } else { Self::Perspective { s, a, near } }
    }

    /// Whether the view depends on the lens position.
    pub fn has_lens(&self) -> bool {
        self.shear() != ([0.0; 2], [0.0; 2])
    }

    fn shear(&self) -> ([f64; 2], [f64; 2]) {
        let (Self::Perspective { s, a, .. } | Self::Orthographic { s, a, .. }) = self;
        (*s, *a)
    }

    fn is_perspective(&self) -> bool {
        matches!(self, Self::Perspective { .. })
    }

    fn near(&self) -> f64 {
        let (Self::Perspective { near, .. } | Self::Orthographic { near, .. }) = self;
        *near
    }
}

/// A closed rectangle of the image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rect {
    /// Range of x.
    pub x: [f64; 2],
    /// Range of y.
    pub y: [f64; 2],
}

/// A closed box of lens and time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Region {
    /// Lens position in [-1, 1].
    pub u: [f64; 2],
    /// Lens position in [-1, 1].
    pub v: [f64; 2],
    /// Time in [0, 1].
    pub t: [f64; 2],
}

/// Intervals in which a triangle may touch a tile.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Touch {
    /// Lens position `u^`; the whole requested region without a lens.
    pub u: [f64; 2],
    /// Lens position `v^`.
    pub v: [f64; 2],
    /// Time `t^`.
    pub t: [f64; 2],
    /// Depth `z^`.
    pub z: [f64; 2],
}

impl Region {
    /// The whole lens and shutter.
    pub const WHOLE: Self = Self { u: [-1.0, 1.0], v: [-1.0, 1.0], t: [0.0, 1.0] };

    /// The box rounded outward; `lens` says whether the camera has a lens.
    fn outward<C: Coordinate>(&self, lens: bool) -> Box5<C> {
        Box5 { u: outward(self.u), v: outward(self.v), t: outward(self.t), lens }
    }

    /// The part of the region in a box.
    fn within<C: Coordinate>(&self, part: &Box5<C>) -> Self {
        let both = |mine: [f64; 2], part: [C; 2]| {
            let [lo, hi]: [f64; 2] = part.map(Into::into);
            [mine[0].max(lo), mine[1].min(hi)]
        };
        let [u, v] = if part.lens { [both(self.u, part.u), both(self.v, part.v)] } else { [self.u, self.v] };
        Self { u, v, t: both(self.t, part.t) }
    }
}

impl Touch {
    /// Hull of the intervals of both.
    #[must_use]
    pub fn hull(&self, other: &Self) -> Self {
        let hull = |a: [f64; 2], b: [f64; 2]| [a[0].min(b[0]), a[1].max(b[1])];
        Self {
            u: hull(self.u, other.u),
            v: hull(self.v, other.v),
            t: hull(self.t, other.t),
            z: hull(self.z, other.z),
        }
    }
}

/// Narrowest range of coordinates that contains the range.
fn outward<C: Coordinate>([lo, hi]: [f64; 2]) -> [C; 2] {
    [C::at_most(lo), C::at_least(hi)]
}
