//! How far the depth of the sample test may be from the plane of the triangle.
//!
//! The sample test rounds the vertices as seen from the sample to `P_k`, is exact for these, and takes the depth
//! `sum(e_k w_k) / sum(e_k)` with rounded edges `e_k = E_k + d_k`. The weights `e_k / sum(e)` are not negative, so the
//! weighted mean of the vertices is a point of the triangle, and every bound on the triangle holds for it. It is not quite on
//! the ray: as `sum(E_k P_k) = 0`, it is off by
//!
//! ```text
//! sum(d_k P_k) / sum(e_k)  + the rounding of P_k itself, half the slack
//! ```
//!
//! Seen from a sample inside, no vertex is farther than the extent `(l_x, l_y)` of the rounded triangle; so with `u = 2^-24`
//! `|d_k| < 4.02 u l_x l_y`. And `sum(e)` is `N . G`, twice the area as seen, with `N` the normal at the sample's own time
//! and `G` its ray: quadratic in time, so its Bernstein coefficients bound it. What rounding takes off it is
//! `3 (slack_x l_y + slack_y l_x)` for the vertices (each of six products of two of them, off by half a slack either
//! way) and `sum |d_k|`. Where nothing is left, as for slivers and where the facing may change, there is no bound.

use super::number::{Real, cross, hull};
use super::plane::{Beam, Points, sides};

/// Half a unit in the last place of `f32`, relative.
const UNIT: f64 = 1.0 / 16_777_216.0;

/// More than what is lost when one product of `f32` falls below the normal range.
const TINY: f64 = f32::MIN_POSITIVE as f64 * UNIT;

/// Products of two lengths and a depth beyond this may overflow in the sample test.
const HUGE: f64 = 1.0e36;

/// How far the depth of a sample may be off.
#[derive(Clone, Copy, Debug)]
pub(super) struct Margin<R> {
    /// How far in x and in y the point whose depth is computed may be from the ray.
    pub off: [R; 2],
    /// What rounding then does to its depth.
    pub depth: R,
}

/// The margin of a triangle with these vertices at the two ends of a time interval (one where it is still), with the slack of
/// its set-up and no vertex deeper than `deepest`. `None` where its area as seen may be rounding.
pub(super) fn margin<R: Real>(
    ends: &[Points<R>],
    beam: &Beam<R>,
    slack: [R; 2],
    deepest: R,
) -> Option<Margin<R>> {
    let slopes = beam.slopes();
    let [wide, high] = [0, 1].map(|axis| extent(ends, axis, slopes[axis]) + slack[axis]);
    let unsure = R::new(13.0 * UNIT).madd(wide * high, R::new(TINY));
    let rounded = R::new(3.0).madd(slack[0].madd(high, slack[1] * wide), unsure);
    let area = seen_area(ends, &slopes) - rounded;
    if area <= R::new(0.0) || wide * high * deepest > R::new(HUGE) {
        return None;
    }
    let half = R::new(0.5);
    let off = [half.madd(slack[0], unsure * wide / area), half.madd(slack[1], unsure * high / area)];
    Some(Margin { off, depth: R::new(9.0 * UNIT).madd(deepest, R::new(TINY) / area) })
}

/// The largest extent along `axis` of the triangle as seen from a ray with a slope in the range, at either end.
fn extent<R: Real>(ends: &[Points<R>], axis: usize, slope: [R; 2]) -> R {
    let mut largest = R::new(0.0);
    for points in ends {
        for (i, j) in [(1, 0), (2, 0), (2, 1)] {
            let (across, deep) = (points[i][axis] - points[j][axis], points[j][2] - points[i][2]);
            for g in slope {
                largest = largest.most(g.madd(deep, across).size());
            }
        }
    }
    largest
}

/// A lower bound on twice the area as seen, whichever way it faces; not above zero where it may change.
fn seen_area<R: Real>(ends: &[Points<R>], slopes: &[[R; 2]; 2]) -> R {
    let first = sides(&ends[0]);
    let seen = |n: [R; 3]| {
        let [x, y] = [0, 1].map(|axis| {
            let ends = slopes[axis].map(|g| n[axis] * g);
            [ends[0].least(ends[1]), ends[0].most(ends[1])]
        });
        [x[0] + y[0] + n[2], x[1] + y[1] + n[2]]
    };
    let mut range = seen(cross(first[0], first[1]));
    if let Some(last) = ends.get(1).map(sides) {
        range = hull(range, seen(cross(last[0], last[1])));
        let (a, b) = (cross(first[0], last[1]), cross(last[0], first[1]));
        range = hull(range, seen([0, 1, 2].map(|i| R::new(0.5) * (a[i] + b[i]))));
    }
    range[0].most(-range[1])
}
