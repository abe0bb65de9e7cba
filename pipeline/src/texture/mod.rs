//! Textures: mip chains with addresses, and the filtering of them.

mod filter;
mod image;
mod srgb;

pub use filter::{Footprint, Sampler};
pub use image::{Texture, TextureError, Wrap};
pub use srgb::{linear_to_srgb8, srgb8_to_linear};
