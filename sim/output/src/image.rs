//! Images as files: PNG in 8-bit sRGB, EXR in linear f32, and thumbnails for the report.

use std::io::Cursor;

use image::codecs::png::PngEncoder;
use image::{ExtendedColorType, ImageEncoder, ImageFormat};
use pipeline::texture::linear_to_srgb8;

use super::dir::{OutDir, OutputError};

/// Error of an image.
#[derive(Debug, thiserror::Error)]
pub enum ImageError {
    /// Width or height is 0.
    #[error("an image of {width}x{height} pixels has no area: ask for at least 1x1")]
    NoArea {
        /// Width in pixels.
        width: u32,
        /// Height in pixels.
        height: u32,
    },
    /// The number of pixels is not width times height.
    #[error("an image of {width}x{height} pixels was given {given} pixels")]
    Length {
        /// Width in pixels.
        width: u32,
        /// Height in pixels.
        height: u32,
        /// Number of pixels given.
        given: usize,
    },
    /// The encoder failed.
    #[error("cannot encode the image: {0}")]
    Encode(#[from] image::ImageError),
}

/// Image in linear RGB: `width * height` pixels, rows from the top.
#[derive(Clone, Copy, Debug)]
pub struct LinearImage<'a> {
    width: u32,
    height: u32,
    pixels: &'a [[f32; 3]],
}

impl<'a> LinearImage<'a> {
    /// Image of `width` x `height` `pixels`.
    ///
    /// # Errors
    /// [`ImageError::NoArea`] for a zero side, [`ImageError::Length`] when `pixels` has another length.
    pub fn new(width: u32, height: u32, pixels: &'a [[f32; 3]]) -> Result<Self, ImageError> {
        if width == 0 || height == 0 {
            return Err(ImageError::NoArea { width, height });
        }
        if u64::from(width) * u64::from(height) != pixels.len() as u64 {
            return Err(ImageError::Length { width, height, given: pixels.len() });
        }
        Ok(Self { width, height, pixels })
    }

    /// Encodes a PNG file, 8-bit sRGB.
    ///
    /// # Errors
    /// [`ImageError::Encode`] when the encoder fails.
    pub fn png(&self) -> Result<Vec<u8>, ImageError> {
        let bytes: Vec<u8> = self.pixels.iter().flat_map(|pixel| pixel.map(linear_to_srgb8)).collect();
        encode_png(self.width, self.height, &bytes)
    }

    /// Encodes an EXR file, linear f32.
    ///
    /// # Errors
    /// [`ImageError::Encode`] when the encoder fails.
    pub fn exr(&self) -> Result<Vec<u8>, ImageError> {
        let values: Vec<f32> = self.pixels.iter().flatten().copied().collect();
        let picture = image::Rgb32FImage::from_raw(self.width, self.height, values)
            .ok_or(ImageError::Length { width: self.width, height: self.height, given: self.pixels.len() })?;
        let mut bytes = Cursor::new(Vec::new());
        picture.write_to(&mut bytes, ImageFormat::OpenExr)?;
        Ok(bytes.into_inner())
    }

    /// Encodes a PNG at most `max_width` pixels wide, never larger than the image. Each pixel is the mean, in
    /// linear light, of the pixels it covers.
    ///
    /// # Errors
    /// [`ImageError::Encode`] when the encoder fails.
    pub fn thumbnail_png(&self, max_width: u32) -> Result<Vec<u8>, ImageError> {
        if self.width <= max_width {
            return self.png();
        }
        let width = self.width.min(max_width.max(1));
        let height = (u64::from(self.height) * u64::from(width) / u64::from(self.width)).max(1) as u32;
        let small: Vec<[f32; 3]> = (0..height)
            .flat_map(|y| (0..width).map(move |x| (x, y)))
            .map(|(x, y)| self.mean(span(x, width, self.width), span(y, height, self.height)))
            .collect();
        LinearImage::new(width, height, &small)?.png()
    }

    /// Writes [`Self::png`] to `relative` in `dir`.
    ///
    /// # Errors
    /// [`OutputError::Write`] with the file and the cause.
    pub fn write_png(&self, dir: &OutDir, relative: &str) -> Result<(), OutputError> {
        dir.write_file(relative, |out| Ok(out.write_all(&self.png()?)?)).map(drop)
    }

    /// Writes [`Self::exr`] to `relative` in `dir`.
    ///
    /// # Errors
    /// [`OutputError::Write`] with the file and the cause.
    pub fn write_exr(&self, dir: &OutDir, relative: &str) -> Result<(), OutputError> {
        dir.write_file(relative, |out| Ok(out.write_all(&self.exr()?)?)).map(drop)
    }

    fn mean(&self, columns: (usize, usize), rows: (usize, usize)) -> [f32; 3] {
        let mut sum = [0.0_f64; 3];
        for y in rows.0..rows.1 {
            let row = y * self.width as usize;
            for pixel in &self.pixels[row + columns.0..row + columns.1] {
                for (total, value) in sum.iter_mut().zip(pixel) {
                    *total += f64::from(*value);
                }
            }
        }
        let area = ((rows.1 - rows.0) * (columns.1 - columns.0)) as f64;
        sum.map(|total| (total / area) as f32)
    }
}

/// Pixels `[from, to)` of a side of `full` pixels that pixel `index` of a side of `small` pixels covers; at
/// least one.
fn span(index: u32, small: u32, full: u32) -> (usize, usize) {
    let edge = |i: u32| (u64::from(i) * u64::from(full) / u64::from(small)) as usize;
    (edge(index), edge(index + 1).max(edge(index) + 1))
}

/// Encodes a PNG file from 8-bit RGB `bytes`, rows from the top.
///
/// # Errors
/// [`ImageError::Encode`] when the encoder fails.
pub fn encode_png(width: u32, height: u32, bytes: &[u8]) -> Result<Vec<u8>, ImageError> {
    let mut file = Vec::new();
    PngEncoder::new(&mut file).write_image(bytes, width, height, ExtendedColorType::Rgb8)?;
    Ok(file)
}
