//! Materials, and the surface shader: what light meets at a point, under the light of the scene.
//!
//! Lights are the lamp and the sky of a scene, and point lights of finite range. Surfaces are diffuse
//! (Lambert 1760), with a highlight (Blinn, Models of light reflection, SIGGRAPH 1977).

use std::sync::Arc;

use glam::{Vec3, Vec4};
use pipeline::{Blend, Cull, DepthState, DrawState, Lane, Shader, ShadingPoint, Texture};
use serde::{Deserialize, Serialize};

/// Effect of the opacity of a surface (glTF 2.0, 3.9.4).
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub enum Alpha {
    /// Nothing: the surface is opaque.
    #[default]
    Opaque,
    /// The surface is opaque, with holes where the opacity is below the cutoff.
    CutOut {
        /// Lowest opacity that is drawn.
        cutoff: f32,
    },
    /// The surface covers this share of what is behind.
    Blended,
}

/// Appearance of a surface. Surfaces are diffuse, with a faint highlight.
#[derive(Clone, Debug)]
pub struct Material {
    /// Name for messages.
    pub name: String,
    /// Linear RGB reflectance; a factor of the texture, if there is one.
    pub base_color: Vec3,
    /// Opacity from 0 to 1; a factor of that of the texture.
    pub opacity: f32,
    /// Effect of the opacity.
    pub alpha: Alpha,
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
        let (opacity, alpha) = (1.0, Alpha::Opaque);
        Self {
            name: name.into(),
            base_color,
            opacity,
            alpha,
            texture: None,
            double_sided: false,
            unlit: false,
        }
    }

    /// The same surface, opaque if its opacity has no effect anywhere.
    #[must_use]
    pub fn simplified(self) -> Self {
        let texture = self.texture.as_ref().map_or(1.0, |texture| f32::from(texture.min_alpha()) / 255.0);
        let needed = match self.alpha {
            Alpha::Opaque => 0.0,
            Alpha::CutOut { cutoff } => cutoff,
            Alpha::Blended => 1.0,
        };
        if self.opacity * texture >= needed { Self { alpha: Alpha::Opaque, ..self } } else { self }
    }

    /// State of draws. A blended surface hides nothing, so its depth is not stored.
    pub fn state(&self) -> DrawState {
        let opaque = DrawState::new(if self.double_sided { Cull::None } else { Cull::Back });
        match self.alpha {
            Alpha::Opaque | Alpha::CutOut { .. } => opaque,
            Alpha::Blended => {
                let depth = DepthState { write: false, ..opaque.depth };
                DrawState { depth, blend: Blend::Over, ..opaque }
            }
        }
    }
}

/// Colours a material under a scene's light.
///
/// The base colour is `texel * base * vertex colour`, the light that of [`Lighting::radiance`]. The vertex
/// colour is left out unless [`SurfaceShader::with_vertex_colors`] requests it. Opacity is computed for
/// materials that are not opaque.
#[derive(Clone, Debug)]
pub struct SurfaceShader {
    base_color: Vec3,
    opacity: f32,
    alpha: Alpha,
    texture: Option<Arc<Texture>>,
    unlit: bool,
    vertex_colors: bool,
    lighting: Lighting,
}

impl SurfaceShader {
    /// The shader of `material` under `light`, whose direction has to be known.
    pub fn new(material: &Material, light: &Light) -> Self {
        Self {
            base_color: material.base_color,
            opacity: material.opacity,
            alpha: material.alpha,
            texture: material.texture.clone(),
            unlit: material.unlit,
            vertex_colors: false,
            lighting: Lighting::new(light),
        }
    }

    /// The same with the base colour multiplied by the colours of vertices.
    #[must_use]
    pub fn with_vertex_colors(self) -> Self {
        Self { vertex_colors: true, ..self }
    }

    /// The light that it is seen under.
    pub fn lighting(&self) -> &Lighting {
        &self.lighting
    }

    /// What light meets at a point, and the opacity there. An unlit surface has no gloss.
    pub fn surface(&self, lane: &Lane, at: &ShadingPoint, texel: Vec4) -> (LitPoint, f32) {
        let base = lane.mul(self.base_color, texel.truncate());
        let base = if self.vertex_colors { lane.mul(base, at.color) } else { base };
        let gloss = if self.unlit { 0.0 } else { HIGHLIGHT };
        let point = LitPoint { base, normal: at.normal, to_camera: at.to_camera, gloss };
        (point, self.opacity(lane, texel))
    }

    /// Whether light changes its colour.
    pub fn is_lit(&self) -> bool {
        !self.unlit
    }

    fn opacity(&self, lane: &Lane, texel: Vec4) -> f32 {
        match self.alpha {
            Alpha::Opaque => 1.0,
            Alpha::CutOut { cutoff } => {
                lane.discard_below(lane.mul(self.opacity, texel.w), cutoff);
                1.0
            }
            Alpha::Blended => lane.mul(self.opacity, texel.w),
        }
    }
}

impl Shader for SurfaceShader {
    fn texture(&self) -> Option<&Texture> {
        self.texture.as_deref()
    }

    fn shade(&self, lane: &Lane, at: &ShadingPoint, texel: Vec4) -> Vec4 {
        let (point, opacity) = self.surface(lane, at, texel);
        let seen = if self.unlit { point.base } else { self.lighting.radiance(lane, &point) };
        seen.extend(opacity)
    }

    fn may_discard(&self) -> bool {
        matches!(self.alpha, Alpha::CutOut { .. })
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

/// Largest share of a lamp's light in the highlight.
const HIGHLIGHT: f32 = 0.12;

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

    /// Linear RGB radiance of a point: `base (lamp max(0, n.l) + mix(ground, sky, n.y)) + gloss lamp max(0,
    /// n.h)^32`, with the half vector `h`.
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
        let falloff = -lane.recip(lane.mul(self.range, self.range));
        let fade = lane.max(lane.madd(square, falloff, 1.0), 0.0);
        let color = lane.scale(self.color, lane.mul(fade, fade));
        let diffuse = lane.mul(at.base, lane.scale(color, facing));
        lane.madd(Vec3::splat(glint), color, diffuse)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shader(unlit: bool) -> SurfaceShader {
        let light =
            Light { toward: Some(Vec3::Y), color: Vec3::ONE, sky: Vec3::splat(0.25), ground: Vec3::ZERO };
        SurfaceShader::new(&Material { unlit, ..Material::colored("m", Vec3::new(0.5, 0.25, 1.0)) }, &light)
    }

    fn point(normal: Vec3) -> ShadingPoint {
        ShadingPoint { normal, to_camera: Vec3::X, ..ShadingPoint::FACING }
    }

    /// Radiance of a point, and the operations it takes.
    fn shade(shader: &SurfaceShader, at: &ShadingPoint, texel: Vec4) -> (Vec3, u32) {
        let lane = Lane::default();
        (shader.shade(&lane, at, texel).truncate(), lane.ops())
    }

    #[test]
    fn a_surface_facing_the_lamp_shows_lamp_and_sky() {
        let (seen, _) = shade(&shader(false), &point(Vec3::Y), Vec4::ONE);
        // The half vector is 45 degrees off, so the highlight adds 0.12 / 2^16.
        let expected = Vec3::new(0.5, 0.25, 1.0) * 1.25 + Vec3::splat(0.12 / 65536.0);
        assert!((seen - expected).length() < 1e-5, "{seen}");
    }

    #[test]
    fn a_surface_turned_away_shows_the_ground_only() {
        assert_eq!(shade(&shader(false), &point(Vec3::NEG_Y), Vec4::ONE).0, Vec3::ZERO);
    }

    #[test]
    fn vertex_colours_multiply_and_cost_where_they_are_requested() {
        let red = ShadingPoint { color: Vec3::new(1.0, 0.5, 0.0), ..point(Vec3::Z) };
        let (plain, colored) = (shader(true), shader(true).with_vertex_colors());
        assert_eq!(shade(&plain, &red, Vec4::ONE), (Vec3::new(0.5, 0.25, 1.0), 3));
        assert_eq!(shade(&colored, &red, Vec4::ONE), (Vec3::new(0.5, 0.125, 0.0), 6));
    }

    #[test]
    fn opacity_costs_where_it_has_an_effect() {
        let half = Material { opacity: 0.5, unlit: true, ..Material::colored("m", Vec3::ONE) };
        let ops = |alpha| {
            let material = Material { alpha, ..half.clone() }.simplified();
            let lane = Lane::default();
            let shader = SurfaceShader::new(&material, &Light::default());
            let color = shader.shade(&lane, &point(Vec3::Z), Vec4::new(1.0, 1.0, 1.0, 0.5));
            (color.w, lane.is_discarded(), lane.ops())
        };
        assert_eq!(ops(Alpha::Opaque), (1.0, false, 3));
        assert_eq!(ops(Alpha::Blended), (0.25, false, 4));
        assert_eq!(ops(Alpha::CutOut { cutoff: 0.75 }), (1.0, true, 5));
        // Without a texture the opacity is one half throughout.
        assert_eq!(ops(Alpha::CutOut { cutoff: 0.5 }), (1.0, false, 3));
    }

    #[test]
    fn an_unlit_surface_shows_its_colour_and_costs_less() {
        let (seen, ops) = shade(&shader(true), &point(Vec3::Z), Vec4::splat(0.5));
        assert_eq!(seen, Vec3::new(0.25, 0.125, 0.5));
        assert!(ops < shade(&shader(false), &point(Vec3::Z), Vec4::ONE).1);
    }
}
