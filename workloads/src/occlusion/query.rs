//! Depths that occlusion queries are asked against.

use pipeline::{Camera, Draw, PassError, RasterPass, Settings};

/// Depth of every sample of `draws` in the order `(y width + x) per_pixel + index`, infinite for no hit.
///
/// # Errors
/// [`PassError`] if the hardware cannot draw it.
pub fn depths(camera: &Camera, draws: &[Draw<'_>], settings: &Settings<'_>) -> Result<Vec<f32>, PassError> {
    Ok(depths_of(&RasterPass::new(camera, draws, settings).visibility()?))
}

/// Depths of visible samples, as [`pipeline::Rendered::visible`] has them.
pub fn depths_of(visible: &[(u32, u32)]) -> Vec<f32> {
    visible.iter().map(|(_, bits)| f32::from_bits(*bits)).collect()
}
