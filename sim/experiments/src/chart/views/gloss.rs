//! Shaders that do, and do not, depend on who looks.

use glam::{Vec3, Vec4};
use pipeline::{Shader, ShaderCost, ShadingPoint, Texture};

/// A shader made independent of the direction to the viewer, with a highlight of its own on top where there is one.
pub(super) struct Gloss<'a> {
    pub looks: &'a dyn Shader,
    /// Exponent of the highlight (Blinn 1977).
    pub exponent: Option<i32>,
}

/// From the scene towards its lamp.
const TOWARD: Vec3 = Vec3::new(0.36, 0.80, 0.48);

impl Shader for Gloss<'_> {
    fn cost(&self) -> ShaderCost {
        self.looks.cost()
    }

    fn texture(&self) -> Option<&Texture> {
        self.looks.texture()
    }

    fn shade(&self, at: &ShadingPoint, texel: Vec4) -> Vec3 {
        let matt = self.looks.shade(&ShadingPoint { to_camera: at.normal, ..*at }, texel);
        let half = (TOWARD + at.to_camera).normalize_or_zero();
        let glint = self.exponent.map_or(0.0, |exponent| at.normal.dot(half).max(0.0).powi(exponent));
        matt + Vec3::splat(glint)
    }
}
