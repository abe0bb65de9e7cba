//! Bounding volumes of beams, which are rasterized to find the pixels that a beam may light.
//!
//! The bounding volumes are implemented from descriptions of the papers; the full texts were not available
//! (see the book).

use glam::DVec3;
use pipeline::Lane;

use super::Beam;

/// How a beam is rasterized.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum BeamMethod {
    /// A moving triangle, with the exact times at each pixel (thesis, Paper VI).
    #[default]
    Moving,
    /// Tetrahedra around the beam's sides, cut where it folds (after Liktor and Dachsbacher 2011, "Real-time
    /// volume caustics with adaptive beam tracing").
    Refined,
    /// The same without cuts, as published. It loses light where a beam folds, so it is for comparison only
    /// and not an option.
    #[serde(skip)]
    Uncut,
    /// The convex hull of the corners.
    Hull,
    /// A prism with touching planes (after Ernst, Akenine-Moeller and Jensen 2005, "Interactive rendering of
    /// caustics using interpolated warped volumes").
    Prism,
}

/// A bounding volume of a beam or a part of it: triangles of consistent orientation, normals outward.
pub(super) type BoundingVolume = Vec<[DVec3; 3]>;

impl BeamMethod {
    /// All methods that lose no light; the paper's comes first.
    pub const ALL: [Self; 4] = [Self::Moving, Self::Refined, Self::Hull, Self::Prism];

    /// Name in files and images.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Moving => "moving triangle",
            Self::Refined => "refined bound",
            Self::Uncut => "refined bound, uncut",
            Self::Hull => "convex hull",
            Self::Prism => "prism",
        }
    }

    /// Faces of the bounding volumes of a beam; none for the moving triangle.
    pub(super) fn bounding_volumes(self, lane: &Lane, beam: &Beam, into: &mut BoundingVolume) {
        into.clear();
        match self {
            Self::Moving => {}
            Self::Refined => refined_faces(lane, beam, into),
            Self::Uncut => uncut_faces(lane, beam, into),
            Self::Hull => hull_faces(lane, beam, into),
            Self::Prism => prism_faces(lane, beam, into),
        }
    }
}

/// Six corners of a beam.
fn corners(beam: &Beam) -> [DVec3; 6] {
    let ([a, b, c], [d, e, f]) = (beam.open, beam.close);
    [a, b, c, d, e, f]
}

fn length(lane: &Lane, vector: DVec3) -> f64 {
    lane.root(lane.dot(vector, vector))
}

/// The vector of length 1; `None` for zero.
fn unit(lane: &Lane, vector: DVec3) -> Option<DVec3> {
    let inverse = lane.div(1.0, length(lane, vector));
    let has_direction = lane.branch(inverse.is_finite() && inverse > 0.0);
    has_direction.then(|| lane.mul(vector, DVec3::splat(inverse)))
}

/// Normal of a triangle, as long as twice its area.
fn normal(lane: &Lane, [a, b, c]: [DVec3; 3]) -> DVec3 {
    lane.cross(lane.sub(b, a), lane.sub(c, a))
}

/// Rounding error of a corner's distance from a plane, relative to the size of the beam.
const COPLANAR: f64 = 1e-12;

/// Adds the faces of the hull. More than three corners in one plane are one face, whose triangles do not overlap.
fn hull_faces(lane: &Lane, beam: &Beam, into: &mut BoundingVolume) {
    let points = corners(beam);
    let size = points.iter().fold(0.0, |most: f64, p| lane.max(most, length(lane, lane.sub(*p, points[0]))));
    let mut found: Vec<[usize; 3]> = Vec::new();
    for i in 0..6 {
        for j in i + 1..6 {
            for k in j + 1..6 {
                let Some((face, in_plane)) = supporting(lane, &points, size, [i, j, k]) else { continue };
                let triangle = face.map(|n| points[n]);
                // All triangles of the plane that overlap no other fill its polygon.
                let is_free = |other: &[usize; 3]| {
                    let overlaps = !are_apart(lane, &triangle, &other.map(|n| points[n]), size);
                    !(overlaps && other.iter().all(|n| in_plane[*n]))
                };
                if found.iter().all(is_free) {
                    found.push(face);
                    into.push(triangle);
                }
            }
        }
    }
}

/// Three corners in the order that faces outward, and which corners lie in their plane; `None` if corners are
/// on both sides of it, or the three are on a line.
fn supporting(
    lane: &Lane,
    points: &[DVec3; 6],
    size: f64,
    of: [usize; 3],
) -> Option<([usize; 3], [bool; 6])> {
    let [i, j, k] = of;
    let normal = normal(lane, of.map(|n| points[n]));
    let slack = lane.mul(lane.mul(COPLANAR, size), length(lane, normal));
    let sides: [f64; 6] = std::array::from_fn(|n| {
        if of.contains(&n) { 0.0 } else { lane.dot(normal, lane.sub(points[n], points[i])) }
    });
    let is_outward = sides.iter().all(|side| lane.branch(*side <= slack));
    let is_inward = sides.iter().all(|side| lane.branch(*side >= -slack));
    let face = if is_outward { of } else { [i, k, j] };
    let is_face = lane.branch(normal != DVec3::ZERO && (is_outward || is_inward));
    is_face.then(|| (face, sides.map(|side| lane.branch(side.abs() <= slack))))
}

/// Whether two triangles that face the same way in one plane do not overlap: an edge of one has the other beyond it.
fn are_apart(lane: &Lane, a: &[DVec3; 3], b: &[DVec3; 3], size: f64) -> bool {
    let beyond = |x: &[DVec3; 3], y: &[DVec3; 3]| {
        let normal = normal(lane, *x);
        let width = length(lane, normal);
        [(0, 1), (1, 2), (2, 0)].iter().any(|&(i, j)| {
            let along = lane.sub(x[j], x[i]);
            let slack = lane.mul(lane.mul(lane.mul(COPLANAR, size), length(lane, along)), width);
            y.iter().all(|p| {
                let side = lane.dot(normal, lane.cross(along, lane.sub(*p, x[i])));
                lane.branch(side <= slack)
            })
        })
    };
    beyond(a, b) || beyond(b, a)
}

/// Sine of the angle between two sides below which they are parallel.
const MIN_SINE: f64 = 1e-6;
/// Rounding error of a touching point, relative to its distance.
const TOUCH_TOLERANCE: f64 = 1e-9;

/// Adds the faces of the prism.
fn prism_faces(lane: &Lane, beam: &Beam, into: &mut BoundingVolume) {
    let Some([base, top]) = ends(lane, beam) else { return hull_faces(lane, beam, into) };
    let up = lane.dot(normal(lane, base), lane.sub(top[0], base[0]));
    let outward = lane.branch(up > 0.0);
    let mut face = |a, b, c| into.push(if outward { [a, b, c] } else { [a, c, b] });
    face(base[0], base[2], base[1]);
    face(top[0], top[1], top[2]);
    for (i, j) in [(0, 1), (1, 2), (2, 0)] {
        face(base[i], base[j], top[j]);
        face(base[i], top[j], top[i]);
    }
}

/// Corners of both caps.
fn ends(lane: &Lane, beam: &Beam) -> Option<[[DVec3; 3]; 2]> {
    let v = &beam.open;
    let up = unit(lane, normal(lane, *v))?;
    let heights_of = |from: [DVec3; 3]| -> [f64; 3] {
        std::array::from_fn(|k| lane.dot(up, lane.sub(beam.close[k], from[k])))
    };
    let sum = heights_of(*v).into_iter().fold(0.0, |sum, height| lane.add(sum, height));
    let up = if lane.branch(sum < 0.0) { -up } else { up };
    let heights = beam.close.map(|p| lane.dot(up, lane.sub(p, v[0])));
    let far = heights.into_iter().fold(0.0, |far: f64, height| lane.max(far, height));
    let near = heights.into_iter().fold(0.0, |near: f64, height| lane.min(near, height));
    let sides = [side(lane, beam, 1, 2)?, side(lane, beam, 2, 0)?, side(lane, beam, 0, 1)?];
    // The sides of the two edges at corner k meet there.
    let corner = |k: usize, height: f64| {
        let along = lane.cross(sides[(k + 1) % 3], sides[(k + 2) % 3]);
        let (rise, sine) = (lane.dot(along, up), length(lane, along));
        let meets = lane.branch(sine > MIN_SINE) && lane.branch(rise.abs() > lane.mul(MIN_SINE, sine));
        meets.then(|| lane.madd(along, DVec3::splat(lane.div(height, rise)), v[k]))
    };
    let cap = |height: f64| Some([corner(0, height)?, corner(1, height)?, corner(2, height)?]);
    let (base, top) = (cap(near)?, cap(far)?);
    let area = |x: &[DVec3; 3]| lane.dot(normal(lane, *x), up);
    // If the sides meet between the caps, a cap is inside out.
    let own = area(v);
    let is_as_generator = |cap: &[DVec3; 3]| lane.branch(lane.mul(area(cap), own) > 0.0);
    (is_as_generator(&base) && is_as_generator(&top) && lane.branch(far > near)).then_some([base, top])
}

/// Outward unit normal of the plane through corners `i` and `j` of the generator and a corner of the end
/// triangle, with all corners on its inner side.
fn side(lane: &Lane, beam: &Beam, i: usize, j: usize) -> Option<DVec3> {
    let (v, opposite) = (&beam.open, 3 - i - j);
    let touching = |through: DVec3| {
        let normal = unit(lane, normal(lane, [v[i], v[j], through]))?;
        let inner = lane.dot(normal, lane.sub(v[opposite], v[i]));
        let normal = if lane.branch(inner > 0.0) { -normal } else { normal };
        let inside = |p: &DVec3| {
            let to = lane.sub(*p, v[i]);
            lane.branch(lane.dot(normal, to) <= lane.mul(TOUCH_TOLERANCE, length(lane, to)))
        };
        (lane.branch(inner != 0.0) && corners(beam).iter().all(inside)).then_some(normal)
    };
    [i, j, opposite].into_iter().find_map(|k| touching(beam.close[k]))
}

/// Adds the faces of all parts.
fn refined_faces(lane: &Lane, beam: &Beam, into: &mut BoundingVolume) {
    for ends in beam.cuts(lane).windows(2) {
        let part = beam.part(lane, ends[0], ends[1]);
        match beam.sign(lane, lane.mul(0.5, lane.add(ends[0], ends[1]))) {
            Some(sign) => outer(lane, &part, sign, into),
            None => hull_faces(lane, &part, into),
        }
    }
    drop_repeated(lane, into);
}

/// Drops triangles that are there twice: where a beam folds back, two parts lie on the same side of the
/// triangle that they share.
fn drop_repeated(lane: &Lane, volume: &mut BoundingVolume) {
    let is_same = |a: &[DVec3; 3], b: &[DVec3; 3]| {
        (0..3).any(|n| lane.branch(*a == [b[n], b[(n + 1) % 3], b[(n + 2) % 3]]))
    };
    let mut kept = 0;
    for place in 0..volume.len() {
        let face = volume[place];
        if !volume[..kept].iter().any(|other| is_same(other, &face)) {
            volume[kept] = face;
            kept += 1;
        }
    }
    volume.truncate(kept);
}

/// Adds the ends and outer faces of the whole beam, without cuts at folds.
fn uncut_faces(lane: &Lane, beam: &Beam, into: &mut BoundingVolume) {
    let folds = beam.cuts(lane);
    let first = beam.sign(lane, lane.mul(0.5, lane.add(folds[0], folds[1])));
    outer(lane, beam, first.unwrap_or(1.0), into);
}

/// Adds the ends and outer faces of a part without folds; `sign` is that of its Jacobian.
fn outer(lane: &Lane, part: &Beam, sign: f64, into: &mut BoundingVolume) {
    let (v, p) = (&part.open, &part.close);
    let mut face = |a, b, c| into.push(if sign > 0.0 { [a, b, c] } else { [a, c, b] });
    face(v[0], v[2], v[1]);
    face(p[0], p[1], p[2]);
    for (i, j) in [(0, 1), (1, 2), (2, 0)] {
        let outward = normal(lane, [v[i], v[j], p[i]]);
        if lane.branch(sign * lane.dot(outward, lane.sub(p[j], v[i])) > 0.0) {
            face(v[i], v[j], p[j]);
            face(v[i], p[j], p[i]);
        } else {
            face(v[i], v[j], p[i]);
            face(v[j], p[j], p[i]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::generator::tests::{hit, turned, uniform, warped};
    use super::*;

    /// Whether a ray hits a back face (Moeller and Trumbore 1997).
    fn leaves(volume: &[[DVec3; 3]], from: DVec3, along: DVec3) -> bool {
        volume.iter().any(|[a, b, c]| {
            let (ab, ac) = (*b - *a, *c - *a);
            let det = ab.dot(along.cross(ac));
            let to = from - *a;
            let u = to.dot(along.cross(ac)) / det;
            let v = along.dot(to.cross(ab)) / det;
            let t = ac.dot(to.cross(ab)) / det;
            u >= -1e-9 && v >= -1e-9 && u + v <= 1.0 + 1e-9 && t >= 0.0 && along.dot(ab.cross(ac)) > 0.0
        })
    }

    /// Every ray from a point of a beam hits a back face of its bounding volume, so every pixel that sees the
    /// beam is covered.
    #[test]
    fn bounding_volumes_contain_their_beam() {
        for method in [BeamMethod::Refined, BeamMethod::Hull, BeamMethod::Prism] {
            let (mut random, mut volume) = (uniform(11), BoundingVolume::new());
            for round in 0..1200 {
                let beam = match round % 6 {
                    0 => turned(&mut random),
                    kind => warped(&mut random, [0.0, 0.15, 0.4, 0.8, 1.5][kind - 1]),
                };
                method.bounding_volumes(&Lane::default(), &beam, &mut volume);
                for _ in 0..20 {
                    let hit = hit(&mut random);
                    let along = DVec3::from_array([0; 3].map(|_| random.within(-1.0, 1.0)));
                    assert!(leaves(&volume, beam.point(&hit), along), "{method:?} {round}: {hit:?}");
                }
            }
        }
    }

    #[test]
    fn a_straight_beam_is_its_own_prism() {
        let mut random = uniform(2);
        for _ in 0..50 {
            let beam = warped(&mut random, 0.0);
            for method in [BeamMethod::Refined, BeamMethod::Hull, BeamMethod::Prism] {
                let mut volume = BoundingVolume::new();
                method.bounding_volumes(&Lane::default(), &beam, &mut volume);
                let volume: f64 = volume.iter().map(|[a, b, c]| a.cross(*b).dot(*c) / 6.0).sum();
                let [a, b, c] = beam.open;
                let own = 0.5 * (b - a).cross(c - a).dot(beam.path(0)).abs();
                assert!((volume - own).abs() < 1e-6 * own, "{method:?}: {volume} {own}");
            }
        }
    }

    /// A ray through a body leaves a hull once, and no part of a refined bound has a triangle twice: each is
    /// rasterized once.
    #[test]
    fn bodies_have_every_face_once() {
        let mut random = uniform(4);
        let crosses = |[a, b, c]: &[DVec3; 3], [x, y]: [f64; 2]| {
            let edge = |p: &DVec3, q: &DVec3| (p.x - x) * (q.y - y) - (q.x - x) * (p.y - y);
            edge(a, b) > 0.0 && edge(b, c) > 0.0 && edge(c, a) > 0.0
        };
        let (mut covered, mut repeated) = (0, 0);
        for round in 0..1200 {
            let beam = match round % 4 {
                0 => turned(&mut random),
                kind => warped(&mut random, [0.0, 0.15, 1.5][kind - 1]),
            };
            // A triangle and a path along it: a quadrilateral in one plane.
            let flat = beam.open[0] + beam.open[1] - beam.open[2];
            let flat = Beam { close: [beam.close[0], beam.close[1], flat], ..beam };
            for beam in [beam, flat] {
                let mut volume = BoundingVolume::new();
                hull_faces(&Lane::default(), &beam, &mut volume);
                for _ in 0..40 {
                    let point = beam.point(&hit(&mut random));
                    let count = volume.iter().filter(|face| crosses(face, [point.x, point.y])).count();
                    assert!(count <= 1, "{round}: {count} of {volume:?}");
                    covered += count;
                }
                BeamMethod::Refined.bounding_volumes(&Lane::default(), &beam, &mut volume);
                let once = volume.len();
                let mut twice = volume.clone();
                twice.extend(&volume);
                drop_repeated(&Lane::default(), &mut twice);
                assert_eq!(twice.len(), once);
                repeated += usize::from(once > 20);
            }
        }
        assert!(covered > 90_000 && repeated > 0, "{covered} {repeated}");
    }
}
