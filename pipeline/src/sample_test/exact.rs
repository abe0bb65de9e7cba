//! Exact sample test for ties of rounded products, and the weights of a hit.

use super::block::SampleRows;
use crate::setup::Corner;
use crate::simd::LANES;

/// A vertex relative to a sample: `[x', y', w]`.
pub type Seen = [f32; 3];

/// Vertices of a triangle as seen by one of sixteen samples.
pub(crate) fn seen(corners: &[Corner; 3], rows: &SampleRows<'_>, lane: usize) -> [Seen; 3] {
    let [slope, lens] =
        [&rows.slope, &rows.lens].map(|axes: &[&[f32; LANES]; 2]| [axes[0][lane], axes[1][lane]]);
    corners.map(|corner| see(&corner, slope, lens, rows.t[lane]))
}

/// Whether a sample with these rays ([`crate::geometry::Shear::ray`]) is inside a triangle and beyond the near depth at time `t`.
pub(crate) fn covers(corners: &[Corner; 3], [across, down]: [[f32; 2]; 2], t: f32, near: f32) -> bool {
    let seen = corners.map(|corner| see(&corner, [across[0], down[0]], [across[1], down[1]], t));
    hit(&seen, [true; 2]).is_some_and(|(depth, _)| depth > near)
}

/// One vertex, with the operations of the kernel in their order.
fn see(corner: &Corner, slope: [f32; 2], lens: [f32; 2], t: f32) -> Seen {
    let [x, y, w] = corner.at(t);
    [(-slope[0]).mul_add(w, x - lens[0]), (-slope[1]).mul_add(w, y - lens[1]), w]
}

/// Depth at which a sample hits a triangle with the given drawn faces, and whether the triangle is counter-clockwise
/// there.
pub(crate) fn hit(seen: &[Seen; 3], faces: [bool; 2]) -> Option<(f32, bool)> {
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
pub fn weights(seen: &[Seen; 3]) -> Option<([f64; 3], bool)> {
    let edges = [(1, 2), (2, 0), (0, 1)].map(|(i, j)| terms(&seen[i], &seen[j]));
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

/// Pairs of exact products whose differences are `e`, `B` and `C` of the edge from `i` to `j`.
fn terms(i: &Seen, j: &Seen) -> [(f64, f64); 3] {
    let [xi, yi, wi] = i.map(f64::from);
    let [xj, yj, wj] = j.map(f64::from);
    [(xi * yj, xj * yi), (yi * wj, yj * wi), (wi * xj, wj * xi)]
}

fn sign((plus, minus): (f64, f64)) -> i8 {
    i8::from(plus > minus) - i8::from(plus < minus)
}

/// Depth of a hit with the given weights, clamped to the range of the vertices.
pub fn depth(seen: &[Seen; 3], weights: &[f64; 3]) -> f32 {
    let w = seen.map(|vertex| vertex[2]);
    let mean: f64 = weights.iter().zip(w).map(|(weight, w)| weight * f64::from(w)).sum();
    (mean as f32).clamp(w[0].min(w[1]).min(w[2]), w[0].max(w[1]).max(w[2]))
}

#[cfg(test)]
mod tests {
    use super::*;

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
        let rim: Vec<Seen> = [(3, 0), (2, 2), (0, 3), (-2, 2), (-3, 0), (-2, -2), (0, -3), (2, -2)]
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
