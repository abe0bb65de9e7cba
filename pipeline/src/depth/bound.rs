//! Depth interval: bounds of every depth that the sample test computes for a triangle, over a tile and a box
//! of lens and time.

use serde::Deserialize;

use super::number::{Real, both, round_down, round_up};
use super::plane::{Beam, MovingPlane, Points, normal, tightest};
use super::rounding::margin;
use crate::geometry::Shear;
use crate::setup::Triangle;
use crate::traversal::{Box5, TileRect};

/// Method of bounding the depth of a triangle over a tile. Each method includes the bounds of the methods
/// before it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Deserialize)]
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
            Some([lo, hi]) => both(vertices, [round_down(lo), round_up(hi)]),
            None => vertices,
        }
    }
}

/// A tile and a box of lens and time.
struct Region<R> {
    tile: [[R; 2]; 2],
    lens: Option<[[R; 2]; 2]>,
    t: [R; 2],
}

impl Region<f64> {
    fn new(tile: &TileRect, within: &Box5) -> Self {
        let wide = |range: [f32; 2]| range.map(f64::from);
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
    fn new(triangle: &Triangle, shear: &Shear) -> Self {
        let [s, a] = [shear.s, shear.a].map(|part| part.map(f64::from));
        let open = triangle.corners.map(|corner| corner.open.map(f64::from));
        let delta = triangle.corners.map(|corner| corner.delta.map(f64::from));
        let largest =
            |axis: usize| (0..3).map(|k| open[k][axis].abs() + delta[k][axis].abs()).fold(0.0, f64::max);
        let size = [largest(0) + s[0].abs(), largest(1) + s[1].abs(), largest(2)];
        let (moving, slack, parallel) = (triangle.moving, triangle.slack.map(f64::from), shear.parallel);
        Self { open, delta, moving, size, slack, s, a, parallel }
    }
}

impl<R: Real> Facts<R> {
    fn at(&self, t: R) -> Points<R> {
        [0, 1, 2].map(|k| [0, 1, 2].map(|axis| t.madd(self.delta[k][axis], self.open[k][axis])))
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
        [0, 1].map(|end| MovingPlane::new(normal(&ends[end]), [&ends[0], &ends[1]], self.size))
    }

    /// Depths allowed by the planes of set-up or, without these, by planes through the triangle at the ends
    /// of the region's time. The interval includes the rounding of the sample test.
    fn over(&self, shutter: Option<&[MovingPlane<R>; 2]>, region: &Region<R>) -> Option<[R; 2]> {
        let beam = match (region.lens, self.parallel) {
            (Some(lens), false) => Beam::lens(region.tile, lens, self.s, self.a),
            (None, false) => Beam::pinhole(region.tile),
            (Some(lens), true) => Beam::oblique(region.tile, lens, self.s, self.a),
            (None, true) => Beam::orthographic(region.tile),
        };
        let ends = if self.moving { region.t.map(|t| self.at(t)) } else { [self.open; 2] };
        let different = if self.moving { 2 } else { 1 };
        let margin = margin(&ends[..different], &beam, self.slack, self.size[2])?;
        let planes = shutter.copied().unwrap_or_else(|| self.through(&ends));
        let bounds = planes[..different].iter().map(|plane| {
            let reach = if shutter.is_some() && self.moving { plane.within(region.t) } else { plane.whole() };
            plane.depths(reach, &beam, margin.off)
        });
        tightest(bounds).map(|[lo, hi]| [lo - margin.depth, hi + margin.depth])
    }
}

#[cfg(test)]
mod tests {
    use super::super::number::counting::{Counted, madds};
    use super::*;
    use crate::geometry::{Cull, MovingVertex};
    use crate::setup::{Outcome, set_up};

    fn triangle(moving: bool) -> Triangle {
        let open = [[-40.0, -40.0, 4.0], [40.0, -30.0, 5.0], [0.0, 50.0, 6.0]];
        let v = open.map(|[x, y, w]| MovingVertex {
            open: [x, y, w],
            close: if moving { [x + 3.0, y - 1.0, w + 0.5] } else { [x, y, w] },
        });
        match set_up(0, [&v[0], &v[1], &v[2]], Cull::None, &SHEAR, 0.1, [64.0; 2]) {
            Outcome::Ready(triangle) => triangle,
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
}
