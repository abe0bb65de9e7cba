//! Facing test: which face of a triangle the samples of a box see.
//!
//! Seen from `(u, v)` at time `t`, the determinant of its vertices is
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

use super::edges::Edges;
use super::number::Number;
use super::region::{Faces, Piece, TimePieces};

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
    use super::super::View;
    use super::super::testing::{Uniform, cases};
    use super::*;

    #[test]
    fn the_face_is_the_sign_of_the_determinant_all_over_the_box() {
        let (mut r, mut decided, mut pieces) = (Uniform::new(6), 0, 0);
        for (seed, case) in cases(400) {
            let edges = Edges::<f64>::new(View::new(&case.triangle, &case.shear, &case.tile, &case.within));
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
        let edges = Edges::<f64>::new(View::new(&triangle, &shear, &tile, &Box5::whole(false)));
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
            let edges = Edges::<f64>::new(View::new(&triangle, &shear, &tile, &Box5::whole(false)));
            assert_eq!(Facing::new(&edges).faces(), [true; 2]);
        }
    }
}
