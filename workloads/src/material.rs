//! Materials, the light of a scene, and the surface shader: Lambert under one lamp and a sky, with a
//! Blinn-Phong highlight.

use std::sync::Arc;

use glam::{Vec3, Vec4};
use pipeline::{Shader, ShaderCost, ShadingPoint, Texture};

/// Appearance of a surface. Surfaces are opaque and diffuse, with a faint highlight.
#[derive(Clone, Debug)]
pub struct Material {
    /// Name for messages.
    pub name: String,
    /// Linear RGB reflectance; a factor of the texture, if there is one.
    pub base_color: Vec3,
    /// Colour texture.
    pub texture: Option<Arc<Texture>>,
    /// Whether back faces are drawn, too.
    pub double_sided: bool,
    /// Whether the base colour is shown without lighting.
    pub unlit: bool,
}

impl Material {
    /// A matt, single-sided surface of one colour (linear RGB reflectance).
    pub fn colored(name: impl Into<String>, base_color: Vec3) -> Self {
        Self { name: name.into(), base_color, texture: None, double_sided: false, unlit: false }
    }

    /// The same surface with a texture.
    #[must_use]
    pub fn textured(self, texture: Arc<Texture>) -> Self {
        Self { texture: Some(texture), ..self }
    }
}

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

/// Colours a material under a scene's light.
///
/// `texel * base * vertex colour * (lamp * max(0, n.l) + mix(ground, sky, n.y)) + highlight * lamp * max(0, n.h)^32`, with the
/// half vector `h` of Blinn (Models of light reflection, SIGGRAPH 1977). The vertex colour is left out unless
/// [`SurfaceShader::with_vertex_colors`] asks for it.
#[derive(Clone, Debug)]
pub struct SurfaceShader {
    base_color: Vec3,
    texture: Option<Arc<Texture>>,
    unlit: bool,
    vertex_colors: bool,
    toward: Vec3,
    lamp: Vec3,
    ground: Vec3,
    sky_over_ground: Vec3,
}

/// Largest share of the lamp's light in the highlight.
const HIGHLIGHT: f32 = 0.12;

/// Base colour by texel: one multiplication for each of three channels.
const BASE_OPS: u32 = 3;

/// Base colour by vertex colour.
const VERTEX_COLOR_OPS: u32 = 3;

/// Counted from [`SurfaceShader::lit`]; a square root, a division, a comparison count as one operation each.
/// Half vector: 3 additions, 3 multiply-adds, root, clamp, reciprocal, 3 to scale = 12; two cosines with their
/// clamps, 4 each = 8; power of 32 = 5 squarings; hemisphere: 1 + 3; lamp onto it: 3; times base: 3; highlight:
/// comparison, strength, 3 to add.
const LIT_OPS: u32 = 12 + 8 + 5 + 4 + 3 + 3 + 5;

/// World to camera: 9 multiply-adds; projection of x and y: 2.
const VERTEX_OPS: u32 = 11;

impl SurfaceShader {
    /// The shader of `material` under `light`, whose direction has to be known.
    pub fn new(material: &Material, light: &Light) -> Self {
        Self {
            base_color: material.base_color,
            texture: material.texture.clone(),
            unlit: material.unlit,
            vertex_colors: false,
            toward: light.toward.unwrap_or(Vec3::Y),
            lamp: light.color,
            ground: light.ground,
            sky_over_ground: light.sky - light.ground,
        }
    }

    /// The same with the base colour multiplied by the colours of vertices.
    #[must_use]
    pub fn with_vertex_colors(self) -> Self {
        Self { vertex_colors: true, ..self }
    }

    fn lit(&self, at: &ShadingPoint, base: Vec3) -> Vec3 {
        let half = self.toward + at.to_camera;
        let length = half.dot(half).sqrt();
        let half = half * (1.0 / length.max(f32::MIN_POSITIVE));
        let facing = at.normal.dot(self.toward).max(0.0);
        let glint = pow32(at.normal.dot(half).max(0.0));
        let up = 0.5 * at.normal.y + 0.5;
        let ambient = self.ground + up * self.sky_over_ground;
        let diffuse = base * (facing * self.lamp + ambient);
        // No highlight on the side turned away from the lamp.
        let glint = if facing > 0.0 { HIGHLIGHT * glint } else { 0.0 };
        diffuse + glint * self.lamp
    }
}

fn pow32(x: f32) -> f32 {
    let (x2, square) = (x * x, |x: f32| x * x);
    square(square(square(square(x2))))
}

impl Shader for SurfaceShader {
    fn cost(&self) -> ShaderCost {
        let base_ops = if self.vertex_colors { BASE_OPS + VERTEX_COLOR_OPS } else { BASE_OPS };
        let pixel_ops = if self.unlit { base_ops } else { base_ops + LIT_OPS };
        ShaderCost { pixel_ops, vertex_ops: VERTEX_OPS }
    }

    fn texture(&self) -> Option<&Texture> {
        self.texture.as_deref()
    }

    fn shade(&self, at: &ShadingPoint, texel: Vec4) -> Vec3 {
        let base = self.base_color * texel.truncate();
        let base = if self.vertex_colors { base * at.color } else { base };
        if self.unlit { base } else { self.lit(at, base) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec2;

    fn shader(unlit: bool) -> SurfaceShader {
        let light =
            Light { toward: Some(Vec3::Y), color: Vec3::ONE, sky: Vec3::splat(0.25), ground: Vec3::ZERO };
        SurfaceShader::new(&Material { unlit, ..Material::colored("m", Vec3::new(0.5, 0.25, 1.0)) }, &light)
    }

    fn point(normal: Vec3) -> ShadingPoint {
        ShadingPoint { position: Vec3::ZERO, normal, to_camera: Vec3::X, uv: Vec2::ZERO, color: Vec3::ONE }
    }

    #[test]
    fn a_surface_facing_the_lamp_shows_lamp_and_sky() {
        let seen = shader(false).shade(&point(Vec3::Y), Vec4::ONE);
        // The half vector is 45 degrees off, so the highlight adds 0.12 / 2^16.
        let expected = Vec3::new(0.5, 0.25, 1.0) * 1.25 + Vec3::splat(0.12 / 65536.0);
        assert!((seen - expected).length() < 1e-5, "{seen}");
    }

    #[test]
    fn a_surface_turned_away_shows_the_ground_only() {
        assert_eq!(shader(false).shade(&point(Vec3::NEG_Y), Vec4::ONE), Vec3::ZERO);
    }

    #[test]
    fn vertex_colours_multiply_and_cost_where_they_are_requested() {
        let red = ShadingPoint { color: Vec3::new(1.0, 0.5, 0.0), ..point(Vec3::Z) };
        let (plain, colored) = (shader(true), shader(true).with_vertex_colors());
        assert_eq!(plain.shade(&red, Vec4::ONE), Vec3::new(0.5, 0.25, 1.0));
        assert_eq!(colored.shade(&red, Vec4::ONE), Vec3::new(0.5, 0.125, 0.0));
        assert_eq!(colored.cost().pixel_ops, plain.cost().pixel_ops + 3);
    }

    #[test]
    fn an_unlit_surface_shows_its_colour_and_costs_less() {
        assert_eq!(shader(true).shade(&point(Vec3::Z), Vec4::splat(0.5)), Vec3::new(0.25, 0.125, 0.5));
        assert!(shader(true).cost().pixel_ops < shader(false).cost().pixel_ops);
    }
}
