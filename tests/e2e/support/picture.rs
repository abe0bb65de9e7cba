//! Looking at images.

use image::{Rgb, RgbImage};

/// A box of pixels, the ends not included.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Bounds {
    /// First and one after the last column.
    pub x: [u32; 2],
    /// First and one after the last row, from the top.
    pub y: [u32; 2],
}

impl Bounds {
    /// Columns.
    pub fn width(self) -> u32 {
        self.x[1] - self.x[0]
    }

    /// Rows.
    pub fn height(self) -> u32 {
        self.y[1] - self.y[0]
    }
}

/// The smallest box around the pixels for which `lit` holds; `None` where there are none.
pub fn lit_bounds(image: &RgbImage, lit: impl Fn(&Rgb<u8>) -> bool) -> Option<Bounds> {
    let places = image.enumerate_pixels().filter(|(.., pixel)| lit(pixel)).map(|(x, y, _)| (x, y));
    places.fold(None, |bounds: Option<Bounds>, (x, y)| {
        let old = bounds.unwrap_or(Bounds { x: [x, x + 1], y: [y, y + 1] });
        Some(Bounds { x: [old.x[0].min(x), old.x[1].max(x + 1)], y: [old.y[0].min(y), old.y[1].max(y + 1)] })
    })
}

/// The mean column and row of the pixels for which `lit` holds; `None` where there are none.
pub fn mean_where(image: &RgbImage, lit: impl Fn(&Rgb<u8>) -> bool) -> Option<[f64; 2]> {
    let places = image.enumerate_pixels().filter(|(.., pixel)| lit(pixel));
    let (mut sum, mut count) = ([0.0; 2], 0.0);
    for (x, y, _) in places {
        sum = [sum[0] + f64::from(x), sum[1] + f64::from(y)];
        count += 1.0;
    }
    (count > 0.0).then(|| sum.map(|value| value / count))
}
