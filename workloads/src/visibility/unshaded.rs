//! The shader of those who ask only who is seen.

use glam::{Vec3, Vec4};
use pipeline::{Shader, ShaderCost, ShadingPoint};

/// Nothing is shaded: only who is seen matters.
#[derive(Clone, Copy, Debug)]
pub struct Unshaded;

impl Shader for Unshaded {
    fn cost(&self) -> ShaderCost {
        ShaderCost::default()
    }

    fn shade(&self, _at: &ShadingPoint, _texel: Vec4) -> Vec3 {
        Vec3::ZERO
    }
}
