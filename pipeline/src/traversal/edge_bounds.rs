//! When a sample of a box may lie on the right side of every edge (after Munkberg and Akenine-Moeller 2012).

use super::cost;
use super::edges::Edges;
use super::number::Number;
use super::quadratic::Quadratic;
use super::timeline::{Faces, Piece, Timeline};

/// The lowest and the highest values of three edges over a box, as quadratics of time.
#[derive(Clone, Copy, Debug)]
pub struct EdgeBounds<N = f64> {
    pub(super) ranges: [[Quadratic<N>; 2]; 3],
    pub(super) moving: bool,
}

impl<N: Number> EdgeBounds<N> {
    /// Bounds on each of `edges` all over their box.
    pub fn new(edges: &Edges<N>) -> Self {
        let skew = edges.skew();
        let ranges = edges.edges.map(|edge| edge.range(&edges.view, skew));
        Self { ranges, moving: edges.view.moving }
    }

    /// The part of the time, from 0 to 1, in which a sample may see one of `faces`, and how many quadratics had to be solved for
    /// it. To see the clockwise face all three edges have to reach above zero, to see the other one all below. So where
    /// facing is decided one edge is enough to cull, and else it takes one below zero and another above.
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

    /// The same for each piece of `times`, of which `drawn` faces matter; `edges` are those bounded. Also says what that takes beyond
    /// [`Edges::bounds`] in multiply-adds.
    pub fn timeline(&self, edges: &Edges<N>, times: &Timeline, drawn: Faces) -> (Timeline, u32) {
        let (mut left, mut madds) = (Timeline::empty(), 0);
        for piece in times.pieces() {
            let part = if edges.spans(piece.t) {
                [N::zero(), N::from(1.0)]
            } else {
                madds += 2 * cost::PHASE;
                piece.t.map(|t| edges.view.phase(t))
            };
            let (part, roots) = self.narrow(part, piece.seen(drawn));
            madds += roots * cost::ROOT;
            if let Some(part) = part {
                let [lo, hi] = if self.moving { edges.view.times(part) } else { piece.t };
                let t = [lo.max(piece.t[0]), hi.min(piece.t[1])];
                if t[0] <= t[1] {
                    left.push(Piece { t, ..*piece });
                }
            }
        }
        (left, madds)
    }

    /// For each edge the farthest it can be on the side of the face, the clockwise one if both are asked for.
    pub(super) fn tallest(&self, faces: Faces) -> [Quadratic<N>; 3] {
        self.ranges.map(|[lowest, highest]| if faces[0] { highest } else { Quadratic(lowest.0.map(|b| -b)) })
    }

    /// The part of `part` in which every edge can have the sign of `face`.
    fn reaching(&self, face: usize, part: [N; 2], solved: &mut u32) -> Option<[N; 2]> {
        let mut left = part;
        for tallest in self.tallest([face == 0, face == 1]) {
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
    use super::super::View;
    use super::super::testing::{Uniform, cases};
    use super::*;

    #[test]
    fn no_time_in_which_a_place_is_inside_is_lost() {
        let (mut r, mut culled, mut shrunk) = (Uniform::new(4), 0, 0);
        for (seed, case) in cases(400) {
            let edges = Edges::<f64>::new(View::new(&case.triangle, &case.shear, &case.tile, &case.within));
            let whole = Timeline::one(Piece { t: case.within.t, faces: [true; 2] });
            for drawn in [[true, true], [true, false], [false, true]] {
                let (left, _) = EdgeBounds::new(&edges).timeline(&edges, &whole, drawn);
                culled += u32::from(left.hull().is_none());
                shrunk += u32::from(left.hull().is_some_and(|t| t != case.within.t));
                for _ in 0..60 {
                    let place = case.place(&mut r);
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
