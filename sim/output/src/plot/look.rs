//! How wide pictures are made, how large their letters, and under which title.

use serde::{Deserialize, Serialize};

/// Width of a column of a two-column paper.
pub const COLUMN_MM: f64 = 85.0;
/// Letters of a picture whose width is given, in points.
const PAPER_LETTERS_PT: f64 = 8.0;
/// Size of ordinary letters of a layout, in pixels of the layout.
const LETTERS_PX: f64 = 13.0;
/// Pixels of a PNG over an inch of a picture whose width is given.
const PNG_PER_INCH: f64 = 300.0;
/// Pixels over an inch of a picture on a screen.
const SCREEN_PER_INCH: f64 = 96.0;

/// What a user may ask of every picture. The default is each picture's own width, title and letters.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Look {
    /// Width in millimetres.
    pub width_mm: Option<f64>,
    /// Size of ordinary letters in points.
    pub font_pt: Option<f64>,
    /// The title in place of the picture's own; empty for a picture without title and subtitle, as a paper has its own caption.
    pub title: Option<String>,
}

/// The paper of one picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Paper {
    /// Width in pixels of the layout, in which ordinary letters are 13 pixels high.
    pub width: f64,
    /// Pixels of the PNG for a pixel of the layout.
    pub zoom: f64,
    /// Width in millimetres, where it was asked for.
    pub width_mm: Option<f64>,
}

impl Look {
    /// The paper of a picture that is usually `usual` pixels wide and needs at least `least`. Where a narrower one is asked for, its
    /// letters get smaller than asked.
    pub(super) fn paper(&self, usual: f64, least: f64) -> Paper {
        let Some(width_mm) = self.width_mm else {
            let zoom = self.font_pt.map_or(1.0, |pt| pt / 72.0 * SCREEN_PER_INCH / LETTERS_PX);
            return Paper { width: libm::round((usual / zoom).max(least)), zoom, width_mm: None };
        };
        let inches = width_mm / 25.4;
        let letters = self.font_pt.unwrap_or(PAPER_LETTERS_PT);
        let width = libm::round((72.0 * inches * LETTERS_PX / letters).max(least));
        Paper { width, zoom: inches * PNG_PER_INCH / width, width_mm: Some(width_mm) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn letters_of_a_column_are_eight_points() {
        let paper = Look { width_mm: Some(COLUMN_MM), ..Look::default() }.paper(1200.0, 300.0);
        let points_per_px = COLUMN_MM / 25.4 * 72.0 / paper.width;
        assert!((LETTERS_PX * points_per_px - PAPER_LETTERS_PT).abs() < 0.05, "{paper:?}");
        assert!((paper.width * paper.zoom - COLUMN_MM / 25.4 * 300.0).abs() < 1e-9);
    }

    #[test]
    fn larger_letters_leave_less_room_on_the_same_screen() {
        assert_eq!(Look::default().paper(1200.0, 300.0), Paper { width: 1200.0, zoom: 1.0, width_mm: None });
        let paper = Look { font_pt: Some(19.5), ..Look::default() }.paper(1200.0, 300.0);
        assert_eq!((paper.width, paper.zoom), (600.0, 2.0));
        assert_eq!(Look { font_pt: Some(39.0), ..Look::default() }.paper(1200.0, 700.0).width, 700.0);
    }
}
