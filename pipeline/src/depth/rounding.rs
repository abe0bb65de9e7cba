//! Distance between the depth of the sample test and the plane of the triangle, caused by rounding.
//!
//! The sample test rounds the vertices as seen from the sample to `P_k` and is exact for these points. Its
//! depth is `sum(e_k w_k) / sum(e_k)` with rounded edges `e_k = E_k + d_k`. The weights `e_k / sum(e)` are
//! not negative, so the weighted mean of the vertices is a point of the triangle, and every bound on the
//! triangle holds for it. This point is slightly off the ray: as `sum(E_k P_k) = 0`, its distance is
//!
//! ```text
//! sum(d_k P_k) / sum(e_k)  + the rounding of P_k itself, half the slack
//! ```
//!
//! Seen from a sample inside, no vertex is farther than the extent `(l_x, l_y)` of the rounded triangle. So
//! with `u = 2^-24`, `|d_k| < 4.02 u l_x l_y`. And `sum(e)` is `N . G`, twice the area as seen, with the
//! normal `N` at the sample's own time and its ray `G`. It is quadratic in time, so its Bernstein
//! coefficients bound it. Rounding reduces it by at most `3 (slack_x l_y + slack_y l_x)` for the vertices
//! (each of six products of two vertices, each off by half a slack either way) plus `sum |d_k|`. If nothing
//! remains, as for slivers and for triangles whose facing may change, there is no bound.

use super::number::{Real, cross, hull};
use super::plane::{Beam, Points, sides};

/// Half an ulp of `f32`, relative.
const HALF_ULP: f64 = 1.0 / 16_777_216.0;

/// Upper bound of the loss when one product of `f32` falls below the normal range.
const UNDERFLOW_LOSS: f64 = f32::MIN_POSITIVE as f64 * HALF_ULP;

/// Products of two lengths and a depth above this may overflow in the sample test.
const OVERFLOW_LIMIT: f64 = 1.0e36;

/// Bound of the depth error at a sample.
#[derive(Clone, Copy, Debug)]
pub(super) struct Margin<R> {
    /// Largest distance in x and y between the ray and the point whose depth is computed.
    pub off: [R; 2],
    /// Largest error of its depth by rounding after that.
    pub depth: R,
}

/// Margin of a triangle with the given vertices at the two ends of a time interval (one end if it is still),
/// with the slack of its set-up; `deepest` bounds the depth of the vertices. `None` if its area as seen may
/// be a rounding error.
pub(super) fn margin<R: Real>(
    ends: &[Points<R>],
    beam: &Beam<R>,
    slack: [R; 2],
    deepest: R,
) -> Option<Margin<R>> {
    let slopes = beam.slopes();
    let [wide, high] = [0, 1].map(|axis| extent(ends, axis, slopes[axis]) + slack[axis]);
    let unsure = R::new(13.0 * HALF_ULP).madd(wide * high, R::new(UNDERFLOW_LOSS));
    let rounded = R::new(3.0).madd(slack[0].madd(high, slack[1] * wide), unsure);
    let area = seen_area(ends, &slopes) - rounded;
    if area <= R::new(0.0) || wide * high * deepest > R::new(OVERFLOW_LIMIT) {
        return None;
    }
    let half = R::new(0.5);
    let off = [half.madd(slack[0], unsure * wide / area), half.madd(slack[1], unsure * high / area)];
    Some(Margin { off, depth: R::new(9.0 * HALF_ULP).madd(deepest, R::new(UNDERFLOW_LOSS) / area) })
}

/// Largest extent along `axis` of the triangle, seen along a ray with a slope in the range, at either end.
fn extent<R: Real>(ends: &[Points<R>], axis: usize, slope: [R; 2]) -> R {
    let mut largest = R::new(0.0);
    for points in ends {
        for (i, j) in [(1, 0), (2, 0), (2, 1)] {
            let (across, deep) = (points[i][axis] - points[j][axis], points[j][2] - points[i][2]);
            for g in slope {
                largest = largest.larger(g.madd(deep, across).magnitude());
            }
        }
    }
    largest
}

/// Lower bound of twice the area as seen, for either facing; 0 or less if the facing may change.
fn seen_area<R: Real>(ends: &[Points<R>], slopes: &[[R; 2]; 2]) -> R {
    let first = sides(&ends[0]);
    let seen = |n: [R; 3]| {
        let [x, y] = [0, 1].map(|axis| {
            let ends = slopes[axis].map(|g| n[axis] * g);
            [ends[0].smaller(ends[1]), ends[0].larger(ends[1])]
        });
        [x[0] + y[0] + n[2], x[1] + y[1] + n[2]]
    };
    let mut range = seen(cross(first[0], first[1]));
    if let Some(last) = ends.get(1).map(sides) {
        range = hull(range, seen(cross(last[0], last[1])));
        let (a, b) = (cross(first[0], last[1]), cross(last[0], first[1]));
        range = hull(range, seen([0, 1, 2].map(|i| R::new(0.5) * (a[i] + b[i]))));
    }
    range[0].larger(-range[1])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::{mix, unit};

    struct Numbers(u64);

    impl Numbers {
        fn within(&mut self, lo: f64, hi: f64) -> f64 {
            self.0 += 1;
            lo + (hi - lo) * unit(mix(self.0))
        }

        fn points(&mut self, reach: f64) -> Points<f64> {
            [(); 3].map(|()| [self.within(-reach, reach), self.within(-reach, reach), self.within(1.0, 4.0)])
        }
    }

    /// Twice the signed area of the triangle at `t` between two ends, seen with slope `g`, and its extents.
    fn seen_at(ends: &[Points<f64>; 2], t: f64, g: [f64; 2]) -> (f64, [f64; 2]) {
        let p = [0, 1, 2].map(|k| {
            let at = [0, 1, 2].map(|axis| ends[0][k][axis] + t * (ends[1][k][axis] - ends[0][k][axis]));
            [0, 1].map(|axis| at[axis] - g[axis] * at[2])
        });
        let side = |i: usize, axis: usize| p[i][axis] - p[0][axis];
        let extent = |axis: usize| {
            let all = p.map(|p| p[axis]);
            all.iter().fold(f64::MIN, |a, &b| a.max(b)) - all.iter().fold(f64::MAX, |a, &b| a.min(b))
        };
        (side(1, 0) * side(2, 1) - side(2, 0) * side(1, 1), [extent(0), extent(1)])
    }

    #[test]
    fn area_and_extent_hold_over_the_whole_box() {
        let (mut r, mut certain, mut turned_twice) = (Numbers(1), 0, 0);
        for _ in 0..3000 {
            let ends = [r.points(6.0), r.points(6.0)];
            let slopes = [0, 1].map(|_| {
                let lo = r.within(-1.0, 1.0);
                [lo, lo + r.within(0.0, 0.1)]
            });
            let area = seen_area(&ends, &slopes);
            let extents = [0, 1].map(|axis| extent(&ends, axis, slopes[axis]));
            certain += u32::from(area > 0.0);
            let middle = slopes.map(|[lo, hi]| 0.5 * (lo + hi));
            let signs = [0.0, 0.5, 1.0].map(|t| seen_at(&ends, t, middle).0 > 0.0);
            turned_twice += u32::from(signs[0] != signs[1] && signs[1] != signs[2]);
            for _ in 0..40 {
                let (t, g) = (r.within(0.0, 1.0), slopes.map(|[lo, hi]| r.within(lo, hi)));
                let (found, wide) = seen_at(&ends, t, g);
                assert!(found.abs() >= area - 1e-9, "{found} {area}");
                assert!((0..2).all(|axis| wide[axis] <= extents[axis] + 1e-9), "{wide:?} {extents:?}");
            }
        }
        assert!(certain > 300 && turned_twice > 100, "{certain} {turned_twice}");
    }

    /// For edges of `f32` vertices around a sample, rounded as in the sample test, the weighted mean is
    /// within the margin of a triangle whose vertices are exact.
    #[test]
    fn weights_are_off_by_no_more_than_the_margin() {
        let (mut r, mut checked, mut closest) = (Numbers(2), 0, 0.0_f64);
        for _ in 0..400_000 {
            let thin = r.within(-12.0, 0.0).exp2();
            let p = r.points(1.0).map(|[x, y, _]| [x as f32, (x + thin * y) as f32, 1.0]);
            let e = [(1, 2), (2, 0), (0, 1)].map(|(i, j)| f64::from(p[i][0] * p[j][1] - p[j][0] * p[i][1]));
            if !(e.iter().all(|&e| e > 0.0) || e.iter().all(|&e| e < 0.0)) {
                continue;
            }
            let ends = [p.map(|p| p.map(f64::from))];
            let Some(margin) = margin(&ends, &Beam::pinhole([[0.0; 2]; 2]), [0.0; 2], 1.0) else { continue };
            let sum: f64 = e.iter().sum();
            for axis in [0, 1] {
                let off = (0..3).map(|k| e[k] * ends[0][k][axis]).sum::<f64>() / sum;
                assert!(off.abs() <= margin.off[axis], "{off} {margin:?}");
                closest = closest.max(off.abs() / margin.off[axis]);
            }
            checked += 1;
        }
        assert!(checked > 10_000 && closest > 0.03, "{checked}, as near as {closest} to the margin");
    }

    #[test]
    fn a_triangle_as_thin_as_the_rounding_of_its_vertices_has_no_margin() {
        let beam = Beam::pinhole([[0.0; 2]; 2]);
        let thin = |height: f64| [[[0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [0.5, height, 1.0]]];
        // Twice the area is the height; each of six products may be off by half a slack times an extent of
        // about one.
        let margin = |height: f64| margin(&thin(height), &beam, [1e-6, 1e-6], 1.0);
        assert!(margin(2.9e-6).is_none());
        assert!(margin(1e-3).is_some_and(|margin| margin.off[0] > 5e-7 && margin.off[0] < 1e-2));
    }
}
