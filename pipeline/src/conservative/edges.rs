//! The edges of a triangle over a tile, lens and time.
//!
//! With a point of the image for origin, vertex `k` is `P_k`. Where the origin is in the triangle, whatever its area, `P_i x P_j` are
//! the weights of the third vertex times one number, so no two of them differ in sign. A tile is culled when one edge is below zero
//! everywhere and another above.
//!
//! With `n` the cross product of vertices `i` and `j` as homogeneous points `(x, y, w)`, seen from the middle of the tile, the edge seen
//! from `(X, Y)` is `n_x X + n_y Y + n_z` (Olano and Greer 1997), so over the tile it is `n_z` give or take `|n_x|` and
//! `|n_y|` times half the tile's sides. `n` is linear in each of u and v and quadratic in t, so what it is at their corners, and in t
//! its three Bernstein coefficients, bound it.

use glam::DVec3;

use super::Region;
use super::seen::Seen;
use crate::depth::Real;

/// The vertices at both ends as homogeneous points.
type Points = [[DVec3; 3]; 2];

/// Whether two edges say that the triangle cannot touch the tile.
pub(super) fn miss(seen: &Seen, region: &Region) -> bool {
    if !seen.view.has_lens() {
        return apart(seen, &[seen.homogeneous()]);
    }
    let places = [(0, 0), (1, 0), (0, 1), (1, 1)].map(|(i, j)| [region.u[i], region.v[j]]);
    apart(seen, &places.map(|place| seen.homogeneous_from(place)))
}

/// The same by the vertices as they are seen from each of some places on the lens.
fn apart<const PLACES: usize>(seen: &Seen, places: &[Points; PLACES]) -> bool {
    let half = seen.tile.map(|[low, high]| high.most(-low));
    let noise = noise(seen, places, half);
    let (mut below, mut above) = (false, false);
    for (i, j) in [(1, 2), (2, 0), (0, 1)] {
        let mut range = [f64::INFINITY, f64::NEG_INFINITY];
        for points in places {
            for normal in normals(points, i, j) {
                let reach = half[0] * normal.x.abs() + half[1] * normal.y.abs();
                range = [range[0].least(normal.z - reach), range[1].most(normal.z + reach)];
            }
        }
        below |= range[1] < -noise;
        above |= range[0] > noise;
    }
    below && above
}

/// What an edge may be off by. From any point of the tile vertices are at most `across` and `down` away on the two axes, so vertices off
/// by their noise `a` and `b` make a product of two off by `2 (a down + b across) + 2 a b`.
///
/// Twice that pays for rounding, too. The noise of a vertex is at least `ROUNDING` times the magnitudes that entered it (see [`Seen`]),
/// which are at least `across` and `down`: of a tile from `lo` to `hi`, `half` and the magnitude of the middle add up to that of the farther
/// side. So the half that vertices leave is at least `4 ROUNDING across down`. The magnitudes in an edge add up to at most twice `across down`,
/// and none passes more than six operations of 2^-53 each: 12 / 32 of `ROUNDING across down`.
fn noise<const PLACES: usize>(seen: &Seen, places: &[Points; PLACES], half: [f64; 2]) -> f64 {
    let all = || places.as_flattened().as_flattened().iter();
    let [across, down] = [0, 1].map(|axis| {
        let far = |p: &DVec3| p[axis].abs() + half[axis] * p.z.abs();
        all().fold(0.0, |most: f64, p| most.most(far(p)))
    });
    4.0 * (seen.noise[0] * down + seen.noise[1] * across) + 4.0 * seen.noise[0] * seen.noise[1]
}

/// The Bernstein coefficients in t of the cross product of vertices `i` and `j`.
fn normals(points: &Points, i: usize, j: usize) -> [DVec3; 3] {
    let product = |a: usize, b: usize| points[a][i].cross(points[b][j]);
    [product(0, 0), 0.5 * (product(0, 1) + product(1, 0)), product(1, 1)]
}
