//! Edge tests of a triangle over a tile, lens and time.
//!
//! With a point of the image as origin, vertex `k` is `P_k`. If the origin is in the triangle, of any area,
//! `P_i x P_j` are the weights of the third vertex times one number, so no two of them differ in sign. A tile
//! is culled if one edge is negative everywhere and another one positive everywhere.
//!
//! Let `n` be the cross product of the homogeneous vertices `i` and `j`, `(x, y, w)`, seen from the middle of
//! the tile. The edge seen from `(X, Y)` is `n_x X + n_y Y + n_z` (Olano and Greer 1997). So over the tile it
//! is `n_z` plus or minus `|n_x|` and `|n_y|` times half the tile's sides. `n` is linear in u and v and
//! quadratic in t, so its values at their corners, and its three Bernstein coefficients in t, bound it.

use super::Region;
use super::triangle::Seen;
use crate::depth::{Numbers, Real, cross};

/// Vertices at both ends as homogeneous points.
type Points<R> = [[[R; 3]; 3]; 2];

/// Whether two edges show that the triangle cannot touch the tile.
pub(super) fn miss<N: Numbers>(numbers: N, seen: &Seen<N::Number>, region: &Region) -> bool {
    numbers.branch(seen.view.is_perspective());
    if !numbers.branch(seen.view.has_lens()) {
        return apart(seen, &[seen.homogeneous()]);
    }
    let [u, v] = [region.u, region.v].map(|side| side.map(|position| numbers.number(position)));
    let lens_positions = [(0, 0), (1, 0), (0, 1), (1, 1)].map(|(i, j)| [u[i], v[j]]);
    apart(seen, &lens_positions.map(|lens| seen.homogeneous_from(numbers, lens)))
}

/// The same test by the vertices as seen from each of the given lens positions.
fn apart<R: Real, const POSITIONS: usize>(seen: &Seen<R>, lens_positions: &[Points<R>; POSITIONS]) -> bool {
    let half = seen.tile.map(|[low, high]| high.larger(-low));
    let noise = noise(seen, lens_positions, half);
    let (mut below, mut above) = (false, false);
    for (i, j) in [(1, 2), (2, 0), (0, 1)] {
        let mut range = [f64::INFINITY, f64::NEG_INFINITY].map(R::new);
        for points in lens_positions {
            for [x, y, z] in normals(points, i, j) {
                let reach = half[0] * x.magnitude() + half[1] * y.magnitude();
                range = [range[0].smaller(z - reach), range[1].larger(z + reach)];
            }
        }
        below |= range[1] < -noise;
        above |= range[0] > noise;
    }
    below && above
}

/// Error bound of an edge. From any point of the tile, vertices are at most `across` and `down` away on the
/// two axes. So noise `a` and `b` of the vertices changes a product of two by at most `2 (a down + b across)
/// + 2 a b`.
///
/// Twice that includes rounding. The noise of a vertex is at least `ROUNDING` times the magnitudes of its
/// terms (see [`Seen`]), which are at least `across` and `down`: for a tile from `lo` to `hi`, `half` plus
/// the magnitude of the middle is that of the farther side. So the unused half is at least `4 ROUNDING across
/// down`. The magnitudes in an edge add up to at most twice `across down`, and none passes more than six
/// operations of 2^-53 each: 12 / 32 of `ROUNDING across down`.
fn noise<R: Real, const POSITIONS: usize>(
    seen: &Seen<R>,
    lens_positions: &[Points<R>; POSITIONS],
    half: [R; 2],
) -> R {
    let all = || lens_positions.as_flattened().as_flattened().iter();
    let [across, down] = [0, 1].map(|axis| {
        let far = |p: &[R; 3]| p[axis].magnitude() + half[axis] * p[2].magnitude();
        all().fold(R::new(0.0), |most, p| most.larger(far(p)))
    });
    let four = R::new(4.0);
    four * (seen.noise[0] * down + seen.noise[1] * across) + four * seen.noise[0] * seen.noise[1]
}

/// Bernstein coefficients in t of the cross product of vertices `i` and `j`.
fn normals<R: Real>(points: &Points<R>, i: usize, j: usize) -> [[R; 3]; 3] {
    let product = |a: usize, b: usize| cross(points[a][i], points[b][j]);
    let mixed = [product(0, 1), product(1, 0)];
    let middle = [0, 1, 2].map(|axis| R::new(0.5) * (mixed[0][axis] + mixed[1][axis]));
    [product(0, 0), middle, product(1, 1)]
}
