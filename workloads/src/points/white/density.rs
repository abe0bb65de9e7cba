//! Densities with upper bounds over boxes: named ones, and images.

use std::f64::consts::TAU;
use std::path::Path;

use serde::{Deserialize, Serialize};

/// A density, up to a factor.
pub trait Density<const D: usize>: Sync {
    /// Density at a point of the unit cube, at least zero.
    fn at(&self, point: &[f64; D]) -> f64;

    /// Upper bound of the density in a box.
    fn upper_bound(&self, low: &[f64; D], high: &[f64; D]) -> f64;
}

/// Named densities of any dimension.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Named {
    /// Constant.
    Constant,
    /// Mean of the coordinates.
    Ramp,
    /// Gaussian about the middle, with a standard deviation of 0.15.
    #[default]
    Gauss,
    /// Three periods along each axis: the product of `(1 + cos(6 pi x)) / 2`.
    Waves,
}

/// Twice the variance of the Gaussian.
const SPREAD: f64 = 2.0 * 0.15 * 0.15;
/// Periods per unit of length.
const WAVES: f64 = 3.0;
/// Allowance for rounding, as a factor.
const ROUNDING: f64 = 1.0 + 1e-12;

fn wave(x: f64) -> f64 {
    0.5 + 0.5 * libm::cos(TAU * WAVES * x)
}

impl Named {
    /// All densities with their names.
    pub const ALL: [(&'static str, Self); 4] =
        [("constant", Self::Constant), ("ramp", Self::Ramp), ("gauss", Self::Gauss), ("waves", Self::Waves)];

    /// The density with a name.
    pub fn by_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|(known, _)| *known == name).map(|(_, density)| density)
    }
}

impl<const D: usize> Density<D> for Named {
    fn at(&self, point: &[f64; D]) -> f64 {
        match self {
            Self::Constant => 1.0,
            Self::Ramp => point.iter().sum::<f64>() / D as f64,
            Self::Gauss => {
                let square: f64 = point.iter().map(|x| (x - 0.5) * (x - 0.5)).sum();
                libm::exp(-square / SPREAD)
            }
            Self::Waves => point.iter().map(|&x| wave(x)).product(),
        }
    }

    fn upper_bound(&self, low: &[f64; D], high: &[f64; D]) -> f64 {
        let near = |k: usize| match self {
            Self::Constant | Self::Ramp => high[k],
            Self::Gauss => 0.5_f64.clamp(low[k], high[k]),
            // The maximum of the wave if it is in the interval, otherwise an end.
            Self::Waves => {
                let crest = (low[k] * WAVES).ceil() / WAVES;
                let ends = if wave(low[k]) > wave(high[k]) { low[k] } else { high[k] };
                if crest <= high[k] { crest } else { ends }
            }
        };
        let highest: [f64; D] = std::array::from_fn(near);
        ROUNDING * self.at(&highest)
    }
}

/// Luminance of an image in linear light, constant over each pixel; the top row is at y = 1.
#[derive(Clone, Debug, PartialEq)]
pub struct ImageDensity {
    width: usize,
    height: usize,
    /// Row by row from the top left.
    luminance: Vec<f64>,
}

/// Reason why an image cannot be a density.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{file}: {message}")]
pub struct ImageError {
    file: String,
    message: String,
}

impl ImageDensity {
    /// Loads a PNG or JPEG file.
    ///
    /// # Errors
    /// [`ImageError`] if it cannot be read or decoded.
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

    /// An image of `width` by `height` values, row by row from the top left; `None` unless all are finite and
    /// at least zero, and some are positive.
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

    fn upper_bound(&self, low: &[f64; 2], high: &[f64; 2]) -> f64 {
        let ([left, bottom], [right, top]) = (self.pixel(*low), self.pixel(*high));
        let row = |row: usize| &self.luminance[row * self.width..][left..=right];
        // Rounding may move a point across a pixel border at the edge of the box.
        let top = top.saturating_sub(1);
        (top..=bottom).flat_map(row).fold(0.0, |upper_bound, &l| f64::max(upper_bound, l))
    }
}
