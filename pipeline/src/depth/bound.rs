//! Depth interval: bounds of every depth that the sample test computes for a triangle, over a tile and a box
//! of lens and time.

use serde::{Deserialize, Serialize};

use super::{
    LensRays, MovingPlane, Numbers, Points, Real, both, cross, hull, normal, range, sides, tightest,
};
use crate::geometry::Shear;
use crate::setup::Triangle;
use crate::tally::{Branches, Costs, Kernel};
use crate::traversal::{Box5, Coordinate, TileRect};

/// Method of bounding the depth of a triangle over a tile. Each method includes the bounds of the methods
/// before it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub enum DepthBound {
    /// Depths of the vertices at the ends of the shutter, the bound of other methods.
    Vertices,
    /// Depths of the vertices at the ends of the time interval (thesis, Paper VI, Appendix A, first test).
    #[default]
    VerticesInTime,
    /// Moving planes through the triangle at each end of the shutter (second test).
    Planes,
    /// Moving planes through the triangle at each end of the time interval, more expensive and tighter.
    LocalPlanes,
}

impl DepthBound {
    /// All methods, the coarsest first.
    pub const ALL: [Self; 4] = [Self::Vertices, Self::VerticesInTime, Self::Planes, Self::LocalPlanes];

    pub(crate) fn has_planes(self) -> bool {
        self >= Self::Planes
    }
}

/// Multiply-adds of preparing a triangle. A still one has one plane, a moving one two. Methods that find their planes
/// in every tile have none here. The choice of tests expects them before the work is done.
pub(crate) const fn set_up_madds(bound: DepthBound, moving: bool, lens: bool) -> u32 {
    let sizes = if moving { 9 } else { 0 } + if lens { 2 } else { 0 };
    match (bound, moving) {
        (DepthBound::Vertices | DepthBound::VerticesInTime, _) => 0,
        (DepthBound::Planes | DepthBound::LocalPlanes, false) => 25 + sizes,
        (DepthBound::Planes, true) => 77 + sizes,
        (DepthBound::LocalPlanes, true) => sizes,
    }
}

/// Multiply-adds of one interval, if every plane gives a bound: expected likewise.
pub(crate) const fn interval_madds(bound: DepthBound, moving: bool, lens: bool) -> u32 {
    match (bound, moving, lens) {
        (DepthBound::Vertices | DepthBound::VerticesInTime, ..) => vertex_madds(bound, moving),
        (_, false, false) => 86,
        (_, false, true) => 158,
        (DepthBound::Planes, true, false) => 208,
        (DepthBound::Planes, true, true) => 340,
        (DepthBound::LocalPlanes, true, false) => 260,
        (DepthBound::LocalPlanes, true, true) => 392,
    }
}

/// Multiply-adds of the depths of three vertices at both ends of a time interval, of [`vertex_range`]. Methods with planes
/// have them from the vertices of their planes.
const fn vertex_madds(bound: DepthBound, moving: bool) -> u32 {
    if matches!(bound, DepthBound::VerticesInTime) && moving { 2 * 3 } else { 0 }
}

/// Smallest and largest depth of the vertices of `triangle` for times in `t`. The depth at a sample is a
/// convex combination, clamped to the range of the vertices. Vertices move monotonically, also with rounding,
/// so the extremes are at the ends of the interval.
pub fn vertex_range(triangle: &Triangle, t: [f32; 2]) -> [f32; 2] {
    let depths = triangle.corners.iter().flat_map(|corner| t.map(|t| corner.at(t)[2]));
    depths.fold([f32::INFINITY, f32::NEG_INFINITY], |[lo, hi], w| [lo.min(w), hi.max(w)])
}

/// Depth bounds of a triangle, prepared before any tile is visited.
#[derive(Clone, Copy, Debug)]
pub struct Bounder {
    triangle: Triangle,
    bound: DepthBound,
    /// Input of the plane bounds, for methods with planes.
    facts: Option<Facts<f64>>,
}

impl Bounder {
    /// Prepare depth bounds of `triangle` under a lens with `shear`.
    pub fn new(triangle: &Triangle, shear: &Shear, bound: DepthBound) -> Self {
        Self::counted(triangle, shear, bound, None).0
    }

    /// The same with the multiply-adds, if there are `costs` to count them with, else 0.
    pub(crate) fn counted(
        triangle: &Triangle,
        shear: &Shear,
        bound: DepthBound,
        costs: Option<&Costs>,
    ) -> (Self, u32) {
        let early = bound == DepthBound::Planes || (bound == DepthBound::LocalPlanes && !triangle.moving);
        let prepared = || Facts::new(triangle, shear).prepared(early, costs);
        let (facts, madds) = bound.has_planes().then(prepared).unzip();
        (Self { triangle: *triangle, bound, facts }, madds.unwrap_or(0))
    }

    /// Interval of the depths of all samples in `tile` and `within` for which
    /// [`test_run`](crate::sample_test::test_run) finds the triangle visible.
    pub fn over(&self, tile: &TileRect, within: &Box5) -> [f32; 2] {
        self.over_counted(tile, within, None).0
    }

    /// The same with the multiply-adds, if there are `costs` to count them with, else 0.
    #[inline]
    pub(crate) fn over_counted(
        &self,
        tile: &TileRect,
        within: &Box5,
        costs: Option<&Costs>,
    ) -> ([f32; 2], u32) {
        let t = if self.bound == DepthBound::Vertices { [0.0, 1.0] } else { within.t };
        let vertices = vertex_range(&self.triangle, t);
        let Some(facts) = &self.facts else {
            return (vertices, costs.map_or(0, |_| vertex_madds(self.bound, self.triangle.moving)));
        };
        let region = Region::new(tile, within);
        let (depths, madds) = match costs {
            None => (facts.over((), &region), 0),
            Some(costs) => costs.run(
                Kernel::Depths,
                |path| facts.over(path, &region),
                |tally| _ = facts.on(tally).over(tally, &region.on(tally)),
            ),
        };
        (depths.map_or(vertices, |[lo, hi]| both(vertices, [f32::at_most(lo), f32::at_least(hi)])), madds)
    }
}

/// Depth bounds of a triangle in conservative mode, by [`DepthBound::LocalPlanes`].
#[derive(Clone, Copy, Debug)]
pub(crate) struct ExactBounder(Facts<f64>);

impl ExactBounder {
    /// Prepare depth bounds of `triangle` under a lens with `shear`; with the multiply-adds, if there are `costs` to
    /// count them with, else 0.
    pub fn new<C: Coordinate>(
        triangle: &Triangle<C>,
        shear: &Shear<C>,
        costs: Option<&Costs>,
    ) -> (Self, u32) {
        let (facts, madds) = Facts::new(triangle, shear).prepared(!triangle.moving, costs);
        (Self(facts), madds)
    }

    /// Interval of the depths of all points seen in `tile` and `within` of a triangle whose vertices are off
    /// by half the slack, and by `depth` in depth. It is empty if there are none. With the multiply-adds likewise.
    pub fn over<C: Coordinate>(
        &self,
        tile: &TileRect<C>,
        within: &Box5<C>,
        depth: C,
        costs: Option<&Costs>,
    ) -> ([C; 2], u32) {
        // Twice the error covers the rounding of vertices at a time, and of the bound.
        let (facts, region, off) = (&self.0, Region::new(tile, within), 2.0 * depth.into());
        let ([lo, hi], madds) = match costs {
            None => (facts.exact((), &region, off), 0),
            Some(costs) => costs.run(
                Kernel::ExactDepths,
                |path| facts.exact(path, &region, off),
                |tally| _ = facts.on(tally).exact(tally, &region.on(tally), tally.number(off)),
            ),
        };
        ([C::at_most(lo), C::at_least(hi)], madds)
    }
}

/// A tile and a box of lens and time.
struct Region<R> {
    tile: [[R; 2]; 2],
    lens: Option<[[R; 2]; 2]>,
    t: [R; 2],
}

impl Region<f64> {
    fn new<C: Coordinate>(tile: &TileRect<C>, within: &Box5<C>) -> Self {
        let wide = |range: [C; 2]| range.map(Into::into);
        Self {
            tile: [wide(tile.x), wide(tile.y)],
            lens: within.lens.then(|| [wide(within.u), wide(within.v)]),
            t: wide(within.t),
        }
    }

    fn on<N: Numbers>(&self, numbers: N) -> Region<N::Number> {
        let number = |value| numbers.number(value);
        Region {
            tile: self.tile.map(|range| range.map(number)),
            lens: self.lens.map(|lens| lens.map(|range| range.map(number))),
            t: self.t.map(number),
        }
    }
}

/// A triangle under a lens, after set-up.
#[derive(Clone, Copy, Debug)]
struct Facts<R> {
    open: Points<R>,
    delta: Points<R>,
    moving: bool,
    /// Largest magnitude on each axis at any time, seen from the lens.
    size: [R; 3],
    slack: [R; 2],
    s: [R; 2],
    a: [R; 2],
    parallel: bool,
    /// Planes through the triangle at the ends of the shutter, if they are found in set-up.
    shutter: Option<[MovingPlane<R>; 2]>,
}

impl Facts<f64> {
    fn new<C: Coordinate>(triangle: &Triangle<C>, shear: &Shear<C>) -> Self {
        let [s, a]: [[f64; 2]; 2] = [shear.s, shear.a].map(|part| part.map(Into::into));
        let open: Points<f64> = triangle.corners.map(|corner| corner.open.map(Into::into));
        let delta: Points<f64> = triangle.corners.map(|corner| corner.delta.map(Into::into));
        let size = [0.0; 3];
        let (moving, slack, parallel) = (triangle.moving, triangle.slack.map(Into::into), shear.parallel);
        Self { open, delta, moving, size, slack, s, a, parallel, shutter: None }
    }

    /// With its size, and with the planes at the ends of the shutter if they are found in set-up. The multiply-adds are
    /// counted if there are `costs` to count them with, else 0.
    fn prepared(self, early: bool, costs: Option<&Costs>) -> (Self, u32) {
        let ((size, shutter), madds) = match costs {
            None => (self.prepare((), early), 0),
            Some(costs) => costs.run(
                Kernel::Planes,
                |path| self.prepare(path, early),
                |tally| _ = self.on(tally).prepare(tally, early),
            ),
        };
        (Self { size, shutter, ..self }, madds)
    }

    fn on<N: Numbers>(&self, numbers: N) -> Facts<N::Number> {
        let number = |value| numbers.number(value);
        Facts {
            open: self.open.map(|point| point.map(number)),
            delta: self.delta.map(|point| point.map(number)),
            moving: self.moving,
            size: self.size.map(number),
            slack: self.slack.map(number),
            s: self.s.map(number),
            a: self.a.map(number),
            parallel: self.parallel,
            shutter: self.shutter.map(|planes| planes.map(|plane| plane.on(numbers))),
        }
    }
}

impl<R: Real> Facts<R> {
    /// The size, and the planes at the ends of the shutter if they are found in set-up.
    fn prepare(&self, path: impl Branches, early: bool) -> ([R; 3], Option<[MovingPlane<R>; 2]>) {
        let size = self.largest(path);
        let sized = Self { size, ..*self };
        (size, path.branch(early).then(|| sized.planes_of_shutter(path)))
    }

    /// Largest magnitude on each axis at any time, seen from the lens.
    fn largest(&self, path: impl Branches) -> [R; 3] {
        let moving = path.branch(self.moving);
        let sheared = path.branch(self.s.iter().any(|s| *s != R::new(0.0)));
        let largest = |axis: usize| {
            let magnitude = |k: usize| {
                let open = self.open[k][axis].magnitude();
                if moving { open + self.delta[k][axis].magnitude() } else { open }
            };
            (0..3).map(magnitude).fold(R::new(0.0), R::larger)
        };
        let [x, y, w] = [0, 1, 2].map(largest);
        if sheared { [x + self.s[0].magnitude(), y + self.s[1].magnitude(), w] } else { [x, y, w] }
    }

    fn at(&self, t: R) -> Points<R> {
        let mut points = self.open;
        for (point, delta) in points.iter_mut().zip(&self.delta) {
            for (coordinate, delta) in point.iter_mut().zip(delta) {
                *coordinate = t.madd(*delta, *coordinate);
            }
        }
        points
    }

    /// Planes through the triangle at each end of the shutter; equal for a still triangle.
    fn planes_of_shutter(&self, path: impl Branches) -> [MovingPlane<R>; 2] {
        if !path.branch(self.moving) {
            return [MovingPlane::still(normal(&self.open), &self.open, self.size); 2];
        }
        let close = [0, 1, 2].map(|k| [0, 1, 2].map(|axis| self.open[k][axis] + self.delta[k][axis]));
        self.through(&[self.open, close])
    }

    fn through(&self, ends: &[Points<R>; 2]) -> [MovingPlane<R>; 2] {
        let plane = |end: &Points<R>| MovingPlane::new(normal(end), [&ends[0], &ends[1]], self.size);
        [plane(&ends[0]), plane(&ends[1])]
    }

    /// Depths allowed by the planes of set-up or, without these, by planes through the triangle at the ends
    /// of the region's time. The interval includes the rounding of the sample test.
    fn over(&self, path: impl Branches, region: &Region<R>) -> Option<[R; 2]> {
        let (beam, ends) = (self.beam(path, region), self.ends(path, region));
        let margin = margin(&ends[..self.different()], &beam, self.slack, self.size[2]);
        path.branch(margin.is_some());
        self.planes(path, region, &beam, &ends, &margin?)
    }

    /// Depths of every point of a triangle whose vertices are off by half the slack, and by `depth` in depth.
    fn exact(&self, path: impl Branches, region: &Region<R>, depth: R) -> [R; 2] {
        let margin = Margin { off: self.slack.map(|slack| R::new(0.5) * slack), depth };
        let (beam, ends) = (self.beam(path, region), self.ends(path, region));
        let depths = |points: &Points<R>| range([points[0][2], points[1][2], points[2][2]]);
        let [lo, hi] = hull(depths(&ends[0]), depths(&ends[1]));
        let vertices = [lo - depth, hi + depth];
        let planes = self.planes(path, region, &beam, &ends, &margin);
        planes.map_or(vertices, |planes| both(vertices, planes))
    }

    fn beam(&self, path: impl Branches, region: &Region<R>) -> LensRays<R> {
        path.branch(region.lens.is_some());
        match (region.lens, path.branch(self.parallel)) {
            (Some(lens), false) => LensRays::lens(region.tile, lens, self.s, self.a),
            (None, false) => LensRays::pinhole(region.tile),
            (Some(lens), true) => LensRays::oblique(region.tile, lens, self.s, self.a),
            (None, true) => LensRays::orthographic(region.tile),
        }
    }

    /// Vertices at the ends of the time.
    fn ends(&self, path: impl Branches, region: &Region<R>) -> [Points<R>; 2] {
        if path.branch(self.moving) { [self.at(region.t[0]), self.at(region.t[1])] } else { [self.open; 2] }
    }

    fn different(&self) -> usize {
        if self.moving { 2 } else { 1 }
    }

    fn planes(
        &self,
        path: impl Branches,
        region: &Region<R>,
        beam: &LensRays<R>,
        ends: &[Points<R>; 2],
        margin: &Margin<R>,
    ) -> Option<[R; 2]> {
        let known = path.branch(self.shutter.is_some());
        let planes = self.shutter.unwrap_or_else(|| self.through(ends));
        let bounds = planes[..self.different()].iter().map(|plane| {
            let reach = if known && self.moving { plane.within(region.t) } else { plane.whole() };
            plane.depths(path, reach, beam, margin.off)
        });
        tightest(bounds).map(|[lo, hi]| [lo - margin.depth, hi + margin.depth])
    }
}

/// Half an ulp of `f32`, relative.
const HALF_ULP: f64 = 1.0 / 16_777_216.0;

/// Upper bound of the loss when one product of `f32` falls below the normal range.
const UNDERFLOW_LOSS: f64 = f32::MIN_POSITIVE as f64 * HALF_ULP;

/// Products of two lengths and a depth above this may overflow in the sample test.
const OVERFLOW_LIMIT: f64 = 1.0e36;

/// Distance between the depth of the sample test and the plane of the triangle, caused by rounding.
///
/// The sample test rounds the vertices as seen from the sample to `P_k` and is exact for these points. Its
/// depth is `sum(e_k w_k) / sum(e_k)` with rounded edges `e_k = E_k + d_k`. The weights `e_k / sum(e)` are
/// not negative, so the weighted mean of the vertices is a point of the triangle, and every bound on the
/// triangle holds for it. This point is slightly off the ray: as `sum(E_k P_k) = 0`, its distance is
///
/// ```text
/// sum(d_k P_k) / sum(e_k)  + the rounding of P_k itself, half the slack
/// ```
///
/// Seen from a sample inside, no vertex is farther than the extent `(l_x, l_y)` of the rounded triangle. So
/// with `u = 2^-24`, `|d_k| < 4.02 u l_x l_y`. And `sum(e)` is `N . G`, twice the area as seen, with the
/// normal `N` at the sample's own time and its ray `G`. It is quadratic in time, so its Bernstein
/// coefficients bound it. Rounding reduces it by at most `3 (slack_x l_y + slack_y l_x)` for the vertices
/// (each of six products of two vertices, each off by half a slack either way) plus `sum |d_k|`. If nothing
/// remains, as for slivers and for triangles whose facing may change, there is no bound.
#[derive(Clone, Copy, Debug)]
struct Margin<R> {
    /// Largest distance in x and y between the ray and the point whose depth is computed.
    pub off: [R; 2],
    /// Largest error of its depth by rounding after that.
    pub depth: R,
}

/// Margin of a triangle with the given vertices at the two ends of a time interval (one end if it is still),
/// with the slack of its set-up; `deepest` bounds the depth of the vertices. `None` if its area as seen may
/// be a rounding error.
fn margin<R: Real>(ends: &[Points<R>], beam: &LensRays<R>, slack: [R; 2], deepest: R) -> Option<Margin<R>> {
    let slopes = beam.slopes();
    let [wide, high] = [0, 1].map(|axis| extent(ends, axis, slopes[axis]) + slack[axis]);
    let unsure = R::new(13.0 * HALF_ULP).madd(wide * high, R::new(UNDERFLOW_LOSS));
    let rounded = R::new(3.0).madd(slack[0].madd(high, slack[1] * wide), unsure);
    let area = seen_area(ends, &slopes) - rounded;
    // Both are computed in any case, as the multiply-adds of a path must not depend on more than its branches.
    let (has_area, may_overflow) = (area > R::new(0.0), wide * high * deepest > R::new(OVERFLOW_LIMIT));
    if !has_area || may_overflow {
        return None;
    }
    let half = R::new(0.5);
    let off = [half.madd(slack[0], unsure * wide / area), half.madd(slack[1], unsure * high / area)];
    Some(Margin { off, depth: R::new(9.0 * HALF_ULP).madd(deepest, R::new(UNDERFLOW_LOSS) / area) })
}

/// Largest extent along `axis` of the triangle, seen along a ray with a slope in the range, at either end.
fn extent<R: Real>(ends: &[Points<R>], axis: usize, slope: [R; 2]) -> R {
    let mut largest = R::new(0.0);
    for points in ends {
        for (i, j) in [(1, 0), (2, 0), (2, 1)] {
            let (across, deep) = (points[i][axis] - points[j][axis], points[j][2] - points[i][2]);
            for g in slope {
                largest = largest.larger(g.madd(deep, across).magnitude());
            }
        }
    }
    largest
}

/// Lower bound of twice the area as seen, for either facing; 0 or less if the facing may change.
fn seen_area<R: Real>(ends: &[Points<R>], slopes: &[[R; 2]; 2]) -> R {
    let first = sides(&ends[0]);
    let seen = |n: [R; 3]| {
        let [x, y] = [0, 1].map(|axis| {
            let ends = slopes[axis].map(|g| n[axis] * g);
            [ends[0].smaller(ends[1]), ends[0].larger(ends[1])]
        });
        [x[0] + y[0] + n[2], x[1] + y[1] + n[2]]
    };
    let mut range = seen(cross(first[0], first[1]));
    if let Some(last) = ends.get(1).map(sides) {
        range = hull(range, seen(cross(last[0], last[1])));
        let (a, b) = (cross(first[0], last[1]), cross(last[0], first[1]));
        range = hull(range, seen([0, 1, 2].map(|i| R::new(0.5) * (a[i] + b[i]))));
    }
    range[0].larger(-range[1])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Cull, MovingVertex};
    use crate::random::{mix, unit};
    use crate::setup::{SetupResult, set_up};
    use crate::tally::Tally;

    fn triangle(moving: bool) -> Triangle {
        let open = [[-40.0, -40.0, 4.0], [40.0, -30.0, 5.0], [0.0, 50.0, 6.0]];
        let v = open.map(|[x, y, w]| MovingVertex {
            open: [x, y, w],
            close: if moving { [x + 3.0, y - 1.0, w + 0.5] } else { [x, y, w] },
        });
        match set_up(0, [&v[0], &v[1], &v[2]], Cull::None, &SHEAR, 0.1, [64.0; 2]) {
            SetupResult::Ready(triangle) => triangle,
            other => panic!("{other:?}"),
        }
    }

    const SHEAR: Shear = Shear::new([9.0, -9.0], [2.0, -2.0]);
    const TILE: TileRect = TileRect { x: [-1.0, 1.0], y: [-1.0, 1.0] };

    fn part(lens: bool) -> Box5 {
        Box5 { u: [-0.5, 0.5], v: [-0.5, 0.5], t: [0.25, 0.5], ..Box5::whole(lens) }
    }

    /// What the choice of tests expects is what is counted where every plane gives a bound.
    #[test]
    fn expected_multiply_adds_are_those_of_the_code() {
        let costs = Costs::default();
        for (bound, moving, lens) in all() {
            for parallel in [false, true] {
                let shear = if lens { SHEAR } else { Shear::default() };
                let (triangle, shear) = (triangle(moving), Shear { parallel, ..shear });
                let (bounder, set_up) = Bounder::counted(&triangle, &shear, bound, Some(&costs));
                assert_eq!(set_up, set_up_madds(bound, moving, lens), "{bound:?} {moving}");
                let within = part(lens);
                let (found, over) = bounder.over_counted(&TILE, &within, Some(&costs));
                assert_eq!(over, interval_madds(bound, moving, lens), "{bound:?} {moving} {lens} {parallel}");
                assert_eq!(found, bounder.over(&TILE, &within));
            }
        }
    }

    /// Depths are a third of the coordinates of the vertices.
    #[test]
    fn vertices_take_a_multiply_add_for_each_coordinate() {
        for moving in [false, true] {
            let (tally, facts) = (Tally::default(), Facts::new(&triangle(moving), &SHEAR));
            let region = Region::new(&TILE, &part(false));
            facts.on(&tally).ends(&tally, &region.on(&tally));
            assert_eq!(tally.madds(), 3 * vertex_madds(DepthBound::VerticesInTime, moving));
        }
    }

    /// A triangle whose facing may change has no margin, which ends the work. In conservative mode each plane that may
    /// be seen edge-on ends the work on it.
    #[test]
    fn less_is_counted_where_there_are_no_bounds() {
        let (costs, within) = (Costs::remembered(), part(true));
        let madds = |shear: &Shear| {
            let (bounder, _) =
                Bounder::counted(&triangle(true), shear, DepthBound::LocalPlanes, Some(&costs));
            let (exact, _) = ExactBounder::new(&triangle(true), shear, Some(&costs));
            let over = bounder.over_counted(&TILE, &within, Some(&costs)).1;
            [over, exact.over(&TILE, &within, 0.01, Some(&costs)).1]
        };
        let (all, less) = (madds(&SHEAR), madds(&Shear::new([9.0, -9.0], [400.0, -400.0])));
        assert_eq!(all[0], interval_madds(DepthBound::LocalPlanes, true, true));
        assert!(less[0] < all[0] && less[1] < all[1], "{less:?} {all:?}");
    }

    /// Costs that are remembered by path are those of counting each time.
    #[test]
    fn multiply_adds_follow_from_the_path() {
        let (known, none, mut r) = (Costs::remembered(), Costs::default(), Uniform(5));
        for n in 0..2000 {
            let moving = n % 2 == 0;
            let shear = Shear { parallel: n % 3 == 0, ..SHEAR };
            let mut triangle = triangle(moving);
            // Products of the largest ones may overflow.
            let scale = [1.0, 1e11, 1e13][n % 11 % 3];
            for corner in &mut triangle.corners {
                let at = [r.within(-6.0, 6.0), r.within(-6.0, 6.0), r.within(-1.0, 4.0)];
                corner.open = at.map(|x| (scale * x) as f32);
            }
            let lo = r.within(-1.0, 0.5);
            let within = Box5 { t: [0.25, 0.5], u: [lo as f32, 0.6], ..Box5::whole(n % 5 < 2) };
            for bound in DepthBound::ALL {
                let all = [&known, &none].map(|costs| {
                    let (bounder, set_up) = Bounder::counted(&triangle, &shear, bound, Some(costs));
                    (set_up, bounder.over_counted(&TILE, &within, Some(costs)))
                });
                assert_eq!(all[0], all[1], "{n} {bound:?}");
            }
            let [first, second] = [&known, &none].map(|costs| {
                let (bounder, set_up) = ExactBounder::new(&triangle, &shear, Some(costs));
                (set_up, bounder.over(&TILE, &within, 0.01, Some(costs)))
            });
            assert_eq!(first, second, "{n}");
        }
    }

    fn all() -> impl Iterator<Item = (DepthBound, bool, bool)> {
        let flags = [(false, false), (true, false), (false, true), (true, true)];
        DepthBound::ALL.into_iter().flat_map(move |b| flags.map(move |(moving, lens)| (b, moving, lens)))
    }

    #[test]
    fn each_method_is_within_the_one_before() {
        for moving in [false, true] {
            let within = Box5 { t: [0.25, 0.5], ..Box5::whole(true) };
            let over = |bound| Bounder::new(&triangle(moving), &SHEAR, bound).over(&TILE, &within);
            let widths = DepthBound::ALL.map(over).map(|[lo, hi]| hi - lo);
            assert!(widths.is_sorted_by(|a, b| a >= b), "{widths:?}");
            assert!(widths[2] < 0.8 * widths[1], "{widths:?}");
        }
    }

    #[test]
    fn a_sliver_has_the_bound_of_its_vertices() {
        let mut sliver = triangle(true);
        sliver.corners[2] = sliver.corners[1];
        let over = |bound| Bounder::new(&sliver, &SHEAR, bound).over(&TILE, &Box5::whole(true));
        assert_eq!(over(DepthBound::LocalPlanes), over(DepthBound::VerticesInTime));
    }

    struct Uniform(u64);

    impl Uniform {
        fn within(&mut self, lo: f64, hi: f64) -> f64 {
            self.0 += 1;
            lo + (hi - lo) * unit(mix(self.0))
        }

        fn points(&mut self, reach: f64) -> Points<f64> {
            [(); 3].map(|()| [self.within(-reach, reach), self.within(-reach, reach), self.within(1.0, 4.0)])
        }
    }

    /// Twice the signed area of the triangle at `t` between two ends, seen with slope `g`, and its extents.
    fn seen_at(ends: &[Points<f64>; 2], t: f64, g: [f64; 2]) -> (f64, [f64; 2]) {
        let p = [0, 1, 2].map(|k| {
            let at = [0, 1, 2].map(|axis| ends[0][k][axis] + t * (ends[1][k][axis] - ends[0][k][axis]));
            [0, 1].map(|axis| at[axis] - g[axis] * at[2])
        });
        let side = |i: usize, axis: usize| p[i][axis] - p[0][axis];
        let extent = |axis: usize| {
            let all = p.map(|p| p[axis]);
            all.iter().fold(f64::MIN, |a, &b| a.max(b)) - all.iter().fold(f64::MAX, |a, &b| a.min(b))
        };
        (side(1, 0) * side(2, 1) - side(2, 0) * side(1, 1), [extent(0), extent(1)])
    }

    #[test]
    fn area_and_extent_hold_over_the_whole_box() {
        let (mut r, mut certain, mut turned_twice) = (Uniform(1), 0, 0);
        for _ in 0..3000 {
            let ends = [r.points(6.0), r.points(6.0)];
            let slopes = [0, 1].map(|_| {
                let lo = r.within(-1.0, 1.0);
                [lo, lo + r.within(0.0, 0.1)]
            });
            let area = seen_area(&ends, &slopes);
            let extents = [0, 1].map(|axis| extent(&ends, axis, slopes[axis]));
            certain += u32::from(area > 0.0);
            let middle = slopes.map(|[lo, hi]| 0.5 * (lo + hi));
            let signs = [0.0, 0.5, 1.0].map(|t| seen_at(&ends, t, middle).0 > 0.0);
            turned_twice += u32::from(signs[0] != signs[1] && signs[1] != signs[2]);
            for _ in 0..40 {
                let (t, g) = (r.within(0.0, 1.0), slopes.map(|[lo, hi]| r.within(lo, hi)));
                let (found, wide) = seen_at(&ends, t, g);
                assert!(found.abs() >= area - 1e-9, "{found} {area}");
                assert!((0..2).all(|axis| wide[axis] <= extents[axis] + 1e-9), "{wide:?} {extents:?}");
            }
        }
        assert!(certain > 300 && turned_twice > 100, "{certain} {turned_twice}");
    }

    /// For edges of `f32` vertices around a sample, rounded as in the sample test, the weighted mean is
    /// within the margin of a triangle whose vertices are exact.
    #[test]
    fn weights_are_off_by_no_more_than_the_margin() {
        let (mut r, mut checked, mut closest) = (Uniform(2), 0, 0.0_f64);
        for _ in 0..400_000 {
            let thin = r.within(-12.0, 0.0).exp2();
            let p = r.points(1.0).map(|[x, y, _]| [x as f32, (x + thin * y) as f32, 1.0]);
            let e = [(1, 2), (2, 0), (0, 1)].map(|(i, j)| f64::from(p[i][0] * p[j][1] - p[j][0] * p[i][1]));
            if !(e.iter().all(|&e| e > 0.0) || e.iter().all(|&e| e < 0.0)) {
                continue;
            }
            let ends = [p.map(|p| p.map(f64::from))];
            let Some(margin) = margin(&ends, &LensRays::pinhole([[0.0; 2]; 2]), [0.0; 2], 1.0) else {
                continue;
            };
            let sum: f64 = e.iter().sum();
            for axis in [0, 1] {
                let off = (0..3).map(|k| e[k] * ends[0][k][axis]).sum::<f64>() / sum;
                assert!(off.abs() <= margin.off[axis], "{off} {margin:?}");
                closest = closest.max(off.abs() / margin.off[axis]);
            }
            checked += 1;
        }
        assert!(checked > 10_000 && closest > 0.03, "{checked}, as near as {closest} to the margin");
    }

    #[test]
    fn a_triangle_as_thin_as_the_rounding_of_its_vertices_has_no_margin() {
        let beam = LensRays::pinhole([[0.0; 2]; 2]);
        let thin = |height: f64| [[[0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [0.5, height, 1.0]]];
        // Twice the area is the height; each of six products may be off by half a slack times an extent of
        // about one.
        let margin = |height: f64| margin(&thin(height), &beam, [1e-6, 1e-6], 1.0);
        assert!(margin(2.9e-6).is_none());
        assert!(margin(1e-3).is_some_and(|margin| margin.off[0] > 5e-7 && margin.off[0] < 1e-2));
    }
}
