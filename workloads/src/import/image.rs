//! Decoding images into textures, with limits on what a small file can unpack to.

use std::io::Cursor;
use std::path::Path;

use ::image::{ImageReader, Limits};
use pipeline::{Texture, Wrap};

/// Largest side of a texture in texels.
const MOST_TEXELS: u32 = 16_384;

/// Most bytes a decoder may take.
const MOST_BYTES: u64 = 512 << 20;

/// A PNG or JPEG image as a texture, or in words why it is none.
pub(super) fn decode(bytes: &[u8], wrap: [Wrap; 2]) -> Result<Texture, String> {
    let mut reader = ImageReader::new(Cursor::new(bytes)).with_guessed_format().map_err(|e| e.to_string())?;
    let mut limits = Limits::default();
    limits.max_image_width = Some(MOST_TEXELS);
    limits.max_image_height = Some(MOST_TEXELS);
    limits.max_alloc = Some(MOST_BYTES);
    reader.limits(limits);
    let image = reader.decode().map_err(|error| error.to_string())?.into_rgba8();
    let (width, height) = image.dimensions();
    let texels = image.pixels().map(|pixel| pixel.0).collect();
    Texture::from_srgb8(width, height, texels, wrap).map_err(|error| error.to_string())
}

/// The image file at `path` as a texture, or in words why it is none.
pub(super) fn load(path: &Path, wrap: [Wrap; 2]) -> Result<Texture, String> {
    decode(&std::fs::read(path).map_err(|error| error.to_string())?, wrap)
}
