//! Decoding images into textures, with limits on what a small file can unpack to.

use std::io::Cursor;
use std::path::Path;

use ::image::{ImageFormat, ImageReader, Limits};
use pipeline::{Texture, Wrap};

use super::reader;

/// Largest side of a texture in texels.
const MOST_TEXELS: u32 = 16_384;

/// Most bytes a decoder may take.
const MOST_BYTES: u64 = 512 << 20;

/// A PNG or JPEG image as a texture, or in words why it is none.
pub(super) fn decode(bytes: &[u8], wrap: [Wrap; 2]) -> Result<Texture, String> {
    let reader = ImageReader::new(Cursor::new(bytes)).with_guessed_format().map_err(|e| e.to_string())?;
    texture(reader, wrap)
}

fn texture(mut reader: ImageReader<Cursor<&[u8]>>, wrap: [Wrap; 2]) -> Result<Texture, String> {
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

/// The image file at `path` as a texture, or in words why it is none. TGA files do not begin in a way of their own, so what does
/// not is what its ending says.
pub(super) fn load(path: &Path, wrap: [Wrap; 2]) -> Result<Texture, String> {
    let bytes = reader::named(path).map_err(|error| error.to_string())?;
    let named = ImageFormat::from_path(path).ok().filter(|_| ::image::guess_format(&bytes).is_err());
    match named {
        Some(format) => texture(ImageReader::with_format(Cursor::new(&bytes), format), wrap),
        None => decode(&bytes, wrap),
    }
}
