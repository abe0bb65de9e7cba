//! The convex hull of the corners of a beam.

use super::{Beam, Body, corners};

/// Parts of the size of a beam that rounding may move a corner out of a plane by.
const FLAT: f64 = 1e-12;

/// Adds the faces of the hull. Where more than three corners lie in one plane every triangle of them is a face.
pub(super) fn faces(beam: &Beam, into: &mut Body) {
    let points = corners(beam);
    let size = points.iter().map(|p| (*p - points[0]).length()).fold(0.0, f64::max);
    for i in 0..6 {
        for j in i + 1..6 {
            for k in j + 1..6 {
                let (a, b, c) = (points[i], points[j], points[k]);
                let normal = (b - a).cross(c - a);
                let slack = FLAT * size * normal.length();
                let beside = || (0..6).filter(|n| ![i, j, k].contains(n)).map(|n| normal.dot(points[n] - a));
                if beside().all(|side| side <= slack) {
                    into.push([a, b, c]);
                } else if beside().all(|side| side >= -slack) {
                    into.push([a, c, b]);
                }
            }
        }
    }
}
