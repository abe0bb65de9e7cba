//! Ray casting against still or moving triangles through a bounding volume hierarchy.
//!
//! The tree is that of the crate `obvhs`: agglomerative clustering (PLOC; Meister and Bittner 2018), optimized by
//! reinsertion, with leaves merged where the surface area heuristic says so. Of moving triangles a node keeps the
//! box at both ends of the shutter, and a ray meets their interpolation at its own time (Woop, Benthin and Áfra
//! 2017, "STBVH", section 3.1). Rays and triangles are in double precision, and boxes are widened by more than its
//! rounding, so the answer is that of a test of all triangles. Of equal distances the lowest number wins.

use glam::{DVec3, Vec3A};
use obvhs::BvhBuildParams;
use obvhs::aabb::Aabb;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::builder::build_bvh2;

/// Lowest and highest corner of a box.
pub(crate) type Bounds = [DVec3; 2];

/// Work of ray casting.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RayWork {
    /// Rays.
    pub rays: u64,
    /// Boxes of nodes tested.
    pub nodes: u64,
    /// Triangles tested.
    pub triangles: u64,
}

impl std::ops::AddAssign for RayWork {
    fn add_assign(&mut self, other: Self) {
        self.rays += other.rays;
        self.nodes += other.nodes;
        self.triangles += other.triangles;
    }
}

/// A ray at one time.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Ray {
    pub from: DVec3,
    pub along: DVec3,
    /// Time over the shutter, 0 to 1.
    pub t: f32,
    /// Hits count beyond this distance, in lengths of `along`.
    pub beyond: f64,
}

/// A search in the tree.
pub(crate) trait Query {
    /// Distance at which a box has to be looked into, or `None` if it may be left out.
    fn enters(&self, bounds: &Bounds) -> Option<f64>;
    /// Whether a box at this distance may still be of interest.
    fn wants(&self, distance: f64) -> bool;
    /// Tests a triangle; whether to go on.
    fn test(&mut self, triangle: usize) -> bool;
}

#[derive(Clone, Debug)]
struct Node {
    /// Boxes at both ends of the shutter.
    ends: [Bounds; 2],
    /// First child, followed by the other one; of a leaf the first place in the order.
    first: u32,
    /// Triangles of a leaf; 0 for an inner node.
    count: u32,
}

/// The tree.
#[derive(Clone, Debug, Default)]
pub(crate) struct Bvh {
    nodes: Vec<Node>,
    /// Triangles in the order of the leaves.
    order: Vec<u32>,
}

/// Limit of coordinates for the shape of the tree, so that areas stay finite in single precision. Boxes have the
/// coordinates themselves.
const MAX_COORDINATE: f64 = 1e18;

/// Widening of boxes, relative to the largest coordinate, and of comparisons of distances: far above the rounding of
/// positions and quotients in double precision.
const MARGIN: f64 = 1.0 / (1_u64 << 44) as f64;

impl Bvh {
    /// A tree over triangles with the given boxes at both ends of the shutter.
    pub fn new(ends: &[[Bounds; 2]]) -> Self {
        let single = |point: DVec3| {
            Vec3A::from(point.clamp(DVec3::splat(-MAX_COORDINATE), DVec3::splat(MAX_COORDINATE)).as_vec3())
        };
        let swept = |[open, close]: &[Bounds; 2]| {
            Aabb::new(single(open[0].min(close[0])), single(open[1].max(close[1])))
        };
        if ends.is_empty() {
            return Self::default();
        }
        let boxes: Vec<Aabb> = ends.iter().map(swept).collect();
        let built = build_bvh2(&boxes, BvhBuildParams::medium_build(), &mut std::time::Duration::default());
        Self::with_bounds(&built, ends)
    }

    fn with_bounds(built: &Bvh2, ends: &[[Bounds; 2]]) -> Self {
        let node = |node: &obvhs::bvh2::node::Bvh2Node| Node {
            ends: [EMPTY; 2],
            first: node.first_index,
            count: node.prim_count,
        };
        let mut tree =
            Self { nodes: built.nodes.iter().map(node).collect(), order: built.primitive_indices.clone() };
        let largest = ends
            .as_flattened()
            .as_flattened()
            .iter()
            .fold(0.0, |largest: f64, corner| largest.max(corner.abs().max_element()));
        let margin = DVec3::splat(MARGIN * largest);
        for index in tree.parents_first().into_iter().rev() {
            let Node { first, count, .. } = tree.nodes[index];
            let own = if count == 0 {
                hull(tree.nodes[first as usize].ends, tree.nodes[first as usize + 1].ends)
            } else {
                let widened = |triangle: &u32| {
                    ends[*triangle as usize].map(|[low, high]| [low - margin, high + margin])
                };
                tree.leaf(first, count).iter().map(widened).fold([EMPTY; 2], hull)
            };
            tree.nodes[index].ends = own;
        }
        tree
    }

    fn leaf(&self, first: u32, count: u32) -> &[u32] {
        &self.order[first as usize..(first + count) as usize]
    }

    /// All nodes, each after its parent.
    fn parents_first(&self) -> Vec<usize> {
        let (mut found, mut open) = (Vec::new(), vec![0]);
        while let Some(index) = open.pop() {
            found.push(index);
            let Node { first, count, .. } = self.nodes[index];
            if count == 0 {
                open.extend([first as usize, first as usize + 1]);
            }
        }
        found
    }

    /// Visits the leaves that a query wants at time `t`, the nearer of two children first.
    pub fn visit<Q: Query>(&self, t: f64, query: &mut Q, work: &mut RayWork) {
        let enters = |query: &Q, index: u32| {
            let bounds = self.nodes.get(index as usize)?.at(t);
            query.enters(&bounds).map(|distance| (distance, index))
        };
        let mut open = Vec::with_capacity(64);
        work.rays += 1;
        work.nodes += 1;
        open.extend(enters(query, 0));
        while let Some((distance, index)) = open.pop() {
            if !query.wants(distance) {
                continue;
            }
            let Node { first, count, .. } = self.nodes[index as usize];
            if count == 0 {
                work.nodes += 2;
                match [first, first + 1].map(|child| enters(query, child)) {
                    [Some(a), Some(b)] if a.0 < b.0 => open.extend([b, a]),
                    [a, b] => open.extend(a.into_iter().chain(b)),
                }
                continue;
            }
            for &triangle in self.leaf(first, count) {
                work.triangles += 1;
                if !query.test(triangle as usize) {
                    return;
                }
            }
        }
    }

    /// The first triangle along a ray and its distance in lengths of `along`; `corners` gives a triangle at the time
    /// of the ray.
    pub fn first(
        &self,
        ray: &Ray,
        corners: impl Fn(usize) -> [DVec3; 3],
        work: &mut RayWork,
    ) -> Option<(usize, f64)> {
        let mut query = First { slabs: Slabs::new(ray), corners, nearest: f64::INFINITY, found: None };
        self.visit(f64::from(ray.t), &mut query, work);
        query.found.map(|triangle| (triangle, query.nearest))
    }

    /// Whether any triangle lies along a ray nearer than `end`; `corners` gives a triangle at the time of the ray, or
    /// `None` if it does not count.
    pub fn any(
        &self,
        ray: &Ray,
        end: f64,
        corners: impl Fn(usize) -> Option<[DVec3; 3]>,
        work: &mut RayWork,
    ) -> bool {
        let mut query = Any { slabs: Slabs::new(ray), corners, end, found: false };
        self.visit(f64::from(ray.t), &mut query, work);
        query.found
    }
}

/// A box that contains nothing.
const EMPTY: Bounds = [DVec3::INFINITY, DVec3::NEG_INFINITY];

fn hull(a: [Bounds; 2], b: [Bounds; 2]) -> [Bounds; 2] {
    [0, 1].map(|end| [a[end][0].min(b[end][0]), a[end][1].max(b[end][1])])
}

impl Node {
    fn at(&self, t: f64) -> Bounds {
        let [open, close] = &self.ends;
        [0, 1].map(|k| open[k] + t * (close[k] - open[k]))
    }
}

/// A ray with the inverses of its direction.
struct Slabs {
    ray: Ray,
    inverse: DVec3,
}

impl Slabs {
    fn new(ray: &Ray) -> Self {
        // A ray in the plane of a side needs a nonzero divisor, because 0 / 0 is NaN.
        let inverse = ray.along.to_array().map(|part| 1.0 / if part == 0.0 { 1e-300 } else { part });
        Self { ray: *ray, inverse: DVec3::from_array(inverse) }
    }

    /// Where the ray enters a box (Kay and Kajiya 1986).
    fn enters(&self, [low, high]: &Bounds) -> Option<f64> {
        let (to_low, to_high) =
            ((*low - self.ray.from) * self.inverse, (*high - self.ray.from) * self.inverse);
        let start = to_low.min(to_high).max_element();
        let end = to_low.max(to_high).min_element() * (1.0 + MARGIN);
        (start <= end && end >= self.ray.beyond.min(0.0)).then_some(start)
    }

    fn hit(&self, corners: &[DVec3; 3]) -> Option<f64> {
        let (distance, _) = hit(self.ray.from, self.ray.along, corners)?;
        (distance > self.ray.beyond).then_some(distance)
    }
}

struct First<F> {
    slabs: Slabs,
    corners: F,
    nearest: f64,
    found: Option<usize>,
}

impl<F: Fn(usize) -> [DVec3; 3]> Query for First<F> {
    fn enters(&self, bounds: &Bounds) -> Option<f64> {
        self.slabs.enters(bounds).filter(|distance| self.wants(*distance))
    }

    fn wants(&self, distance: f64) -> bool {
        distance <= self.nearest * (1.0 + MARGIN)
    }

    fn test(&mut self, triangle: usize) -> bool {
        if let Some(distance) = self.slabs.hit(&(self.corners)(triangle))
            && (distance < self.nearest
                || distance == self.nearest && self.found.is_none_or(|found| triangle < found))
        {
            (self.nearest, self.found) = (distance, Some(triangle));
        }
        true
    }
}

struct Any<F> {
    slabs: Slabs,
    corners: F,
    end: f64,
    found: bool,
}

impl<F: Fn(usize) -> Option<[DVec3; 3]>> Query for Any<F> {
    fn enters(&self, bounds: &Bounds) -> Option<f64> {
        self.slabs.enters(bounds).filter(|distance| self.wants(*distance))
    }

    fn wants(&self, distance: f64) -> bool {
        distance <= self.end * (1.0 + MARGIN)
    }

    fn test(&mut self, triangle: usize) -> bool {
        let corners = (self.corners)(triangle);
        self.found = corners.and_then(|corners| self.slabs.hit(&corners)).is_some_and(|at| at < self.end);
        !self.found
    }
}

/// Box of points.
pub(crate) fn bounds_of(points: &[DVec3]) -> Bounds {
    points.iter().fold(EMPTY, |[low, high], point| [low.min(*point), high.max(*point)])
}

/// Where the line `from + s along` meets a triangle: `s` and two barycentric coordinates (Möller and Trumbore 1997).
pub(crate) fn hit(from: DVec3, along: DVec3, [a, b, c]: &[DVec3; 3]) -> Option<(f64, [f64; 2])> {
    let (ab, ac) = (*b - *a, *c - *a);
    let across = along.cross(ac);
    let det = ab.dot(across);
    if det == 0.0 {
        return None;
    }
    let to = from - *a;
    let u = to.dot(across) / det;
    let turned = to.cross(ab);
    let v = along.dot(turned) / det;
    (u >= 0.0 && v >= 0.0 && u + v <= 1.0).then(|| (ac.dot(turned) / det, [u, v]))
}

#[cfg(test)]
mod tests {
    use pipeline::random::SplitMix;

    use super::*;

    fn point(r: &mut SplitMix, scale: f64) -> DVec3 {
        DVec3::from_array([0; 3].map(|_| (r.next_unit() - 0.5) * scale))
    }

    type Moving = [[DVec3; 3]; 2];

    fn at(ends: &Moving, t: f32) -> [DVec3; 3] {
        std::array::from_fn(|k| ends[0][k] + f64::from(t) * (ends[1][k] - ends[0][k]))
    }

    fn tree(faces: &[Moving]) -> Bvh {
        Bvh::new(&faces.iter().map(|ends| ends.map(|end| bounds_of(&end))).collect::<Vec<_>>())
    }

    /// Moving triangles of single-precision coordinates, some of them twice, some on a grid and in the plane y = 0.
    fn strewn(count: usize, seed: u64) -> Vec<Moving> {
        let mut r = SplitMix::new(seed);
        let mut faces: Vec<Moving> = Vec::new();
        for index in 0..count {
            let place = point(&mut r, 4.0);
            let open = [0; 3].map(|_| place + point(&mut r, 0.8));
            let drift = point(&mut r, if index % 2 == 0 { 1.0 } else { 0.0 });
            let close = open.map(|corner| corner + drift);
            let single = |end: [DVec3; 3]| end.map(|corner| corner.as_vec3().as_dvec3());
            let flat = |end: [DVec3; 3]| {
                end.map(|corner| DVec3::new((2.0 * corner.x).round(), 0.0, (2.0 * corner.z).round()))
            };
            faces.push(match index % 5 {
                3 => [flat(open); 2],
                4 => faces[index / 2],
                _ => [single(open), single(close)],
            });
        }
        faces
    }

    fn rays(count: usize, seed: u64) -> impl Iterator<Item = Ray> {
        let mut r = SplitMix::new(seed);
        (0..count).map(move |index| {
            let t = (point(&mut r, 1.0).x + 0.5) as f32;
            let (mut from, mut along) = (point(&mut r, 6.0), point(&mut r, 2.0));
            match index % 4 {
                // Along an axis, from a point of the grid: through edges and vertices of the triangles there.
                0 => {
                    from = (2.0 * from).round();
                    along = DVec3::new(0.0, along.y, 0.0);
                }
                1 => along.z = 0.0,
                _ => {}
            }
            Ray { from, along, t, beyond: [0.0, 1.0, 1e-9][index % 3] }
        })
    }

    #[test]
    fn the_first_triangle_is_that_of_testing_all_of_them() {
        let (mut hits, mut ties) = (0, 0);
        for count in [1, 2, 3, 5, 64, 65, 900] {
            let faces = strewn(count, count as u64);
            let tree = tree(&faces);
            for ray in rays(3000, 7) {
                let distances: Vec<(usize, f64)> = (0..count)
                    .filter_map(|id| Some((id, hit(ray.from, ray.along, &at(&faces[id], ray.t))?.0)))
                    .filter(|(_, distance)| *distance > ray.beyond)
                    .collect();
                let expected = distances.iter().copied().min_by(|a, b| a.1.total_cmp(&b.1));
                ties += usize::from(
                    distances.iter().filter(|at| Some(at.1) == expected.map(|e| e.1)).count() > 1,
                );
                let found = tree.first(&ray, |id| at(&faces[id], ray.t), &mut RayWork::default());
                assert_eq!(found, expected, "{count}: {ray:?}");
                hits += usize::from(found.is_some());
                for end in [0.5, 1.0, 4.0] {
                    let blocked = |but: usize| distances.iter().any(|(id, at)| *id != but && *at < end);
                    let other = |id: usize| (id != 0).then(|| at(&faces[id], ray.t));
                    assert_eq!(
                        tree.any(&ray, end, other, &mut RayWork::default()),
                        blocked(0),
                        "{count}: {ray:?}"
                    );
                }
            }
        }
        assert!(hits > 1000 && ties > 100, "{hits} {ties}");
    }

    #[test]
    fn no_triangles_and_triangles_in_one_place() {
        let ray = Ray { from: DVec3::new(0.1, 0.1, -1.0), along: DVec3::Z, t: 0.5, beyond: 0.0 };
        assert_eq!(tree(&[]).first(&ray, |_| [DVec3::ZERO; 3], &mut RayWork::default()), None);
        let same = vec![[[DVec3::ZERO, DVec3::X, DVec3::Y]; 2]; 300];
        assert_eq!(tree(&same).first(&ray, |id| same[id][0], &mut RayWork::default()), Some((0, 1.0)));
        let huge = 1e30 * DVec3::X;
        let wide = vec![[[DVec3::ZERO - huge, huge, 1e30 * DVec3::Y]; 2]; 3];
        assert_eq!(tree(&wide).first(&ray, |id| wide[id][0], &mut RayWork::default()), Some((0, 1.0)));
    }

    #[test]
    fn a_tree_tests_few_of_many_triangles() {
        let faces = strewn(20_000, 3);
        let (tree, mut work) = (tree(&faces), RayWork::default());
        for ray in rays(200, 9) {
            tree.first(&ray, |id| at(&faces[id], ray.t), &mut work);
        }
        assert_eq!(work.rays, 200);
        assert!(work.triangles < 200 * 400 && work.nodes > work.rays, "{work:?}");
    }
}
