//! The refined bound for warped beams.
//!
//! A bilinear side lies in the tetrahedron of its four corners, so the two faces of that which are farther out bound it. Where
//! the Jacobian of a beam has one sign, the body of these faces and both ends winds once about every point of the beam, and at least once
//! with what lies between its sides and these faces, so every ray that meets the beam meets a back face. Where light crosses itself
//! *outside* is another side than before, and the bound as published loses light; there the beam is cut, and the part in which sides
//! cross is put into its hull.

use super::hull;
use super::{Beam, Body};

/// Adds the faces of every part.
pub(super) fn faces(beam: &Beam, into: &mut Body) {
    for ends in beam.cuts().windows(2) {
        let part = beam.part(ends[0], ends[1]);
        match beam.sign(0.5 * (ends[0] + ends[1])) {
            Some(sign) => outer(&part, sign, into),
            None => hull::faces(&part, into),
        }
    }
}

/// Adds the ends and outer faces of the whole beam, as if it never folded.
pub(super) fn uncut(beam: &Beam, into: &mut Body) {
    let folds = beam.cuts();
    let first = beam.sign(0.5 * (folds[0] + folds[1]));
    outer(beam, first.unwrap_or(1.0), into);
}

/// The ends and outer faces of a part that does not fold, its Jacobian having this sign.
fn outer(part: &Beam, sign: f64, into: &mut Body) {
    let (v, p) = (&part.open, &part.close);
    let mut face = |a, b, c| into.push(if sign > 0.0 { [a, b, c] } else { [a, c, b] });
    face(v[0], v[2], v[1]);
    face(p[0], p[1], p[2]);
    for (i, j) in [(0, 1), (1, 2), (2, 0)] {
        let outward = (v[j] - v[i]).cross(p[i] - v[i]);
        if sign * outward.dot(p[j] - v[i]) > 0.0 {
            face(v[i], v[j], p[j]);
            face(v[i], p[j], p[i]);
        } else {
            face(v[i], v[j], p[i]);
            face(v[j], p[j], p[i]);
        }
    }
}
