//! Whether two triangles cross at an instant. Never trusted to say no: where it says yes, a pair need not be looked at any closer.

use glam::DVec3;

use super::object::Ends;

/// The corners at time `t`.
fn at(ends: &Ends, t: f64) -> [DVec3; 3] {
    [0, 1, 2].map(|corner| DVec3::from(ends[0][corner]).lerp(DVec3::from(ends[1][corner]), t))
}

/// Whether an edge of one of the triangles passes through the other at time `t`, as far as rounding can tell.
pub(super) fn cross(a: &Ends, b: &Ends, t: f64) -> bool {
    let (a, b) = (at(a, t), at(b, t));
    let edges = |p: [DVec3; 3]| [[p[0], p[1]], [p[1], p[2]], [p[2], p[0]]];
    edges(a).iter().any(|edge| pierces(edge, &b)) || edges(b).iter().any(|edge| pierces(edge, &a))
}

/// Whether a segment passes through a triangle: its ends on both sides of the plane, and the triangle around it (signed volumes).
fn pierces(&[p, q]: &[DVec3; 2], [a, b, c]: &[DVec3; 3]) -> bool {
    let volume = |d: DVec3, e: DVec3, f: DVec3| d.cross(e).dot(f);
    let side = |point: DVec3| volume(*b - *a, *c - *a, point - *a);
    if side(p) * side(q) >= 0.0 {
        return false;
    }
    let around = [(*a, *b), (*b, *c), (*c, *a)].map(|(d, e)| volume(q - p, d - p, e - p));
    around.iter().all(|&turn| turn > 0.0) || around.iter().all(|&turn| turn < 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_passes_through_crosses_while_it_does() {
        let floor = [[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [0.0, 1.0, 0.0]];
        let blade = |z: f64| [[0.0, 0.0, z], [0.1, 0.0, z + 0.5], [-0.1, 0.0, z + 0.5]];
        let (still, falling) = ([floor; 2], [blade(1.0), blade(-1.0)]);
        assert!(
            !cross(&still, &falling, 0.25) && cross(&still, &falling, 0.6) && !cross(&still, &falling, 0.9)
        );
        assert!(cross(&falling, &still, 0.6));
    }
}
