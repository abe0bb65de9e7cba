//! Moving objects made of triangles.

use glam::DVec3;
use pipeline::conservative::MIN_UNCERTAINTY;

use super::bounds::times_inside;
use super::bounds::{Bounds, Ends};
use crate::visibility::MovingMesh;

/// An object: triangles, each with linear motion from time 0 to time 1.
#[derive(Clone, Debug)]
pub struct Object {
    pub(super) triangles: Vec<Ends>,
    /// Swept box of each triangle.
    pub(super) boxes: Vec<Bounds>,
    /// Swept box of the object.
    pub(super) bounds: Bounds,
    /// Largest error of a coordinate.
    pub(super) uncertainty: f64,
}

/// Largest accepted coordinate. Products of three stay finite.
const MAX_COORDINATE: f64 = 1e60;

impl Object {
    /// Takes the triangles of a mesh, whose coordinates may be off by up to `uncertainty`. `None` if a
    /// coordinate is NaN or beyond 1e60.
    pub fn new(mesh: &MovingMesh, uncertainty: f64) -> Option<Self> {
        let corner = |end: &[DVec3], vertex: u32| end[vertex as usize].to_array();
        let ends = |corners: &[u32; 3]| [&mesh.open, &mesh.close].map(|end| corners.map(|v| corner(end, v)));
        Self::from_ends(mesh.triangles.iter().map(ends).collect(), uncertainty)
    }

    /// Takes triangles by their corners at both times; as [`new`](Self::new).
    pub fn from_ends(triangles: Vec<Ends>, uncertainty: f64) -> Option<Self> {
        let fits = |at: &f64| at.abs() <= MAX_COORDINATE;
        // Allows for rounding in differences of a coordinate and its uncertainty.
        let uncertainty = 1.001 * uncertainty;
        if !triangles.as_flattened().as_flattened().as_flattened().iter().all(fits) {
            return None;
        }
        Some(Self::with_boxes(triangles, uncertainty))
    }

    /// Mean translation of the corners from time 0 to time 1, from up to 64 triangles.
    pub(super) fn translation(&self) -> [f64; 3] {
        const SAMPLED_TRIANGLES: usize = 64;
        let sampled = self.triangles.iter().step_by(self.triangles.len().div_ceil(SAMPLED_TRIANGLES).max(1));
        let count = (3 * sampled.len()).max(1) as f64;
        [0, 1, 2].map(|axis| {
            let translation =
                |[open, close]: &Ends| (0..3).map(|k| close[k][axis] - open[k][axis]).sum::<f64>();
            sampled.clone().map(translation).sum::<f64>() / count
        })
    }

    /// The triangles of `list` in a frame of reference that is translated by `translation` from time 0 to
    /// time 1.
    pub(super) fn in_frame(&self, list: &[u32], translation: [f64; 3]) -> Self {
        let seen =
            |[open, close]: &Ends| [*open, close.map(|p| [0, 1, 2].map(|axis| p[axis] - translation[axis]))];
        let triangles: Vec<Ends> = list.iter().map(|&n| seen(&self.triangles[n as usize])).collect();
        let coordinates = triangles.as_flattened().as_flattened().as_flattened();
        let largest =
            coordinates.iter().chain(&translation).fold(0.0, |largest: f64, at| largest.max(at.abs()));
        // A difference has an error of half an ulp.
        Self::with_boxes(triangles, self.uncertainty + f64::EPSILON * largest)
    }

    /// The object scaled by `factor`, a power of two.
    pub(super) fn scaled(&self, factor: f64) -> Self {
        let scaled = |ends: &Ends| ends.map(|end| end.map(|p| p.map(|at| at * factor)));
        Self::with_boxes(self.triangles.iter().map(scaled).collect(), self.uncertainty * factor)
    }

    /// Largest absolute coordinate of the swept box.
    pub(super) fn largest(&self) -> f64 {
        self.bounds.space.as_flattened().iter().fold(0.0, |largest, at| largest.max(at.abs()))
    }

    /// Computes the swept boxes.
    fn with_boxes(triangles: Vec<Ends>, uncertainty: f64) -> Self {
        let swept = |ends: &Ends| Bounds::of(ends.as_flattened().iter().copied()).inflated(uncertainty);
        let boxes: Vec<Bounds> = triangles.iter().map(swept).collect();
        let bounds =
            boxes.iter().fold(Bounds { time: [0.0, 1.0], ..Bounds::NOTHING }, |all, one| all.hull(one));
        Self { triangles, boxes, bounds, uncertainty }
    }

    /// The object with its uncertainty raised by the share `relative` of its largest coordinate.
    #[must_use]
    pub fn loosened(&self, relative: f64) -> Self {
        let coordinates = self.triangles.as_flattened().as_flattened().as_flattened();
        let largest = coordinates.iter().fold(0.0, |largest: f64, at| largest.max(at.abs()));
        Self::with_boxes(self.triangles.clone(), self.uncertainty + relative * largest)
    }

    /// Number of triangles.
    pub fn len(&self) -> usize {
        self.triangles.len()
    }

    /// Whether the object has no triangles.
    pub fn is_empty(&self) -> bool {
        self.triangles.is_empty()
    }

    /// Uncertainty for the rasterizer, large enough for products that underflow. The boxes do not need it.
    pub(super) fn raster_uncertainty(&self) -> f64 {
        self.uncertainty.max(MIN_UNCERTAINTY)
    }

    /// Times at which a triangle may be inside a box of space and time.
    pub(super) fn times_inside(&self, triangle: u32, within: &Bounds) -> Option<[f64; 2]> {
        let triangle = triangle as usize;
        times_inside(&self.triangles[triangle], &self.boxes[triangle], within, self.raster_uncertainty())
    }

    /// Swept box.
    pub fn bounds(&self) -> &Bounds {
        &self.bounds
    }
}

/// Connected components of a mesh, by shared vertices, in the order of their first triangles.
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

/// Root of a vertex in the union-find forest, with path halving.
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
    fn triangles_that_share_a_vertex_are_one_component() {
        let points = vec![DVec3::ZERO; 9];
        let triangles = vec![[0, 1, 2], [3, 4, 5], [2, 6, 7], [8, 8, 5]];
        let mesh = MovingMesh { open: points.clone(), close: points, triangles };
        let parts: Vec<_> = components(&mesh).into_iter().map(|part| part.triangles).collect();
        assert_eq!(parts, [vec![[0, 1, 2], [2, 6, 7]], vec![[3, 4, 5], [8, 8, 5]]]);
    }

    #[test]
    fn nan_and_large_coordinates_are_refused() {
        let mut ends = [[[0.0; 3]; 3]; 2];
        assert!(Object::from_ends(vec![ends], 0.0).is_some());
        for bad in [f64::NAN, f64::INFINITY, -2e60] {
            ends[1][2][1] = bad;
            assert!(Object::from_ends(vec![ends], 0.0).is_none());
        }
    }
}
