//! One frame of a scene: the camera and every mesh at both ends of the shutter.

use std::sync::Arc;

use glam::{DVec3, Vec2, Vec3};
use pipeline::{Camera, Cull, Draw, Geometry};
use serde::Serialize;

use super::Scene;
use super::deform::{Carriage, Pose};
use super::mesh::{Instance, Mesh, Normals, smooth_normals};
use super::near::NearSpace;

/// A scene between the opening and the closing of one frame's shutter: everything that changes from frame to frame.
///
/// It does not know its number or its time, so two frames of a scene with the same content draw the same picture with the same
/// work; their [`Fingerprint`](crate::Fingerprint)s show it.
#[derive(Clone, Debug, Serialize)]
pub struct Frame {
    /// The camera, its motion and its lens.
    pub camera: Camera,
    /// Every mesh, in the scene's order.
    pub meshes: Vec<FrameMesh>,
}

/// A mesh in world space at both ends of the shutter.
///
/// A mesh that does not move during the shutter shares one storage for both ends, and one that never moves
/// shares it between frames. A vertex that stays put in a moving mesh has the same bits at both ends.
#[derive(Clone, Debug, Serialize)]
pub struct FrameMesh {
    /// Name for messages.
    pub name: String,
    /// Positions when the shutter opens.
    pub open: Arc<[Vec3]>,
    /// Positions when it closes.
    pub close: Arc<[Vec3]>,
    /// Unit normals at mid-shutter; empty where faces are flat.
    pub normals: Arc<[Vec3]>,
    /// Texture coordinates; empty where there are none.
    pub uvs: Arc<[Vec2]>,
    /// Vertex colours in linear RGB; empty where there are none.
    pub colors: Arc<[Vec3]>,
    /// Vertex indices of each triangle, counter-clockwise seen from the front.
    pub triangles: Arc<[[u32; 3]]>,
    /// Index of the material in [`Scene::materials`].
    pub material: usize,
}

/// Why a frame cannot be made.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum FrameError {
    /// A vertex leaves the range of numbers.
    #[error(
        "frame {frame}: mesh `{mesh}`: the position of vertex {vertex} is not finite, because a transform or an animation overflows: fix its scale or its keys"
    )]
    NotFinite {
        /// The frame.
        frame: u32,
        /// The mesh.
        mesh: String,
        /// The vertex, from 0.
        vertex: usize,
    },
    /// The camera cannot be placed.
    #[error("frame {frame}: camera: {message}")]
    Camera {
        /// The frame.
        frame: u32,
        /// What is wrong.
        message: String,
    },
    /// The pipeline does not take a mesh.
    #[error("mesh `{mesh}`: {message}")]
    Draw {
        /// The mesh.
        mesh: String,
        /// What is wrong.
        message: String,
    },
}

impl Frame {
    /// The frame as the pipeline takes it, one draw for each mesh that has triangles. `scene` has to be the
    /// one that made this frame.
    ///
    /// # Errors
    /// [`FrameError::Draw`] when the pipeline does not take a mesh.
    pub fn draws<'a>(&'a self, scene: &'a Scene) -> Result<Vec<Draw<'a>>, FrameError> {
        self.meshes.iter().filter(|mesh| !mesh.triangles.is_empty()).map(|mesh| mesh.draw(scene)).collect()
    }

    /// Whether the camera or any vertex moves while the shutter is open.
    pub fn is_moving(&self) -> bool {
        self.camera.open() != self.camera.close() || self.meshes.iter().any(|mesh| !mesh.is_still())
    }

    /// Triangles in the frame.
    pub fn triangle_count(&self) -> usize {
        self.meshes.iter().map(|mesh| mesh.triangles.len()).sum()
    }
}

impl FrameMesh {
    /// Whether nothing of the mesh moves while the shutter is open.
    pub fn is_still(&self) -> bool {
        Arc::ptr_eq(&self.open, &self.close)
    }

    /// Depth of the nearest point of the mesh in `space`.
    pub(super) fn nearest(&self, space: &NearSpace) -> Option<f64> {
        let corners = |triangle: &[u32; 3], end: &[Vec3]| triangle.map(|vertex| end[vertex as usize]);
        let nearest = |triangle| {
            space.nearest(corners(triangle, &self.open), corners(triangle, &self.close), Cull::None)
        };
        self.triangles.iter().filter_map(nearest).min_by(f64::total_cmp)
    }

    fn draw<'a>(&'a self, scene: &'a Scene) -> Result<Draw<'a>, FrameError> {
        let refused = |message: String| FrameError::Draw { mesh: self.name.clone(), message };
        let shader = scene.shader(self.material, !self.colors.is_empty());
        let shader = shader.ok_or_else(|| refused(format!("there is no material {}", self.material)))?;
        let mut geometry =
            Geometry::new(&self.open, &self.close, &self.triangles).map_err(|e| refused(e.to_string()))?;
        if !self.normals.is_empty() {
            geometry = geometry.with_normals(&self.normals).map_err(|e| refused(e.to_string()))?;
        }
        if !self.uvs.is_empty() {
            geometry = geometry.with_uvs(&self.uvs).map_err(|e| refused(e.to_string()))?;
        }
        if !self.colors.is_empty() {
            geometry = geometry.with_colors(&self.colors).map_err(|e| refused(e.to_string()))?;
        }
        let cull = if scene.materials()[self.material].double_sided { Cull::None } else { Cull::Back };
        Ok(Draw { geometry, shader, cull })
    }
}

/// Poses of the scene at the ends and in the middle of one shutter interval.
pub(super) struct Interval {
    pub frame: u32,
    pub open: Pose,
    pub middle: Pose,
    pub close: Pose,
}

/// Positions at both ends.
pub(super) type Path = (Arc<[Vec3]>, Arc<[Vec3]>);

impl Interval {
    pub fn path(&self, scene: &Scene, instance: Instance) -> Result<Path, FrameError> {
        let mesh = &scene.graph.meshes[instance.mesh];
        let open = self.open.carriage(&scene.graph, instance);
        let close = self.close.carriage(&scene.graph, instance);
        let (from, to) = if open == close { still(mesh, &open) } else { moving(mesh, &open, &close) };
        for end in [&from, &to] {
            if let Some(vertex) = end.iter().position(|p| !p.is_finite()) {
                return Err(FrameError::NotFinite { frame: self.frame, mesh: mesh.name.clone(), vertex });
            }
        }
        Ok((from, to))
    }

    pub fn mesh(&self, scene: &Scene, instance: Instance) -> Result<FrameMesh, FrameError> {
        let mesh = &scene.graph.meshes[instance.mesh];
        let (open, close) = self.path(scene, instance)?;
        let middle = self.middle.carriage(&scene.graph, instance);
        let triangles = if self.open.carriage(&scene.graph, instance).mirrors() {
            mesh.triangles.iter().map(|[a, b, c]| [*a, *c, *b]).collect()
        } else {
            Arc::clone(&mesh.triangles)
        };
        Ok(FrameMesh {
            name: mesh.name.clone(),
            normals: normals(mesh, &middle, (&open, &close), &triangles),
            open,
            close,
            uvs: Arc::clone(&mesh.uvs),
            colors: Arc::clone(&mesh.colors),
            triangles,
            material: mesh.material,
        })
    }
}

fn still(mesh: &Mesh, carriage: &Carriage) -> Path {
    let open: Arc<[Vec3]> =
        (0..mesh.positions.len()).map(|index| carriage.position(mesh, index).as_vec3()).collect();
    (Arc::clone(&open), open)
}

fn moving(mesh: &Mesh, open: &Carriage, close: &Carriage) -> Path {
    let ends = |index| {
        let (from, to) = (open.position(mesh, index), close.position(mesh, index));
        (from.as_vec3(), if is_noise(from, to) { from } else { to }.as_vec3())
    };
    let (from, to): (Vec<Vec3>, Vec<Vec3>) = (0..mesh.positions.len()).map(ends).unzip();
    let from: Arc<[Vec3]> = from.into();
    let same =
        from.iter().zip(&to).all(|(a, b)| a.to_array().map(f32::to_bits) == b.to_array().map(f32::to_bits));
    let to = if same { Arc::clone(&from) } else { to.into() };
    (from, to)
}

/// A vertex on the axis of a spin stays put but for the rounding of f64; rounding must not look like motion.
fn is_noise(from: DVec3, to: DVec3) -> bool {
    (to - from).abs().max_element() <= 1e-13 * from.abs().max_element().max(to.abs().max_element())
}

fn normals(
    mesh: &Mesh,
    middle: &Carriage,
    (open, close): (&[Vec3], &[Vec3]),
    triangles: &[[u32; 3]],
) -> Arc<[Vec3]> {
    match &mesh.normals {
        Normals::Flat => Arc::from([]),
        Normals::Smooth => {
            let between: Vec<Vec3> = open.iter().zip(close).map(|(a, b)| *a + 0.5 * (*b - *a)).collect();
            smooth_normals(&between, triangles).into()
        }
        Normals::Given(_) => {
            let cofactors = middle.cofactors();
            let of = |index| middle.normal(mesh, index, &cofactors).unwrap_or(Vec3::Y);
            (0..mesh.positions.len()).map(of).collect()
        }
    }
}
