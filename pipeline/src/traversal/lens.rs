//! Lens lines in the dual space of image and lens (after Laine, Aila, Karras and Lehtinen 2011, "Clipless
//! dual-space bounds for faster stochastic rasterization").
//!
//! Seen from `u` of the lens a vertex appears at `X = (x + u (a w - s)) / w`, a line in the plane of X and u.
//! The whole triangle is between a lower and an upper line
//!
//! ```text
//! l(u) <= X <= h(u)
//! ```
//!
//! found once per triangle, over all times; likewise in (Y, v). A tile then needs the lens positions at which
//! the lower line is left of its right side and the upper line right of its left side. That costs four
//! differences per axis, and a quotient if the answer is neither all nor nothing.
//!
//! Nothing is clipped: a lower line needs `f = x + u (a w - s) - l(u) w >= 0` for each vertex, for any sign
//! of `w`. Then a sample `X w = sum(l_i (x_i + u (a w_i - s)))` of positive depth has `(X - l(u)) w >= 0`.
//! `f` is bilinear in `u` and time, so the corners decide, and the line passes through the tightest values at
//! both ends of the lens. (The paper fixes a slope and finds the offset; the two ends of the lens are tighter
//! and as cheap.) In an orthographic view `X = x + u (a w - s)`, again a line, and `f` has 1 in place of the
//! last `w`. Vertices behind the camera bound those values from the other side. If no value remains there is
//! no line.
//!
//! Lens spans: separate `u` tests for views over disjoint regions of the lens (Nilsson et al. 2012, section
//! 8): "the separate lens regions could share the tile test for the v-axis, but perform separate tests for
//! the u-axis".
//!
//! Between the regions the lens has no samples. One interval of `u` and `t` over the whole lens has to contain the
//! gaps, and its times are those of all views together. With one interval per region a tile between the views'
//! images of a triangle is culled, and each view keeps its own times.

use super::number::Number;
use super::side_planes::{narrow_sides, union};
use super::{Box5, TileRect};
use crate::geometry::Shear;
use crate::sampling::LensRegion;
use crate::setup::Triangle;

/// Lines of one triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LensLines<N = f64> {
    /// For (X, u) and (Y, v): the lower line, and the upper line with its sign inverted, each at `u = -1` and
    /// `u = 1`.
    axes: [[[N; 2]; 2]; 2],
}

impl<N: Number> LensLines<N> {
    /// Lines of `triangle` for samples beyond the depth `near`.
    pub fn new(triangle: &Triangle, shear: &Shear, near: f32) -> Self {
        let none = N::from(f32::NEG_INFINITY);
        if !depth_is_sound(triangle, near) {
            return Self { axes: [[[none; 2]; 2]; 2] };
        }
        Self { axes: [0, 1].map(|axis| lines(triangle, shear, axis)) }
    }

    /// The part of `within` from which the triangle may be visible in `tile`, or `None`, and the number of
    /// crossings computed.
    pub fn narrow(&self, tile: &TileRect, within: &Box5) -> (Option<Box5>, u32) {
        let (mut next, mut crossings) = (*within, 0);
        if !within.lens {
            return (Some(next), crossings);
        }
        for (axis, [low, high]) in [tile.x, tile.y].into_iter().enumerate() {
            let range = if axis == 0 { &mut next.u } else { &mut next.v };
            for (line, side) in self.axes[axis].iter().zip([high, -low]) {
                // `side - l(u)`, not negative where the triangle may be in the tile.
                let room = line.map(|end| N::from(side) - end);
                let Some(left) = narrowed(*range, room, &mut crossings) else { return (None, crossings) };
                *range = left;
            }
        }
        (Some(next), crossings)
    }
}

/// Whether the sign of a sample's depth is reliable. No vertex may be behind the camera, or the near depth
/// has to be well above the rounding error of a depth; and products of depths and positions have to stay
/// within the range of f32.
fn depth_is_sound(triangle: &Triangle, near: f32) -> bool {
    let depth = triangle.corners.iter().map(|c| c.open[2].abs() + c.delta[2].abs()).fold(0.0, f32::max);
    let [slack_x, slack_y] = triangle.slack;
    let weight = f64::from(slack_x) * f64::from(slack_y) * f64::from(depth);
    !triangle.behind || (near > depth / 1_048_576.0 && weight > 1e-36 && weight < 1e24)
}

/// Lower line of an axis, and the upper line with its sign inverted.
fn lines<N: Number>(triangle: &Triangle, shear: &Shear, axis: usize) -> [[N; 2]; 2] {
    let [s, a] = [shear.s[axis], shear.a[axis]].map(N::from);
    let slack = N::from(triangle.slack[axis]);
    let mut lines = [[Offset::<N>::any(); 2]; 2];
    for corner in &triangle.corners {
        for end in 0..if triangle.moving { 2 } else { 1 } {
            let [x, w] = [axis, 2].map(|k| {
                let open = N::from(corner.open[k]);
                if end == 0 { open } else { open + N::from(corner.delta[k]) }
            });
            let shift = a * w - s;
            for (u, position) in [x - shift, x + shift].into_iter().enumerate() {
                let weight = if shear.parallel { N::from(1.0) } else { w };
                lines[0][u].keep_below(position - slack, weight);
                lines[1][u].keep_below(-(position + slack), weight);
            }
        }
    }
    lines.map(|line| line.map(|offset| offset.highest().unwrap_or(N::from(f32::NEG_INFINITY))))
}

/// Range of values of a lower line at one end of the lens.
#[derive(Clone, Copy)]
struct Offset<N> {
    max: N,
    min: N,
    possible: bool,
}

impl<N: Number> Offset<N> {
    fn any() -> Self {
        Self { max: N::from(f32::INFINITY), min: N::from(f32::NEG_INFINITY), possible: true }
    }

    /// Keep the values for which the line is below a vertex at `position` on the homogeneous plane with
    /// weight `w`.
    fn keep_below(&mut self, position: N, w: N) {
        if w > N::zero() {
            self.max = self.max.min(position / w);
        } else if w < N::zero() {
            self.min = self.min.max(position / w);
        } else {
            self.possible &= w == N::zero() && position >= N::zero();
        }
    }

    /// Highest value, less an allowance for the rounding of the quotients.
    fn highest(&self) -> Option<N> {
        let rounding = N::constant(MAX_RELATIVE_ROUNDING);
        let max = self.max - self.max.abs() * rounding;
        let bounded = self.max < N::from(f32::INFINITY)
            && (self.min == N::from(f32::NEG_INFINITY) || max >= self.min + self.min.abs() * rounding);
        (self.possible && bounded).then_some(max)
    }
}

/// Bound of the rounding error of a quotient, relative to it.
const MAX_RELATIVE_ROUNDING: f64 = 1e-12;

/// The part of `range` in which a linear function with the given values at -1 and 1 is not negative.
fn narrowed<N: Number>(range: [f32; 2], [start, end]: [N; 2], crossings: &mut u32) -> Option<[f32; 2]> {
    let starts_below = start < N::zero();
    if starts_below == (end < N::zero()) {
        return (!starts_below).then_some(range);
    }
    *crossings += 1;
    // Mapped from -1 to 1 and rounded outward to a float. NaN leaves the range unchanged.
    let position: f64 = (start / (start - end) * N::from(2.0) - N::from(1.0)).into();
    let left = if starts_below {
        [range[0].max((position as f32).next_down()), range[1]]
    } else {
        [range[0], range[1].min((position as f32).next_up())]
    };
    (left[0] <= left[1]).then_some(left)
}

/// Part of a region of the lens and its times.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LensSpan {
    /// Lens positions.
    pub u: [f32; 2],
    /// Times.
    pub t: [f32; 2],
}

impl LensSpan {
    /// Intersection with a box of lens and time, or `None` if it is empty.
    pub fn within(&self, within: &Box5) -> Option<Self> {
        let both = |a: [f32; 2], b: [f32; 2]| [a[0].max(b[0]), a[1].min(b[1])];
        let (u, t) = (both(self.u, within.u), both(self.t, within.t));
        (u[0] <= u[1] && t[0] <= t[1]).then_some(Self { u, t })
    }
}

/// Disjoint spans of `u` that contain all lens positions with samples, from low to high.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LensSpans {
    spans: [LensSpan; Self::MAX],
    len: usize,
    /// Total length in `u` before any test.
    length: f32,
}

impl LensSpans {
    /// Largest number of spans. Beyond it, neighbouring regions share one.
    pub const MAX: usize = 8;

    /// Spans of the regions' ranges of `u`. Regions one above the other share a span, as do ranges that overlap.
    /// `None` if fewer than two spans remain: the test over the whole lens is then as good.
    pub fn new(regions: &[LensRegion]) -> Option<Self> {
        let mut ranges: Vec<[f32; 2]> = regions.iter().map(|region| [region.u.0, region.u.1]).collect();
        ranges.sort_by(|a, b| a[0].total_cmp(&b[0]));
        let mut apart: Vec<[f32; 2]> = Vec::new();
        for [low, high] in ranges {
            match apart.last_mut() {
                Some(last) if low < last[1] => last[1] = last[1].max(high),
                // A position on a common border belongs to the lower span, so no sample is tested twice.
                Some(last) if low == last[1] => apart.push([low.next_up(), high]),
                _ => apart.push([low, high]),
            }
        }
        if apart.len() < 2 {
            return None;
        }
        let length = apart.iter().map(|[low, high]| high - low).sum();
        let whole = LensSpan { u: [0.0; 2], t: [0.0, 1.0] };
        let mut spans = Self { spans: [whole; Self::MAX], len: 0, length };
        for group in apart.chunks(apart.len().div_ceil(Self::MAX)) {
            spans.push(LensSpan { u: [group[0][0], group[group.len() - 1][1]], ..whole });
        }
        Some(spans)
    }

    fn push(&mut self, span: LensSpan) {
        self.spans[self.len] = span;
        self.len += 1;
    }

    /// The spans.
    pub fn as_slice(&self) -> &[LensSpan] {
        &self.spans[..self.len]
    }

    /// The parts inside a box, and the box around them; `None` if nothing remains.
    pub fn within(&self, within: &Box5) -> Option<(Self, Box5)> {
        self.kept(within, |span| span.within(within))
    }

    fn kept(
        &self,
        within: &Box5,
        mut keep: impl FnMut(&LensSpan) -> Option<LensSpan>,
    ) -> Option<(Self, Box5)> {
        let mut kept = Self { len: 0, ..*self };
        let mut hull = None;
        for span in self.as_slice().iter().filter_map(&mut keep) {
            kept.push(span);
            hull = union(hull, Some(span.t));
        }
        let [first, last] = [kept.as_slice().first()?.u, kept.as_slice().last()?.u];
        Some((kept, Box5 { u: [first[0], last[1]], t: hull?, ..*within }))
    }

    /// The parts from which `triangle` may touch `tile`, with the box around them, or `None` if it cannot; and the
    /// multiply-adds. The sides along `v` are tested once, for all spans.
    pub fn narrow_counted<N: Number>(
        &self,
        triangle: &Triangle,
        shear: &Shear,
        tile: &TileRect,
        within: &Box5,
    ) -> (Option<(Self, Box5)>, u32) {
        let mut common = *within;
        let (is_left, mut madds) = narrow_sides::<N, _>(triangle, shear, tile, &mut common, 1);
        if !is_left {
            return (None, madds);
        }
        let kept = self.kept(&common, |span| {
            let LensSpan { u, t } = span.within(&common)?;
            let mut left = Box5 { u, t, ..common };
            let (is_left, more) = narrow_sides::<N, _>(triangle, shear, tile, &mut left, 0);
            madds += more;
            is_left.then_some(LensSpan { u: left.u, t: left.t })
        });
        (kept, madds)
    }

    /// Fraction of the samples that remain in these spans, each with the fraction `of` the shutter.
    pub fn share(&self, of: impl Fn(&LensSpan) -> f64) -> f64 {
        let parts = self.as_slice().iter().map(|span| f64::from(span.u[1] - span.u[0]) * of(span));
        parts.sum::<f64>() / f64::from(self.length)
    }
}

#[cfg(test)]
mod tests {
    use super::super::narrow;
    use super::super::testing::{NEAR, Uniform, cases};
    use super::*;

    #[test]
    fn every_point_of_the_triangle_lies_between_the_lines() {
        let (mut r, mut bounded, mut behind) = (Uniform::new(7), 0, 0);
        for (seed, case) in cases(500).filter(|(_, case)| case.within.lens) {
            let lines = LensLines::<f64>::new(&case.triangle, &case.shear, NEAR);
            let finite = lines.axes.iter().flatten().flatten().filter(|line| line.is_finite()).count();
            bounded += finite;
            behind += if case.triangle.behind { finite } else { 0 };
            for _ in 0..60 {
                let [_, _, u, v, t] = case.position(&mut r);
                let (seen, weights) = (case.seen([0.0, 0.0, u, v, t]), r.weights());
                let [x, y, w] = [0, 1, 2].map(|k| (0..3).map(|i| weights[i] * seen[i][k]).sum::<f64>());
                if w <= f64::from(NEAR) && !case.shear.parallel {
                    continue;
                }
                let weight = case.weight(w);
                for (axis, position, lens) in [(0, x / weight, u), (1, y / weight, v)] {
                    let at = |line: [f64; 2]| {
                        let bounded = line.iter().all(|end| end.is_finite());
                        if bounded {
                            line[0] + 0.5 * (lens + 1.0) * (line[1] - line[0])
                        } else {
                            f64::NEG_INFINITY
                        }
                    };
                    let [low, high] = lines.axes[axis];
                    let inside = at(low) <= position && position <= -at(high);
                    assert!(inside, "{seed}: {position} {low:?} {high:?} {lens}");
                }
            }
        }
        assert!(bounded > 3000 && behind > 100, "{bounded} {behind}");
    }

    #[test]
    fn a_lens_part_from_which_a_tile_sees_the_triangle_is_not_lost() {
        let (mut r, mut culled, mut narrowed) = (Uniform::new(8), 0, 0);
        for (seed, case) in cases(500).filter(|(_, case)| case.within.lens) {
            let (left, _) =
                LensLines::<f64>::new(&case.triangle, &case.shear, NEAR).narrow(&case.tile, &case.within);
            culled += u32::from(left.is_none());
            narrowed += u32::from(left.is_some_and(|left| left != case.within));
            for _ in 0..60 {
                let position = case.position(&mut r);
                let e = case.edges(position);
                let depth = case.depth(position);
                let inside = e.iter().all(|&e| e >= 0.0) || e.iter().all(|&e| e <= 0.0);
                let [u, v] = [position[2] as f32, position[3] as f32];
                let kept =
                    left.is_some_and(|b| (b.u[0]..=b.u[1]).contains(&u) && (b.v[0]..=b.v[1]).contains(&v));
                assert!(kept || !inside || depth <= f64::from(NEAR), "{seed}: {position:?}");
            }
        }
        assert!(culled > 200 && narrowed > 40, "{culled} {narrowed}");
    }

    #[test]
    fn a_point_at_one_depth_has_one_line() {
        use crate::geometry::{Cull, MovingVertex};
        use crate::setup::{SetupResult, set_up};
        // At twice the focus depth of 6 the circle of confusion has the radius a - s / w = 15 - 90 / 12 =
        // 7.5.
        let shear = Shear::new([90.0, -90.0], [15.0, -15.0]);
        let v = [[0.0, 0.0, 12.0], [12.0, 0.0, 12.0], [0.0, 12.0, 12.0]]
            .map(|p| MovingVertex { open: p, close: p });
        let SetupResult::Ready(triangle) = set_up(0, v.each_ref(), Cull::None, &shear, 0.1, [64.0; 2]) else {
            panic!("the triangle is visible");
        };
        let [[low, high], _] = LensLines::<f64>::new(&triangle, &shear, 0.1).axes;
        for (found, expected) in [(low, [-7.5, 7.5]), (high.map(|l| -l), [-6.5, 8.5])] {
            assert!(found.iter().zip(expected).all(|(f, e): (&f64, f64)| (f - e).abs() < 1e-4), "{found:?}");
        }
        let tile = TileRect { x: [4.75, 12.75], y: [-8.0, 8.0] };
        let lines = LensLines::<f64>::new(&triangle, &shear, 0.1);
        let left = lines.narrow(&tile, &Box5::whole(true)).0.unwrap();
        assert!((left.u[0] - 0.5).abs() < 1e-4 && left.u[0] <= 0.5 && left.u[1] == 1.0, "{left:?}");
    }

    fn region(low: f32, high: f32) -> LensRegion {
        LensRegion { u: (low, high), v: (-1.0, 1.0) }
    }

    fn ranges(regions: &[LensRegion]) -> Vec<[f32; 2]> {
        LensSpans::new(regions).map_or(Vec::new(), |s| s.as_slice().iter().map(|span| span.u).collect())
    }

    #[test]
    fn regions_apart_have_a_span_each_and_others_share_one() {
        let eyes = [region(0.6, 1.0), region(-1.0, -0.6)];
        assert_eq!(ranges(&eyes), [[-1.0, -0.6], [0.6, 1.0]]);
        assert!(ranges(&[LensRegion::WHOLE]).is_empty());
        assert!(ranges(&[region(-1.0, 0.1), region(0.0, 1.0)]).is_empty(), "they overlap in u");
        let adjoining = ranges(&[region(-1.0, 0.0), region(0.0, 1.0)]);
        assert_eq!(adjoining, [[-1.0, 0.0], [0.0_f32.next_up(), 1.0]]);
    }

    #[test]
    fn more_regions_than_spans_share_them_and_none_is_lost() {
        for count in 1..=40_u32 {
            let edge = |k: u32| -1.0 + 2.0 * k as f32 / count as f32;
            let regions: Vec<_> = (0..count).map(|k| region(edge(k), edge(k + 1).min(1.0))).collect();
            let spans = ranges(&regions);
            assert!(spans.len() <= LensSpans::MAX, "{count}");
            assert!(spans.windows(2).all(|pair| pair[0][1] < pair[1][0]), "{count}");
            for place in (0..=1000).map(|k| k as f32 / 500.0 - 1.0) {
                let found = spans.iter().filter(|[low, high]| (low..=high).contains(&&place)).count();
                assert_eq!(found, usize::from(!spans.is_empty()), "{count}: {place}");
            }
        }
    }

    /// Every point of the regions that sees the triangle is kept; and never more than by the test over the whole
    /// lens.
    #[test]
    fn no_view_loses_a_sample_and_none_keeps_more() {
        let eyes = [region(-1.0, -0.5), region(0.5, 1.0)];
        let (mut r, mut culled, mut tighter) = (Uniform::new(14), 0, 0);
        for (seed, case) in cases(600).filter(|(_, case)| case.within.lens) {
            let Some((spans, within)) = LensSpans::new(&eyes).unwrap().within(&case.within) else { continue };
            let (left, _) = spans.narrow_counted::<f64>(&case.triangle, &case.shear, &case.tile, &within);
            let whole = narrow(&case.triangle, &case.shear, &case.tile, &within);
            culled += u32::from(left.is_none() && whole.is_some());
            let volume = |t: [f32; 2], u: [f32; 2]| (t[1] - t[0]) * (u[1] - u[0]);
            if let (Some((spans, _)), Some(whole)) = (&left, &whole) {
                let separate: f32 = spans.as_slice().iter().map(|s| volume(s.t, s.u)).sum();
                let common: f32 = spans
                    .as_slice()
                    .iter()
                    .filter_map(|s| s.within(whole))
                    .map(|s| volume(whole.t, s.u))
                    .sum();
                tighter += u32::from(separate < 0.99 * common);
            }
            for _ in 0..60 {
                let place = case.position(&mut r);
                let (u, t) = (place[2] as f32, place[4] as f32);
                let Some(span) = spans.as_slice().iter().find(|s| (s.u[0]..=s.u[1]).contains(&u)) else {
                    continue;
                };
                let e = case.edges(place);
                let inside = e.iter().all(|&e| e >= 0.0) || e.iter().all(|&e| e <= 0.0);
                let kept = left.is_some_and(|(left, hull)| {
                    let of = |s: &LensSpan| {
                        (s.u[0]..=s.u[1]).contains(&u)
                            && (!case.triangle.moving || (s.t[0]..=s.t[1]).contains(&t))
                    };
                    left.as_slice().iter().any(of) && (hull.u[0]..=hull.u[1]).contains(&u)
                });
                assert!(kept || !inside, "{seed}: {place:?} {span:?} {left:?}");
            }
        }
        assert!(culled > 20 && tighter > 5, "{culled} {tighter}");
    }
}
