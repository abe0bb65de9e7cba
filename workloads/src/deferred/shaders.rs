//! Shaders that light surfaces: forward, and from a G-buffer by a quad over the screen or by a light volume.

use glam::{Vec3, Vec4};
use pipeline::{Camera, Lane, Shader, ShadingPoint, Texture};

use super::buffer::Reader;
use crate::lighting::{Lighting, PointLight};
use crate::material::SurfaceShader;

/// A surface under the light of its scene and point lights.
pub(super) struct Forward<'a> {
    pub surface: &'a SurfaceShader,
    pub lights: &'a [PointLight],
}

impl Shader for Forward<'_> {
    fn texture(&self) -> Option<&Texture> {
        self.surface.texture()
    }

    fn shade(&self, lane: &Lane, at: &ShadingPoint, texel: Vec4) -> Vec4 {
        let (point, opacity) = self.surface.surface(lane, at, texel);
        if !self.surface.is_lit() {
            return point.base.extend(opacity);
        }
        let scene = self.surface.lighting().radiance(lane, &point);
        let add = |sum, light: &PointLight| lane.add(sum, light.radiance(lane, &point, at.position));
        self.lights.iter().fold(scene, add).extend(opacity)
    }

    fn may_discard(&self) -> bool {
        self.surface.may_discard()
    }
}

/// The rays of a still pinhole or orthographic camera.
#[derive(Clone, Copy, Debug)]
pub(super) struct CameraRays {
    eye: Vec3,
    forward: Vec3,
    is_orthographic: bool,
}

impl CameraRays {
    /// The rays when the shutter opens.
    pub fn new(camera: &Camera) -> Self {
        let world = camera.open().inverse();
        let (eye, forward) = (world.translation.into(), world.matrix3.z_axis.into());
        Self { eye, forward, is_orthographic: camera.is_orthographic() }
    }

    /// The point at `depth` on the ray through `through`.
    pub fn at(&self, lane: &Lane, through: Vec3, depth: f32) -> Vec3 {
        let from_eye = lane.sub(through, self.eye);
        let own = lane.dot(from_eye, self.forward);
        let ray = if self.is_orthographic { self.forward } else { lane.scale(from_eye, lane.recip(own)) };
        lane.madd(ray, Vec3::splat(lane.sub(depth, own)), through)
    }
}

/// Lights a G-buffer: the light of the scene and `lights`.
pub(super) struct Screen<'a> {
    pub reader: Reader,
    pub rays: CameraRays,
    pub scene: Lighting,
    pub lights: &'a [PointLight],
}

impl Shader for Screen<'_> {
    fn shade(&self, lane: &Lane, at: &ShadingPoint, _: Vec4) -> Vec4 {
        let Some(stored) = self.reader.read(lane, at) else { return Vec4::ZERO };
        let point = stored.point;
        if !stored.is_lit {
            return point.base.extend(1.0);
        }
        let scene = self.scene.radiance(lane, &point);
        if self.lights.is_empty() {
            return scene.extend(1.0);
        }
        let position = self.rays.at(lane, at.position, stored.depth);
        let add = |sum, light: &PointLight| lane.add(sum, light.radiance(lane, &point, position));
        self.lights.iter().fold(scene, add).extend(1.0)
    }
}

/// Light of one point light on a G-buffer, for the pixels of its volume.
pub(super) struct Volume {
    pub reader: Reader,
    pub rays: CameraRays,
    pub light: PointLight,
}

impl Shader for Volume {
    fn shade(&self, lane: &Lane, at: &ShadingPoint, _: Vec4) -> Vec4 {
        let stored = self.reader.read(lane, at).filter(|stored| stored.is_lit);
        let Some(stored) = stored else { return Vec4::ZERO };
        let position = self.rays.at(lane, at.position, stored.depth);
        self.light.radiance(lane, &stored.point, position).extend(0.0)
    }
}
