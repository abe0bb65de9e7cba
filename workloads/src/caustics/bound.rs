//! Bounding volumes of beams, which are rasterized to find the pixels that a beam may light.
//!
//! The bounding volumes are implemented from descriptions of the papers; the full texts were not available
//! (see the book).

use glam::DVec3;

use super::Beam;

/// How a beam is rasterized.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Method {
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

impl Method {
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
    pub(super) fn bounding_volumes(self, beam: &Beam, into: &mut BoundingVolume) {
        into.clear();
        match self {
            Self::Moving => {}
            Self::Refined => refined_faces(beam, into),
            Self::Uncut => uncut_faces(beam, into),
            Self::Hull => hull_faces(beam, into),
            Self::Prism => prism_faces(beam, into),
        }
    }
}

/// Six corners of a beam.
fn corners(beam: &Beam) -> [DVec3; 6] {
    let ([a, b, c], [d, e, f]) = (beam.open, beam.close);
    [a, b, c, d, e, f]
}

/// Rounding error of a corner's distance from a plane, relative to the size of the beam.
const COPLANAR: f64 = 1e-12;

/// Adds the faces of the hull. More than three corners in one plane are one face, whose triangles do not overlap.
fn hull_faces(beam: &Beam, into: &mut BoundingVolume) {
    let points = corners(beam);
    let size = points.iter().map(|p| (*p - points[0]).length()).fold(0.0, f64::max);
    let mut found: Vec<[usize; 3]> = Vec::new();
    for i in 0..6 {
        for j in i + 1..6 {
            for k in j + 1..6 {
                let Some((face, in_plane)) = supporting(&points, size, [i, j, k]) else { continue };
                let triangle = face.map(|n| points[n]);
                // All triangles of the plane that overlap no other fill its polygon.
                let is_free = |other: &[usize; 3]| {
                    let overlaps = !are_apart(&triangle, &other.map(|n| points[n]), size);
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

/// Three corners in the order that faces outward, and which corners lie in their plane; `None` if corners are on both sides of it, or
/// the three are on a line.
fn supporting(points: &[DVec3; 6], size: f64, of: [usize; 3]) -> Option<([usize; 3], [bool; 6])> {
    let [i, j, k] = of;
    let normal = (points[j] - points[i]).cross(points[k] - points[i]);
    let slack = COPLANAR * size * normal.length();
    let sides: [f64; 6] =
        std::array::from_fn(|n| if of.contains(&n) { 0.0 } else { normal.dot(points[n] - points[i]) });
    let is_outward = sides.iter().all(|side| *side <= slack);
    let is_inward = sides.iter().all(|side| *side >= -slack);
    let face = if is_outward { of } else { [i, k, j] };
    let is_face = normal != DVec3::ZERO && (is_outward || is_inward);
    is_face.then_some((face, sides.map(|side| side.abs() <= slack)))
}

/// Whether two triangles that face the same way in one plane do not overlap: an edge of one has the other beyond it.
fn are_apart(a: &[DVec3; 3], b: &[DVec3; 3], size: f64) -> bool {
    let beyond = |x: &[DVec3; 3], y: &[DVec3; 3]| {
        let normal = (x[1] - x[0]).cross(x[2] - x[0]);
        [(0, 1), (1, 2), (2, 0)].iter().any(|&(i, j)| {
            let along = x[j] - x[i];
            let slack = COPLANAR * size * along.length() * normal.length();
            y.iter().all(|p| normal.dot(along.cross(*p - x[i])) <= slack)
        })
    };
    beyond(a, b) || beyond(b, a)
}

/// Sine of the angle between two sides below which they are parallel.
const MIN_SINE: f64 = 1e-6;
/// Rounding error of a touching point, relative to its distance.
const TOUCH_TOLERANCE: f64 = 1e-9;

/// Adds the faces of the prism.
fn prism_faces(beam: &Beam, into: &mut BoundingVolume) {
    let Some([base, top]) = ends(beam) else { return hull_faces(beam, into) };
    let outward = (base[1] - base[0]).cross(base[2] - base[0]).dot(top[0] - base[0]) > 0.0;
    let mut face = |a, b, c| into.push(if outward { [a, b, c] } else { [a, c, b] });
    face(base[0], base[2], base[1]);
    face(top[0], top[1], top[2]);
    for (i, j) in [(0, 1), (1, 2), (2, 0)] {
        face(base[i], base[j], top[j]);
        face(base[i], top[j], top[i]);
    }
}

/// Corners of both caps.
fn ends(beam: &Beam) -> Option<[[DVec3; 3]; 2]> {
    let v = &beam.open;
    let normal = (v[1] - v[0]).cross(v[2] - v[0]).try_normalize()?;
    let sum: f64 = (0..3).map(|k| normal.dot(beam.path(k))).sum();
    let normal = if sum < 0.0 { -normal } else { normal };
    let heights = beam.close.map(|p| normal.dot(p - v[0]));
    let far = heights.into_iter().fold(0.0, f64::max);
    let near = heights.into_iter().fold(0.0, f64::min);
    let sides = [side(beam, 1, 2)?, side(beam, 2, 0)?, side(beam, 0, 1)?];
    // The sides of the two edges at corner k meet there.
    let corner = |k: usize, height: f64| {
        let along = sides[(k + 1) % 3].cross(sides[(k + 2) % 3]);
        let rise = along.dot(normal);
        (along.length() > MIN_SINE && rise.abs() > MIN_SINE * along.length())
            .then(|| v[k] + along * (height / rise))
    };
    let cap = |height: f64| Some([corner(0, height)?, corner(1, height)?, corner(2, height)?]);
    let (base, top) = (cap(near)?, cap(far)?);
    let area = |x: &[DVec3; 3]| (x[1] - x[0]).cross(x[2] - x[0]).dot(normal);
    // If the sides meet between the caps, a cap is inside out.
    (area(&base) * area(v) > 0.0 && area(&top) * area(v) > 0.0 && far > near).then_some([base, top])
}

/// Outward unit normal of the plane through corners `i` and `j` of the generator and a corner of the end
/// triangle, with all corners on its inner side.
fn side(beam: &Beam, i: usize, j: usize) -> Option<DVec3> {
    let (v, opposite) = (&beam.open, 3 - i - j);
    let touching = |through: DVec3| {
        let normal = (v[j] - v[i]).cross(through - v[i]).try_normalize()?;
        let inner = normal.dot(v[opposite] - v[i]);
        let normal = if inner > 0.0 { -normal } else { normal };
        let inside = |p: &DVec3| normal.dot(*p - v[i]) <= TOUCH_TOLERANCE * (*p - v[i]).length();
        (inner != 0.0 && corners(beam).iter().all(inside)).then_some(normal)
    };
    [i, j, opposite].into_iter().find_map(|k| touching(beam.close[k]))
}

/// Adds the faces of all parts.
fn refined_faces(beam: &Beam, into: &mut BoundingVolume) {
    for ends in beam.cuts().windows(2) {
        let part = beam.part(ends[0], ends[1]);
        match beam.sign(0.5 * (ends[0] + ends[1])) {
            Some(sign) => outer(&part, sign, into),
            None => hull_faces(&part, into),
        }
    }
    drop_repeated(into);
}

/// Drops triangles that are there twice: where a beam folds back, two parts lie on the same side of the triangle that they share.
fn drop_repeated(volume: &mut BoundingVolume) {
    let is_same =
        |a: &[DVec3; 3], b: &[DVec3; 3]| (0..3).any(|n| *a == [b[n], b[(n + 1) % 3], b[(n + 2) % 3]]);
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
fn uncut_faces(beam: &Beam, into: &mut BoundingVolume) {
    let folds = beam.cuts();
    let first = beam.sign(0.5 * (folds[0] + folds[1]));
    outer(beam, first.unwrap_or(1.0), into);
}

/// Adds the ends and outer faces of a part without folds; `sign` is that of its Jacobian.
fn outer(part: &Beam, sign: f64, into: &mut BoundingVolume) {
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

#[cfg(test)]
mod tests {
    use super::super::generator::tests::{Uniform, turned, warped};
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
        for method in [Method::Refined, Method::Hull, Method::Prism] {
            let (mut random, mut volume) = (Uniform::new(11), BoundingVolume::new());
            for round in 0..1200 {
                let beam = match round % 6 {
                    0 => turned(&mut random),
                    kind => warped(&mut random, [0.0, 0.15, 0.4, 0.8, 1.5][kind - 1]),
                };
                method.bounding_volumes(&beam, &mut volume);
                for _ in 0..20 {
                    let hit = random.hit();
                    let along = DVec3::from_array([0; 3].map(|_| random.within(-1.0, 1.0)));
                    assert!(leaves(&volume, beam.point(&hit), along), "{method:?} {round}: {hit:?}");
                }
            }
        }
    }

    #[test]
    fn a_straight_beam_is_its_own_prism() {
        let mut random = Uniform::new(2);
        for _ in 0..50 {
            let beam = warped(&mut random, 0.0);
            for method in [Method::Refined, Method::Hull, Method::Prism] {
                let mut volume = BoundingVolume::new();
                method.bounding_volumes(&beam, &mut volume);
                let volume: f64 = volume.iter().map(|[a, b, c]| a.cross(*b).dot(*c) / 6.0).sum();
                let [a, b, c] = beam.open;
                let own = 0.5 * (b - a).cross(c - a).dot(beam.path(0)).abs();
                assert!((volume - own).abs() < 1e-6 * own, "{method:?}: {volume} {own}");
            }
        }
    }

    /// A ray through a body leaves a hull once, and no part of a refined bound has a triangle twice: each is rasterized once.
    #[test]
    fn bodies_have_every_face_once() {
        let mut random = Uniform::new(4);
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
                hull_faces(&beam, &mut volume);
                for _ in 0..40 {
                    let point = beam.point(&random.hit());
                    let count = volume.iter().filter(|face| crosses(face, [point.x, point.y])).count();
                    assert!(count <= 1, "{round}: {count} of {volume:?}");
                    covered += count;
                }
                Method::Refined.bounding_volumes(&beam, &mut volume);
                let once = volume.len();
                let mut twice = volume.clone();
                twice.extend(&volume);
                drop_repeated(&mut twice);
                assert_eq!(twice.len(), once);
                repeated += usize::from(once > 20);
            }
        }
        assert!(covered > 90_000 && repeated > 0, "{covered} {repeated}");
    }
}
