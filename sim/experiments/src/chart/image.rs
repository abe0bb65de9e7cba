//! Errors of images, and what images of nothing but edges are shaded with.

use glam::{Vec3, Vec4};
use pipeline::{Shader, ShaderCost, ShadingPoint};

/// White all over, at no cost.
pub(super) struct White;

impl Shader for White {
    fn cost(&self) -> ShaderCost {
        ShaderCost::default()
    }

    fn shade(&self, _at: &ShadingPoint, _texel: Vec4) -> Vec3 {
        Vec3::ONE
    }
}

/// The differences of two images, channel by channel.
pub(super) fn errors(image: &[Vec3], reference: &[Vec3]) -> Vec<f64> {
    let pixels = image.iter().zip(reference);
    pixels.flat_map(|(a, b)| (*a - *b).to_array()).map(f64::from).collect()
}

/// The mean of the squares.
pub(super) fn mean_square(errors: &[f64]) -> f64 {
    errors.iter().map(|error| error * error).sum::<f64>() / errors.len().max(1) as f64
}

/// The correlation of the errors of pixels side by side, in rows of `width` pixels of three channels.
pub(super) fn neighbours(errors: &[f64], width: usize) -> f64 {
    let products =
        errors.chunks_exact(3 * width).flat_map(|row| row.iter().zip(&row[3..]).map(|(a, b)| a * b));
    let (sum, count) = products.fold((0.0, 0_u32), |(sum, count), product| (sum + product, count + 1));
    let squares = mean_square(errors);
    if count == 0 || squares == 0.0 { 0.0 } else { sum / f64::from(count) / squares }
}
