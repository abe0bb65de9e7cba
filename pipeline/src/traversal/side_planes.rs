//! The side planes of a tile over lens and time (Munkberg et al. 2011 in t, extended here to u and v).
//!
//! A vertex is beyond the left side of a tile at `(u, t)` where `d = x(t) + u (a w(t) - s) - X0 w(t) < 0`, and the
//! triangle is outside where all three are. `d` is bilinear in `(u, t)`, so the times that can matter are the hull over
//! the vertices of where `max(d(u_lo, t), d(u_hi, t)) >= 0`: two linear functions each. For `u` likewise with the ends
//! of `t`. A vertex behind the camera (`w < 0`) is beyond the side only when it is for every `X` of the tile, so both
//! edges of the tile are tried there.

use super::{Box5, TileRect};
use crate::geometry::Shear;
use crate::setup::Triangle;

/// Multiply-adds of testing the four sides once. For each side and vertex: a translation, and where there is a lens a
/// shear of two, at each corner of the (lens, time) rectangle in use; then a root and its mapping, two, for each linear
/// function of each variable in use.
pub const fn madds(moving: bool, lens: bool) -> u32 {
    let (times, places) = (1 + moving as u32, 1 + lens as u32);
    let values = times * places * if lens { 3 } else { 1 };
    let roots = moving as u32 * places + lens as u32 * times;
    4 * 3 * (values + 2 * roots)
}

/// The part of `within` in which `triangle` may touch `tile`, or `None` where it cannot.
pub fn narrow(triangle: &Triangle, shear: &Shear, tile: &TileRect, within: &Box5) -> Option<Box5> {
    let mut current = *within;
    for axis in [0, 1] {
        let [low, high] = if axis == 0 { tile.x } else { tile.y };
        for (edge, other, sign) in [(low, high, 1.0), (high, low, -1.0)] {
            let edges = if triangle.behind { [edge, other] } else { [edge, edge] };
            current = Side { triangle, shear, axis, edges, sign }.narrow(&current)?;
        }
    }
    Some(current)
}

/// One side of a tile: `sign` is 1 for the left or top one and -1 for the right or bottom one.
struct Side<'a> {
    triangle: &'a Triangle,
    shear: &'a Shear,
    axis: usize,
    edges: [f32; 2],
    sign: f32,
}

impl Side<'_> {
    fn narrow(&self, within: &Box5) -> Option<Box5> {
        let lens = match (within.lens, self.axis) {
            (false, _) => [0.0, 0.0],
            (true, 0) => within.u,
            (true, _) => within.v,
        };
        let slack = 2.0 * self.triangle.slack[self.axis];
        let (mut times, mut places) = (None, None);
        for corner in &self.triangle.corners {
            for edge in self.edges {
                let d = self.distances(corner.at(within.t[0]), corner.at(within.t[1]), lens, edge);
                for [opening, closing] in d {
                    times = union(times, above(within.t, opening, closing, slack));
                }
                for end in [0, 1] {
                    places = union(places, above(lens, d[0][end], d[1][end], slack));
                }
            }
        }
        let mut next = Box5 { t: times?, ..*within };
        if within.lens {
            *if self.axis == 0 { &mut next.u } else { &mut next.v } = places?;
        }
        Some(next)
    }

    /// How far a vertex lies to the inner side of `edge`, by end of the lens and end of the time interval.
    fn distances(&self, opening: [f32; 3], closing: [f32; 3], lens: [f32; 2], edge: f32) -> [[f32; 2]; 2] {
        lens.map(|place| {
            [opening, closing].map(|p| {
                let shift = place * (self.shear.a[self.axis] * p[2] - self.shear.s[self.axis]);
                self.sign * (p[self.axis] + shift - edge * p[2])
            })
        })
    }
}

/// The part of `range` where the linear function with the values `lo` and `hi` at its ends is at least `-slack`.
fn above(range: [f32; 2], lo: f32, hi: f32, slack: f32) -> Option<[f32; 2]> {
    let (lo, hi) = (lo + slack, hi + slack);
    match (lo >= 0.0, hi >= 0.0) {
        (true, true) => Some(range),
        (false, false) => None,
        (keeps_start, _) => {
            // The slack is twice the rounding of the values, which pays for that of the quotient as well; the nudge
            // pays for that of mapping it to the range.
            let root = range[0] + (range[1] - range[0]) * (lo / (lo - hi));
            let nudge = 4.0 * f32::EPSILON * range[0].abs().max(range[1].abs());
            Some(if keeps_start {
                [range[0], (root + nudge).min(range[1])]
            } else {
                [(root - nudge).max(range[0]), range[1]]
            })
        }
    }
}

fn union(a: Option<[f32; 2]>, b: Option<[f32; 2]>) -> Option<[f32; 2]> {
    match (a, b) {
        (Some(a), Some(b)) => Some([a[0].min(b[0]), a[1].max(b[1])]),
        (a, b) => a.or(b),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_part_above_zero() {
        assert_eq!(above([0.0, 1.0], 1.0, 2.0, 0.0), Some([0.0, 1.0]));
        assert_eq!(above([0.0, 1.0], -1.0, -2.0, 0.0), None);
        let [lo, hi] = above([0.0, 1.0], -1.0, 1.0, 0.0).unwrap();
        assert!((lo - 0.5).abs() < 1e-6 && lo <= 0.5 && hi == 1.0);
        let [lo, hi] = above([2.0, 4.0], 3.0, -1.0, 0.0).unwrap();
        assert!((hi - 3.5).abs() < 1e-5 && hi >= 3.5 && lo == 2.0);
    }
}
