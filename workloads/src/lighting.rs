//! Light: the lamp and the sky of a scene, and point lights of finite range. Surfaces are diffuse (Lambert 1760), with a highlight
//! (Blinn, Models of light reflection, SIGGRAPH 1977).

use glam::Vec3;
use pipeline::Lane;

/// One directional light, and an ambient term that depends on the normal of the surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Light {
    /// Unit vector from the scene towards the lamp; `None` for a lamp over the camera's shoulder, placed with
    /// the camera.
    pub toward: Option<Vec3>,
    /// Linear RGB radiance of a white surface that faces the lamp, by the lamp alone.
    pub color: Vec3,
    /// Linear RGB radiance of a white surface with its normal upwards, by the sky alone.
    pub sky: Vec3,
    /// The same with the normal downwards.
    pub ground: Vec3,
}

impl Default for Light {
    fn default() -> Self {
        Self {
            toward: None,
            color: Vec3::new(0.74, 0.71, 0.66),
            sky: Vec3::new(0.26, 0.29, 0.34),
            ground: Vec3::new(0.12, 0.11, 0.10),
        }
    }
}

/// Largest share of a lamp's light in the highlight.
pub(crate) const HIGHLIGHT: f32 = 0.12;

/// What light meets at a point of a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LitPoint {
    /// Linear RGB reflectance.
    pub base: Vec3,
    /// Unit normal, facing the camera.
    pub normal: Vec3,
    /// Unit vector to the camera.
    pub to_camera: Vec3,
    /// Largest share of a lamp's light in the highlight.
    pub gloss: f32,
}

impl LitPoint {
    /// Diffuse and glossy share of light from the direction `toward`.
    fn lobes(&self, lane: &Lane, toward: Vec3) -> [f32; 2] {
        let half = lane.add(toward, self.to_camera);
        let length = lane.max(lane.sqrt(lane.dot(half, half)), f32::MIN_POSITIVE);
        let half = lane.scale(half, lane.recip(length));
        let facing = lane.max(lane.dot(self.normal, toward), 0.0);
        let glint = pow32(lane, lane.max(lane.dot(self.normal, half), 0.0));
        // No highlight on the side turned away from the lamp.
        [facing, lane.select_greater([facing, 0.0], lane.mul(self.gloss, glint), 0.0)]
    }
}

fn pow32(lane: &Lane, x: f32) -> f32 {
    (0..5).fold(x, |power, _| lane.mul(power, power))
}

/// The lamp and the sky of a scene, as shaders compute them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lighting {
    toward: Vec3,
    lamp: Vec3,
    ground: Vec3,
    sky_over_ground: Vec3,
}

impl Lighting {
    /// The light of a scene, whose direction has to be known.
    pub fn new(light: &Light) -> Self {
        Self {
            toward: light.toward.unwrap_or(Vec3::Y),
            lamp: light.color,
            ground: light.ground,
            sky_over_ground: light.sky - light.ground,
        }
    }

    /// Linear RGB radiance of a point: `base (lamp max(0, n.l) + mix(ground, sky, n.y)) + gloss lamp max(0, n.h)^32`, with the half
    /// vector `h`.
    pub fn radiance(&self, lane: &Lane, at: &LitPoint) -> Vec3 {
        let [facing, glint] = at.lobes(lane, self.toward);
        let up = lane.madd(0.5, at.normal.y, 0.5);
        let ambient = lane.madd(Vec3::splat(up), self.sky_over_ground, self.ground);
        let diffuse = lane.mul(at.base, lane.madd(Vec3::splat(facing), self.lamp, ambient));
        lane.madd(Vec3::splat(glint), self.lamp, diffuse)
    }
}

/// A light at a point. Beyond its range it adds exactly nothing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PointLight {
    /// Position in world space.
    pub position: Vec3,
    /// Linear RGB radiance of a white surface that faces it from next to it.
    pub color: Vec3,
    /// Range in scene units.
    pub range: f32,
}

impl PointLight {
    /// Linear RGB radiance that the light adds at `position`: as [`Lighting::radiance`] without a sky, times
    /// `max(0, 1 - (distance / range)^2)^2`.
    pub fn radiance(&self, lane: &Lane, at: &LitPoint, position: Vec3) -> Vec3 {
        let to_light = lane.sub(self.position, position);
        let square = lane.dot(to_light, to_light);
        let length = lane.max(lane.sqrt(square), f32::MIN_POSITIVE);
        let [facing, glint] = at.lobes(lane, lane.scale(to_light, lane.recip(length)));
        let fade = lane.max(lane.madd(square, -1.0 / (self.range * self.range), 1.0), 0.0);
        let color = lane.scale(self.color, lane.mul(fade, fade));
        let diffuse = lane.mul(at.base, lane.scale(color, facing));
        lane.madd(Vec3::splat(glint), color, diffuse)
    }
}
