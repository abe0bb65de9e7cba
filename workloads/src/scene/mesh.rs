//! A mesh at rest: its triangles and everything that can deform it.

use std::sync::Arc;

use glam::{DAffine3, Vec2, Vec3};

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
pub struct Target {
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
    /// Their weights, adding up to one for each vertex.
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
    pub targets: Vec<Target>,
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
    /// A mesh of each part, `of_triangle` naming the part of each triangle, with the vertices it uses in the order in which it
    /// uses them. The mesh has to be one that no joints carry.
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
        let target = |target: &Target| Target {
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
    let mut sums = vec![glam::DVec3::ZERO; positions.len()];
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
pub fn unit(v: glam::DVec3) -> Vec3 {
    let length = v.length();
    if length.is_finite() && length > 0.0 { (v / length).as_vec3() } else { Vec3::Y }
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
}
