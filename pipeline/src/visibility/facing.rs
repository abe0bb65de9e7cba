//! Facing of a triangle as a polynomial of lens and time.
//!
//! With the vertices `p_k = (x, y, w)`, sheared to the lens position `(u, v)`,
//!
//! ```text
//! det(u, v, t) = det[x, y, w] - u s.x sum(y_i w_j - y_j w_i) - v s.y sum(w_i x_j - w_j x_i)
//! ```
//!
//! since the part of the shear that grows with depth adds a multiple of one row to another. The first term is
//! cubic in `t`, the sums are quadratic. The edge functions weighted by depth add up to `det`. So a sample
//! inside, beyond the near depth, sees all edges with the sign of `det`, and the face is known before any
//! sample is tested.

use crate::geometry::Shear;
use crate::setup::{Corner, cross};

/// Facing determinant of a triangle, by powers of `t`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Facing {
    /// Part independent of the lens.
    pub constant: [f32; 4],
    /// Factors of `u` and `v`.
    pub lens: [[f32; 3]; 2],
}

type Point = [f64; 3];

impl Facing {
    /// Computed in `f64` and rounded to `f32`. Each coefficient is within 2^-24 of itself plus 2^-48 of the
    /// products in it.
    pub fn new(corners: &[Corner; 3], shear: &Shear) -> Self {
        let open = corners.map(|corner| corner.open.map(f64::from));
        let delta = corners.map(|corner| corner.delta.map(f64::from));
        let normal = |i: usize, j: usize| {
            [cross(open[i], open[j]), mixed(i, j, &open, &delta), cross(delta[i], delta[j])]
        };
        let normals = [normal(1, 2), normal(2, 0), normal(0, 1)];
        let mut constant = [0.0; 4];
        for (power, part) in constant.iter_mut().enumerate() {
            // The determinant is the first vertex times the normal of the opposite edge.
            let still = if power < 3 { dot(open[0], normals[0][power]) } else { 0.0 };
            let moved = if power > 0 { dot(delta[0], normals[0][power - 1]) } else { 0.0 };
            *part = (still + moved) as f32;
        }
        let lens = [0, 1].map(|axis| {
            let s = f64::from(shear.s[axis]);
            [0, 1, 2].map(|power| -(s * normals.iter().map(|n| n[power][axis]).sum::<f64>()) as f32)
        });
        Self { constant, lens }
    }
}

fn mixed(i: usize, j: usize, open: &[Point; 3], delta: &[Point; 3]) -> Point {
    let (a, b) = (cross(open[i], delta[j]), cross(delta[i], open[j]));
    [0, 1, 2].map(|axis| a[axis] + b[axis])
}

fn dot(a: Point, b: Point) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::MovingVertex;

    #[test]
    fn the_polynomial_is_the_determinant_of_the_sheared_vertices() {
        let shear = Shear::new([3.0, -3.0], [0.5, -0.5]);
        let ends = [
            ([1.0, 2.0, 4.0], [2.0, -1.0, 5.0]),
            ([-3.0, 0.5, 6.0], [0.0, 1.0, -2.0]),
            ([2.0, -4.0, 3.0], [1.0, 1.0, 7.0]),
        ];
        let corners = ends.map(|(open, close)| Corner::new(&MovingVertex { open, close }));
        let facing = Facing::new(&corners, &shear);
        for (u, v, t) in [(0.0, 0.0, 0.0), (0.5, -0.25, 0.25), (-1.0, 0.75, 0.5), (0.3, 0.9, 1.0)] {
            let p = corners.map(|corner| {
                let [x, y, w] = corner.at(t as f32).map(f64::from);
                [x + u * (0.5 * w - 3.0), y + v * (-0.5 * w + 3.0), w]
            });
            let horner = |c: &[f32]| c.iter().rev().fold(0.0, |sum, &c| sum * t + f64::from(c));
            let ours = horner(&facing.constant) + u * horner(&facing.lens[0]) + v * horner(&facing.lens[1]);
            let expected = dot(p[0], cross(p[1], p[2]));
            assert!((ours - expected).abs() < 1e-4, "{ours} {expected} at {u} {v} {t}");
        }
    }
}
