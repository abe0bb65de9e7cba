//! The receiver as it is seen: its own colour, and the map by the Fresnel term.

use glam::{Vec3, Vec4};
use pipeline::texture::linear_to_srgb8;
use pipeline::{Shader, ShaderCost, ShadingPoint, Texture, TextureError, Viewport, Wrap};

/// A surface of one colour under a map.
#[derive(Clone, Debug)]
pub struct ReceiverShader {
    map: Texture,
    /// Linear RGB radiance of the surface without the map.
    base: Vec3,
    /// Share of light from straight above that goes into the map.
    least: f32,
}

impl ReceiverShader {
    /// The shader of a receiver with this map on it. `least` is what Schlick's approximation takes at a right angle; 1 for a mirror, or a pane
    /// that all light goes through.
    ///
    /// # Errors
    /// When the map is no image of the size of `viewport`.
    pub fn new(map: &[Vec3], viewport: Viewport, base: Vec3, least: f32) -> Result<Self, TextureError> {
        let texel = |pixel: &Vec3| {
            let [r, g, b] = pixel.to_array().map(linear_to_srgb8);
            [r, g, b, 255]
        };
        let texels = map.iter().map(texel).collect();
        let map = Texture::from_srgb8(viewport.width(), viewport.height(), texels, [Wrap::Clamp; 2])?;
        Ok(Self { map, base, least })
    }
}

impl Shader for ReceiverShader {
    /// Cosine 4, fifth power 3, Fresnel term 2, mix 6; world to camera and projection 11.
    fn cost(&self) -> ShaderCost {
        ShaderCost { pixel_ops: 15, vertex_ops: 11 }
    }

    fn texture(&self) -> Option<&Texture> {
        Some(&self.map)
    }

    fn shade(&self, at: &ShadingPoint, texel: Vec4) -> Vec3 {
        let away = 1.0 - at.normal.dot(at.to_camera).clamp(0.0, 1.0);
        let square = away * away;
        // Schlick 1994.
        let share = self.least + (1.0 - self.least) * square * square * away;
        self.base + (texel.truncate() - self.base) * share
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec2;

    use super::*;

    /// Schlick 1994: at 60 degrees (1 - 1/2)^5 = 1/32 of what is missing is added to the share of light from straight above.
    #[test]
    fn the_share_of_the_map_follows_schlick() {
        let one = Viewport::new(1, 1).unwrap();
        let surface = ReceiverShader::new(&[Vec3::ONE], one, Vec3::splat(0.2), 0.04).unwrap();
        let seen = |cosine: f32| {
            let to_camera = Vec3::new((1.0 - cosine * cosine).sqrt(), cosine, 0.0);
            let at = ShadingPoint {
                position: Vec3::ZERO,
                normal: Vec3::Y,
                to_camera,
                uv: Vec2::ZERO,
                color: Vec3::ONE,
            };
            surface.shade(&at, Vec4::ONE).x
        };
        for (cosine, share) in [(1.0, 0.04), (0.5, 0.04 + 0.96 / 32.0), (0.0, 1.0)] {
            let expected = 0.2 + 0.8 * share;
            assert!((seen(cosine) - expected).abs() < 1e-6, "{cosine}: {} {expected}", seen(cosine));
        }
    }
}
