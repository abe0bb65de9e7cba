//! Whether two triangles cross or share a corner at an instant. Never trusted to say no: where it says yes, a pair need not be
//! looked at any closer.

use glam::DVec3;

use super::bounds::Ends;

/// The corners at time `t`.
fn at(ends: &Ends, t: f64) -> [DVec3; 3] {
    [0, 1, 2].map(|corner| DVec3::from(ends[0][corner]).lerp(DVec3::from(ends[1][corner]), t))
}

/// Whether an edge of one of the triangles passes through the other at time `t`, or both have a corner in the same place, as far as
/// rounding can tell.
pub(super) fn cross(a: &Ends, b: &Ends, t: f64) -> bool {
    let (a, b) = (at(a, t), at(b, t));
    if a.iter().any(|corner| b.contains(corner)) {
        return true;
    }
    // Most lie on one side of the other's plane.
    if !on_both_sides(&a, &b) || !on_both_sides(&b, &a) {
        return false;
    }
    let edges = |p: [DVec3; 3]| [[p[0], p[1]], [p[1], p[2]], [p[2], p[0]]];
    edges(a).iter().any(|edge| pierces(edge, &b)) || edges(b).iter().any(|edge| pierces(edge, &a))
}

/// Whether `points` lie on both sides of the plane of a triangle, as computed.
fn on_both_sides([a, b, c]: &[DVec3; 3], points: &[DVec3; 3]) -> bool {
    let normal = (b - a).cross(c - a);
    let sides = points.map(|point| normal.dot(point - a));
    sides.iter().any(|&side| side > 0.0) && sides.iter().any(|&side| side < 0.0)
}

/// Whether a segment passes through a triangle, beyond what rounding could make of one that does not.
fn pierces(segment: &[DVec3; 2], triangle: &[DVec3; 3]) -> bool {
    let volume = |d: DVec3, e: DVec3, f: DVec3| d.cross(e).dot(f);
    // Most do not even as computed; only of the others is it asked by how much.
    passes(segment, triangle, volume) && {
        let [p, q] = segment;
        let corners = [p, q].into_iter().chain(triangle);
        let size = corners.fold(0.0, |size: f64, p| size.max(p.abs().max_element()));
        // What a corner at an instant is off by, and so a difference of two.
        let off = 8.0 * f64::EPSILON * size;
        passes(segment, triangle, |d, e, f| {
            let computed = volume(d, e, f);
            let [d, e, f] = [d, e, f].map(|side| side.abs().element_sum());
            let margin = off * (d * e + e * f + f * d) + 8.0 * f64::EPSILON * d * e * f;
            if computed.abs() > 2.0 * margin { computed } else { 0.0 }
        })
    }
}

/// The ends on both sides of the plane, and the triangle around the segment, by signed volumes.
fn passes(
    &[p, q]: &[DVec3; 2],
    &[a, b, c]: &[DVec3; 3],
    volume: impl Fn(DVec3, DVec3, DVec3) -> f64,
) -> bool {
    let side = |point: DVec3| volume(b - a, c - a, point - a);
    let (one, other) = (side(p), side(q));
    if !(one > 0.0 && other < 0.0 || one < 0.0 && other > 0.0) {
        return false;
    }
    let around = [(a, b), (b, c), (c, a)].map(|(d, e)| volume(q - p, d - p, e - p));
    around.iter().all(|&turn| turn > 0.0) || around.iter().all(|&turn| turn < 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DQuat;

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

    #[test]
    fn what_only_touches_or_lies_in_one_plane_does_not_cross() {
        let turn = DQuat::from_axis_angle(DVec3::new(1.0, 2.0, -0.5).normalize(), 0.7);
        let wall = |x: f64| [[0.5, x, 0.0], [0.5, x + 1.0, 0.2], [0.5, x, 1.0]];
        let posed = |ends: [[f64; 3]; 3]| ends.map(|p| (turn * DVec3::from(p)).to_array());
        for n in 1..100 {
            let x = f64::from(n) * 0.01;
            let (one, other) = ([posed(wall(0.0)); 2], [posed(wall(x - 0.5)), posed(wall(x + 0.5))]);
            assert!(!cross(&one, &other, 0.5), "{x}");
        }
    }

    #[test]
    fn a_corner_of_both_is_a_contact_while_it_is() {
        let one = [[0.25, 0.5, 0.75], [1.25, 0.5, 0.75], [0.25, 1.5, 0.75]];
        let other = |y: f64| [[-0.75, y, 0.5], [0.25, y, 0.75], [-0.75, y, 1.0]];
        let passing = [other(1.5), other(-0.5)];
        assert!(cross(&[one; 2], &passing, 0.5) && !cross(&[one; 2], &passing, 0.25));
        assert!(cross(&[one; 2], &[one; 2], 0.3), "in one plane, too");
    }
}
