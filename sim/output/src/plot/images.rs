//! Images in colour beside each other, each with a caption.

use pipeline::texture::linear_to_srgb8;

use super::palette::Colour;
use super::picture::{Across, Look, Picture, Text, text};

/// An image with a caption.
#[derive(Clone, Debug)]
pub struct CaptionedImage {
    /// Width and height in pixels.
    pub size: [u32; 2],
    /// Linear RGB radiance of each pixel, row by row from the top left.
    pub pixels: Vec<[f32; 3]>,
    /// Caption.
    pub caption: String,
}

/// Images in rows.
#[derive(Clone, Copy, Debug)]
pub struct Images<'a> {
    /// Title.
    pub title: &'a str,
    /// What the images show, for the line below the title.
    pub subject: &'a str,
    /// Images in a row.
    pub across: usize,
    /// The images, row by row, with captions below them.
    pub images: &'a [CaptionedImage],
}

/// Width of the whole picture, unless a [`Look`] sets it.
const WIDTH: f64 = 960.0;
/// Empty pixels between images.
const GAP: f64 = 12.0;
/// Height of a caption.
const CAPTION: f64 = 24.0;

impl Images<'_> {
    /// Draws the images. All of a row have the same width.
    pub fn picture(&self, look: &Look) -> Picture {
        let mut picture = Picture::titled(look, (WIDTH, 300.0), [self.title, self.subject]);
        if self.images.is_empty() {
            return picture.nothing("no image was drawn");
        }
        let (across, left) = (self.across.max(1), picture.margin());
        let width = (picture.width() - 2.0 * left + GAP) / across as f64 - GAP;
        for row in self.images.chunks(across) {
            let top = picture.height + 8.0;
            let mut bottom = top;
            for (place, image) in row.iter().enumerate() {
                let left = left + place as f64 * (width + GAP);
                let scale = width / f64::from(image.size[0]);
                draw(&mut picture, image, (left, top), scale);
                let below = top + f64::from(image.size[1]) * scale;
                let at = (left + 0.5 * width, below + 0.5 * CAPTION);
                picture.text(Text { across: Across::Centre, ..text(&image.caption, at) });
                bottom = bottom.max(below + CAPTION);
            }
            picture.height = bottom;
        }
        picture.height += 12.0;
        picture
    }
}

/// Draws the pixels, equal ones of a row as one rectangle.
fn draw(picture: &mut Picture, image: &CaptionedImage, (left, top): (f64, f64), scale: f64) {
    for (y, row) in image.pixels.chunks(image.size[0].max(1) as usize).enumerate() {
        let row: Vec<[u8; 3]> = row.iter().map(|pixel| pixel.map(linear_to_srgb8)).collect();
        let mut x = 0;
        for equal in row.chunk_by(|a, b| a == b) {
            let at = |x: usize, y: usize| (left + x as f64 * scale, top + y as f64 * scale);
            picture.rect(at(x, y), at(x + equal.len(), y + 1), Colour { rgb: equal[0], alpha: 1.0 });
            x += equal.len();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::picture::Shape;
    use super::*;

    #[test]
    fn pixels_are_rectangles_in_their_place() {
        let pixels = [[1.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0; 3], [0.0, 0.0, 1.0], [0.0; 3], [0.0; 3]];
        let image = |caption: &str| CaptionedImage {
            size: [3, 2],
            pixels: pixels.into(),
            caption: caption.to_owned(),
        };
        let images = ["one", "two"].map(image);
        let images = Images { title: "t", subject: "s", across: 2, images: &images };
        let picture = images.picture(&Look::default());
        let rects = picture.shapes.iter().filter_map(|shape| match shape {
            Shape::Rect { from, to, fill } => Some((to.0 - from.0, to.1 - from.1, fill.rgb)),
            _ => None,
        });
        let rects: Vec<_> = rects.collect();
        assert_eq!(rects.len(), 8);
        let [two, one] = [rects[0], rects[1]];
        assert_eq!((two.2, one.2), ([255, 0, 0], [0; 3]));
        assert!((two.0 - 2.0 * one.0).abs() < 1e-9 && (one.0 - one.1).abs() < 1e-9, "square pixels");
        let svg = picture.svg().unwrap();
        assert!(svg.contains("one") && svg.contains("two"));
    }
}
