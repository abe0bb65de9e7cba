//! A picture as a density: bright is dense.

use std::path::Path;

use super::Density;

/// The luminance of a picture in linear light, even over each pixel; the top row is at y = 1.
#[derive(Clone, Debug, PartialEq)]
pub struct ImageDensity {
    width: usize,
    height: usize,
    /// Row by row from the top left.
    luminance: Vec<f64>,
}

/// Why a picture is no density.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{file}: {message}")]
pub struct ImageError {
    file: String,
    message: String,
}

impl ImageDensity {
    /// The picture in a PNG or JPEG file.
    ///
    /// # Errors
    /// When it cannot be read or decoded.
    pub fn load(path: &Path) -> Result<Self, ImageError> {
        let refused = |message: String| ImageError { file: path.display().to_string(), message };
        let unread = |error: std::io::Error| refused(format!("cannot be read: {error}"));
        let unknown = |error| refused(format!("is no picture that is known ({error}); give a PNG or JPEG"));
        let picture =
            image::ImageReader::open(path).map_err(unread)?.with_guessed_format().map_err(unread)?;
        let picture = picture.decode().map_err(unknown)?.into_rgb8();
        let (width, height) = (picture.width() as usize, picture.height() as usize);
        let linear = |byte: u8| libm::pow(f64::from(byte) / 255.0, 2.2);
        let luminance = |[r, g, b]: [u8; 3]| 0.2126 * linear(r) + 0.7152 * linear(g) + 0.0722 * linear(b);
        Self::new(width, height, picture.pixels().map(|pixel| luminance(pixel.0)).collect()).ok_or_else(
            || {
                refused(
                    "is black all over, and bright is dense; give a picture with something bright in it"
                        .to_owned(),
                )
            },
        )
    }

    /// A picture of `width` times `height` numbers, none below zero and some above, row by row from the top left.
    pub fn new(width: usize, height: usize, luminance: Vec<f64>) -> Option<Self> {
        let fits = width * height == luminance.len() && luminance.iter().all(|l| *l >= 0.0 && l.is_finite());
        (fits && luminance.iter().any(|l| *l > 0.0)).then_some(Self { width, height, luminance })
    }

    fn pixel(&self, [x, y]: [f64; 2]) -> [usize; 2] {
        let along = |at: f64, count: usize| ((at * count as f64) as usize).min(count - 1);
        [along(x, self.width), along(1.0 - y, self.height)]
    }
}

impl Density<2> for ImageDensity {
    fn at(&self, point: &[f64; 2]) -> f64 {
        let [column, row] = self.pixel(*point);
        self.luminance[row * self.width + column]
    }

    fn most(&self, low: &[f64; 2], high: &[f64; 2]) -> f64 {
        let ([left, bottom], [right, top]) = (self.pixel(*low), self.pixel(*high));
        let row = |row: usize| &self.luminance[row * self.width..][left..=right];
        // Where a border runs through a box rounding may take a point across it.
        let top = top.saturating_sub(1);
        (top..=bottom).flat_map(row).fold(0.0, |most, &l| f64::max(most, l))
    }
}
