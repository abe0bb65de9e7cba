//! One frame of a scene: the camera and every mesh at both ends of the shutter.

use std::sync::Arc;

use glam::{Affine3A, DAffine3, DVec3, DVec4, Vec2, Vec3};
use pipeline::{Camera, Clip, Cull, Draw, Geometry};
use serde::Serialize;

use super::Scene;
use super::deform::{InstanceTransforms, Pose};
use super::mesh::{Instance, Mesh, Normals, smooth_normals};
use crate::material::Alpha;

/// A scene during one shutter interval: everything that changes from frame to frame.
///
/// It contains neither its number nor its time. Two frames with the same content give the same image and the same
/// work, and their [`Fingerprint`](crate::Fingerprint)s are equal.
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
/// shares it between frames. A still vertex of a moving mesh has the same bits at both ends.
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
    /// Part of lens and shutter in which it is drawn.
    pub clip: Clip,
}

/// Reason why a frame cannot be made.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum FrameError {
    /// A vertex position overflows.
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
        /// Description of the error.
        message: String,
    },
    /// The pipeline rejects a mesh.
    #[error("mesh `{mesh}`: {message}")]
    Draw {
        /// The mesh.
        mesh: String,
        /// Description of the error.
        message: String,
    },
}

impl Frame {
    /// Draws of the frame, one for each mesh that has triangles: meshes in the scene's order, then blended
    /// ones from far to near by their middles. `scene` has to be the scene that made this frame.
    ///
    /// # Errors
    /// [`FrameError::Draw`] if the pipeline rejects a mesh.
    pub fn draws<'a>(&'a self, scene: &'a Scene) -> Result<Vec<Draw<'a>>, FrameError> {
        self.drawn(scene).into_iter().map(|mesh| mesh.draw(scene)).collect()
    }

    /// Meshes with triangles, in the order in which they are drawn.
    pub(crate) fn drawn(&self, scene: &Scene) -> Vec<&FrameMesh> {
        let is_blended = |mesh: &&FrameMesh| {
            scene.materials().get(mesh.material).is_some_and(|material| material.alpha == Alpha::Blended)
        };
        let meshes = self.meshes.iter().filter(|mesh| !mesh.triangles.is_empty());
        let (mut blended, mut drawn): (Vec<_>, Vec<_>) = meshes.partition(is_blended);
        let eye = 0.5 * (self.camera.open().translation + self.camera.close().translation);
        let distance = |mesh: &FrameMesh| mesh.middle().distance_squared(eye.into());
        blended.sort_by(|a, b| distance(b).total_cmp(&distance(a)));
        drawn.append(&mut blended);
        drawn
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
    /// Whether the mesh is still while the shutter is open.
    pub fn is_still(&self) -> bool {
        Arc::ptr_eq(&self.open, &self.close)
    }

    /// Middle of the box around the mesh at both ends of the shutter.
    fn middle(&self) -> Vec3 {
        let points = || self.open.iter().chain(self.close.iter()).copied();
        let corner = |pick: fn(Vec3, Vec3) -> Vec3| points().reduce(pick).unwrap_or_default();
        0.5 * (corner(Vec3::min) + corner(Vec3::max))
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
        let shader = shader.ok_or_else(|| refused(format!("unknown material {}", self.material)))?;
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
        let state = scene.materials()[self.material].state();
        let geometry = geometry.with_clip(self.clip);
        Ok(Draw::new(geometry, shader, state.cull).with_state(state))
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
        let open = self.open.transforms(&scene.graph, instance);
        let close = self.close.transforms(&scene.graph, instance);
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
        let middle = self.middle.transforms(&scene.graph, instance);
        let triangles = if self.open.transforms(&scene.graph, instance).mirrors() {
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
            clip: instance.clip,
        })
    }
}

fn still(mesh: &Mesh, transforms: &InstanceTransforms) -> Path {
    let open: Arc<[Vec3]> =
        (0..mesh.positions.len()).map(|index| transforms.position(mesh, index).as_vec3()).collect();
    (Arc::clone(&open), open)
}

fn moving(mesh: &Mesh, open: &InstanceTransforms, close: &InstanceTransforms) -> Path {
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

/// Whether a displacement is only f64 rounding, as of a vertex on the axis of a spin. It must not count as motion.
fn is_noise(from: DVec3, to: DVec3) -> bool {
    (to - from).abs().max_element() <= 1e-13 * from.abs().max_element().max(to.abs().max_element())
}

fn normals(
    mesh: &Mesh,
    middle: &InstanceTransforms,
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

/// Number of times at which a moving triangle is tested.
const INSTANTS: u32 = 9;

/// The space in view between the plane of the camera and a depth.
#[derive(Clone, Debug)]
pub struct NearSpace {
    open: DAffine3,
    close: DAffine3,
    orthographic: bool,
    /// Largest depth, in scene units.
    depth: f64,
    /// A point `p` of camera space is inside a plane where `plane . (p, 1) >= 0`.
    planes: [DVec4; 6],
}

impl NearSpace {
    /// The space in view of `camera` nearer than `depth`, from the whole lens, for an image `aspect` times as
    /// wide as high.
    pub fn new(camera: &Camera, aspect: f64, depth: f64) -> Self {
        let half = f64::from(camera.half_height());
        let shift = 2.0 * half * camera.shift().as_dvec2();
        // A lens widens the view by `radius |z / focus - 1|`, which a chord bounds.
        let [blur, growth] = camera.lens().map_or([0.0; 2], |lens| {
            let [radius, focus] = [lens.radius(), lens.focus()].map(f64::from);
            [radius, radius * ((depth / focus - 1.0).abs() - 1.0) / depth]
        });
        let side = |toward: DVec3, half: f64| {
            let [by_depth, constant] = if camera.is_orthographic() { [0.0, half] } else { [half, 0.0] };
            (toward + (by_depth + growth) * DVec3::Z).extend(constant + blur)
        };
        // A shift of the image moves the view the other way.
        let [x, y] = [shift.x, -shift.y];
        let planes = [
            DVec3::Z.extend(0.0),
            DVec3::NEG_Z.extend(depth),
            side(DVec3::X, half * aspect + x),
            side(DVec3::NEG_X, half * aspect - x),
            side(DVec3::Y, half + y),
            side(DVec3::NEG_Y, half - y),
        ];
        let [open, close] = [camera.open(), camera.close()].map(widen);
        Self { open, close, orthographic: camera.is_orthographic(), depth, planes }
    }

    /// The depth of the nearest point inside of a triangle whose corners move from `open` to `close` in world
    /// space, and of which the faces are drawn that `cull` leaves; `None` where nothing of it is inside.
    pub fn nearest(&self, open: [Vec3; 3], close: [Vec3; 3], cull: Cull) -> Option<f64> {
        let from = open.map(|corner| self.open.transform_point3(corner.as_dvec3()));
        let to = close.map(|corner| self.close.transform_point3(corner.as_dvec3()));
        let depths = || from.iter().chain(&to).map(|corner| corner.z);
        if depths().all(|depth| depth >= self.depth) || depths().all(|depth| depth <= 0.0) {
            return None;
        }
        let instants = if from == to { 1 } else { INSTANTS };
        let at = |instant: u32| {
            let time = f64::from(instant) / f64::from(INSTANTS - 1);
            [0, 1, 2].map(|corner| from[corner].lerp(to[corner], time))
        };
        (0..instants).filter_map(|instant| self.nearest_at_once(at(instant), cull)).min_by(f64::total_cmp)
    }

    fn nearest_at_once(&self, corners: [DVec3; 3], cull: Cull) -> Option<f64> {
        let is_drawn = match (cull, self.facing(&corners)) {
            (_, 0.0) => false,
            (Cull::None, _) => true,
            (Cull::Back, facing) => facing > 0.0,
            (Cull::Front, facing) => facing < 0.0,
        };
        if !is_drawn {
            return None;
        }
        let inside = self.planes.iter().fold(corners.to_vec(), |polygon, plane| clipped(&polygon, *plane));
        inside.iter().map(|point| point.z).min_by(f64::total_cmp)
    }

    /// Above zero where the front of a triangle is seen, zero where it is seen from its edge.
    fn facing(&self, [a, b, c]: &[DVec3; 3]) -> f64 {
        let normal = (*b - *a).cross(*c - *a);
        let along = if self.orthographic { DVec3::Z } else { *a };
        let facing = normal.dot(along);
        if facing.abs() <= 1e-12 * normal.length() * along.length() { 0.0 } else { facing }
    }
}

fn widen(pose: Affine3A) -> DAffine3 {
    DAffine3::from_cols_array(&pose.to_cols_array().map(f64::from))
}

/// The part of a convex polygon inside a plane (Sutherland and Hodgman 1974).
fn clipped(polygon: &[DVec3], plane: DVec4) -> Vec<DVec3> {
    let height = |point: DVec3| plane.dot(point.extend(1.0));
    let mut inside = Vec::with_capacity(polygon.len() + 1);
    for (&from, &to) in polygon.iter().zip(polygon.iter().cycle().skip(1)) {
        let [start, end] = [height(from), height(to)];
        if start >= 0.0 {
            inside.push(from);
        }
        if (start >= 0.0) != (end >= 0.0) {
            inside.push(from.lerp(to, start / (start - end)));
        }
    }
    inside
}

#[cfg(test)]
mod tests {
    use super::*;
    use pipeline::Lens;

    /// A wall across the view at a depth, reaching `low` to `high` on both axes; it faces the camera.
    fn wall(depth: f32, low: f32, high: f32) -> [Vec3; 3] {
        [[low, low], [2.0 * high - low, low], [low, 2.0 * high - low]].map(|[x, y]| Vec3::new(x, y, depth))
    }

    fn pinhole() -> Camera {
        Camera::new(Affine3A::IDENTITY, 0.5, 1.0).unwrap()
    }

    fn nearest(camera: &Camera, open: [Vec3; 3], close: [Vec3; 3]) -> Option<f64> {
        NearSpace::new(camera, 2.0, 1.0).nearest(open, close, Cull::None)
    }

    #[test]
    fn what_is_in_view_below_the_depth_is_found() {
        let still = |triangle: [Vec3; 3]| nearest(&pinhole(), triangle, triangle);
        assert_eq!(still(wall(0.25, -1.0, 1.0)), Some(0.25));
        assert_eq!(still(wall(1.5, -1.0, 1.0)), None, "beyond");
        assert_eq!(still(wall(-0.5, -1.0, 1.0)), None, "behind");
        assert_eq!(still(wall(0.25, 0.3, 9.0)), None, "beside");
        // A floor half below the eye enters the view at the depth of 1, whose half height is 0.5.
        let floor = |y: f32| [[-99.0, -99.0], [0.0, 199.0], [99.0, -99.0]].map(|[x, z]| Vec3::new(x, y, z));
        assert_eq!(still(floor(-0.51)), None);
        let depth = still(floor(-0.25)).unwrap();
        assert!((depth - 0.5).abs() < 1e-6, "{depth}");
        assert_eq!(still(floor(0.0)), None, "seen from its edge");
    }

    #[test]
    fn moving_shifted_orthographic_and_lens_views_are_their_own() {
        let far = wall(3.0, -1.0, 1.0);
        let depth = nearest(&pinhole(), far, wall(0.5, -1.0, 1.0)).unwrap();
        assert_eq!(depth, 0.5);
        let aside = wall(0.5, 0.3, 0.6);
        assert_eq!(nearest(&pinhole(), aside, aside), None);
        // Moved by a quarter of the image down, the view holds what was above it.
        let shifted = pinhole().with_shift(Vec2::new(0.0, 0.25)).unwrap();
        assert!(nearest(&shifted, aside, aside).is_some());
        let wide = Camera::orthographic(Affine3A::IDENTITY, 0.5, 1.0).unwrap();
        assert!(nearest(&wide, aside, aside).is_some());
        let lens = pinhole().with_lens(Some(Lens::new(0.2, 4.0).unwrap()));
        assert!(nearest(&lens, aside, aside).is_some());
    }

    #[test]
    fn faces_that_are_not_drawn_are_not_seen() {
        let space = NearSpace::new(&pinhole(), 2.0, 1.0);
        let [a, b, c] = wall(0.5, -1.0, 1.0);
        let seen = |corners, cull| space.nearest(corners, corners, cull).is_some();
        assert_eq!(
            [Cull::None, Cull::Back, Cull::Front].map(|cull| seen([a, b, c], cull)),
            [true, true, false]
        );
        assert_eq!(
            [Cull::None, Cull::Back, Cull::Front].map(|cull| seen([a, c, b], cull)),
            [true, false, true]
        );
    }
}
