//! Sample test: whether a sample at its own `(x, y, u, v, t)` is inside the triangle, and its depth.
//!
//! The three vertices are moved to the time of the sample, sheared to its lens position, and translated so
//! that the sample is the origin of the image plane:
//!
//! ```text
//! x' = x + u (a w - s) - X w = (x - u s) - (X - u a) w        and y' likewise
//! e_ij = x_i' y_j' - x_j' y_i'
//! ```
//!
//! In an orthographic view `X` is subtracted without the factor `w`, and `u a w` stays. With a base and a
//! slope of its own, `(x - base) - slope w`, a sample covers both forms ([`crate::geometry::Shear::ray`]).
//!
//! The first form equals `(p_i x p_j) . (X, Y, 1)` and has far smaller intermediate values. The sample is
//! inside if all three edges have one sign. Its depth is the convex combination `sum(e_k w_k) / sum(e_k)`,
//! which has to be beyond the near depth.
//!
//! Every operation rounds once, so `e_ji = -e_ij` holds to the last bit, and neighbours agree on a shared
//! edge without a common vertex order. Rounding is monotone, so a strict sign of the rounded difference is
//! the exact sign. If the rounded products tie, [`weights`] decides by the exact products in `f64`. The test is
//! therefore *exact* for the rounded points `(x', y')`. That makes it watertight, and allows proofs that
//! culling changes nothing: points on one side of a line through the sample cannot surround it.
//!
//! `kernel` runs the test sixteen samples at a time.

mod kernel;

use crate::sampling::TileSamples;
use crate::setup::Corner;
use crate::shader::Lane;
pub use crate::simd::VectorWidth;
use crate::simd::{LANES, Lanes, Mask};
pub use kernel::{Covered, Hits, PixelHits, SampleTest, StoredSamples, madds, test_run};

/// Data of sixteen samples for the sample test, in memory.
#[derive(Clone, Copy)]
pub(crate) struct SampleRows<'a> {
    /// Factor of a vertex's depth ([`crate::geometry::Shear::ray`]).
    pub slope: [&'a [f32; LANES]; 2],
    /// Offset of a vertex independent of its depth; read with a lens or in an orthographic view.
    pub lens: [&'a [f32; LANES]; 2],
    /// Time; read for moving triangles.
    pub t: &'a [f32; LANES],
}

impl<'a> SampleRows<'a> {
    /// The sixteen samples of a tile from `base` on, a multiple of sixteen.
    #[inline(always)]
    pub fn of(samples: &'a TileSamples, base: usize) -> Self {
        Self {
            slope: [block_of(&samples.slope[0], base), block_of(&samples.slope[1], base)],
            lens: [block_of(&samples.lens[0], base), block_of(&samples.lens[1], base)],
            t: block_of(&samples.t, base),
        }
    }
}

#[inline(always)]
fn block_of(array: &[f32], base: usize) -> &[f32; LANES] {
    // Arrays are padded to whole blocks, so the fallback is never used.
    array[base..base + LANES].first_chunk().unwrap_or(&[0.0; LANES])
}

/// Data of sixteen samples in registers, in perspective or in an orthographic view.
#[derive(Clone, Copy)]
pub(crate) struct View<V, const MOTION: bool, const LENS: bool, const PARALLEL: bool = false> {
    pub slope: [V; 2],
    pub lens: [V; 2],
    pub t: V,
}

/// A vertex relative to the samples.
#[derive(Clone, Copy)]
pub(crate) struct SeenLanes<V> {
    pub x: V,
    pub y: V,
    pub w: V,
}

impl<V: Lanes, const MOTION: bool, const LENS: bool, const PARALLEL: bool> View<V, MOTION, LENS, PARALLEL> {
    const HAS_BASE: bool = LENS || PARALLEL;
    const HAS_SLOPE: bool = LENS || !PARALLEL;

    #[inline(always)]
    pub fn load(rows: &SampleRows<'_>) -> Self {
        let zero = V::splat(0.0);
        Self {
            slope: [V::load(rows.slope[0]), V::load(rows.slope[1])],
            lens: if Self::HAS_BASE { [V::load(rows.lens[0]), V::load(rows.lens[1])] } else { [zero; 2] },
            t: if MOTION { V::load(rows.t) } else { zero },
        }
    }

    #[inline(always)]
    pub fn see(&self, corner: &Corner) -> SeenLanes<V> {
        let [mut x, mut y, mut w] =
            [V::splat(corner.open[0]), V::splat(corner.open[1]), V::splat(corner.open[2])];
        if MOTION {
            x = self.t.times_plus(V::splat(corner.delta[0]), x);
            y = self.t.times_plus(V::splat(corner.delta[1]), y);
            w = self.t.times_plus(V::splat(corner.delta[2]), w);
        }
        if Self::HAS_BASE {
            x = x - self.lens[0];
            y = y - self.lens[1];
        }
        if Self::HAS_SLOPE {
            x = self.slope[0].times_from(w, x);
            y = self.slope[1].times_from(w, y);
        }
        SeenLanes { x, y, w }
    }
}

/// Edge functions of a triangle at sixteen samples, and their signs.
pub(crate) struct Crossing<V> {
    edges: [V; 3],
    depths: [V; 3],
    /// Smallest and largest edge function.
    ends: [V; 2],
}

impl<V: Lanes> Crossing<V> {
    #[inline(always)]
    pub fn new<const MOTION: bool, const LENS: bool, const PARALLEL: bool>(
        corners: &[Corner; 3],
        view: &View<V, MOTION, LENS, PARALLEL>,
    ) -> Self {
        let (a, b, c) = (view.see(&corners[0]), view.see(&corners[1]), view.see(&corners[2]));
        let e0 = b.x * c.y - c.x * b.y;
        let e1 = c.x * a.y - a.x * c.y;
        let e2 = a.x * b.y - b.x * a.y;
        let (min, max) = (e0.min(e1).min(e2), e0.max(e1).max(e2));
        Self { edges: [e0, e1, e2], depths: [a.w, b.w, c.w], ends: [min, max] }
    }

    /// Whether any lane is inside or on an edge.
    #[inline(always)]
    pub fn any(&self) -> bool {
        let zero = V::splat(0.0);
        (self.ends[0].ge(zero) | zero.ge(self.ends[1])) != 0
    }

    /// Lanes on an edge or a vertex and outside of no other edge; [`weights`] decides them.
    #[inline(always)]
    pub fn tie(&self) -> Mask {
        let zero = V::splat(0.0);
        self.ends[0].equal(zero) | self.ends[1].equal(zero)
    }

    /// Lanes inside that show a drawn face.
    #[inline(always)]
    pub fn shown(&self, faces: [bool; 2]) -> Mask {
        let zero = V::splat(0.0);
        // Uniform branches rather than masks, which the compiler would vectorize.
        let mut shown = 0;
        if faces[0] {
            shown |= self.ends[0].gt(zero);
        }
        if faces[1] {
            shown |= zero.gt(self.ends[1]);
        }
        shown
    }

    /// Barycentric weights of the lanes, extrapolated outside.
    #[inline(always)]
    pub fn weights(&self) -> [V; 3] {
        let [e0, e1, e2] = self.edges;
        let sum = (e0 + e1) + e2;
        [e0 / sum, e1 / sum, e2 / sum]
    }

    /// Depth of the lanes inside.
    #[inline(always)]
    pub fn depth(&self) -> V {
        let ([e0, e1, e2], [a, b, c]) = (self.edges, self.depths);
        let quotient = ((e0 * a + e1 * b) + e2 * c) / ((e0 + e1) + e2);
        // The quotient may leave the range of the vertices by rounding; depth culling relies on the range.
        quotient.max(a.min(b).min(c)).min(a.max(b).max(c))
    }
}

/// Vertices at the ends of the edges, each opposite the vertex of its number.
const EDGES: [[usize; 2]; 3] = [[1, 2], [2, 0], [0, 1]];

/// A vertex relative to a sample: `[x', y', w]`.
pub type SeenVertex = [f32; 3];

/// Vertices of a triangle as seen by one of sixteen samples.
pub(crate) fn vertices_seen(corners: &[Corner; 3], rows: &SampleRows<'_>, lane: usize) -> [SeenVertex; 3] {
    let [slope, lens] =
        [&rows.slope, &rows.lens].map(|axes: &[&[f32; LANES]; 2]| [axes[0][lane], axes[1][lane]]);
    corners.map(|corner| see(&corner, slope, lens, rows.t[lane]))
}

/// Whether a sample with these rays ([`crate::geometry::Shear::ray`]) is inside a triangle and beyond the
/// near depth at time `t`.
pub(crate) fn covers(corners: &[Corner; 3], [across, down]: [[f32; 2]; 2], t: f32, near: f32) -> bool {
    let seen = corners.map(|corner| see(&corner, [across[0], down[0]], [across[1], down[1]], t));
    hit(&seen, [true; 2]).is_some_and(|(depth, _)| depth > near)
}

/// One vertex, with the operations of the kernel in their order.
fn see(corner: &Corner, slope: [f32; 2], lens: [f32; 2], t: f32) -> SeenVertex {
    let [x, y, w] = corner.at(t);
    [(-slope[0]).mul_add(w, x - lens[0]), (-slope[1]).mul_add(w, y - lens[1]), w]
}

/// Depth at which a sample hits a triangle with the given drawn faces, and whether the triangle is counter-clockwise
/// there.
pub(crate) fn hit(seen: &[SeenVertex; 3], faces: [bool; 2]) -> Option<(f32, bool)> {
    let (weights, counter_clockwise) = weights(seen)?;
    faces[usize::from(counter_clockwise)].then(|| (depth(seen, &weights), counter_clockwise))
}

/// Barycentric weights of the origin in the triangle, or `None` if it is outside. They add up to 1 and are
/// not negative. The flag says whether the triangle is counter-clockwise on the screen (`y` downwards).
///
/// Ties are broken by moving the sample by `(eps, eps^2)` for an infinitely small `eps`. The edge becomes `e
/// + eps B + eps^2 C` with `B = y_i w_j - y_j w_i`, `C = w_i x_j - w_j x_i`, and its first nonzero term
/// decides (Edelsbrunner and Mücke 1990, simulation of simplicity). Products of two `f32` are exact in `f64`.
///
/// In an orthographic view the same terms tilt the ray about its point at depth 0, by `(eps, eps^2)` per unit
/// of depth. Any tilted ray makes neighbours agree. At positive depth, where alone samples count, edges and
/// vertices have the same owner as if the sample were moved.
pub fn weights(seen: &[SeenVertex; 3]) -> Option<([f64; 3], bool)> {
    let edges = EDGES.map(|[i, j]| terms(&seen[i], &seen[j]));
    let signs = edges.map(|levels| levels.into_iter().map(sign).find(|&s| s != 0).unwrap_or(0));
    if signs[0] == 0 || signs[1] != signs[0] || signs[2] != signs[0] {
        return None;
    }
    // The lowest order at which any edge is nonzero has the weights.
    let level = (0..3).find(|&level| edges.iter().any(|levels| sign(levels[level]) != 0))?;
    let parts = edges.map(|levels| levels[level].0 - levels[level].1);
    let parts = [0, 1, 2].map(|k| if sign(edges[k][level]) == signs[0] { parts[k].abs() } else { 0.0 });
    let sum: f64 = parts.iter().sum();
    (sum > 0.0).then(|| (parts.map(|part| part / sum), signs[0] < 0))
}

/// The weights of [`weights`], computed on a lane, which goes on to `B` and `C` for edges through the origin only.
pub fn weights_on(lane: &Lane, seen: &[SeenVertex; 3]) -> Option<[f64; 3]> {
    let level = |[i, j]: [usize; 2], level| term_on(lane, &seen[i], &seen[j], level);
    let is_zero = |edge: f64| lane.branch(edge == 0.0);
    let mut parts = EDGES.map(|edge| level(edge, 0));
    let signs: [f64; 3] = std::array::from_fn(|k| {
        let next = |next| level(EDGES[k], next);
        let first = Some(parts[k]).filter(|&edge| !is_zero(edge));
        first.or_else(|| Some(next(1)).filter(|&edge| !is_zero(edge))).unwrap_or_else(|| next(2))
    });
    let is_inside = signs.iter().all(|&sign| lane.branch(sign > 0.0))
        || signs.iter().all(|&sign| lane.branch(sign < 0.0));
    if !is_inside {
        return None;
    }
    for next in 1..3 {
        if parts.iter().any(|&part| !is_zero(part)) {
            break;
        }
        parts = EDGES.map(|edge| level(edge, next));
    }
    let parts = parts.map(f64::abs);
    let sum = lane.add(lane.add(parts[0], parts[1]), parts[2]);
    Some(parts.map(|part| lane.div(part, sum)))
}

/// `e`, `B` or `C` of the edge from `i` to `j`, whose products are exact.
fn term_on(lane: &Lane, i: &SeenVertex, j: &SeenVertex, level: usize) -> f64 {
    let (first, second) = [(0, 1), (1, 2), (2, 0)][level];
    let [i, j] = [i, j].map(|seen| [seen[first], seen[second]].map(f64::from));
    lane.madd(-j[0], i[1], lane.mul(i[0], j[1]))
}

/// Pairs of exact products whose differences are `e`, `B` and `C` of the edge from `i` to `j`.
fn terms(i: &SeenVertex, j: &SeenVertex) -> [(f64, f64); 3] {
    let [xi, yi, wi] = i.map(f64::from);
    let [xj, yj, wj] = j.map(f64::from);
    [(xi * yj, xj * yi), (yi * wj, yj * wi), (wi * xj, wj * xi)]
}

fn sign((plus, minus): (f64, f64)) -> i8 {
    i8::from(plus > minus) - i8::from(plus < minus)
}

/// Depth of a hit with the given weights, clamped to the range of the vertices.
pub fn depth(seen: &[SeenVertex; 3], weights: &[f64; 3]) -> f32 {
    let w = seen.map(|vertex| vertex[2]);
    let mean: f64 = weights.iter().zip(w).map(|(weight, w)| weight * f64::from(w)).sum();
    (mean as f32).clamp(w[0].min(w[1]).min(w[2]), w[0].max(w[1]).max(w[2]))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Small integers, so that edges pass through the origin often.
    #[test]
    fn a_lane_computes_the_same_weights() {
        let [mut inside, mut on_edge] = [0, 0];
        for number in 0..20_000 {
            let word = |k: u64| crate::random::mix(9 * number + k);
            let seen: [SeenVertex; 3] = std::array::from_fn(|vertex| {
                let [x, y, w] = [0, 1, 2].map(|axis| word(3 * vertex as u64 + axis) >> 8);
                [(x % 5) as f32 - 2.0, (y % 5) as f32 - 2.0, (w % 4) as f32]
            });
            let (lane, expected) = (Lane::default(), weights(&seen).map(|(weights, _)| weights));
            let found = weights_on(&lane, &seen);
            assert_eq!(
                found.map(|all| all.map(f64::to_bits)),
                expected.map(|all| all.map(f64::to_bits)),
                "{seen:?}"
            );
            inside += u32::from(found.is_some());
            on_edge += u32::from(found.is_some_and(|all| all.contains(&0.0)));
        }
        assert!(inside > 1000 && on_edge > 100, "{inside} {on_edge}");
    }

    #[test]
    fn weights_cost_what_they_compute() {
        let ops = |seen: &[SeenVertex; 3]| {
            let lane = Lane::default();
            let found = weights_on(&lane, seen).is_some();
            (lane.ops(), found)
        };
        // Edges 6, comparisons with zero 3 + 1, signs 3, the sum 2, quotients 6. Seen from behind, one comparison more.
        let seen = [[2.0, 0.0, 1.0], [-1.0, 1.0, 1.0], [-1.0, -1.0, 1.0]];
        assert_eq!(ops(&seen), (21, true));
        assert_eq!(ops(&[seen[0], seen[2], seen[1]]), (22, true));
        assert!(!ops(&seen.map(|[x, y, w]| [x + 9.0, y, w])).1);
    }

    #[test]
    fn the_middle_of_a_triangle_has_equal_weights() {
        let seen = [[2.0, 0.0, 1.0], [-1.0, 1.0, 1.0], [-1.0, -1.0, 1.0]];
        let (w, counter_clockwise) = weights(&seen).unwrap();
        assert!(!counter_clockwise, "x towards y is clockwise when y points down");
        assert!(w.iter().zip([1.0 / 3.0; 3]).all(|(a, b)| (a - b).abs() < 1e-15), "{w:?}");
    }

    #[test]
    fn a_shared_edge_has_one_owner_for_all_samples_on_it() {
        let (a, b) = ([-3.0_f32, -1.5, 1.0], [6.0_f32, 3.0, 2.0]);
        let (left, right) = ([-1.0_f32, 4.0, 1.5], [2.0_f32, -5.0, 0.5]);
        let owners = [[a, b, left], [b, a, right]].iter().filter(|t| weights(t).is_some()).count();
        assert_eq!(owners, 1);
    }

    #[test]
    fn a_shared_vertex_has_one_owner() {
        // A fan of eight triangles around a vertex at the sample itself.
        let rim: Vec<SeenVertex> = [(3, 0), (2, 2), (0, 3), (-2, 2), (-3, 0), (-2, -2), (0, -3), (2, -2)]
            .map(|(x, y)| [x as f32, y as f32, 1.0 + 0.1 * x as f32])
            .to_vec();
        let centre = [0.0, 0.0, 1.0];
        let owners = (0..8).filter(|&k| weights(&[centre, rim[k], rim[(k + 1) % 8]]).is_some()).count();
        assert_eq!(owners, 1);
    }

    #[test]
    fn nothing_surrounds_a_point_outside() {
        assert!(weights(&[[1.0, 1.0, 1.0], [2.0, 1.0, 1.0], [1.0, 2.0, 1.0]]).is_none());
        assert!(weights(&[[1.0, 1.0, 1.0], [2.0, 2.0, 1.0], [3.0, 3.0, 1.0]]).is_none());
    }
}
