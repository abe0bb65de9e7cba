//! Textures: mip chains with addresses, and filtering.

mod filter;
mod image;

pub use filter::{Footprint, Sampler};
pub use image::{Texture, TextureError, Wrap, linear_to_srgb8, srgb8_to_linear};
