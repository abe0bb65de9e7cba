//! A rectangle that reflects or refracts, its camera position, and its shading.

use glam::{DVec3, Vec3, Vec4};
use pipeline::texture::linear_to_srgb8;
use pipeline::{Lane, Shader, ShadingPoint, Texture, TextureError, Viewport, Wrap};
use serde::{Deserialize, Serialize};

/// A rectangle in world space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Receiver {
    /// Centre.
    pub centre: DVec3,
    /// Unit vector along the first side.
    pub right: DVec3,
    /// Unit normal, towards the viewer.
    pub normal: DVec3,
    /// Half of the sides, along `right` and across; scene units.
    pub half: [f64; 2],
}

/// Reflection or refraction.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Effect {
    /// Reflection.
    Reflection,
    /// Refraction into a medium with this index.
    Refraction(f64),
}

impl Receiver {
    /// A horizontal rectangle seen from above.
    pub fn lying(centre: DVec3, half: [f64; 2]) -> Self {
        Self { centre, right: DVec3::X, normal: DVec3::Y, half }
    }

    /// Height of a point above the plane, scene units.
    pub fn height(&self, point: DVec3) -> f64 {
        (point - self.centre).dot(self.normal)
    }

    /// Camera position of the map (Figure 13): the viewer mirrored in the plane, or moved along the normal so
    /// that the ray `along`, refracted by Snell's law, comes straight from it. `None` if the viewer is not
    /// above the receiver, or the ray does not go down.
    pub fn eye(&self, eye: DVec3, along: DVec3, effect: Effect) -> Option<DVec3> {
        let height = self.height(eye);
        if !(height > 0.0 && height.is_finite()) {
            return None;
        }
        let Effect::Refraction(index) = effect else { return Some(eye - 2.0 * height * self.normal) };
        let down = -along.dot(self.normal) / along.length();
        if !(down > 1e-6 && index > 0.0) {
            return None;
        }
        let sine = (1.0 - down * down).max(0.0).sqrt();
        // At normal incidence, the ratio of tangents becomes that of sines.
        let refracted = sine / index;
        let cosine = (1.0 - refracted * refracted).max(0.0).sqrt();
        let ratio = if sine < 1e-9 { index } else { (sine / down) * cosine / refracted };
        (ratio.is_finite() && ratio > 0.0).then(|| eye + (ratio - 1.0) * height * self.normal)
    }

    /// Corners, counter-clockwise seen from above, starting at the first row of the map.
    pub fn corners(&self) -> [Vec3; 4] {
        let across = self.right.cross(self.normal);
        [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]]
            .map(|[x, y]| (self.centre + x * self.half[0] * self.right + y * self.half[1] * across).as_vec3())
    }
}

/// Shader of a surface of one colour with a map.
#[derive(Clone, Debug)]
pub struct ReceiverShader {
    map: Texture,
    /// Linear RGB radiance of the surface without the map.
    base: Vec3,
    /// Reflected share at normal incidence.
    normal_share: f32,
}

impl ReceiverShader {
    /// Makes the shader of a receiver with a map. `normal_share` is Schlick's reflectance at normal
    /// incidence; 1 for a mirror, or a fully transparent pane.
    ///
    /// # Errors
    /// [`TextureError`] if the size of the map differs from `viewport`.
    pub fn new(
        map: &[Vec3],
        viewport: Viewport,
        base: Vec3,
        normal_share: f32,
    ) -> Result<Self, TextureError> {
        let texel = |pixel: &Vec3| {
            let [r, g, b] = pixel.to_array().map(linear_to_srgb8);
            [r, g, b, 255]
        };
        let texels = map.iter().map(texel).collect();
        let map = Texture::from_srgb8(viewport.width(), viewport.height(), texels, [Wrap::Clamp; 2])?;
        Ok(Self { map, base, normal_share })
    }
}

impl Shader for ReceiverShader {
    fn texture(&self) -> Option<&Texture> {
        Some(&self.map)
    }

    fn shade(&self, lane: &Lane, at: &ShadingPoint, texel: Vec4) -> Vec4 {
        let away = lane.sub(1.0, lane.saturate(lane.dot(at.normal, at.to_camera)));
        let square = lane.mul(away, away);
        // Schlick 1994.
        let rest = lane.mul(lane.mul(1.0 - self.normal_share, square), square);
        let share = lane.madd(rest, away, self.normal_share);
        let over = lane.sub(texel.truncate(), self.base);
        lane.madd(over, Vec3::splat(share), self.base).extend(1.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_mirrored_position_is_as_far_below() {
        let floor = Receiver::lying(DVec3::new(0.0, 1.0, 0.0), [1.0, 1.0]);
        let eye = floor.eye(DVec3::new(2.0, 4.0, 1.0), DVec3::NEG_Y, Effect::Reflection);
        assert_eq!(eye, Some(DVec3::new(2.0, -2.0, 1.0)));
        assert_eq!(floor.eye(DVec3::ZERO, DVec3::NEG_Y, Effect::Reflection), None, "from below");
    }

    /// Compares the central ray with Snell's law.
    #[test]
    fn the_central_ray_follows_snell() {
        let water = Receiver::lying(DVec3::ZERO, [1.0, 1.0]);
        for (along, index) in [(DVec3::new(0.6, -0.8, 0.0), 1.33), (DVec3::new(0.3, -0.2, 0.4), 1.5)] {
            let eye = DVec3::new(-1.0, 2.0, 0.5);
            let met = eye + along * (eye.y / -along.y);
            let from = water.eye(eye, along, Effect::Refraction(index)).unwrap();
            assert_eq!([from.x, from.z], [eye.x, eye.z], "it moves along the normal");
            let sine = |ray: DVec3| (1.0 - (ray.normalize().y).powi(2)).sqrt();
            assert!((sine(along) / sine(met - from) - index).abs() < 1e-9);
        }
        let down = water.eye(DVec3::Y, DVec3::NEG_Y, Effect::Refraction(1.5)).unwrap();
        assert!((down.y - 1.5).abs() < 1e-9, "apparent depth");
        assert_eq!(water.eye(DVec3::Y, DVec3::X, Effect::Refraction(1.5)), None);
    }

    /// Schlick 1994: at 60 degrees, (1 - 1/2)^5 = 1/32 of the missing share is added to the reflectance at
    /// normal incidence.
    #[test]
    fn the_share_of_the_map_follows_schlick() {
        let one = Viewport::new(1, 1).unwrap();
        let surface = ReceiverShader::new(&[Vec3::ONE], one, Vec3::splat(0.2), 0.04).unwrap();
        let seen = |cosine: f32| {
            let to_camera = Vec3::new((1.0 - cosine * cosine).sqrt(), cosine, 0.0);
            let at = ShadingPoint { normal: Vec3::Y, to_camera, ..ShadingPoint::FACING };
            surface.shade(&Lane::default(), &at, Vec4::ONE).x
        };
        for (cosine, share) in [(1.0, 0.04), (0.5, 0.04 + 0.96 / 32.0), (0.0, 1.0)] {
            let expected = 0.2 + 0.8 * share;
            assert!((seen(cosine) - expected).abs() < 1e-6, "{cosine}: {} {expected}", seen(cosine));
        }
    }
}
