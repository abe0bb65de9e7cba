//! Ray casting against still triangles, for measuring a scene before it is rendered.

use glam::DVec3;

use crate::bvh::{Bounds, Bvh, Query, Ray, RayWork, bounds_of, hit};

/// Triangles sorted along a space-filling curve, so that points spread over them are spread over space, and a
/// tree over them.
pub(super) struct Rays {
    triangles: Vec<[DVec3; 3]>,
    tree: Bvh,
    bounds: Bounds,
}

/// First hit of a ray.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Hit {
    /// Distance, in lengths of the ray's direction.
    pub distance: f64,
    /// Unit normal of the triangle, to the side from which its corners run counter-clockwise; zero if it has no area.
    pub normal: DVec3,
    /// Whether the ray came from that side.
    pub front: bool,
}

impl Rays {
    /// Prepares `triangles`, in O(n log n).
    pub fn new(mut triangles: Vec<[DVec3; 3]>) -> Self {
        let bounds = bounds_of(triangles.as_flattened());
        let [low, high] = bounds;
        let size = (high - low).max(DVec3::splat(f64::MIN_POSITIVE));
        triangles.sort_by_cached_key(|[a, b, c]| {
            let middle = ((*a + *b + *c) / 3.0 - low) / size;
            middle
                .to_array()
                .map(|part| spread((part * 2_097_151.0) as u64))
                .iter()
                .fold(0, |code, part| code << 1 | part)
        });
        let boxes: Vec<[Bounds; 2]> = triangles.iter().map(|corners| [bounds_of(corners); 2]).collect();
        Self { tree: Bvh::new(&boxes), triangles, bounds }
    }

    /// The triangles, along the curve.
    pub fn triangles(&self) -> &[[DVec3; 3]] {
        &self.triangles
    }

    /// Bounds of all triangles.
    pub fn bounds(&self) -> Bounds {
        self.bounds
    }

    /// The first triangle along a ray, farther than `beyond` lengths of `along`.
    pub fn first(&self, from: DVec3, along: DVec3, beyond: f64) -> Option<Hit> {
        let ray = Ray { from, along, t: 0.0, beyond };
        let (triangle, distance) = self.tree.first(&ray, |id| self.triangles[id], &mut RayWork::default())?;
        let normal = normal(&self.triangles[triangle]).normalize_or_zero();
        Some(Hit { distance, normal, front: normal.dot(along) < 0.0 })
    }

    /// Whether no triangle is nearer to `point` than `room`.
    pub fn is_clear(&self, point: DVec3, room: f64) -> bool {
        let mut query = Near { triangles: &self.triangles, point, room, found: false };
        self.tree.visit(0.0, &mut query, &mut RayWork::default());
        !query.found
    }
}

/// A search for a triangle near a point.
struct Near<'a> {
    triangles: &'a [[DVec3; 3]],
    point: DVec3,
    room: f64,
    found: bool,
}

impl Query for Near<'_> {
    fn enters(&self, [low, high]: &Bounds) -> Option<f64> {
        let distance = self.point.distance(self.point.clamp(low.min(*high), high.max(*low)));
        (distance < self.room).then_some(distance)
    }

    fn wants(&self, distance: f64) -> bool {
        distance < self.room
    }

    fn test(&mut self, triangle: usize) -> bool {
        self.found = nearest(self.point, &self.triangles[triangle]) < self.room;
        !self.found
    }
}

/// Distance of a point from a triangle.
fn nearest(point: DVec3, triangle: &[DVec3; 3]) -> f64 {
    let along = normal(triangle);
    if let Some((steps, _)) = hit(point, along, triangle) {
        return steps.abs() * along.length();
    }
    let of_edge = |k: usize| {
        let (from, edge) = (triangle[k], triangle[(k + 1) % 3] - triangle[k]);
        let part = ((point - from).dot(edge) / edge.length_squared().max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
        point.distance(from + part * edge)
    };
    (0..3).map(of_edge).fold(f64::INFINITY, f64::min)
}

/// Twice the area of a triangle, along its normal.
pub(super) fn normal([a, b, c]: &[DVec3; 3]) -> DVec3 {
    (*b - *a).cross(*c - *a)
}

/// Every third bit, from the 21 lowest.
fn spread(bits: u64) -> u64 {
    let steps = [
        (32, 0x001f_0000_0000_ffff),
        (16, 0x001f_0000_ff00_00ff),
        (8, 0x100f_00f0_0f00_f00f),
        (4, 0x10c3_0c30_c30c_30c3),
        (2, 0x1249_2492_4924_9249),
    ];
    steps.into_iter().fold(bits & 0x1f_ffff, |bits, (by, mask)| (bits | bits << by) & mask)
}

#[cfg(test)]
mod tests {
    use pipeline::random::SplitMix;

    use super::*;

    /// Triangles strewn at random.
    fn strewn(count: usize) -> Vec<[DVec3; 3]> {
        let mut random = SplitMix::new(1);
        let mut point = |scale: f64| DVec3::from_array([0; 3].map(|_| random.next_unit() - 0.5)) * scale;
        (0..count)
            .map(|_| {
                let at = point(4.0);
                [at, at + point(0.8), at + point(0.8)]
            })
            .collect()
    }

    #[test]
    fn the_tree_finds_what_a_search_of_all_triangles_finds() {
        for count in [1, 3, 4, 5, 63, 64, 65, 700] {
            let triangles = strewn(count);
            let rays = Rays::new(triangles.clone());
            let aims = strewn(100);
            for [from, to, _] in aims.iter().map(|[a, b, c]| [*a * 2.0, *b - *a, *c]) {
                let all = triangles.iter().filter_map(|triangle| hit(from, to, triangle)).map(|(at, _)| at);
                let expected = all.filter(|at| *at > 1e-9).min_by(f64::total_cmp);
                assert_eq!(rays.first(from, to, 1e-9).map(|hit| hit.distance), expected, "{count}");
            }
        }
    }

    #[test]
    fn the_tree_finds_the_nearest_triangle() {
        let triangles = strewn(300);
        let rays = Rays::new(triangles.clone());
        for [corner, ..] in strewn(100) {
            let point = 0.9 * corner + 0.05;
            let distance =
                triangles.iter().map(|triangle| nearest(point, triangle)).fold(f64::INFINITY, f64::min);
            assert!(rays.is_clear(point, 0.999 * distance) && !rays.is_clear(point, 1.001 * distance));
        }
        let triangle = [DVec3::ZERO, DVec3::X, DVec3::Y];
        for (point, expected) in [
            ([0.25, 0.25, -2.0], 2.0),
            ([2.0, 0.0, 0.0], 1.0),
            ([0.5, -3.0, 4.0], 5.0),
            ([1.0, 1.0, 0.0], 0.5_f64.sqrt()),
        ] {
            assert!((nearest(DVec3::from(point), &triangle) - expected).abs() < 1e-12, "{point:?}");
        }
    }

    #[test]
    fn a_front_face_turns_counter_clockwise_to_the_viewer() {
        let rays = Rays::new(vec![[DVec3::NEG_X, DVec3::X, DVec3::Y]]);
        let from = DVec3::new(0.0, 0.25, 2.0);
        let hit = rays.first(from, DVec3::NEG_Z, 0.0).unwrap();
        assert_eq!((hit.distance, hit.front, hit.normal), (2.0, true, DVec3::Z));
        assert!(!rays.first(-from + DVec3::Y * 0.5, DVec3::Z, 0.0).unwrap().front);
        assert!(rays.first(from, DVec3::Z, 0.0).is_none());
    }
}
