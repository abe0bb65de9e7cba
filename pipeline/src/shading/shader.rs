//! A shader is a cost and a Rust function: the timing sees the cost, the image sees the function.

use glam::{Vec2, Vec3, Vec4};

use crate::texture::Texture;

/// What one run of a shader lane costs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ShaderCost {
    /// Multiply-adds or simpler operations of one pixel shader lane.
    pub pixel_ops: u32,
    /// Multiply-adds or simpler operations of one vertex shader run, for one end of the shutter.
    pub vertex_ops: u32,
}

/// Where a shader is evaluated: interpolated over the triangle at the reference lens position and time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ShadingPoint {
    /// World position.
    pub position: Vec3,
    /// Unit normal in world space, facing the camera.
    pub normal: Vec3,
    /// Unit vector from the point to the camera.
    pub to_camera: Vec3,
    /// Texture coordinate; zero where the draw has none.
    pub uv: Vec2,
    /// Vertex colour in linear RGB, each channel 0 to 1; white where the draw has none.
    pub color: Vec3,
}

/// Colours a point of a surface. The result has to depend on the arguments alone: workers shade in any
/// order, and the shading cache may hand one result to many samples.
pub trait Shader: Sync {
    /// What a run costs.
    fn cost(&self) -> ShaderCost;

    /// The texture sampled at the point's texture coordinate before the shader runs, if any. Its fetches go
    /// through the texture unit and its cache.
    fn texture(&self) -> Option<&Texture> {
        None
    }

    /// Linear RGB radiance. `texel` is the filtered texel in linear RGBA, or white where there is no texture.
    fn shade(&self, at: &ShadingPoint, texel: Vec4) -> Vec3;
}
