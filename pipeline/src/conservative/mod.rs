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
//! [`depth`](crate::depth)). They take `f32`, so a triangle is rounded before them, relative to the middle of
//! the tiles, and the error is carried as inflation together with that of inexact input
//! ([`MovingTriangle::uncertain`]). For an exact triangle the sides of a tile move out by at most 2^-21 of
//! the terms of a vertex as seen, half the extent of the tiles included: 0.002 tiles across a grid of 2048.
//! Times and lens positions are rounded outward to `f32`. [`Rasterizer::in_doubles`] runs the same tests on
//! `f64`, where the sides move out by 2^-45 of the terms.
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

use crate::depth::Real;
use crate::geometry::Shear;
use crate::setup::{Corner, Triangle};
use crate::traversal::{Box5, Coordinate, TileRect};
pub use rasterizer::{Grid, Rasterizer, TileLoop};

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

/// A triangle whose vertices `[x, y, depth]` move linearly from `open` to `close`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MovingTriangle {
    open: [[f64; 3]; 3],
    close: [[f64; 3]; 3],
    uncertainty: [f64; 3],
}

/// Larger coordinates may overflow when they are moved.
const MAX_COORDINATE: f64 = 1e60;

impl MovingTriangle {
    /// An exact triangle, or `None` if a coordinate is not finite or beyond 1e60.
    pub fn new(open: [[f64; 3]; 3], close: [[f64; 3]; 3]) -> Option<Self> {
        Self::uncertain(open, close, [0.0; 3])
    }

    /// A triangle whose vertices have an error of at most `uncertainty` on each axis, at both ends. `None` as
    /// for [`Self::new`].
    pub fn uncertain(open: [[f64; 3]; 3], close: [[f64; 3]; 3], uncertainty: [f64; 3]) -> Option<Self> {
        let mut all = open.iter().chain(&close).chain([&uncertainty]).flatten();
        all.all(|c| c.abs() <= MAX_COORDINATE).then_some(Self { open, close, uncertainty })
    }

    /// Vertices when the shutter opens.
    pub fn open(&self) -> &[[f64; 3]; 3] {
        &self.open
    }

    /// Whether its ends differ.
    pub(crate) fn is_moving(&self) -> bool {
        self.open != self.close
    }

    fn vertices(&self) -> impl Iterator<Item = &[f64; 3]> {
        self.open.iter().chain(&self.close)
    }

    /// Largest magnitude along an axis.
    fn largest(&self, axis: usize) -> f64 {
        self.vertices().map(|p| p[axis].abs()).fold(0.0, f64::max)
    }
}

/// Type of the coordinates in which triangles are tested.
trait Precision: Coordinate {
    /// Bound of the rounding of a vertex as seen, relative to the magnitudes of its terms, times two.
    const ROUNDED: f64;
}

/// A vertex at a time is `open + t delta`, each of which is off by half an ulp: 2^-24. What follows is `f64`, whose
/// rounding is far less.
impl Precision for f32 {
    const ROUNDED: f64 = 1.0 / (1_u64 << 22) as f64;
}

/// 128 times `u` = 2^-53, half of which bounds a vertex as seen. It takes 8. So if no vertex is farther than
/// `X` and `Y` from any point of the tile, `112 u 2 X Y` of the slack of an edge remains. Of this the
/// coefficients of the edge and their sums over the tile take at most 32, and its roots 24: their
/// discriminant is that of coefficients off by 2 each, and their other operations move them by at most 5 `u`
/// of the time, in which the edge changes by `4 2 X Y`. The last sum of a root is covered by the ulp by which
/// roots are moved outward. Sides and depths take less.
impl Precision for f64 {
    const ROUNDED: f64 = 1.0 / (1_u64 << 46) as f64;
}

/// Rounding of moving to the origin in `f64`, relative to the coordinates before: more than four of 2^-53 each.
const MAX_RELATIVE_SHIFT_ERROR: f64 = 1.0 / (1_u64 << 50) as f64;

/// A triangle and a view as the tile tests take them, for tiles within one rectangle.
///
/// Before the tile tests a triangle is moved so that the middle of the tiles is the origin, in `f64`, scaled
/// by powers of two so that no number or product leaves the range of its type, and rounded to that of the
/// tests: `f32`, or `f64` for tiles that are smaller than its precision. The slack that the tile tests allow
/// for the rounding of samples in standard mode here bounds the rounding of vertices and the uncertainty of
/// the input. Tiles, lens positions and times are rounded outward.
#[derive(Clone, Copy, Debug)]
struct Rounded<C> {
    pub triangle: Triangle<C>,
    pub shear: Shear<C>,
    /// Smallest visible depth; negative infinity for all.
    pub near: C,
    /// Bound of the error of a depth.
    pub depth_slack: C,
    /// Unit of the image on each axis, and its origin.
    image: [Unit; 2],
    depth: Unit,
}

/// A coordinate is `(value - origin) scale`, where `scale` is a product of two powers of two.
#[derive(Clone, Copy, Debug, Default)]
struct Unit {
    origin: f64,
    scale: [f64; 2],
}

impl Unit {
    fn of(&self, value: f64) -> f64 {
        (value - self.origin) * self.scale[0] * self.scale[1]
    }

    /// A range with more than the rounding of [`Self::of`] on either side.
    fn outward<C: Coordinate>(&self, [lo, hi]: [f64; 2]) -> [C; 2] {
        let off = |value: f64| {
            MAX_RELATIVE_SHIFT_ERROR * (value.abs() + self.origin.abs()) * self.scale[0] * self.scale[1]
        };
        [C::at_most(self.of(lo) - off(lo)), C::at_least(self.of(hi) + off(hi))]
    }

    fn back(&self, value: impl Into<f64>) -> f64 {
        value.into() / self.scale[1] / self.scale[0] + self.origin
    }
}

/// 2^-900, about 1e-271. Rounding is allowed for as if magnitudes were at least this large, as it is not relative to
/// numbers that underflow.
const MIN_SIZE: f64 = f64::from_bits(123 << 52);

/// The power of two that brings a size to between 1/2 and 1, for sizes from [`MIN_SIZE`] to 2^1021.
fn to_one(size: f64) -> f64 {
    f64::from_bits((2045 - (size.to_bits() >> 52)) << 52)
}

impl<C: Precision> Rounded<C> {
    /// `triangle` in `view` for tiles within `rect`.
    pub fn new(view: &View, triangle: &MovingTriangle, rect: &Rect) -> Self {
        let recentred = Recentred::new(view, triangle, rect, C::ROUNDED);
        let (perspective, a, moving) = (view.is_perspective(), view.shear().1, triangle.is_moving());
        let axes = [recentred.axis(0), recentred.axis(1), recentred.depth()];
        let scale = axes.map(|axis| to_one(axis.size + axis.slack));
        let deep = scale[2];
        let image = [0, 1].map(|axis| Unit {
            origin: recentred.origin[axis],
            scale: [if perspective { deep.recip() } else { 1.0 }, scale[axis]],
        });
        let depth = Unit { origin: recentred.origin[2], scale: [deep, 1.0] };
        let rounded = |p: [f64; 3]| [0, 1, 2].map(|axis| C::nearest(p[axis] * scale[axis]));
        let corner =
            |k: usize| Corner { open: rounded(recentred.open[k]), delta: rounded(recentred.delta[k]) };
        Self {
            triangle: Triangle {
                id: 0,
                corners: [0, 1, 2].map(corner),
                moving,
                behind: false,
                faces: [true; 2],
                slack: [0, 1].map(|axis| C::at_least(axes[axis].slack * scale[axis])),
            },
            shear: Shear {
                s: [0, 1].map(|axis| C::nearest(axes[axis].shift * scale[axis])),
                a: [0, 1].map(|axis| C::nearest(a[axis] / deep * scale[axis])),
                parallel: !perspective,
            },
            near: depth.outward([view.near(); 2])[0],
            depth_slack: C::at_least(axes[2].slack * deep),
            image,
            depth,
        }
    }

    /// A rectangle of the image as the tile tests see it.
    pub fn tile(&self, rect: &Rect) -> TileRect<C> {
        TileRect { x: self.image[0].outward(rect.x), y: self.image[1].outward(rect.y) }
    }

    /// Depths in their own unit.
    pub fn depths(&self, z: [C; 2]) -> [f64; 2] {
        z.map(|z| self.depth.back(z))
    }
}

/// A triangle moved to the middle of the tiles, in the units of the input.
struct Recentred<'a> {
    view: &'a View,
    triangle: &'a MovingTriangle,
    origin: [f64; 3],
    /// Half the extent of the tiles.
    reach: [f64; 2],
    open: [[f64; 3]; 3],
    delta: [[f64; 3]; 3],
    /// Largest magnitude of a vertex and its motion on each axis.
    largest: [f64; 3],
    /// Error of a depth before it is rounded.
    depth_off: f64,
    /// [`Precision::ROUNDED`].
    rounded: f64,
}

/// An axis of a recentred triangle.
#[derive(Clone, Copy)]
struct Axis {
    /// Shift of the lens, as in [`Shear::s`].
    shift: f64,
    /// Magnitudes of the terms of a vertex as seen.
    size: f64,
    /// Slack of the image, or error of a depth.
    slack: f64,
}

impl<'a> Recentred<'a> {
    fn new(view: &'a View, triangle: &'a MovingTriangle, rect: &Rect, rounded: f64) -> Self {
        let perspective = view.is_perspective();
        let depths = triangle.vertices().map(|p| p[2]);
        let depths = depths.fold([f64::INFINITY, f64::NEG_INFINITY], |[lo, hi], z| [lo.min(z), hi.max(z)]);
        let middle = |[lo, hi]: [f64; 2]| 0.5 * (lo + hi);
        let origin = [middle(rect.x), middle(rect.y), if perspective { 0.0 } else { middle(depths) }];
        let ends = [triangle.open, triangle.close].map(|end| end.map(|p| moved(p, origin, perspective)));
        let [open, close] = ends;
        let difference = |k: usize| [0, 1, 2].map(|axis| close[k][axis] - open[k][axis]);
        let delta = if triangle.is_moving() { [0, 1, 2].map(difference) } else { Default::default() };
        let largest = [0, 1, 2]
            .map(|axis| (0..3).map(|k| open[k][axis].abs() + delta[k][axis].abs()).fold(0.0, f64::max));
        let depth_off =
            triangle.uncertainty[2] + MAX_RELATIVE_SHIFT_ERROR * (triangle.largest(2) + origin[2].abs());
        let reach = [rect.x[1] - origin[0], rect.y[1] - origin[1]];
        Self { view, triangle, origin, reach, open, delta, largest, depth_off, rounded }
    }

    fn depth(&self) -> Axis {
        let size = self.largest[2].max(MIN_SIZE);
        Axis { shift: 0.0, size, slack: 0.5 * self.rounded * size + self.depth_off }
    }

    fn axis(&self, axis: usize) -> Axis {
        let (perspective, (s, a)) = (self.view.is_perspective(), self.view.shear());
        let (at, reach, bent) = (self.origin[axis].abs(), self.reach[axis], a[axis].abs());
        let shift = s[axis] - a[axis] * self.origin[2];
        let deepest = self.largest[2];
        let size = self.largest[axis]
            + shift.abs()
            + bent * deepest
            + if perspective { reach * deepest } else { reach };
        // Errors before anything is rounded to the type of the tests.
        let by_depth = if perspective { at + reach + bent } else { bent };
        let terms =
            self.triangle.largest(axis) + if perspective { at * self.triangle.largest(2) } else { at };
        let terms = terms + s[axis].abs() + bent * self.origin[2].abs();
        let off =
            self.triangle.uncertainty[axis] + by_depth * self.depth_off + MAX_RELATIVE_SHIFT_ERROR * terms;
        let size = size.max(MIN_SIZE);
        Axis { shift, size, slack: self.rounded * size + 2.0 * off }
    }
}

/// A vertex, with the middle of the tiles at the origin.
fn moved<R: Real>(p: [R; 3], origin: [R; 3], perspective: bool) -> [R; 3] {
    let [x, y] = [0, 1].map(|axis| p[axis] - if perspective { origin[axis] * p[2] } else { origin[axis] });
    [x, y, if perspective { p[2] } else { p[2] - origin[2] }]
}

/// Multiply-adds of moving the vertices to the origin. Scales are exponents, and differences belong to set-up.
const fn recentring_madds(moving: bool, perspective: bool) -> u32 {
    let ends = if moving { 2 } else { 1 };
    3 * ends * if perspective { 2 } else { 3 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tally::{Counting, Tally};

    #[test]
    fn the_cost_of_recentring_is_that_of_its_kernel() {
        for perspective in [false, true] {
            let tally = Tally::default();
            let point = |p: [f64; 3]| p.map(|c| Counting::new(c, &tally));
            moved(point([1.0, 2.0, 3.0]), point([4.0, 5.0, 6.0]), perspective);
            assert_eq!(3 * tally.madds(), recentring_madds(false, perspective));
            assert_eq!(6 * tally.madds(), recentring_madds(true, perspective));
        }
    }

    #[test]
    fn sizes_are_brought_to_one() {
        for size in [1.0, 0.75, MIN_SIZE, 3e-270, 7e300] {
            let scaled = size * to_one(size);
            assert!((0.5..1.0).contains(&scaled), "{size}: {scaled}");
            assert!(to_one(size).log2().fract() == 0.0);
        }
    }
}
