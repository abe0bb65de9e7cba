//! Depth interval: bounds of every depth that the sample test computes for a triangle, over a tile and a box
//! of lens and time.

use serde::{Deserialize, Serialize};

use super::{LensRays, MovingPlane, Points, Real, both, cross, hull, normal, range, sides, tightest};
use crate::geometry::Shear;
use crate::setup::Triangle;
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

    fn has_planes(self) -> bool {
        self >= Self::Planes
    }
}

/// Multiply-adds of [`Bounder::new`], counted from the code by a test with counting numbers. A still triangle
/// has one plane, a moving one two. Methods that find their planes in every tile have none here.
pub const fn set_up_madds(bound: DepthBound, moving: bool) -> u32 {
    match (bound, moving) {
        (DepthBound::Vertices | DepthBound::VerticesInTime, _) | (DepthBound::LocalPlanes, true) => 0,
        (DepthBound::Planes | DepthBound::LocalPlanes, false) => 25,
        (DepthBound::Planes, true) => 77,
    }
}

/// Multiply-adds of one [`Bounder::over`], counted likewise, if every plane gives a bound. Rounding
/// allowances are included.
pub const fn interval_madds(bound: DepthBound, moving: bool, lens: bool) -> u32 {
    match (bound, moving, lens) {
        (DepthBound::VerticesInTime, true, _) => 6,
        (DepthBound::Vertices | DepthBound::VerticesInTime, ..) => 0,
        (_, false, false) => 90,
        (_, false, true) => 172,
        (DepthBound::Planes, true, false) => 220,
        (DepthBound::Planes, true, true) => 368,
        (DepthBound::LocalPlanes, true, false) => 272,
        (DepthBound::LocalPlanes, true, true) => 420,
    }
}

/// Multiply-adds of one interval of a triangle in conservative mode, by [`DepthBound::LocalPlanes`]: counted
/// likewise.
pub(crate) const fn exact_interval_madds(moving: bool, lens: bool) -> u32 {
    match (moving, lens) {
        (false, false) => 32,
        (false, true) => 114,
        (true, false) => 144,
        (true, true) => 292,
    }
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
    /// Planes through the triangle at the ends of the shutter, for methods that find them in set-up.
    shutter: Option<[MovingPlane<f64>; 2]>,
}

impl Bounder {
    /// Prepare depth bounds of `triangle` under a lens with `shear`.
    pub fn new(triangle: &Triangle, shear: &Shear, bound: DepthBound) -> Self {
        let facts = bound.has_planes().then(|| Facts::new(triangle, shear));
        let early = bound == DepthBound::Planes || (bound == DepthBound::LocalPlanes && !triangle.moving);
        let shutter = facts.as_ref().filter(|_| early).map(Facts::shutter);
        Self { triangle: *triangle, bound, facts, shutter }
    }

    /// Interval of the depths of all samples in `tile` and `within` for which
    /// [`test_run`](crate::sample_test::test_run) finds the triangle visible.
    pub fn over(&self, tile: &TileRect, within: &Box5) -> [f32; 2] {
        let t = if self.bound == DepthBound::Vertices { [0.0, 1.0] } else { within.t };
        let vertices = vertex_range(&self.triangle, t);
        let Some(facts) = &self.facts else { return vertices };
        match facts.over(self.shutter.as_ref(), &Region::new(tile, within)) {
            Some([lo, hi]) => both(vertices, [f32::at_most(lo), f32::at_least(hi)]),
            None => vertices,
        }
    }
}

/// Depth bounds of a triangle in conservative mode, by [`DepthBound::LocalPlanes`].
#[derive(Clone, Copy, Debug)]
pub(crate) struct ExactBounder {
    facts: Facts<f64>,
    /// The plane of a still triangle.
    shutter: Option<[MovingPlane<f64>; 2]>,
}

impl ExactBounder {
    /// Prepare depth bounds of `triangle` under a lens with `shear`.
    pub fn new<C: Coordinate>(triangle: &Triangle<C>, shear: &Shear<C>) -> Self {
        let facts = Facts::new(triangle, shear);
        let shutter = (!triangle.moving).then(|| facts.shutter());
        Self { facts, shutter }
    }

    /// Interval of the depths of all points seen in `tile` and `within` of a triangle whose vertices are off
    /// by half the slack, and by `depth` in depth. It is empty if there are none.
    pub fn over<C: Coordinate>(&self, tile: &TileRect<C>, within: &Box5<C>, depth: C) -> [C; 2] {
        // Twice the error covers the rounding of vertices at a time, and of the bound.
        let [lo, hi] =
            self.facts.exact(self.shutter.as_ref(), &Region::new(tile, within), 2.0 * depth.into());
        [C::at_most(lo), C::at_least(hi)]
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
}

impl Facts<f64> {
    fn new<C: Coordinate>(triangle: &Triangle<C>, shear: &Shear<C>) -> Self {
        let [s, a]: [[f64; 2]; 2] = [shear.s, shear.a].map(|part| part.map(Into::into));
        let open: Points<f64> = triangle.corners.map(|corner| corner.open.map(Into::into));
        let delta: Points<f64> = triangle.corners.map(|corner| corner.delta.map(Into::into));
        let largest =
            |axis: usize| (0..3).map(|k| open[k][axis].abs() + delta[k][axis].abs()).fold(0.0, f64::max);
        let size = [largest(0) + s[0].abs(), largest(1) + s[1].abs(), largest(2)];
        let (moving, slack, parallel) = (triangle.moving, triangle.slack.map(Into::into), shear.parallel);
        Self { open, delta, moving, size, slack, s, a, parallel }
    }
}

impl<R: Real> Facts<R> {
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
    fn shutter(&self) -> [MovingPlane<R>; 2] {
        if !self.moving {
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
    fn over(&self, shutter: Option<&[MovingPlane<R>; 2]>, region: &Region<R>) -> Option<[R; 2]> {
        let (beam, ends) = (self.beam(region), self.ends(region));
        let margin = margin(&ends[..self.different()], &beam, self.slack, self.size[2])?;
        self.planes(shutter, region, &beam, &ends, &margin)
    }

    /// Depths of every point of a triangle whose vertices are off by half the slack, and by `depth` in depth.
    fn exact(&self, shutter: Option<&[MovingPlane<R>; 2]>, region: &Region<R>, depth: R) -> [R; 2] {
        let margin = Margin { off: self.slack.map(|slack| R::new(0.5) * slack), depth };
        let ends = self.ends(region);
        let depths = |points: &Points<R>| range([points[0][2], points[1][2], points[2][2]]);
        let [lo, hi] = hull(depths(&ends[0]), depths(&ends[1]));
        let vertices = [lo - depth, hi + depth];
        let planes = self.planes(shutter, region, &self.beam(region), &ends, &margin);
        planes.map_or(vertices, |planes| both(vertices, planes))
    }

    fn beam(&self, region: &Region<R>) -> LensRays<R> {
        match (region.lens, self.parallel) {
            (Some(lens), false) => LensRays::lens(region.tile, lens, self.s, self.a),
            (None, false) => LensRays::pinhole(region.tile),
            (Some(lens), true) => LensRays::oblique(region.tile, lens, self.s, self.a),
            (None, true) => LensRays::orthographic(region.tile),
        }
    }

    /// Vertices at the ends of the time.
    fn ends(&self, region: &Region<R>) -> [Points<R>; 2] {
        if self.moving { [self.at(region.t[0]), self.at(region.t[1])] } else { [self.open; 2] }
    }

    fn different(&self) -> usize {
        if self.moving { 2 } else { 1 }
    }

    fn planes(
        &self,
        shutter: Option<&[MovingPlane<R>; 2]>,
        region: &Region<R>,
        beam: &LensRays<R>,
        ends: &[Points<R>; 2],
        margin: &Margin<R>,
    ) -> Option<[R; 2]> {
        let planes = shutter.copied().unwrap_or_else(|| self.through(ends));
        let bounds = planes[..self.different()].iter().map(|plane| {
            let reach = if shutter.is_some() && self.moving { plane.within(region.t) } else { plane.whole() };
            plane.depths(reach, beam, margin.off)
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
    if area <= R::new(0.0) || wide * high * deepest > R::new(OVERFLOW_LIMIT) {
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
    use super::super::counting::{Counted, madds};
    use super::*;
    use crate::geometry::{Cull, MovingVertex};
    use crate::random::{mix, unit};
    use crate::setup::{SetupResult, set_up};

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

    fn counted<const N: usize>(values: [f64; N]) -> [Counted; N] {
        values.map(Counted)
    }

    fn counting(facts: &Facts<f64>) -> Facts<Counted> {
        Facts {
            open: facts.open.map(counted),
            delta: facts.delta.map(counted),
            moving: facts.moving,
            size: counted(facts.size),
            slack: counted(facts.slack),
            s: counted(facts.s),
            a: counted(facts.a),
            parallel: facts.parallel,
        }
    }

    #[test]
    fn multiply_adds_are_those_of_the_code() {
        for ((bound, moving, lens), parallel) in
            all().flat_map(|one| [false, true].map(|parallel| (one, parallel)))
        {
            if !bound.has_planes() {
                continue;
            }
            let shear = Shear { parallel, ..SHEAR };
            let facts = counting(&Facts::new(&triangle(moving), &shear));
            let mut shutter = None;
            let set_up =
                madds(|| shutter = (bound == DepthBound::Planes || !moving).then(|| facts.shutter()));
            assert_eq!(set_up, set_up_madds(bound, moving), "set-up, {bound:?} {moving}");
            let lens_box = lens.then(|| [counted([-0.5, 0.5]); 2]);
            let region = Region { tile: [counted([-1.0, 1.0]); 2], lens: lens_box, t: counted([0.25, 0.5]) };
            let mut found = None;
            let over = madds(|| found = facts.over(shutter.as_ref(), &region));
            assert!(found.is_some());
            // The vertices at the ends of the interval are computed in any case.
            assert_eq!(over, interval_madds(bound, moving, lens), "tile, {bound:?} {moving} {lens}");
            if bound == DepthBound::LocalPlanes {
                let exact = madds(|| _ = facts.exact(shutter.as_ref(), &region, Counted(0.01)));
                assert_eq!(exact, exact_interval_madds(moving, lens), "exact, {moving} {lens}");
            }
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

    struct Numbers(u64);

    impl Numbers {
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
        let (mut r, mut certain, mut turned_twice) = (Numbers(1), 0, 0);
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
        let (mut r, mut checked, mut closest) = (Numbers(2), 0, 0.0_f64);
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
