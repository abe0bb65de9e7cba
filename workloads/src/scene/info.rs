//! Summary of a scene's content, for display before rendering, with a suggested lens.

use std::collections::BTreeSet;
use std::sync::Arc;

use glam::DVec3;
use serde::Serialize;
use warnings::Warning;

use super::Scene;
use super::camera::{Frustum, Rig};
use super::camera_used::{CameraUsed, field_of_view};
use super::frame::FrameError;
use super::graph::movers;
use super::settings::SceneSettings;
use crate::material::Alpha;

/// Summary of a scene. Lengths are in scene units; bounds are those of the first requested frame, while its
/// shutter is open.
#[derive(Clone, Debug, Serialize)]
pub struct SceneInfo {
    /// Name of the scene, or the file it came from.
    pub name: String,
    /// Triangles in every frame.
    pub triangles: usize,
    /// Vertices in every frame.
    pub vertices: usize,
    /// Instances of meshes; a mesh on two nodes counts twice.
    pub meshes: Vec<MeshInfo>,
    /// Materials.
    pub materials: Vec<MaterialInfo>,
    /// Different textures.
    pub textures: Vec<TextureInfo>,
    /// Smallest and largest coordinates.
    pub bounds: [[f64; 3]; 2],
    /// Length along each axis.
    pub extent: [f64; 3],
    /// Whether any vertex moves.
    pub animated: bool,
    /// Animation clips; one plays at a time.
    pub clips: Vec<ClipInfo>,
    /// Joints of each skin.
    pub skins: Vec<usize>,
    /// The scene's own cameras.
    pub cameras: Vec<CameraInfo>,
    /// The light.
    pub light: LightInfo,
    /// Size of the image, sampling, time and lens.
    pub settings: SettingsInfo,
    /// The camera of the scene.
    pub camera: CameraUsed,
    /// A suggested lens.
    pub suggested: Option<LensInfo>,
    /// Warnings about ignored, replaced or repaired content.
    pub warnings: Vec<Warning>,
}

/// A mesh.
#[derive(Clone, Debug, Serialize)]
#[allow(missing_docs, reason = "the names say it")]
pub struct MeshInfo {
    pub name: String,
    pub triangles: usize,
    pub vertices: usize,
    pub material: usize,
    pub skinned: bool,
    pub morph_targets: usize,
    /// Whether its vertices depend on time.
    pub moves: bool,
}

/// A material.
#[derive(Clone, Debug, Serialize)]
#[allow(missing_docs, reason = "the names say it")]
pub struct MaterialInfo {
    pub name: String,
    /// Linear RGB reflectance.
    pub color: [f32; 3],
    /// Index of its texture.
    pub texture: Option<usize>,
    pub double_sided: bool,
    pub unlit: bool,
    /// Opacity, and what it does.
    pub opacity: f32,
    pub alpha: Alpha,
}

/// A texture.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct TextureInfo {
    /// Texels across.
    pub width: u32,
    /// Texels down.
    pub height: u32,
    /// Bytes of memory, with smaller copies.
    pub bytes: u64,
}

/// An animation clip.
#[derive(Clone, Debug, Serialize)]
pub struct ClipInfo {
    /// Name.
    pub name: String,
    /// Duration of the loop in seconds.
    pub duration_s: f64,
    /// Tracks, each of one property of one node.
    pub tracks: usize,
    /// Keys of all tracks.
    pub keys: usize,
}

/// A camera of the scene's file.
#[derive(Clone, Debug, Serialize)]
pub struct CameraInfo {
    /// Name.
    pub name: String,
    /// Vertical field of view in degrees; `None` for an orthographic camera.
    pub fov_deg: Option<f64>,
    /// Height of an orthographic view.
    pub view_height: Option<f64>,
    /// Whether the camera moves.
    pub moves: bool,
}

/// The lamp.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct LightInfo {
    /// Unit vector from the scene to the lamp; `None` for a lamp over the camera's shoulder.
    pub toward: Option<[f32; 3]>,
    /// Linear RGB radiance of a white surface that faces the lamp, by the lamp alone.
    pub color: [f32; 3],
}

/// Render settings.
#[derive(Clone, Debug, Serialize)]
#[allow(missing_docs, reason = "the names say it, documented at `SceneSettings`")]
pub struct SettingsInfo {
    pub width: u32,
    pub height: u32,
    pub samples: u32,
    pub frame_rate_hz: f64,
    pub shutter: f64,
    pub frames: [u32; 2],
    pub table: String,
}

impl SettingsInfo {
    /// `settings`, without the lens, which belongs to the camera.
    pub fn new(settings: &SceneSettings) -> Self {
        Self {
            width: settings.width,
            height: settings.height,
            samples: settings.samples,
            frame_rate_hz: settings.frame_rate_hz,
            shutter: settings.shutter,
            frames: [settings.frames.start, settings.frames.end],
            table: settings.table.clone(),
        }
    }
}

/// A lens that blurs the nearest or the farthest corner over a fiftieth of the image's height.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct LensInfo {
    /// Radius of the lens in scene units.
    pub lens_radius: f32,
    /// Focus depth in scene units.
    pub focus: f32,
}

/// Radius of the widest suggested lens, in focus depths.
const WIDEST: f64 = 0.05;

/// Blur of a suggested lens, in heights of the image.
const BLUR: f64 = 0.02;

impl Scene {
    /// Summary of the scene and its camera.
    ///
    /// # Errors
    /// If the first frame cannot be made.
    pub fn info(&self) -> Result<SceneInfo, FrameError> {
        let [low, high] = self.bounds(self.settings.frames.start)?;
        let camera = self.camera_used()?;
        let (materials, textures) = self.surfaces();
        Ok(SceneInfo {
            name: self.name.clone(),
            triangles: self.triangle_count(),
            vertices: self.vertex_count(),
            meshes: self.mesh_infos(),
            materials,
            textures,
            bounds: [low, high].map(|end| (end + self.origin).to_array()),
            extent: (high - low).to_array(),
            animated: self.moving.contains(&true),
            clips: self.clip_infos(),
            skins: self.graph.skins.iter().map(|skin| skin.joints.len()).collect(),
            cameras: self.camera_infos(),
            light: LightInfo {
                toward: self.light.toward.map(|toward| toward.to_array()),
                color: self.light.color.to_array(),
            },
            settings: SettingsInfo::new(&self.settings),
            suggested: self.suggested(&camera, [low, high]),
            camera,
            warnings: self.warnings.clone(),
        })
    }

    fn mesh_infos(&self) -> Vec<MeshInfo> {
        let of = |(instance, moves): (&super::Instance, &bool)| {
            let mesh = &self.graph.meshes[instance.mesh];
            MeshInfo {
                name: mesh.name.clone(),
                triangles: mesh.triangles.len(),
                vertices: mesh.positions.len(),
                material: mesh.material,
                skinned: instance.skin.is_some(),
                morph_targets: mesh.targets.len(),
                moves: *moves,
            }
        };
        self.graph.instances.iter().zip(&self.moving).map(of).collect()
    }

    /// The materials of meshes, and their distinct textures. Materials keep their numbers.
    fn surfaces(&self) -> (Vec<MaterialInfo>, Vec<TextureInfo>) {
        let worn: BTreeSet<usize> =
            self.graph.instances.iter().map(|instance| self.graph.meshes[instance.mesh].material).collect();
        let last = worn.last().map_or(0, |last| last + 1);
        let mut textures: Vec<&Arc<pipeline::Texture>> = Vec::new();
        let mut materials = Vec::new();
        for material in &self.graph.materials[..last.min(self.graph.materials.len())] {
            let texture = material.texture.as_ref().map(|texture| {
                let known = textures.iter().position(|known| Arc::ptr_eq(known, texture));
                known.unwrap_or_else(|| {
                    textures.push(texture);
                    textures.len() - 1
                })
            });
            materials.push(MaterialInfo {
                name: material.name.clone(),
                color: material.base_color.to_array(),
                texture,
                double_sided: material.double_sided,
                unlit: material.unlit,
                opacity: material.opacity,
                alpha: material.alpha,
            });
        }
        let texture = |texture: &&Arc<pipeline::Texture>| {
            let [width, height] = texture.size();
            TextureInfo { width, height, bytes: texture.bytes() }
        };
        (materials, textures.iter().map(texture).collect())
    }

    fn clip_infos(&self) -> Vec<ClipInfo> {
        let of = |clip: &super::AnimationClip| ClipInfo {
            name: clip.name.clone(),
            duration_s: clip.duration_s,
            tracks: clip.tracks.len(),
            keys: clip.tracks.iter().map(|(.., track)| track.key_count()).sum(),
        };
        self.clips.iter().map(of).collect()
    }

    fn camera_infos(&self) -> Vec<CameraInfo> {
        let moving = movers(&self.graph.nodes);
        let of = |own: &super::OwnCamera| {
            let (fov_deg, view_height) = match own.camera.view.unwrap_or_default() {
                Frustum::Perspective { tan_half_height } => (Some(field_of_view(tan_half_height)), None),
                Frustum::Orthographic { half_height } => (None, Some(2.0 * half_height)),
            };
            let moves = match own.camera.rig {
                Rig::Node(node) => moving.get(node).copied().unwrap_or(false),
                _ => own.camera.has_track(),
            };
            CameraInfo { name: own.name.clone(), fov_deg, view_height, moves }
        };
        self.cameras.iter().map(of).collect()
    }

    /// A lens for `camera`. Its blur is largest at the nearest or the farthest visible corner of the bounds.
    fn suggested(&self, camera: &CameraUsed, [low, high]: [DVec3; 2]) -> Option<LensInfo> {
        let (eye, along) = (DVec3::from(camera.position), DVec3::from(camera.direction));
        let corner = |index: usize| {
            DVec3::from_array(std::array::from_fn(|axis| {
                if index >> axis & 1 == 0 { low[axis] } else { high[axis] }
            }))
        };
        let depths = (0..8).map(|index| (corner(index) - eye).dot(along).max(camera.near));
        let focus = f64::from(camera.focus);
        // Diameter of the blur in heights of the image, for a lens of radius 1.
        let blur = |depth: f64| match self.sees() {
            Frustum::Perspective { tan_half_height } => (1.0 / focus - 1.0 / depth).abs() / tan_half_height,
            Frustum::Orthographic { half_height } => (depth / focus - 1.0).abs() / half_height,
        };
        // Points much nearer than the focus are blurred by any lens.
        let most = depths.map(|depth| blur(depth.max(0.2 * focus))).fold(0.0, f64::max);
        let radius = (BLUR / most).min(WIDEST * focus);
        let power = libm::pow(10.0, libm::floor(libm::log10(radius)) - 1.0);
        let lens_radius = ((radius / power).round() * power) as f32;
        let usable = lens_radius.is_finite() && lens_radius > 0.0 && focus.is_finite() && focus > 0.0;
        usable.then_some(LensInfo { lens_radius, focus: camera.focus })
    }
}
