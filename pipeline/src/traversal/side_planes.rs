//! Side planes of a tile over lens and time (Munkberg et al. 2011 in t, extended here to u and v).
//!
//! A vertex is beyond the left side of a tile at `(u, t)` if `d = x(t) + u (a w(t) - s) - X0 w(t) < 0`. The
//! triangle is outside if all three vertices are. `d` is bilinear in `(u, t)`, so the possible times are the
//! hull over the vertices of the times with `max(d(u_lo, t), d(u_hi, t)) >= 0`: two linear functions each.
//! Likewise for `u` with the ends of `t`. A vertex behind the camera (`w < 0`) is beyond the side only if it
//! is for every `X` of the tile, so both edges of the tile are tested there. In an orthographic view `d =
//! x(t) + u (a w(t) - s) - X0`, for any sign of `w`.

use super::number::{Coordinate, Number};
use super::{Box5, SIDE_ROOT, TileRect, near_madds, side_madds};
use crate::geometry::Shear;
use crate::setup::{Corner, Triangle};

/// The part of `within` in which `triangle` may touch `tile`, or `None` if it cannot.
pub fn narrow(triangle: &Triangle, shear: &Shear, tile: &TileRect, within: &Box5) -> Option<Box5> {
    narrow_counted::<f64>(triangle, shear, tile, within).0
}

/// The same, with its cost in multiply-adds.
pub fn narrow_counted<N: Number>(
    triangle: &Triangle,
    shear: &Shear,
    tile: &TileRect,
    within: &Box5,
) -> (Option<Box5>, u32) {
    let mut left = *within;
    let (is_left, madds) = narrow_by_sides::<N, _>(triangle, shear, tile, &mut left);
    (is_left.then_some(left), madds)
}

/// Narrows `within` to the part in which `triangle` may touch `tile`. Whether there is one, and the cost in
/// multiply-adds.
pub fn narrow_by_sides<N: Number, C: Coordinate>(
    triangle: &Triangle<C>,
    shear: &Shear<C>,
    tile: &TileRect<C>,
    within: &mut Box5<C>,
) -> (bool, u32) {
    let (is_left, madds) = narrow_sides::<N, _>(triangle, shear, tile, within, 0);
    if !is_left {
        return (false, madds);
    }
    let (is_left, more) = narrow_sides::<N, _>(triangle, shear, tile, within, 1);
    (is_left, madds + more)
}

/// The same for the two sides along one axis: 0 for x and u, 1 for y and v.
pub(super) fn narrow_sides<N: Number, C: Coordinate>(
    triangle: &Triangle<C>,
    shear: &Shear<C>,
    tile: &TileRect<C>,
    within: &mut Box5<C>,
    axis: usize,
) -> (bool, u32) {
    let mut madds = 0;
    let price = side_madds(triangle.moving, within.lens, triangle.behind);
    let [low, high] = if axis == 0 { tile.x } else { tile.y };
    for (edge, other, positive) in [(low, high, true), (high, low, false)] {
        let edges = if triangle.behind { [edge, other] } else { [edge, edge] };
        let side = Side::<N, C> {
            triangle,
            s: N::of(shear.s[axis]),
            a: N::of(shear.a[axis]),
            parallel: shear.parallel,
            axis,
            edges: edges.map(N::of),
            positive,
        };
        let (is_left, roots) = side.narrow(within);
        madds += price + roots * SIDE_ROOT;
        if !is_left {
            return (false, madds);
        }
    }
    (true, madds)
}

/// Narrows `within` to the part in which a vertex may be beyond the depth `near`. Whether there is one, and
/// the cost in multiply-adds. `slack` bounds the error of a depth. The near depth is a side that no lens
/// position moves.
pub fn narrow_near<N: Number, C: Coordinate>(
    triangle: &Triangle<C>,
    near: C,
    slack: C,
    within: &mut Box5<C>,
) -> (bool, u32) {
    let limit = N::of(near) - N::of(C::nearest(2.0) * slack);
    let depths = triangle.corners.each_ref().map(|corner| {
        let [open, delta] = [corner.open[2], corner.delta[2]].map(N::of);
        let at = |t: C| if triangle.moving { open + N::of(t) * delta } else { open } - limit;
        let first = at(within.t[0]);
        [first, if triangle.moving { at(within.t[1]) } else { first }]
    });
    let mut roots = 0;
    let times = above(within.t, &depths, &mut roots);
    let madds = near_madds(triangle.moving) + roots * SIDE_ROOT;
    (times.map(|t| within.t = t).is_some(), madds)
}

/// One side of a tile; the left and top sides are `positive`.
struct Side<'a, N, C> {
    triangle: &'a Triangle<C>,
    s: N,
    a: N,
    parallel: bool,
    axis: usize,
    edges: [N; 2],
    positive: bool,
}

impl<N: Number, C: Coordinate> Side<'_, N, C> {
    /// Narrows `within` to the part on the inner side. Whether there is one, and the number of roots.
    fn narrow(&self, within: &mut Box5<C>) -> (bool, u32) {
        if within.lens { self.through_lens(within) } else { self.through_pinhole(within) }
    }

    fn through_pinhole(&self, within: &mut Box5<C>) -> (bool, u32) {
        let (slack, mut times, mut roots) = (self.slack(), None, 0);
        for &edge in self.edges() {
            let mut d = [[N::zero(); 2]; 3];
            for (d, corner) in d.iter_mut().zip(&self.triangle.corners) {
                *d = self.at_ends(|end| {
                    let w = if self.parallel { N::zero() } else { self.at(corner, 2, within.t[end]) };
                    self.inward(self.flat(self.at(corner, self.axis, within.t[end]), edge, w), slack)
                });
            }
            times = union(times, above(within.t, &d, &mut roots));
        }
        (times.map(|t| within.t = t).is_some(), roots)
    }

    fn through_lens(&self, within: &mut Box5<C>) -> (bool, u32) {
        let lens = if self.axis == 0 { within.u } else { within.v };
        let (slack, mut times, mut places, mut roots) = (self.slack(), None, None, 0);
        for corner in &self.triangle.corners {
            for &edge in self.edges() {
                let d = self.at_ends(|end| {
                    let [x, w] = [self.axis, 2].map(|axis| self.at(corner, axis, within.t[end]));
                    let (flat, shift) = (self.flat(x, edge, w), self.a * w - self.s);
                    lens.map(|place| self.inward(flat + N::of(place) * shift, slack))
                });
                let over_time = [0, 1].map(|place| d.map(|end| end[place]));
                times = union(times, above(within.t, &over_time, &mut roots));
                let over_lens = &d[..if self.triangle.moving { 2 } else { 1 }];
                places = union(places, above(lens, over_lens, &mut roots));
            }
        }
        let (Some(t), Some(places)) = (times, places) else { return (false, roots) };
        within.t = t;
        *if self.axis == 0 { &mut within.u } else { &mut within.v } = places;
        (true, roots)
    }

    /// Edges of the tile that bound a vertex.
    fn edges(&self) -> &[N] {
        &self.edges[..if self.triangle.behind { 2 } else { 1 }]
    }

    /// Something at both ends of the time interval.
    #[inline(always)]
    fn at_ends<T: Copy>(&self, of: impl Fn(usize) -> T) -> [T; 2] {
        let first = of(0);
        [first, if self.triangle.moving { of(1) } else { first }]
    }

    #[inline(always)]
    fn at(&self, corner: &Corner<C>, axis: usize, t: C) -> N {
        let open = N::of(corner.open[axis]);
        if self.triangle.moving { open + N::of(t) * N::of(corner.delta[axis]) } else { open }
    }

    /// Distance to `edge` through a pinhole.
    #[inline(always)]
    fn flat(&self, x: N, edge: N, w: N) -> N {
        x - if self.parallel { edge } else { edge * w }
    }

    fn slack(&self) -> N {
        N::of(C::nearest(2.0) * self.triangle.slack[self.axis])
    }

    /// Distance on the inner side, plus the slack.
    #[inline(always)]
    fn inward(&self, d: N, slack: N) -> N {
        if self.positive { d + slack } else { slack - d }
    }
}

/// The part of `range` in which one of some linear functions, given by the values at its ends, is not negative.
#[inline(always)]
fn above<N: Number, C: Coordinate>(range: [C; 2], functions: &[[N; 2]], roots: &mut u32) -> Option<[C; 2]> {
    let (mut whole, mut crossing) = (false, 0);
    for [lo, hi] in functions {
        let below = [*lo < N::zero(), *hi < N::zero()];
        whole |= below == [false; 2];
        crossing += u32::from(below[0] != below[1]);
    }
    *roots += crossing;
    if crossing == 0 {
        return whole.then_some(range);
    }
    let crossing = functions.iter().filter(|[lo, hi]| (*lo < N::zero()) != (*hi < N::zero()));
    let parts = crossing.map(|ends| beside_root(range, *ends));
    if whole {
        N::unused(|| parts.for_each(drop));
        return Some(range);
    }
    parts.map(Some).fold(None, union)
}

/// The part of `range` on the side of the root of a linear function where it is not negative.
fn beside_root<N: Number, C: Coordinate>(range: [C; 2], [lo, hi]: [N; 2]) -> [C; 2] {
    // The slack is twice the rounding of the sample test, which also covers the rounding of the quotient and of its
    // product with the range; the nudge covers that of the sum. NaN leaves the range unchanged.
    let share = lo / (lo - hi);
    let [from, to] = range.map(N::of);
    let root = C::nearest((from + (to - from) * share).into());
    if lo < N::zero() {
        [root.next_down().max(range[0]), range[1]]
    } else {
        [range[0], root.next_up().min(range[1])]
    }
}

/// Smallest interval that contains both.
pub(super) fn union<C: Coordinate>(a: Option<[C; 2]>, b: Option<[C; 2]>) -> Option<[C; 2]> {
    match (a, b) {
        (Some(a), Some(b)) => Some([a[0].min(b[0]), a[1].max(b[1])]),
        (a, b) => a.or(b),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_part_above_zero() {
        let part = |range: [f32; 2], lo: f64, hi: f64| above(range, &[[lo, hi]], &mut 0);
        assert_eq!(part([0.0, 1.0], 1.0, 2.0), Some([0.0, 1.0]));
        assert_eq!(part([0.0, 1.0], -1.0, -2.0), None);
        let [lo, hi] = part([0.0, 1.0], -1.0, 1.0).unwrap();
        assert!((lo - 0.5).abs() < 1e-6 && lo <= 0.5 && hi == 1.0);
        let [lo, hi] = part([2.0, 4.0], 3.0, -1.0).unwrap();
        assert!((hi - 3.5).abs() < 1e-5 && hi >= 3.5 && lo == 2.0);
    }

    #[test]
    fn no_part_of_lens_and_time_from_which_a_tile_sees_the_triangle_is_lost() {
        use crate::traversal::testing::{Uniform, cases};
        let (mut r, mut culled, mut narrowed) = (Uniform::new(13), 0, 0);
        for (seed, case) in cases(400) {
            let left = narrow(&case.triangle, &case.shear, &case.tile, &case.within);
            culled += u32::from(left.is_none());
            narrowed += u32::from(left.is_some_and(|left| left != case.within));
            for _ in 0..60 {
                let place = case.position(&mut r);
                let e = case.edges(place);
                let inside = e.iter().all(|&e| e >= 0.0) || e.iter().all(|&e| e <= 0.0);
                let within = |[lo, hi]: [f32; 2], value: f64| (lo..=hi).contains(&(value as f32));
                let kept = left.is_some_and(|b| {
                    let lens = !case.within.lens || (within(b.u, place[2]) && within(b.v, place[3]));
                    lens && (!case.triangle.moving || within(b.t, place[4]))
                });
                assert!(kept || !inside, "{seed}: {place:?} {left:?}");
            }
        }
        assert!(culled > 300 && narrowed > 100, "{culled} {narrowed}");
    }
}
