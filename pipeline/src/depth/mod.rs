//! Depth: the depth interval of a triangle over a box, and the stored depths of a tile for culling.
//!
//! - [`MovingPlane`]: moving planes that bound a triangle from one side, the mathematics of the depth interval,
//! - [`DepthBound`] and [`Bounder`]: the interval of all depths that the sample test computes in a tile,
//! - [`DepthBoxes`]: farthest and nearest stored depth of a tile, by boxes of lens and time,
//! - [`DepthTile`]: the stored samples,
//! - [`Pyramid`]: farthest stored depths of larger and larger tiles, for occlusion queries,
//! - [`Real`]: numbers of the depth bounds and of tests of points: `f64`, or a number that counts its operations.
//!
//! *Moving planes* that bound a triangle from one side (thesis, Paper VI, Appendix A, second test). For any
//! vector `n`, `n . p` over a moving triangle is between the minimum and maximum over its vertices. The
//! vertices move linearly, so at time `t` between two ends it is at most
//!
//! ```text
//! h(t) = (1 - t) max_i n . q_i + t max_i n . r_i
//! ```
//!
//! and at least the same with the minimum. A ray has the points `z G + B` at depth `z`. So the depth of the
//! triangle on it is at most `(h(t) - n . B) / (n . G)` where `n . G > 0`. The paper takes the normal of the
//! triangle at one end for `n`, which makes `h` vanish there up to rounding. No step relies on that, so a
//! normal that consists of rounding errors gives a loose bound but never a wrong one.
//!
//! In perspective with a thin lens `G = (X - u a_x, Y - v a_y, 1)` and `B = (u s_x, v s_y, 0)`. In an
//! orthographic view `G = (-u a_x, -v a_y, 1)` and `B = (X + u s_x, Y + v s_y, 0)`. The bound is a ratio of
//! functions linear in each variable, so its extremes are at corners.

mod bound;
mod boxes;
mod grid;

use std::ops::{Add, Div, Mul, Neg, Sub};

use crate::tally::{Branches, Counting, Path, Tally};
pub use bound::{Bounder, DepthBound, vertex_range};
pub(crate) use bound::{ExactBounder, interval_madds, set_up_madds};
pub use boxes::{DepthBoxes, DepthTile, Visible};
pub use grid::{BoxGrid, DepthSpec, Pyramid};

/// A real number.
pub trait Real:
    Copy
    + PartialOrd
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
{
    /// The number `value`.
    fn new(value: f64) -> Self;

    /// Value of the number.
    fn value(self) -> f64;

    /// `self b + c`, rounded after each operation; one multiply-add.
    fn madd(self, b: Self, c: Self) -> Self;

    /// The other one if `takes_other`; a choice is free.
    fn or(self, other: Self, takes_other: bool) -> Self {
        if takes_other { other } else { self }
    }

    /// Minimum; comparisons are free.
    fn smaller(self, other: Self) -> Self {
        self.or(other, other < self)
    }

    /// Maximum.
    fn larger(self, other: Self) -> Self {
        self.or(other, other > self)
    }

    /// Magnitude.
    fn magnitude(self) -> Self {
        if self < Self::new(0.0) { -self } else { self }
    }
}

impl Real for f64 {
    fn new(value: f64) -> Self {
        value
    }

    fn value(self) -> f64 {
        self
    }

    fn madd(self, b: Self, c: Self) -> Self {
        self * b + c
    }
}

impl Real for Counting<'_> {
    fn new(value: f64) -> Self {
        Self::constant(value)
    }

    fn value(self) -> f64 {
        Self::value(self)
    }

    fn madd(self, b: Self, c: Self) -> Self {
        self.multiply_add(b, c)
    }

    fn or(self, other: Self, takes_other: bool) -> Self {
        self.choice(other, takes_other)
    }
}

/// Source of the numbers that a kernel computes with, and recorder of its branches.
pub(crate) trait Numbers: Branches {
    /// Type of the numbers.
    type Number: Real;

    /// An input of the kernel.
    fn number(self, value: f64) -> Self::Number;
}

/// Plain numbers, whose branches are not recorded.
impl Numbers for () {
    type Number = f64;

    #[inline(always)]
    fn number(self, value: f64) -> f64 {
        value
    }
}

/// Plain numbers.
impl Numbers for &Path {
    type Number = f64;

    #[inline(always)]
    fn number(self, value: f64) -> f64 {
        value
    }
}

impl<'t> Numbers for &'t Tally {
    type Number = Counting<'t>;

    #[inline(always)]
    fn number(self, value: f64) -> Counting<'t> {
        Counting::new(value, self)
    }
}

/// `a . b`.
fn dot<R: Real>(a: [R; 3], b: [R; 3]) -> R {
    a[0].madd(b[0], a[1].madd(b[1], a[2] * b[2]))
}

/// `a x b`.
fn cross<R: Real>(a: [R; 3], b: [R; 3]) -> [R; 3] {
    let part = |i: usize, j: usize| a[i].madd(b[j], -(a[j] * b[i]));
    [part(1, 2), part(2, 0), part(0, 1)]
}

/// Smallest and largest value.
fn range<R: Real, const N: usize>(values: [R; N]) -> [R; 2] {
    values.iter().fold([values[0]; 2], |[lo, hi], &value| [lo.smaller(value), hi.larger(value)])
}

/// Intersection of two ranges.
fn both<R: PartialOrd + Copy>(a: [R; 2], b: [R; 2]) -> [R; 2] {
    [if b[0] > a[0] { b[0] } else { a[0] }, if b[1] < a[1] { b[1] } else { a[1] }]
}

/// Hull of two ranges.
fn hull<R: Real>(a: [R; 2], b: [R; 2]) -> [R; 2] {
    [a[0].smaller(b[0]), a[1].larger(b[1])]
}

/// Three points.
pub type Points<R> = [[R; 3]; 3];

/// Rays with the points `z (g_x, g_y, 1) + (b_x, b_y, 0)`, for all `g` and `b` in their ranges.
#[derive(Clone, Copy, Debug)]
pub struct Rays<R> {
    /// Ranges of `g_x` and `g_y`.
    pub slope: [[R; 2]; 2],
    /// Ranges of `b_x` and `b_y`.
    pub base: [[R; 2]; 2],
}

/// Rays of a tile from a part of the lens, one set per corner of that part.
#[derive(Clone, Copy, Debug)]
pub struct LensRays<R> {
    rays: [Rays<R>; 4],
    corners: usize,
}

impl<R: Real> LensRays<R> {
    /// Rays through a pinhole; `tile` has the ranges of X and Y.
    pub fn pinhole(tile: [[R; 2]; 2]) -> Self {
        Self::single(Rays { slope: tile, base: [[R::new(0.0); 2]; 2] })
    }

    /// Parallel rays.
    pub fn orthographic(tile: [[R; 2]; 2]) -> Self {
        Self::single(Rays { slope: [[R::new(0.0); 2]; 2], base: tile })
    }

    fn single(rays: Rays<R>) -> Self {
        Self { rays: [rays; 4], corners: 1 }
    }

    /// Rays through the part `lens` (ranges of u and v) of a thin lens with the shear `s`, `a`.
    pub fn lens(tile: [[R; 2]; 2], lens: [[R; 2]; 2], s: [R; 2], a: [R; 2]) -> Self {
        Self::corners(lens, |axis, position| {
            (tile[axis].map(|end| end - position * a[axis]), [position * s[axis]; 2])
        })
    }

    /// Rays of an orthographic view with the same arguments.
    pub fn oblique(tile: [[R; 2]; 2], lens: [[R; 2]; 2], s: [R; 2], a: [R; 2]) -> Self {
        Self::corners(lens, |axis, position| {
            ([-(position * a[axis]); 2], tile[axis].map(|end| end + position * s[axis]))
        })
    }

    /// Rays from each corner of a part of the lens; `ray` gives slope and base along an axis for a lens
    /// position.
    fn corners(lens: [[R; 2]; 2], ray: impl Fn(usize, R) -> ([R; 2], [R; 2])) -> Self {
        let axis = |axis: usize| lens[axis].map(|position| ray(axis, position));
        let (across, down) = (axis(0), axis(1));
        let rays = [(0, 0), (1, 0), (0, 1), (1, 1)].map(|(i, j)| {
            let ((slope_x, base_x), (slope_y, base_y)) = (across[i], down[j]);
            Rays { slope: [slope_x, slope_y], base: [base_x, base_y] }
        });
        Self { rays, corners: 4 }
    }

    /// Rays from each corner of the part of the lens.
    pub fn rays(&self) -> &[Rays<R>] {
        &self.rays[..self.corners]
    }

    /// Range of the slopes of all rays.
    pub fn slopes(&self) -> [[R; 2]; 2] {
        let all = self.rays().iter();
        all.fold(self.rays[0].slope, |slopes, rays| {
            [hull(slopes[0], rays.slope[0]), hull(slopes[1], rays.slope[1])]
        })
    }
}

/// A plane that moves linearly between two times.
#[derive(Clone, Copy, Debug)]
pub struct MovingPlane<R> {
    normal: [R; 3],
    /// Minimum and maximum of `n . p` at each end.
    ends: [[R; 2]; 2],
    /// Bound of the rounding error of `n . p`.
    noise: R,
}

/// Rounding of a few operations in `f64`, relative to the sum of magnitudes.
const ROUNDING: f64 = 1.0 / (1_u64 << 48) as f64;

/// Rounding of products that underflow, for coordinates up to 2^40: each is off by at most 2^-1075.
const UNDERFLOW: f64 = f64::MIN_POSITIVE;

/// Bound of the rounding error of `n . p` for a `normal` and points with magnitudes up to `size`.
fn noise<R: Real>(normal: [R; 3], size: [R; 3]) -> R {
    R::new(ROUNDING).madd(dot(normal.map(R::magnitude), size), R::new(UNDERFLOW))
}

impl MovingPlane<f64> {
    /// The plane in other numbers.
    fn on<N: Numbers>(&self, numbers: N) -> MovingPlane<N::Number> {
        let number = |value| numbers.number(value);
        MovingPlane {
            normal: self.normal.map(number),
            ends: self.ends.map(|range| range.map(number)),
            noise: number(self.noise),
        }
    }
}

impl<R: Real> MovingPlane<R> {
    /// The plane with `normal` for a triangle with the given vertices at the two ends; `size` bounds their
    /// magnitudes by axis.
    pub fn new(normal: [R; 3], ends: [&Points<R>; 2], size: [R; 3]) -> Self {
        Self { normal, ends: [along(normal, ends[0]), along(normal, ends[1])], noise: noise(normal, size) }
    }

    /// The plane for a triangle that does not move.
    pub fn still(normal: [R; 3], points: &Points<R>, size: [R; 3]) -> Self {
        Self { normal, ends: [along(normal, points); 2], noise: noise(normal, size) }
    }

    /// Range of `n . p` over the whole motion.
    pub fn whole(&self) -> [R; 2] {
        hull(self.ends[0], self.ends[1])
    }

    /// Range of `n . p` for times `t` in [0, 1].
    pub fn within(&self, t: [R; 2]) -> [R; 2] {
        let at = |side: usize, t: R| t.madd(self.ends[1][side] - self.ends[0][side], self.ends[0][side]);
        [at(0, t[0]).smaller(at(0, t[1])), at(1, t[0]).larger(at(1, t[1]))]
    }

    /// Depth range in which a ray of the beam meets points with `n . p` in `reach` that are at most `off`
    /// from the ray in x and y. `None` if the plane may be seen edge-on, which gives no bound.
    pub(crate) fn depths(
        &self,
        path: impl Branches,
        reach: [R; 2],
        beam: &LensRays<R>,
        off: [R; 2],
    ) -> Option<[R; 2]> {
        let [nx, ny, _] = self.normal;
        let slack = nx.magnitude().madd(off[0], ny.magnitude().madd(off[1], self.noise));
        let reach = [reach[0] - slack, reach[1] + slack];
        let mut depths: Option<([R; 2], bool)> = None;
        for rays in beam.rays() {
            let (facing, base) = (self.facing(&rays.slope), self.based(&rays.base));
            let found = quotient([reach[0] - base[1], reach[1] - base[0]], facing);
            let front = facing[0] > R::new(0.0);
            let found = match depths {
                None => found,
                Some((known, before)) => found.filter(|_| before == front).map(|found| hull(known, found)),
            };
            path.branch(found.is_some());
            depths = Some((found?, front));
        }
        depths.map(|(depths, _)| depths)
    }

    /// Range of `n . G`, rounding included.
    fn facing(&self, slope: &[[R; 2]; 2]) -> [R; 2] {
        let [nx, ny, nw] = self.normal;
        let (x, y) = (by_sign(nx, slope[0]), by_sign(ny, slope[1]));
        let size = |slope: [R; 2]| slope[0].magnitude().larger(slope[1].magnitude());
        let sum = nx.magnitude().madd(size(slope[0]), ny.magnitude().madd(size(slope[1]), nw.magnitude()));
        let noise = || R::new(ROUNDING) * sum;
        [nx.madd(x[0], ny.madd(y[0], nw)) - noise(), nx.madd(x[1], ny.madd(y[1], nw)) + noise()]
    }

    /// Range of `n . B`, rounding included.
    fn based(&self, base: &[[R; 2]; 2]) -> [R; 2] {
        let [nx, ny, _] = self.normal;
        let (x, y) = (by_sign(nx, base[0]), by_sign(ny, base[1]));
        let size = |base: [R; 2]| base[0].magnitude().larger(base[1].magnitude());
        let sum = nx.magnitude().madd(size(base[0]), ny.magnitude() * size(base[1]));
        let noise = || R::new(ROUNDING) * sum;
        [nx.madd(x[0], ny * y[0]) - noise(), nx.madd(x[1], ny * y[1]) + noise()]
    }
}

/// Range of `n . p` over some vertices.
fn along<R: Real>(n: [R; 3], points: &Points<R>) -> [R; 2] {
    range([dot(n, points[0]), dot(n, points[1]), dot(n, points[2])])
}

/// The ends of `range`, ordered so that `factor` times them rises.
fn by_sign<R: Real>(factor: R, [lo, hi]: [R; 2]) -> [R; 2] {
    if factor < R::new(0.0) { [hi, lo] } else { [lo, hi] }
}

/// Range of the quotient of two ranges; `None` if the denominator may be zero.
fn quotient<R: Real>([lo, hi]: [R; 2], [min, max]: [R; 2]) -> Option<[R; 2]> {
    let zero = R::new(0.0);
    if max < zero {
        return quotient([-hi, -lo], [-max, -min]);
    }
    let below = lo / if lo > zero { max } else { min };
    let above = hi / if hi > zero { min } else { max };
    (min > zero).then_some([below, above])
}

/// Normal of a triangle, with a length of twice its area.
pub fn normal<R: Real>(p: &Points<R>) -> [R; 3] {
    let [first, second] = sides(p);
    cross(first, second)
}

/// The two sides from the first vertex.
pub(super) fn sides<R: Real>([a, b, c]: &Points<R>) -> [[R; 3]; 2] {
    [b, c].map(|p| [p[0] - a[0], p[1] - a[1], p[2] - a[2]])
}

/// Intersection of all given depth ranges.
pub fn tightest<R: Real>(bounds: impl IntoIterator<Item = Option<[R; 2]>>) -> Option<[R; 2]> {
    bounds.into_iter().flatten().reduce(both)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A square facing the camera that recedes from depth 2 to 4 and moves sideways.
    const OPEN: Points<f64> = [[-2.0, -2.0, 2.0], [2.0, -2.0, 2.0], [-2.0, 2.0, 2.0]];
    const CLOSE: Points<f64> = [[0.0, -4.0, 4.0], [4.0, -4.0, 4.0], [0.0, 4.0, 4.0]];
    const SIZE: [f64; 3] = [4.0; 3];
    const TILE: [[f64; 2]; 2] = [[-0.5, 0.5], [-0.25, 0.25]];

    fn close_to(found: [f64; 2], expected: [f64; 2]) {
        let near = |a: f64, b: f64| (a - b).abs() < 1e-9;
        assert!(near(found[0], expected[0]) && near(found[1], expected[1]), "{found:?} {expected:?}");
    }

    #[test]
    fn a_triangle_parallel_to_the_screen_is_bounded_by_its_depth() {
        let plane = MovingPlane::new(normal(&OPEN), [&OPEN, &CLOSE], SIZE);
        let beam = LensRays::pinhole(TILE);
        close_to(plane.depths((), plane.whole(), &beam, [0.0; 2]).unwrap(), [2.0, 4.0]);
        close_to(plane.depths((), plane.within([0.25, 0.5]), &beam, [0.0; 2]).unwrap(), [2.5, 3.0]);
        let lens = LensRays::lens(TILE, [[-1.0, 1.0]; 2], [3.0, -3.0], [0.5, -0.5]);
        close_to(plane.depths((), plane.within([0.25, 0.5]), &lens, [0.0; 2]).unwrap(), [2.5, 3.0]);
        let parallel = LensRays::orthographic(TILE);
        close_to(plane.depths((), plane.within([0.25, 0.5]), &parallel, [0.0; 2]).unwrap(), [2.5, 3.0]);
    }

    /// The plane w = 4 + x has depth 4 / (1 - X) at X, and 4 + X in parallel light.
    #[test]
    fn a_slanted_plane_is_bounded_at_the_corners_of_the_tile() {
        let points = [[0.0, 0.0, 4.0], [1.0, 0.0, 5.0], [0.0, 1.0, 4.0]];
        let plane = MovingPlane::new(normal(&points), [&points, &points], [1.0, 1.0, 5.0]);
        let depths = |beam: &LensRays<f64>| plane.depths((), plane.whole(), beam, [0.0; 2]);
        close_to(depths(&LensRays::pinhole(TILE)).unwrap(), [4.0 / 1.5, 8.0]);
        close_to(depths(&LensRays::orthographic(TILE)).unwrap(), [3.5, 4.5]);
        assert!(depths(&LensRays::pinhole([[0.5, 1.5], [0.0, 1.0]])).is_none(), "seen edge-on at X = 1");
        // From u on a lens with s = 2, F = 4: w (1 - (X - u / 2)) = 4 + 2 u.
        let lens = LensRays::lens(TILE, [[-1.0, 0.5], [0.0, 0.0]], [2.0, 2.0], [0.5, 0.5]);
        let at = |x: f64, u: f64| (4.0 + 2.0 * u) / (1.0 - x + 0.5 * u);
        let corners = range([at(-0.5, -1.0), at(0.5, -1.0), at(-0.5, 0.5), at(0.5, 0.5)]);
        assert!(depths(&lens).is_none(), "seen edge-on from u = -1 at X = 1/2");
        let lens = LensRays::lens([[-0.5, 0.25], TILE[1]], [[-1.0, 0.5], [0.0, 0.0]], [2.0, 2.0], [0.5, 0.5]);
        let inner = range([at(-0.5, -1.0), at(0.25, -1.0), at(-0.5, 0.5), at(0.25, 0.5)]);
        assert!(corners[1] > inner[1]);
        close_to(depths(&lens).unwrap(), inner);
    }

    /// The plane w = 4 + x at X + u (a w - s) = x with s = 2, a = 1/2: w = 4 + X - u (w / 2 - 2), so w (1 + u
    /// / 2) = 4 + X + 2 u.
    #[test]
    fn an_oblique_view_is_bounded_at_the_corners_of_tile_and_lens() {
        let points = [[0.0, 0.0, 4.0], [1.0, 0.0, 5.0], [0.0, 1.0, 4.0]];
        let plane = MovingPlane::new(normal(&points), [&points, &points], [1.0, 1.0, 5.0]);
        let beam = LensRays::oblique(TILE, [[-1.0, 0.5], [0.0, 0.0]], [2.0, 2.0], [0.5, 0.5]);
        let at = |x: f64, u: f64| (4.0 + x + 2.0 * u) / (1.0 + 0.5 * u);
        let corners = range([at(-0.5, -1.0), at(0.5, -1.0), at(-0.5, 0.5), at(0.5, 0.5)]);
        close_to(plane.depths((), plane.whole(), &beam, [0.0; 2]).unwrap(), corners);
    }

    /// A bound that allowed only for rounding relative to the products would leave out a vertex.
    #[test]
    fn products_that_underflow_are_allowed_for() {
        let units = [1e-271 / 3.0, 1e-44 / 3.0, 0.01 / 3.0];
        let vertices = [[-22.0, 2.0, 82.0], [-20.0, 3.0, 81.0], [-24.0, 3.0, 84.0]];
        let points: Points<f64> = vertices.map(|p: [f64; 3]| [0, 1, 2].map(|axis| p[axis] * units[axis]));
        let size = [24.0 * units[0], 3.0 * units[1], 84.0 * units[2]];
        let plane = MovingPlane::new(normal(&points), [&points, &points], size);
        for [x, y, w] in points {
            let found = plane.depths((), plane.whole(), &LensRays::orthographic([[x; 2], [y; 2]]), [0.0; 2]);
            assert!(found.is_none_or(|[lo, hi]| lo <= w && w <= hi), "{w} in {found:?}");
        }
    }

    /// Front-facing from one end of the lens and back-facing from the other: edge-on from a point in between.
    #[test]
    fn a_plane_seen_from_both_faces_bounds_nothing() {
        let points = [[0.0, 0.0, 4.0], [1.0, 0.0, 5.0], [0.0, 1.0, 4.0]];
        let plane = MovingPlane::new(normal(&points), [&points, &points], [1.0, 1.0, 5.0]);
        let tile = [[1.0, 1.2], [0.0, 0.1]];
        let from = |u| LensRays::lens(tile, [u, [0.0; 2]], [2.0; 2], [0.5; 2]);
        assert!(plane.depths((), plane.whole(), &from([1.0; 2]), [0.0; 2]).is_some());
        assert!(plane.depths((), plane.whole(), &from([-1.0; 2]), [0.0; 2]).is_some());
        assert!(plane.depths((), plane.whole(), &from([-1.0, 1.0]), [0.0; 2]).is_none());
    }

    #[test]
    fn quotients_of_ranges() {
        assert_eq!(quotient([-1.0, 2.0], [2.0, 4.0]), Some([-0.5, 1.0]));
        assert_eq!(quotient([1.0, 2.0], [2.0, 4.0]), Some([0.25, 1.0]));
        assert_eq!(quotient([1.0, 2.0], [-4.0, -2.0]), Some([-1.0, -0.25]));
        assert_eq!(quotient([1.0, 2.0], [-1.0, 2.0]), None);
        assert_eq!(quotient([1.0, 2.0], [0.0, 2.0]), None);
    }
}
