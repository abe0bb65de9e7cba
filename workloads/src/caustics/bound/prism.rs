//! The prism with touching planes.
//!
//! Its caps are the plane of the generator (moved back where the beam goes behind it) and the parallel plane through the farthest end. A side
//! goes through an edge of the generator and touches the end triangle. Where there is no such side, or two sides are so nearly parallel
//! that their corner is out of all proportion, the hull takes its place.

use glam::DVec3;

use super::{Beam, Body, corners, hull};

/// Sides that enclose an angle whose sine is less than this are parallel.
const PARALLEL: f64 = 1e-6;
/// Parts of a length that rounding may move a touching point out by.
const TOUCHING: f64 = 1e-9;

/// Adds the faces.
pub(super) fn faces(beam: &Beam, into: &mut Body) {
    let Some([base, top]) = ends(beam) else { return hull::faces(beam, into) };
    let outward = (base[1] - base[0]).cross(base[2] - base[0]).dot(top[0] - base[0]) > 0.0;
    let mut face = |a, b, c| into.push(if outward { [a, b, c] } else { [a, c, b] });
    face(base[0], base[2], base[1]);
    face(top[0], top[1], top[2]);
    for (i, j) in [(0, 1), (1, 2), (2, 0)] {
        face(base[i], base[j], top[j]);
        face(base[i], top[j], top[i]);
    }
}

/// The corners of both caps.
fn ends(beam: &Beam) -> Option<[[DVec3; 3]; 2]> {
    let v = &beam.open;
    let normal = (v[1] - v[0]).cross(v[2] - v[0]).try_normalize()?;
    let sum: f64 = (0..3).map(|k| normal.dot(beam.path(k))).sum();
    let normal = if sum < 0.0 { -normal } else { normal };
    let heights = beam.close.map(|p| normal.dot(p - v[0]));
    let far = heights.into_iter().fold(0.0, f64::max);
    let near = heights.into_iter().fold(0.0, f64::min);
    let sides = [side(beam, 1, 2)?, side(beam, 2, 0)?, side(beam, 0, 1)?];
    // At corner k the sides of its two edges meet.
    let corner = |k: usize, height: f64| {
        let along = sides[(k + 1) % 3].cross(sides[(k + 2) % 3]);
        let rise = along.dot(normal);
        (along.length() > PARALLEL && rise.abs() > PARALLEL * along.length())
            .then(|| v[k] + along * (height / rise))
    };
    let cap = |height: f64| Some([corner(0, height)?, corner(1, height)?, corner(2, height)?]);
    let (base, top) = (cap(near)?, cap(far)?);
    let area = |x: &[DVec3; 3]| (x[1] - x[0]).cross(x[2] - x[0]).dot(normal);
    // Sides that meet before the far cap, or behind the near one, turn it inside out.
    (area(&base) * area(v) > 0.0 && area(&top) * area(v) > 0.0 && far > near).then_some([base, top])
}

/// The outward unit normal of the plane through corners `i` and `j` of the generator and one of the end triangle that has all else on its inner
/// side.
fn side(beam: &Beam, i: usize, j: usize) -> Option<DVec3> {
    let (v, opposite) = (&beam.open, 3 - i - j);
    let touching = |through: DVec3| {
        let normal = (v[j] - v[i]).cross(through - v[i]).try_normalize()?;
        let inner = normal.dot(v[opposite] - v[i]);
        let normal = if inner > 0.0 { -normal } else { normal };
        let inside = |p: &DVec3| normal.dot(*p - v[i]) <= TOUCHING * (*p - v[i]).length();
        (inner != 0.0 && corners(beam).iter().all(inside)).then_some(normal)
    };
    [i, j, opposite].into_iter().find_map(|k| touching(beam.close[k]))
}
