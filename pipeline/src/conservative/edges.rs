//! The edges of a triangle over a tile, lens and time.
//!
//! Seen from a point of the tile and of the lens, with that point for origin, vertex `k` is `P_k`. Where the origin is in the
//! triangle, whatever its area, `P_i x P_j` are the weights of the third vertex times one number, so no two of them differ in sign. A tile
//! is culled when one edge is below zero everywhere and another above. `P_i x P_j` is linear in each of X, u, Y and v and
//! quadratic in t, so its values at their corners, and in t its three Bernstein coefficients, bound it.

use super::Region;
use super::seen::Seen;

/// One coordinate of the three vertices at both ends of the time, for each corner of side and lens.
struct Corners {
    values: [[[f64; 2]; 3]; 4],
    count: usize,
    reach: f64,
}

/// Whether two edges say that the triangle cannot touch the tile.
pub(super) fn miss(seen: &Seen, region: &Region) -> bool {
    let (across, down) = (corners(seen, 0, region.u), corners(seen, 1, region.v));
    let noise = 4.0 * (seen.noise[0] * down.reach + seen.noise[1] * across.reach)
        + 4.0 * seen.noise[0] * seen.noise[1]
        + super::seen::ROUNDING * across.reach * down.reach;
    let (mut below, mut above) = (false, false);
    for (i, j) in [(1, 2), (2, 0), (0, 1)] {
        let [lo, hi] = edge(&across, &down, i, j);
        below |= hi < -noise;
        above |= lo > noise;
    }
    below && above
}

fn corners(seen: &Seen, axis: usize, lens: [f64; 2]) -> Corners {
    let mut found = Corners { values: [[[0.0; 2]; 3]; 4], count: 0, reach: 0.0 };
    let places = if seen.view.has_lens() { &lens[..] } else { &lens[..1] };
    for &place in places {
        for side in seen.tile[axis] {
            let values = [0, 1, 2].map(|k| [0, 1].map(|end| seen.from(axis, k, end, place, side)));
            found.reach = values.iter().flatten().fold(found.reach, |reach, value| reach.max(value.abs()));
            found.values[found.count] = values;
            found.count += 1;
        }
    }
    found
}

/// Between what the edge from vertex `i` to `j` lies.
fn edge(across: &Corners, down: &Corners, i: usize, j: usize) -> [f64; 2] {
    let mut range = [f64::INFINITY, f64::NEG_INFINITY];
    for x in &across.values[..across.count] {
        for y in &down.values[..down.count] {
            let product = |a: usize, b: usize| x[i][a] * y[j][b] - x[j][a] * y[i][b];
            for value in [product(0, 0), 0.5 * (product(0, 1) + product(1, 0)), product(1, 1)] {
                range = [range[0].min(value), range[1].max(value)];
            }
        }
    }
    range
}
