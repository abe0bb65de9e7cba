//! A mesh at rest: its triangles and everything that can deform it; its bounds, and loss of precision far
//! from the origin.

use std::sync::Arc;

use glam::{DAffine3, DVec3, Vec2, Vec3};
use warnings::{Code, Warning};

/// Source of a mesh's normals.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum Normals {
    /// None: faces are flat.
    #[default]
    Flat,
    /// The mean of the faces around each vertex, weighted by area, at mid-shutter.
    Smooth,
    /// One for each vertex, as stored.
    Given(Vec<Vec3>),
}

/// One morph target: displacements of the vertices at weight one. Either list may be empty.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MorphTarget {
    /// Displacements in the mesh's units.
    pub positions: Vec<Vec3>,
    /// Changes of the normals.
    pub normals: Vec<Vec3>,
}

/// Joints of a skin that move each vertex, and their weights.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Influences {
    /// Number of joints per vertex.
    pub per_vertex: usize,
    /// Indices into the skin's joints, `per_vertex` for each vertex.
    pub joints: Vec<u16>,
    /// Weights of the joints, adding up to one for each vertex.
    pub weights: Vec<f32>,
}

/// Triangles of one material, in local coordinates.
#[derive(Clone, Debug)]
pub struct Mesh {
    /// Name for messages.
    pub name: String,
    /// Positions in the mesh's units.
    pub positions: Vec<Vec3>,
    /// Source of the normals.
    pub normals: Normals,
    /// Texture coordinates, one for each vertex or none.
    pub uvs: Arc<[Vec2]>,
    /// Linear RGB factors of the material's colour, one for each vertex or none.
    pub colors: Arc<[Vec3]>,
    /// Vertex indices of each triangle, all in range.
    pub triangles: Arc<[[u32; 3]]>,
    /// Index of the material.
    pub material: usize,
    /// Morph targets.
    pub targets: Vec<MorphTarget>,
    /// Default weights of the targets, without weights of a node or track.
    pub weights: Vec<f64>,
    /// Joints and weights of each vertex, for skinned meshes.
    pub influences: Option<Influences>,
}

/// Joints of a skin and their bind poses.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Skin {
    /// Node of each joint.
    pub joints: Vec<usize>,
    /// Inverse bind matrices, from the mesh to each joint.
    pub inverse_bind: Vec<DAffine3>,
}

/// An instance of a mesh on a node.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Instance {
    /// Index of the node.
    pub node: usize,
    /// Index of the mesh.
    pub mesh: usize,
    /// Index of the skin; a skinned mesh follows its joints, not its node.
    pub skin: Option<usize>,
    /// Part of lens and shutter in which it is drawn.
    pub clip: pipeline::Clip,
}

impl Mesh {
    /// A rigid mesh of `triangles` over `positions`, flat, without texture coordinates.
    ///
    /// # Errors
    /// A message about the first index out of range or position that is not finite.
    pub fn new(
        name: impl Into<String>,
        positions: Vec<Vec3>,
        triangles: Vec<[u32; 3]>,
        material: usize,
    ) -> Result<Self, String> {
        if let Some((vertex, place)) = positions.iter().enumerate().find(|(_, p)| !p.is_finite()) {
            let what = if place.is_nan() { "NaN or infinite" } else { "infinite or beyond f32 (3.4e38)" };
            return Err(format!("vertex {vertex} has a coordinate that is {what}"));
        }
        let count = positions.len();
        for (triangle, corners) in triangles.iter().enumerate() {
            if let Some(vertex) = corners.iter().find(|&&v| v as usize >= count) {
                return Err(format!("triangle {triangle} uses vertex {vertex}, but there are only {count}"));
            }
        }
        Ok(Self {
            name: name.into(),
            positions,
            normals: Normals::Flat,
            uvs: Arc::from([]),
            colors: Arc::from([]),
            triangles: triangles.into(),
            material,
            targets: Vec::new(),
            weights: Vec::new(),
            influences: None,
        })
    }
}

impl Mesh {
    /// A mesh of each part, `of_triangle` naming the part of each triangle, with the vertices it uses in the
    /// order in which it uses them. The mesh has to be one that no joints carry.
    pub(crate) fn split(&self, of_triangle: &[u32], parts: usize) -> Vec<Self> {
        let mut triangles = vec![Vec::new(); parts];
        for (corners, &part) in self.triangles.iter().zip(of_triangle) {
            triangles[part as usize].push(*corners);
        }
        let mut places = vec![u32::MAX; self.positions.len()];
        let part = |mut triangles: Vec<[u32; 3]>| {
            let mut used: Vec<u32> = Vec::new();
            for vertex in triangles.as_flattened_mut() {
                let place = &mut places[*vertex as usize];
                if *place == u32::MAX {
                    *place = used.len() as u32;
                    used.push(*vertex);
                }
                *vertex = *place;
            }
            used.iter().for_each(|&vertex| places[vertex as usize] = u32::MAX);
            self.gathered(&used, triangles)
        };
        triangles.into_iter().map(part).collect()
    }

    /// The vertices `used` with `triangles` over them.
    fn gathered(&self, used: &[u32], triangles: Vec<[u32; 3]>) -> Self {
        let target = |target: &MorphTarget| MorphTarget {
            positions: gathered(&target.positions, used),
            normals: gathered(&target.normals, used),
        };
        Self {
            name: self.name.clone(),
            positions: gathered(&self.positions, used),
            normals: match &self.normals {
                Normals::Given(normals) => Normals::Given(gathered(normals, used)),
                other => other.clone(),
            },
            uvs: gathered(&self.uvs, used).into(),
            colors: gathered(&self.colors, used).into(),
            triangles: triangles.into(),
            material: self.material,
            targets: self.targets.iter().map(target).collect(),
            weights: self.weights.clone(),
            influences: None,
        }
    }
}

/// The `used` ones of `values`, or nothing where there are none.
fn gathered<T: Copy>(values: &[T], used: &[u32]) -> Vec<T> {
    if values.is_empty() { Vec::new() } else { used.iter().map(|&vertex| values[vertex as usize]).collect() }
}

/// Unit normals from the faces around each vertex, weighted by area; +y where there are none.
pub fn smooth_normals(positions: &[Vec3], triangles: &[[u32; 3]]) -> Vec<Vec3> {
    let mut sums = vec![DVec3::ZERO; positions.len()];
    for corners in triangles {
        let [a, b, c] = corners.map(|v| positions.get(v as usize).copied().unwrap_or_default().as_dvec3());
        let face = (b - a).cross(c - a);
        for &vertex in corners {
            if let Some(sum) = sums.get_mut(vertex as usize) {
                *sum += face;
            }
        }
    }
    sums.into_iter().map(unit).collect()
}

/// `v` with unit length, or +y where it has none: a shader must be able to rely on its normal.
pub fn unit(v: DVec3) -> Vec3 {
    let length = v.length();
    if length.is_finite() && length > 0.0 { (v / length).as_vec3() } else { Vec3::Y }
}

/// Distance from the origin, in sizes of the scene, beyond which positions are relative to the scene's middle.
const FAR: f64 = 100.0;

/// Least number of f32 values along the longest side of a mesh; with fewer, rounding is visible.
const MIN_STEPS: f64 = 4096.0;

/// A bounding box of points.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Bounds {
    low: DVec3,
    high: DVec3,
}

impl Default for Bounds {
    fn default() -> Self {
        Self { low: DVec3::INFINITY, high: DVec3::NEG_INFINITY }
    }
}

impl Bounds {
    /// The bounding box of `points`.
    pub fn of(points: impl IntoIterator<Item = DVec3>) -> Self {
        let mut bounds = Self::default();
        points.into_iter().for_each(|point| bounds.add(point));
        bounds
    }

    pub fn add(&mut self, point: DVec3) {
        self.low = self.low.min(point);
        self.high = self.high.max(point);
    }

    /// Includes a box that is transformed by `matrix`.
    pub fn add_placed(&mut self, other: &Self, matrix: &DAffine3) {
        for corner in 0..8 {
            let choose =
                |axis: usize| if corner >> axis & 1 == 0 { other.low[axis] } else { other.high[axis] };
            self.add(matrix.transform_point3(DVec3::new(choose(0), choose(1), choose(2))));
        }
    }

    /// The longest side, and the largest coordinate; `None` if the box is empty, a point or not finite.
    fn size_and_distance(&self) -> Option<[f64; 2]> {
        let size = (self.high - self.low).max_element();
        let distance = self.low.abs().max(self.high.abs()).max_element();
        (size > 0.0 && distance.is_finite()).then_some([size, distance])
    }

    /// Origin to subtract from positions before rounding to f32, so that the shape keeps its precision; zero unless
    /// the box is far from the origin for its size.
    pub fn origin(&self) -> DVec3 {
        match self.size_and_distance() {
            // Rounded to few bits, so that the subtraction is exact.
            Some([size, distance]) if distance > FAR * size => {
                (0.5 * self.low + 0.5 * self.high).as_vec3().as_dvec3()
            }
            _ => DVec3::ZERO,
        }
    }

    /// Number of f32 values along the longest side, if it is too small for the shape.
    fn too_few_steps(&self) -> Option<f64> {
        let [size, distance] = self.size_and_distance()?;
        let steps = size / (distance * f64::from(f32::EPSILON));
        (steps < MIN_STEPS).then_some(steps)
    }

    /// Warns if the surface `name`, whose positions are f32 and fill the box, is distorted by rounding.
    pub fn rounded(&self, name: &str) -> Option<Warning> {
        let steps = self.too_few_steps()?;
        let what = "stored so far from the origin that 32-bit positions lose the shape: move the geometry to the origin in the \
                    program that made it";
        let detail =
            format!("`{name}`: about {:.0} different positions along its longest side", steps.max(1.0));
        Some(Warning::about(Code::CoordinatesFarFromOrigin, "surface", what, detail))
    }
}

/// Reports the origin of positions.
pub(super) fn recentred(origin: DVec3) -> Warning {
    let message = format!(
        "the scene is more than {FAR} times its size away from its origin, so positions are computed relative to ({}, {}, {}), \
         which keeps its shape; coordinates in files and flags stay as they are",
        origin.x, origin.y, origin.z
    );
    Warning::new(Code::CoordinatesRecentred, message)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_index_out_of_range_and_a_nan_are_named() {
        let corners = vec![Vec3::ZERO, Vec3::X, Vec3::Y];
        let error = Mesh::new("m", corners.clone(), vec![[0, 1, 2], [2, 1, 7]], 0).unwrap_err();
        assert!(error.contains("triangle 1 uses vertex 7"), "{error}");
        let error = Mesh::new("m", vec![Vec3::ZERO, Vec3::NAN, Vec3::Y], vec![], 0).unwrap_err();
        assert!(error.contains("vertex 1"), "{error}");
    }

    #[test]
    fn smooth_normals_of_a_fold_lie_between_its_faces() {
        // Two unit squares' worth of triangles meeting at a right angle along x.
        let positions = [Vec3::ZERO, Vec3::X, Vec3::Z, Vec3::Y];
        let normals = smooth_normals(&positions, &[[0, 2, 1], [0, 1, 3]]);
        assert_eq!(normals[2], Vec3::Y);
        assert_eq!(normals[3], Vec3::Z);
        assert!((normals[0] - Vec3::new(0.0, 0.5f32.sqrt(), 0.5f32.sqrt())).length() < 1e-6);
    }

    fn patch(at: DVec3) -> Bounds {
        Bounds::of([at - 0.5, at + 0.5])
    }

    #[test]
    fn only_what_is_far_for_its_size_is_recentred() {
        let utm = DVec3::new(500_000.0, 0.0, 4_000_000.0);
        assert_eq!(patch(utm).origin(), utm);
        for near in [DVec3::ZERO, DVec3::new(50.0, -90.0, 0.0)] {
            assert_eq!(patch(near).origin(), DVec3::ZERO);
        }
        for nothing in [Bounds::default(), Bounds::of([utm]), Bounds::of([utm, DVec3::INFINITY])] {
            assert_eq!((nothing.origin(), nothing.too_few_steps()), (DVec3::ZERO, None));
        }
    }

    #[test]
    fn a_mesh_that_f32_cannot_hold_is_reported() {
        let square =
            |x: f64, side: f64| Bounds::of([DVec3::new(x, 0.0, 0.0), DVec3::new(x + side, 1.0, 0.0)]);
        assert!(square(4e6, 1.0).rounded("a").unwrap().to_string().contains("`a`: about 2 different"));
        // Four kilometres at the same distance have a resolution of half a metre, which is enough.
        assert!(square(4e6, 4e3).rounded("b").is_none());
        assert!(square(100.0, 1.0).rounded("c").is_none() && Bounds::default().rounded("d").is_none());
    }

    #[test]
    fn a_placed_box_holds_its_corners() {
        let turn = DAffine3::from_rotation_z(std::f64::consts::FRAC_PI_2);
        let mut all = Bounds::default();
        all.add_placed(&Bounds::of([DVec3::ZERO, DVec3::new(2.0, 1.0, 0.0)]), &turn);
        assert!((all.low - DVec3::new(-1.0, 0.0, 0.0)).length() < 1e-12);
        assert!((all.high - DVec3::new(0.0, 2.0, 0.0)).length() < 1e-12);
    }
}
