//! Edges of a triangle over a box as quadratics of time, and the times at which a sample may be inside all of
//! them.
//!
//! Seen from the middle of a box (see [`TileView`]) the edge `e = P_i x P_j` is, exactly,
//!
//! ```text
//! e(d) = e + dX (-A) + dY (-B) + du (a A + s (y_i - y_j)) + dv (b B + s' (x_j - x_i))
//!          + (w_j - w_i) (dY s du - dX s' dv + (a s' - b s) du dv)
//! A = w_i y_j - w_j y_i        B = w_j x_i - w_i x_j
//! ```
//!
//! In an orthographic view `dX` and `dY` move a vertex without the factor of its depth, and so
//!
//! ```text
//! e(d) = e + dX (y_i - y_j) + dY (x_j - x_i) + du (a A + s (y_i - y_j)) + dv (b B + s' (x_j - x_i))
//!          + (w_j - w_i) (dY a du - dX b dv + (a s' - b s) du dv)
//! ```
//!
//! where `e`, `A` and `B` are quadratic in time and the last factor is linear. Each is stored in Bernstein
//! form, so bounds of its coefficients hold at all times. (Munkberg and Akenine-Moeller 2012 bound edges this
//! way; the form relative to the middle of the box is new here.)

use super::number::{Coordinate, Number, Quadratic};
use super::region::{Faces, Piece, Point, TimePieces};
use super::{PHASE, ROOT, TileView};

/// Edges of a triangle over a box; edge `k` is opposite vertex `k`.
#[derive(Clone, Copy, Debug)]
pub struct Edges<N = f64, C = f32> {
    pub(super) view: TileView<N, C>,
    pub(super) edges: [Edge<N>; 3],
}

/// The edge from vertex `i` to vertex `j`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Edge<N> {
    /// Value in the middle of the tile and the lens.
    pub value: Quadratic<N>,
    /// Slopes along X, Y, u, v.
    pub slopes: [Quadratic<N>; 4],
    /// Difference of the depths of its vertices at both ends of the time.
    pub depths: [N; 2],
}

impl<N: Number, C: Coordinate> Edges<N, C> {
    /// Edges of the triangle in `view`.
    #[inline(always)]
    pub fn new(view: TileView<N, C>) -> Self {
        let edge = |i: usize, j: usize| Edge::new(&view, i, j);
        let edges = [edge(1, 2), edge(2, 0), edge(0, 1)];
        Self { view, edges }
    }

    /// Whether `t` covers the whole time of the box, as far as it matters.
    pub fn spans(&self, t: [C; 2]) -> bool {
        !self.view.moving || t == self.view.t
    }

    /// Factor of the difference of depths in the nonlinear term over lens and tile.
    pub(super) fn skew(&self) -> N {
        let TileView { half, s, a, lens, parallel, .. } = &self.view;
        if !lens {
            return N::zero();
        }
        let twist = (a[0] * s[1] - a[1] * s[0]).abs();
        let with_image = (if *parallel { a } else { s }).map(N::abs);
        half[1] * with_image[0] * half[2] + (half[0] * with_image[1] + twist * half[2]) * half[3]
    }
}

impl<N: Number> Edge<N> {
    #[inline(always)]
    fn new<C: Coordinate>(view: &TileView<N, C>, i: usize, j: usize) -> Self {
        let [open, close] = view.ends.map(|points| [points[i], points[j]]);
        let difference = |axis: usize| [open, close].map(|[p, q]| q[axis] - p[axis]);
        let over_time = |[start, end]: [N; 2]| {
            if view.moving { Quadratic::linear(start, end) } else { Quadratic::constant(start) }
        };
        let none = Quadratic::constant(N::zero());
        // Slopes that the view does not need are not computed.
        let [along, across] = if view.lens || !view.parallel {
            [
                product(view.moving, open, close, |p, q| p[2] * q[1] - q[2] * p[1]),
                product(view.moving, open, close, |p, q| q[2] * p[0] - p[2] * q[0]),
            ]
        } else {
            [none; 2]
        };
        let [right, down] = if view.lens || view.parallel {
            [over_time(difference(0)), over_time(difference(1))]
        } else {
            [none; 2]
        };
        let [by_x, by_y] = if view.parallel { [-down, right] } else { [-along, -across] };
        let mut edge = Self {
            value: product(view.moving, open, close, |p, q| p[0] * q[1] - p[1] * q[0]),
            slopes: [by_x, by_y, none, none],
            depths: [N::zero(); 2],
        };
        if view.lens {
            edge.slopes[2] = Self::lens_slope(view.moving, &down, -view.s[0], &along, view.a[0]);
            edge.slopes[3] = Self::lens_slope(view.moving, &right, view.s[1], &across, view.a[1]);
            edge.depths = difference(2);
        }
        edge
    }

    fn lens_slope(moving: bool, shift: &Quadratic<N>, s: N, turn: &Quadratic<N>, a: N) -> Quadratic<N> {
        if moving {
            shift.zip(turn, |shift, turn| shift * s + turn * a)
        } else {
            Quadratic::constant(shift.0[0] * s + turn.0[0] * a)
        }
    }

    /// Lower and upper bound in the arithmetic of the sample test, as quadratics of time.
    #[inline]
    pub(super) fn range<C: Coordinate>(&self, view: &TileView<N, C>, skew: N) -> [Quadratic<N>; 2] {
        let [from, to] = self.depths.map(N::abs);
        let bend = [from, from.max(to), to];
        let axes = if view.lens { 4 } else { 2 };
        let mut range = [self.value; 2];
        for (k, &bend) in bend.iter().enumerate().take(if view.moving { 3 } else { 1 }) {
            let mut extent = view.rounding;
            for axis in 0..axes {
                extent = extent + self.slopes[axis].0[k].abs() * view.half[axis];
            }
            if view.lens {
                extent = extent + skew * bend;
            }
            range[0].0[k] = self.value.0[k] - extent;
            range[1].0[k] = self.value.0[k] + extent;
        }
        if !view.moving {
            range = range.map(|q| Quadratic::constant(q.0[0]));
        }
        range
    }
}

/// A product of two vertices that move.
#[inline(always)]
fn product<N: Number>(
    moving: bool,
    open: [Point<N>; 2],
    close: [Point<N>; 2],
    f: impl Fn(Point<N>, Point<N>) -> N,
) -> Quadratic<N> {
    let start = f(open[0], open[1]);
    if !moving {
        return Quadratic::constant(start);
    }
    let middle = (f(open[0], close[1]) + f(close[0], open[1])) * N::from(0.5);
    Quadratic([start, middle, f(close[0], close[1])])
}

/// Lower and upper bounds of three edges over a box, as quadratics of time (after Munkberg and
/// Akenine-Moeller 2012).
#[derive(Clone, Copy, Debug)]
pub struct EdgeBounds<N = f64> {
    pub(super) ranges: [[Quadratic<N>; 2]; 3],
    pub(super) moving: bool,
}

impl<N: Number> EdgeBounds<N> {
    /// Bounds of each of `edges` over the whole box.
    #[inline(always)]
    pub fn new<C: Coordinate>(edges: &Edges<N, C>) -> Self {
        let skew = edges.skew();
        let range = |k: usize| edges.edges[k].range(&edges.view, skew);
        Self { ranges: [range(0), range(1), range(2)], moving: edges.view.moving }
    }

    /// Bounds that hold where either of two does.
    pub fn hull(&self, other: &Self) -> Self {
        let ranges = [0, 1, 2].map(|k| {
            let ([low, high], [lower, higher]) = (&self.ranges[k], &other.ranges[k]);
            [low.zip(lower, N::min), high.zip(higher, N::max)]
        });
        Self { ranges, moving: self.moving }
    }

    /// The part of the time, from 0 to 1, in which a sample may see one of `faces`, and the number of
    /// quadratics solved. The clockwise face needs all three edges to reach above zero, the other face all
    /// below. So if the facing is known, one edge suffices to cull; otherwise one negative and one positive
    /// edge are needed.
    pub fn narrow(&self, part: [N; 2], faces: Faces) -> (Option<[N; 2]>, u32) {
        let mut solved = 0;
        let [clockwise, counter_clockwise] =
            [0, 1].map(|face| if faces[face] { self.reaching(face, part, &mut solved) } else { None });
        let hull = match (clockwise, counter_clockwise) {
            (Some(a), Some(b)) => Some([a[0].min(b[0]), a[1].max(b[1])]),
            (a, b) => a.or(b),
        };
        (hull, solved)
    }

    /// The same for each piece of `times`, for the `drawn` faces; `edges` are those bounded. The second
    /// result is the cost in multiply-adds beyond those of the edges themselves.
    pub fn timeline(&self, edges: &Edges<N>, times: &TimePieces, drawn: Faces) -> (TimePieces, u32) {
        let (mut left, mut madds) = (TimePieces::empty(), 0);
        for piece in times.pieces() {
            let (t, more) = self.times(edges, piece.t, piece.seen(drawn));
            madds += more;
            if let Some(t) = t {
                left.push(Piece { t, ..*piece });
            }
        }
        (left, madds)
    }

    /// The same for the times `t` and the faces that a sample may see in them.
    pub fn times<C: Coordinate>(
        &self,
        edges: &Edges<N, C>,
        t: [C; 2],
        faces: Faces,
    ) -> (Option<[C; 2]>, u32) {
        let mut madds = 0;
        let part = if edges.spans(t) {
            [N::zero(), N::from(1.0)]
        } else {
            madds += 2 * PHASE;
            t.map(|t| edges.view.phase(t))
        };
        let (part, roots) = self.narrow(part, faces);
        madds += roots * ROOT;
        let Some(part) = part else { return (None, madds) };
        let [lo, hi] = if self.moving { edges.view.times(part) } else { t };
        let left = [lo.max(t[0]), hi.min(t[1])];
        ((left[0] <= left[1]).then_some(left), madds)
    }

    /// For each edge its upper bound on the side of the face; on that of the clockwise face if both are
    /// requested.
    pub(super) fn tallest(&self, faces: Faces) -> [Quadratic<N>; 3] {
        self.ranges.map(|[lowest, highest]| if faces[0] { highest } else { Quadratic(lowest.0.map(|b| -b)) })
    }

    /// The part of `part` in which every edge can have the sign of `face`.
    fn reaching(&self, face: usize, part: [N; 2], solved: &mut u32) -> Option<[N; 2]> {
        let mut left = part;
        for tallest in &self.tallest([face == 0, face == 1]) {
            if !self.moving {
                if tallest.0[0] < N::zero() {
                    return None;
                }
                continue;
            }
            let (above, rooted) = tallest.hull_above();
            *solved += u32::from(rooted);
            let [lo, hi] = above?;
            left = [left[0].max(lo), left[1].min(hi)];
            if left[0] > left[1] {
                return None;
            }
        }
        Some(left)
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::{Case, Uniform, cases};
    use super::super::{EdgeBounds, TileView};
    use super::*;

    fn edges(case: &Case) -> Edges {
        Edges::new(TileView::new(&case.triangle, &case.shear, &case.tile, &case.within))
    }

    fn at(q: &Quadratic, phase: f64) -> f64 {
        let rest = 1.0 - phase;
        q.0[0] * rest * rest + 2.0 * q.0[1] * phase * rest + q.0[2] * phase * phase
    }

    #[test]
    fn every_edge_stays_within_its_range() {
        let mut r = Uniform::new(3);
        for (seed, case) in cases(300) {
            let edges = edges(&case);
            let bounds = EdgeBounds::new(&edges);
            for _ in 0..40 {
                let place = case.position(&mut r);
                let phase = edges.view.phase(place[4] as f32);
                for (value, [low, high]) in case.edges(place).into_iter().zip(&bounds.ranges) {
                    // The allowance for the rounding of the sample test must not be used up.
                    let room = 0.99 * edges.view.rounding;
                    let range = [at(low, phase) + room, at(high, phase) - room];
                    assert!(range[0] <= value && value <= range[1], "{seed}: {value} {range:?}");
                }
            }
        }
    }

    #[test]
    fn over_a_point_of_the_image_the_range_is_the_edge_itself() {
        for (_, mut case) in cases(50).filter(|(_, case)| !case.within.lens) {
            (case.tile.x[1], case.tile.y[1]) = (case.tile.x[0], case.tile.y[0]);
            let edges = edges(&case);
            for (k, [low, high]) in EdgeBounds::new(&edges).ranges.iter().enumerate() {
                for step in 0..=4_u8 {
                    let phase = f64::from(step) / 4.0;
                    let [start, end] = case.within.t.map(f64::from);
                    let place = [case.tile.x[0], case.tile.y[0], 0.0, 0.0, 0.0].map(f64::from);
                    let place = [place[0], place[1], 0.0, 0.0, start + phase * (end - start)];
                    let [value, room] = [case.edges(place)[k], edges.view.rounding * 1.01];
                    assert!(at(low, phase) >= value - room && at(high, phase) <= value + room);
                }
            }
        }
    }

    #[test]
    fn a_side_of_the_box_is_reached_along_each_axis_alone() {
        for (_, case) in cases(60).filter(|(_, case)| case.within.lens && !case.triangle.moving) {
            let middle = edges(&case).view.middle.map(f64::from);
            for axis in 0..4 {
                let mut thin =
                    Case { triangle: case.triangle, shear: case.shear, tile: case.tile, within: case.within };
                let flat = |k: usize, range: [f32; 2]| if k == axis { range } else { [middle[k] as f32; 2] };
                (thin.tile.x, thin.tile.y) = (flat(0, case.tile.x), flat(1, case.tile.y));
                (thin.within.u, thin.within.v) = (flat(2, case.within.u), flat(3, case.within.v));
                let edges = edges(&thin);
                let ranges = [thin.tile.x, thin.tile.y, thin.within.u, thin.within.v];
                for (k, [_, high]) in EdgeBounds::new(&edges).ranges.iter().enumerate() {
                    let most = [0, 1].map(|end| {
                        let mut place = [middle[0], middle[1], middle[2], middle[3], 0.0];
                        place[axis] = f64::from(ranges[axis][end]);
                        thin.edges(place)[k]
                    });
                    let (most, over) = (most[0].max(most[1]), high.0[0] - edges.view.rounding);
                    let width = edges.edges[k].slopes[axis].0[0].abs() * edges.view.half[axis];
                    assert!(
                        (over - most).abs() <= 1e-5 * width + 1e-9 * most.abs() + 1e-9,
                        "{axis}: {over} {most}"
                    );
                }
            }
        }
    }

    #[test]
    fn no_time_in_which_a_place_is_inside_is_lost() {
        let (mut r, mut culled, mut shrunk) = (Uniform::new(4), 0, 0);
        for (seed, case) in cases(400) {
            let edges =
                Edges::<f64>::new(TileView::new(&case.triangle, &case.shear, &case.tile, &case.within));
            let whole = TimePieces::one(Piece { t: case.within.t, faces: [true; 2] });
            for drawn in [[true, true], [true, false], [false, true]] {
                let (left, _) = EdgeBounds::new(&edges).timeline(&edges, &whole, drawn);
                culled += u32::from(left.hull().is_none());
                shrunk += u32::from(left.hull().is_some_and(|t| t != case.within.t));
                for _ in 0..60 {
                    let place = case.position(&mut r);
                    let e = case.edges(place);
                    let seen = (drawn[0] && e.iter().all(|&e| e >= 0.0))
                        || (drawn[1] && e.iter().all(|&e| e <= 0.0));
                    let kept = left.pieces().iter().any(|p| (p.t[0]..=p.t[1]).contains(&(place[4] as f32)));
                    assert!(kept || !seen, "{seed}: {drawn:?} {place:?} {left:?}");
                }
            }
        }
        assert!(culled > 500 && shrunk > 100, "{culled} {shrunk}");
    }
}
