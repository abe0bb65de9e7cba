//! What a box shows of a triangle. *Screening* of single samples by edges linearized in (X, Y, u, v, t)
//! (Munkberg and Akenine-Moeller 2012, whose hyperplanes these are; the remainder bound is new here).
//!
//! *Facing test*: which face of a triangle the samples of a box see. Seen from `(u, v)` at time `t`, the
//! determinant of its vertices is
//!
//! ```text
//! det(u, v, t) = det[x, y, w] + u s sum(A) + v s' sum(B)        A, B as in `edges`
//! ```
//!
//! cubic in time and affine in `u, v`. An orthographic view uses the determinant of `(x, y, 1)`, twice the
//! area as seen:
//!
//! ```text
//! det(u, v, t) = sum(e_k) + u a sum(A) + v b sum(B)
//! ```
//!
//! So its four Bernstein coefficients, each plus or minus its lens terms, bound it. A sample inside has `det
//! = sum(e_k w_k)`, its depth times `sum(e_k)` with a depth beyond the near depth, or `det = sum(e_k)`. In
//! both cases the sign of `det` is that of all three edges. If the sign is undecided over the whole time, the
//! time is bisected (de Casteljau).

use super::edges::{Edge, Edges};
use super::number::{Number, Quadratic, Scalar};
use super::region::{Faces, Piece, TileView, TimePieces};

/// Linear edges in the arithmetic of the sample test. A sample is outside if one edge is below `-margin` and
/// another above `margin`.
#[derive(Clone, Copy, Debug)]
pub struct Screen {
    /// Value of each edge in the middle of the box.
    pub value: [f32; 3],
    /// Value of each edge in the middle of the tile, extrapolated to the middle of the lens and the start of
    /// the shutter, from which positions of samples are.
    pub base: [f32; 3],
    /// Slope of each edge along X, Y, u, v, t.
    pub gradient: [[f32; 5]; 3],
    /// Error bound of the linear value of each edge.
    pub margin: [f32; 3],
    /// Largest difference of each edge from its value in the middle, without the margin.
    pub extent: [f32; 3],
}

/// Multiply-adds of [`Screen::gain`].
pub const SCREEN_GAIN_MADDS: u32 = 28;

impl Screen {
    /// Screen for single samples of the box of `edges` at times `t`, within those of the box, if only `faces`
    /// can be visible.
    pub fn new<N: Number>(edges: &Edges<N>, t: [f32; 2], faces: Faces) -> Self {
        let (view, skew) = (&edges.view, edges.skew());
        let ([.., u, v], middle_t) = (view.middle, 0.5 * (t[0] + t[1]));
        let middle = [(2, u, view.lens), (3, v, view.lens), (4, middle_t, view.moving)];
        let part = (view.moving && t != view.t).then(|| t.map(|t| view.phase(t)));
        let half_t = (N::from(t[1]) - N::from(t[0])) * N::from(0.5);
        let linear = edges.edges.map(|edge| edge.linear(view, part, half_t, skew));
        let mut screen = Self {
            value: [0.0; 3],
            base: [0.0; 3],
            gradient: [[0.0; 5]; 3],
            margin: [0.0; 3],
            extent: [0.0; 3],
        };
        for (k, linear) in linear.iter().enumerate() {
            let away = middle
                .iter()
                .filter(|(.., is_used)| *is_used)
                .map(|(axis, at, _)| (linear.slopes[*axis], N::of(*at)));
            let base = away.clone().fold(linear.value, |base, (slope, at)| base - slope * at);
            let reach: f64 = away.map(|(slope, at)| (slope.into() * at.into()).abs()).sum();
            // The middle of the times is rounded; the resulting shift goes into the margin.
            let off = Into::<f64>::into(linear.slopes[4]).abs() * f64::from(f32::EPSILON * middle_t.abs());
            let [shift, margin] = one_sided(linear, [off, reach], faces);
            let [value, base] = [linear.value, base].map(|at| (Into::<f64>::into(at) + shift) as f32);
            (screen.value[k], screen.base[k], screen.margin[k]) =
                (value, base, margin as f32 + margin.abs() as f32 * 1e-6);
            screen.extent[k] = Into::<f64>::into(linear.extent) as f32;
            screen.gradient[k] = linear.slopes.map(|slope| Into::<f64>::into(slope) as f32);
        }
        screen
    }

    /// Expected fraction of samples rejected, for edges distributed evenly over their extents and independent
    /// of each other.
    pub fn gain(&self) -> f32 {
        gain(self.value, self.margin, self.extent.map(|extent| extent.max(f32::MIN_POSITIVE)))
    }
}

/// [`Screen::gain`] of edges with positive extents.
fn gain<N: Scalar>(value: [N; 3], margin: [N; 3], extent: [N; 3]) -> N {
    let [zero, one] = [0.0, 1.0].map(N::from);
    let share = |part: N| {
        if part < zero {
            zero
        } else if part > one {
            one
        } else {
            part
        }
    };
    let mut kept = [one; 2];
    for k in 0..3 {
        let per = N::from(0.5) / extent[k];
        let [below, above] =
            [-value[k], value[k]].map(|value| share(one - (value - margin[k] + extent[k]) * per));
        kept = [kept[0] * below, kept[1] * above];
    }
    (one - kept[0]) * (one - kept[1])
}

/// `value + slopes . d` over a box, within `remainder` of the result of the sample test.
#[derive(Clone, Copy, Debug)]
pub(super) struct Linear<N> {
    pub value: N,
    pub slopes: [N; 5],
    pub remainder: N,
    /// Largest difference of the linear part from its middle value.
    pub extent: N,
}

/// Multiply-adds of screening one sample: three edges, one per dimension in use. The sample table has
/// positions from the middle of the tile.
pub const fn screen_madds(moving: bool, lens: bool) -> u32 {
    3 * (2 + moving as u32 + 2 * lens as u32)
}

/// Shift of the values of an edge, and its margin. If only one face can be visible, one edge on the wrong
/// side suffices. The threshold is then shifted so far that the other side always passes. `off` is an error
/// of the values, and `reach` how far the edge changes from the box to where positions are from.
fn one_sided<N: Number>(linear: &Linear<N>, [off, reach]: [f64; 2], faces: Faces) -> [f64; 2] {
    // The linear value is rounded a dozen times, each by at most 2^-24 of the sum of magnitudes.
    const ROUNDING: f64 = 1.0 / 1_048_576.0;
    let [value, extent, remainder]: [f64; 3] =
        [linear.value, linear.extent, linear.remainder].map(Into::into);
    let tallest = 1.001 * (value.abs() + extent);
    let both = faces[0] == faces[1];
    let rounded = if both { tallest } else { 4.0 * (tallest + remainder) } + 4.0 * reach;
    let margin = remainder + off + ROUNDING * rounded;
    if both {
        return [0.0, margin];
    }
    let beyond = 2.0 * (tallest + margin);
    let shift = 0.5 * (beyond + margin);
    [if faces[0] { shift } else { -shift }, 0.5 * (margin - beyond)]
}

impl<N: Number> Edge<N> {
    /// The edge linearized over `part` of the time, or over all of it; `half_t` is half the length.
    fn linear(&self, view: &TileView<N>, part: Option<[N; 2]>, half_t: N, skew: N) -> Linear<N> {
        let over = |q: &Quadratic<N>| match part {
            Some(part) => q.over(part),
            None => *q,
        };
        let mut linear = Linear {
            value: self.value.0[0],
            slopes: [N::zero(); 5],
            remainder: view.rounding,
            extent: N::zero(),
        };
        if view.moving {
            let [m0, m1, m2] = over(&self.value).centred();
            // `c^2` is not negative: half of its term goes into the value.
            let bend = m2 * N::from(0.5);
            linear.value = m0 + bend;
            linear.remainder = linear.remainder + bend.abs();
            linear.extent = m1.abs();
            linear.slopes[4] = if half_t > N::zero() { m1 / half_t } else { N::zero() };
        }
        for axis in 0..if view.lens { 4 } else { 2 } {
            let half = view.half[axis];
            linear.slopes[axis] = self.slopes[axis].0[0];
            if view.moving {
                let [m0, m1, m2] = over(&self.slopes[axis]).centred();
                linear.slopes[axis] = m0;
                linear.remainder = linear.remainder + half * (m1.abs() + m2.abs());
            }
            linear.extent = linear.extent + linear.slopes[axis].abs() * half;
        }
        if view.lens {
            let bend = self.depths[0].abs().max(self.depths[1].abs());
            linear.remainder = linear.remainder + skew * bend;
        }
        linear
    }
}

/// Bounds of the determinant over a box: its lowest and highest Bernstein coefficients.
#[derive(Clone, Copy, Debug)]
pub struct Facing<N = f64> {
    range: [[N; 4]; 2],
    margin: N,
    moving: bool,
}

impl<N: Number> Facing<N> {
    /// Determinant of the triangle of `edges`.
    pub fn new(edges: &Edges<N>) -> Self {
        let view = &edges.view;
        let third = N::constant(1.0 / 3.0);
        let count = if view.moving { 4 } else { 1 };
        let [mut lowest, mut highest] = [[N::zero(); 4]; 2];
        // If vertices have equal weights, their lens terms are the sums of the edges' slopes.
        let (first, factors) = if view.parallel { (2, [N::from(1.0); 2]) } else { (0, view.s.map(N::abs)) };
        let sums: [[N; 3]; 2] = [0, 1].map(|axis| {
            let [a, b, c] = edges.edges.map(|edge| edge.slopes[first + axis]);
            if view.lens { a.zip(&b, |a, b| a + b).zip(&c, |a, b| a + b).0 } else { [N::zero(); 3] }
        });
        for (k, (low, high)) in lowest.iter_mut().zip(&mut highest).take(count).enumerate() {
            let middle = determinant(edges, k);
            let middle = if k == 1 || k == 2 { middle * third } else { middle };
            let mut extent = N::zero();
            if view.lens {
                for (axis, sum) in sums.iter().enumerate() {
                    extent = extent + elevated(sum, k, third).abs() * factors[axis] * view.half[2 + axis];
                }
            }
            (*low, *high) = (middle - extent, middle + extent);
        }
        let mut range = [lowest, highest];
        if !view.moving {
            range = range.map(|[first, ..]| [first; 4]);
        }
        Self { range, margin: margin(edges), moving: view.moving }
    }

    /// Faces that may be visible over the whole time.
    pub fn faces(&self) -> Faces {
        // Written so that NaN keeps both faces.
        let above = self.range[0].iter().all(|&low| low > self.margin);
        let below = self.range[1].iter().all(|&high| high < -self.margin);
        [!below, !above]
    }

    /// The parts of the times `t` in which one of the faces `drawn` may be visible. Undecided time is
    /// bisected up to `splits` times. The second result is the number of bisections.
    pub fn timeline(&self, t: [f32; 2], drawn: Faces, splits: u32) -> (TimePieces, u32) {
        let (mut timeline, mut done) = (TimePieces::empty(), 0);
        let splits = if self.moving { splits.min(TimePieces::MAX_SPLITS) } else { 0 };
        self.bisect([t[0], t[1], t[1]], drawn, splits, &mut timeline, &mut done);
        (timeline, done)
    }

    /// `last` is the last time of a part that ends at `end`. The end belongs to the next part, except for the
    /// last part.
    fn bisect(
        &self,
        [start, end, last]: [f32; 3],
        drawn: Faces,
        splits: u32,
        out: &mut TimePieces,
        done: &mut u32,
    ) {
        let piece = Piece { t: [start, last], faces: self.faces() };
        let middle = 0.5 * (start + end);
        if splits == 0 || piece.is_decided() || !(start < middle && middle < end) {
            if piece.seen(drawn) != [false; 2] {
                out.push(piece);
            }
            return;
        }
        *done += 1;
        let (from, span) = (N::from(start), N::from(end) - N::from(start));
        let phase = (N::from(middle) - from) / span;
        let [earlier, later] = self.split(phase);
        earlier.bisect([start, middle, middle.next_down()], drawn, splits - 1, out, done);
        later.bisect([middle, end, last], drawn, splits - 1, out, done);
    }

    /// The determinant before and after `phase` of the time. Each coefficient is a convex combination of
    /// others, so bounds stay bounds.
    fn split(&self, phase: N) -> [Self; 2] {
        let mut parts = [*self; 2];
        for side in [0, 1] {
            let mut level = self.range[side];
            for step in 0..4 {
                parts[0].range[side][step] = level[0];
                parts[1].range[side][3 - step] = level[3 - step];
                for k in 0..3 - step {
                    level[k] = level[k] + (level[k + 1] - level[k]) * phase;
                }
            }
        }
        parts
    }
}

/// Bernstein coefficient `k` of the determinant, the inner two times three.
fn determinant<N: Number>(edges: &Edges<N>, k: usize) -> N {
    let [open, close] = edges.view.ends;
    let mut sum = N::zero();
    for (vertex, edge) in edges.edges.iter().enumerate() {
        let [w0, w1] = [open, close].map(|points| edges.view.weight(points[vertex][2]));
        let [e0, e1, e2] = edge.value.0;
        let part = match k {
            0 => e0 * w0,
            1 => e0 * w1 + (e1 + e1) * w0,
            2 => (e1 + e1) * w1 + e2 * w0,
            _ => e2 * w1,
        };
        sum = if vertex == 0 { part } else { sum + part };
    }
    sum
}

/// Coefficient `k` of a quadratic written as a cubic.
fn elevated<N: Number>(q: &[N; 3], k: usize, third: N) -> N {
    match k {
        0 => q[0],
        1 => (q[0] + q[1] + q[1]) * third,
        2 => (q[1] + q[1] + q[2]) * third,
        _ => q[2],
    }
}

/// Error bound of the determinant as the sample test sees it, weighted by rounded depths: three edges of at
/// most `2 reach_x reach_y`, each rounded, times rounded depths.
fn margin<N: Number>(edges: &Edges<N>) -> N {
    const ROUNDING: f64 = 1.0 / 524_288.0;
    let view = &edges.view;
    let [reach_x, reach_y] = view.reach;
    let weight = reach_x * reach_y * view.depth[1];
    // Outside the range of f32 the depth of a sample is meaningless. With vertices behind the camera, its
    // sign would matter.
    if !(weight > N::constant(1e-30) && weight < N::constant(1e36)) {
        return N::from(f32::INFINITY);
    }
    view.depth[0] * view.rounding * N::from(3.0) + N::constant(3.0 * ROUNDING) * weight
}

#[cfg(test)]
mod tests {
    use super::super::number::counted::{Counted, count};
    use super::super::testing::{Uniform, cases};
    use super::super::{Edges, Screen, TileView};
    use super::*;

    #[test]
    fn the_cost_of_a_gain_is_that_of_its_kernel() {
        let part = |value: f32| [value; 3].map(Counted::from);
        for value in [-9.0, -0.5, 0.0, 0.25, 9.0] {
            let (madds, _) = count(|| gain(part(value), part(0.1), part(1.0)));
            assert_eq!(madds, SCREEN_GAIN_MADDS, "{value}");
        }
    }

    #[test]
    fn edges_stay_within_the_margin_and_one_sided_screens_say_the_same() {
        let (mut r, mut outside) = (Uniform::new(5), [0; 3]);
        for (seed, case) in cases(300) {
            let edges =
                Edges::<f64>::new(TileView::new(&case.triangle, &case.shear, &case.tile, &case.within));
            let [start, end] = case.within.t;
            let part = if seed % 2 == 0 {
                [start, end]
            } else {
                [start + 0.25 * (end - start), 0.5 * (start + end)]
            };
            for (kind, faces) in [[true, true], [true, false], [false, true]].into_iter().enumerate() {
                let screen = Screen::new(&edges, part, faces);
                let [x, y] = [case.tile.x, case.tile.y].map(|[lo, hi]| 0.5 * (lo + hi));
                let origin = [x, y, 0.0, 0.0, 0.0].map(f64::from);
                for _ in 0..30 {
                    let mut place = case.position(&mut r);
                    place[4] = f64::from(r.often_an_end(part));
                    let e = case.edges(place);
                    // As in the sample test, but without rounding.
                    let signs: Vec<_> = (0..3)
                        .map(|k| {
                            let linear: f64 = (0..5)
                                .map(|axis| {
                                    let offset = place[axis] - origin[axis];
                                    f64::from(screen.gradient[k][axis]) * offset
                                })
                                .sum();
                            let value = f64::from(screen.base[k]) + linear;
                            let margin = f64::from(screen.margin[k]);
                            (value < -margin, value > margin)
                        })
                        .collect();
                    let out = signs.iter().any(|s| s.0) && signs.iter().any(|s| s.1);
                    outside[kind] += u32::from(out);
                    let seen = (faces[0] && e.iter().all(|&e| e >= 0.0))
                        || (faces[1] && e.iter().all(|&e| e <= 0.0));
                    assert!(!(out && seen), "{seed} {faces:?}: {e:?} {screen:?}");
                    let room = edges.view.rounding * 0.9;
                    if kind == 0 {
                        for (k, value) in e.into_iter().enumerate() {
                            assert!(
                                !(signs[k].0 && value > -room || signs[k].1 && value < room),
                                "{seed}: {value}"
                            );
                        }
                    } else {
                        let edge_says = e.iter().any(|&e| if kind == 1 { e < 0.0 } else { e > 0.0 });
                        assert!(!out || edge_says);
                    }
                }
            }
        }
        assert!(outside[0] > 1000 && outside[1] > outside[0] && outside[2] > outside[0], "{outside:?}");
    }

    #[test]
    fn the_face_is_the_sign_of_the_determinant_all_over_the_box() {
        let (mut r, mut decided, mut pieces) = (Uniform::new(6), 0, 0);
        for (seed, case) in cases(400) {
            let edges =
                Edges::<f64>::new(TileView::new(&case.triangle, &case.shear, &case.tile, &case.within));
            let facing = Facing::new(&edges);
            for (drawn, splits) in
                [([true, true], 3), ([true, false], 2), ([false, true], 1), ([true, true], 0)]
            {
                let (times, _) = facing.timeline(case.within.t, drawn, splits);
                decided += times.pieces().iter().filter(|p| p.is_decided()).count();
                pieces += usize::from(times.pieces().len() > 1);
                for _ in 0..40 {
                    let place = case.position(&mut r);
                    let det = case.det(place);
                    // Slightly beyond the rounding error that the margin covers.
                    let sure = 0.99 * facing.margin;
                    let t = place[4] as f32;
                    let here: Vec<_> = times.pieces().iter().filter(|p| p.t[0] <= t && t <= p.t[1]).collect();
                    assert!(here.len() <= 1, "pieces overlap at {t}: {times:?}");
                    let faces = here.first().map_or([false; 2], |piece| piece.faces);
                    let hidden = [0, 1].map(|face| drawn[face] && !faces[face]);
                    assert!(!hidden[0] || det < -sure, "{seed}: {det} {drawn:?} {times:?}");
                    assert!(!hidden[1] || det > sure, "{seed}: {det} {drawn:?} {times:?}");
                }
            }
        }
        assert!(decided > 2000 && pieces > 50, "{decided} {pieces}");
    }

    #[test]
    fn a_turn_in_the_middle_of_the_shutter_is_found_by_cutting_there() {
        use crate::geometry::{Cull, MovingVertex, Shear};
        use crate::setup::{SetupResult, set_up};
        use crate::traversal::{Box5, TileRect};
        let still = |p| MovingVertex { open: p, close: p };
        let v = [
            still([0.0, 0.0, 1.0]),
            still([0.0, 8.0, 1.0]),
            MovingVertex { open: [8.0, 4.0, 1.0], close: [-8.0, 4.0, 1.0] },
        ];
        let shear = Shear::default();
        let SetupResult::Ready(triangle) = set_up(0, v.each_ref(), Cull::None, &shear, 0.1, [8.0; 2]) else {
            panic!("the triangle is visible");
        };
        let tile = TileRect { x: [0.0, 8.0], y: [0.0, 8.0] };
        let edges = Edges::<f64>::new(TileView::new(&triangle, &shear, &tile, &Box5::whole(false)));
        let facing = Facing::new(&edges);
        assert_eq!(facing.timeline([0.0, 1.0], [true; 2], 0).0.pieces().len(), 1);
        // Around the time without area neither half is decided; the outer quarters are.
        let (times, bisections) = facing.timeline([0.0, 1.0], [true; 2], 3);
        let found: Vec<_> = times.pieces().iter().map(|p| (p.t[0], p.faces)).collect();
        assert_eq!(
            found,
            [(0.0, [false, true]), (0.375, [true, true]), (0.625, [true, false])],
            "{bisections}"
        );
        let (front, _) = facing.timeline([0.0, 1.0], [true, false], 3);
        assert_eq!(front.hull().map(|t| t[0]), Some(0.375));
    }

    #[test]
    fn a_triangle_that_turns_and_turns_back_is_not_decided_by_its_ends() {
        use crate::geometry::{Cull, MovingVertex, Shear};
        use crate::setup::{SetupResult, set_up};
        use crate::traversal::{Box5, TileRect};
        // Its area is proportional to (1 - 3 t) (2 - 3 t), negative in the middle third only.
        let v = [
            ([0.0, 0.0, 1.0], [0.0, 0.0, 1.0]),
            ([8.0, 0.0, 1.0], [-16.0, 0.0, 1.0]),
            ([0.0, 16.0, 1.0], [0.0, -8.0, 1.0]),
        ]
        .map(|(open, close)| MovingVertex { open, close });
        let shear = Shear::default();
        for order in [[0, 1, 2], [0, 2, 1]] {
            let corners = order.map(|k: usize| &v[k]);
            let SetupResult::Ready(triangle) = set_up(0, corners, Cull::None, &shear, 0.1, [8.0; 2]) else {
                panic!("the triangle is visible");
            };
            let tile = TileRect { x: [0.0, 8.0], y: [0.0, 8.0] };
            let edges = Edges::<f64>::new(TileView::new(&triangle, &shear, &tile, &Box5::whole(false)));
            assert_eq!(Facing::new(&edges).faces(), [true; 2]);
        }
    }
}
