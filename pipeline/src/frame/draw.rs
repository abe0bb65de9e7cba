//! Draws: triangles with the shader that colours them.

use crate::geometry::{Cull, Geometry};
use crate::shading::Shader;

/// Triangles with the shader that colours them.
#[derive(Clone, Copy)]
pub struct Draw<'a> {
    /// What is drawn.
    pub geometry: Geometry<'a>,
    /// What it costs and how it looks.
    pub shader: &'a dyn Shader,
    /// Which faces are dropped.
    pub cull: Cull,
}
