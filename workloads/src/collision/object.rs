//! What may collide.

use glam::DVec3;
use pipeline::conservative::LEAST_UNCERTAINTY;

use super::bounds::{Bounds, Ends};
use super::window::times_inside;
use crate::visibility::MovingMesh;

/// Triangles that move as one.
#[derive(Clone, Debug)]
pub struct Object {
    pub(super) triangles: Vec<Ends>,
    /// The swept box of each.
    pub(super) boxes: Vec<Bounds>,
    /// The swept box of all.
    pub(super) bounds: Bounds,
    /// How far a coordinate may be from what was meant.
    pub(super) uncertainty: f64,
}

/// The largest coordinate that may be: products of three stay finite.
const LARGEST: f64 = 1e60;

impl Object {
    /// The triangles of a mesh; coordinates may be off by up to `uncertainty`. `None` where one is beyond 1e60 or not a number.
    pub fn new(mesh: &MovingMesh, uncertainty: f64) -> Option<Self> {
        let corner = |end: &[DVec3], vertex: u32| end[vertex as usize].to_array();
        let ends = |corners: &[u32; 3]| [&mesh.open, &mesh.close].map(|end| corners.map(|v| corner(end, v)));
        Self::from_ends(mesh.triangles.iter().map(ends).collect(), uncertainty)
    }

    /// Triangles given by their corners at both times.
    pub fn from_ends(triangles: Vec<Ends>, uncertainty: f64) -> Option<Self> {
        let fits = |at: &f64| at.abs() <= LARGEST;
        // What differences of a coordinate and its uncertainty are rounded by.
        let uncertainty = 1.001 * uncertainty;
        if !triangles.as_flattened().as_flattened().as_flattened().iter().all(fits) {
            return None;
        }
        Some(Self::fitted(triangles, uncertainty))
    }

    /// How far its corners go from time 0 to time 1, by some of them.
    pub(super) fn way(&self) -> [f64; 3] {
        const SOME: usize = 64;
        let some = self.triangles.iter().step_by(self.triangles.len().div_ceil(SOME).max(1));
        let count = (3 * some.len()).max(1) as f64;
        [0, 1, 2].map(|axis| {
            let way = |[open, close]: &Ends| (0..3).map(|k| close[k][axis] - open[k][axis]).sum::<f64>();
            some.clone().map(way).sum::<f64>() / count
        })
    }

    /// Some of its triangles seen from a frame of reference that goes `way` from time 0 to time 1.
    pub(super) fn less(&self, list: &[u32], way: [f64; 3]) -> Self {
        let seen = |[open, close]: &Ends| [*open, close.map(|p| [0, 1, 2].map(|axis| p[axis] - way[axis]))];
        let triangles: Vec<Ends> = list.iter().map(|&n| seen(&self.triangles[n as usize])).collect();
        let coordinates = triangles.as_flattened().as_flattened().as_flattened();
        let largest = coordinates.iter().chain(&way).fold(0.0, |largest: f64, at| largest.max(at.abs()));
        // A difference is off by half a unit of its last place.
        Self::fitted(triangles, self.uncertainty + f64::EPSILON * largest)
    }

    /// The same `factor` times as large, a power of two.
    pub(super) fn scaled(&self, factor: f64) -> Self {
        let scaled = |ends: &Ends| ends.map(|end| end.map(|p| p.map(|at| at * factor)));
        Self::fitted(self.triangles.iter().map(scaled).collect(), self.uncertainty * factor)
    }

    /// The largest coordinate that it reaches.
    pub(super) fn largest(&self) -> f64 {
        self.bounds.space.as_flattened().iter().fold(0.0, |largest, at| largest.max(at.abs()))
    }

    /// With its boxes.
    fn fitted(triangles: Vec<Ends>, uncertainty: f64) -> Self {
        let swept = |ends: &Ends| Bounds::of(ends.as_flattened().iter().copied()).inflated(uncertainty);
        let boxes: Vec<Bounds> = triangles.iter().map(swept).collect();
        let bounds =
            boxes.iter().fold(Bounds { time: [0.0, 1.0], ..Bounds::NOTHING }, |all, one| all.hull(one));
        Self { triangles, boxes, bounds, uncertainty }
    }

    /// The same, its coordinates unsure by `relative` of the largest.
    #[must_use]
    pub fn loosened(&self, relative: f64) -> Self {
        let coordinates = self.triangles.as_flattened().as_flattened().as_flattened();
        let largest = coordinates.iter().fold(0.0, |largest: f64, at| largest.max(at.abs()));
        Self::fitted(self.triangles.clone(), self.uncertainty + relative * largest)
    }

    /// Its triangles.
    pub fn len(&self) -> usize {
        self.triangles.len()
    }

    /// Whether it has none.
    pub fn is_empty(&self) -> bool {
        self.triangles.is_empty()
    }

    /// How far a coordinate may be off at least, which pays for products that are too small to be numbers. Boxes are exact without.
    pub(super) fn unsure(&self) -> f64 {
        self.uncertainty.max(LEAST_UNCERTAINTY)
    }

    /// The times at which a triangle may be inside a box of space and time.
    pub(super) fn times_inside(&self, triangle: u32, within: &Bounds) -> Option<[f64; 2]> {
        let triangle = triangle as usize;
        times_inside(&self.triangles[triangle], &self.boxes[triangle], within, self.unsure())
    }

    /// The box that it sweeps.
    pub fn bounds(&self) -> &Bounds {
        &self.bounds
    }
}

/// The parts of a mesh that hang together by shared vertices, in the order of their first triangles.
pub fn components(mesh: &MovingMesh) -> Vec<MovingMesh> {
    let mut parents: Vec<u32> = (0..mesh.open.len() as u32).collect();
    for [a, b, c] in &mesh.triangles {
        let root = find(&mut parents, *a);
        for vertex in [*b, *c] {
            let other = find(&mut parents, vertex);
            parents[other as usize] = root;
        }
    }
    let mut parts: Vec<MovingMesh> = Vec::new();
    let mut part_of = vec![usize::MAX; parents.len()];
    for corners in &mesh.triangles {
        let root = find(&mut parents, corners[0]) as usize;
        if part_of[root] == usize::MAX {
            part_of[root] = parts.len();
            parts.push(MovingMesh {
                open: mesh.open.clone(),
                close: mesh.close.clone(),
                triangles: Vec::new(),
            });
        }
        parts[part_of[root]].triangles.push(*corners);
    }
    parts
}

/// The root of a vertex; paths are halved on the way.
fn find(parents: &mut [u32], mut vertex: u32) -> u32 {
    while parents[vertex as usize] != vertex {
        parents[vertex as usize] = parents[parents[vertex as usize] as usize];
        vertex = parents[vertex as usize];
    }
    vertex
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_shares_a_vertex_hangs_together() {
        let points = vec![DVec3::ZERO; 9];
        let triangles = vec![[0, 1, 2], [3, 4, 5], [2, 6, 7], [8, 8, 5]];
        let mesh = MovingMesh { open: points.clone(), close: points, triangles };
        let parts: Vec<_> = components(&mesh).into_iter().map(|part| part.triangles).collect();
        assert_eq!(parts, [vec![[0, 1, 2], [2, 6, 7]], vec![[3, 4, 5], [8, 8, 5]]]);
    }

    #[test]
    fn what_is_not_a_number_is_refused() {
        let mut ends = [[[0.0; 3]; 3]; 2];
        assert!(Object::from_ends(vec![ends], 0.0).is_some());
        for bad in [f64::NAN, f64::INFINITY, -2e60] {
            ends[1][2][1] = bad;
            assert!(Object::from_ends(vec![ends], 0.0).is_none());
        }
    }
}
