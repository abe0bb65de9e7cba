//! Materials: how a surface looks, and the shader that makes it so.

mod light;
mod shade;

use std::sync::Arc;

use glam::Vec3;
use pipeline::Texture;

pub use light::Light;
pub use shade::SurfaceShader;

/// How a surface looks. Surfaces are opaque and diffuse, with a faint highlight.
#[derive(Clone, Debug)]
pub struct Material {
    /// Name for messages.
    pub name: String,
    /// Linear RGB reflectance; multiplies the texture where there is one.
    pub base_color: Vec3,
    /// Colour texture.
    pub texture: Option<Arc<Texture>>,
    /// Whether back faces are drawn, too.
    pub double_sided: bool,
    /// Whether the base colour is shown as it is, whatever the light.
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
