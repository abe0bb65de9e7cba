//! How a series is distinguished: colour, marker and strokes.

use super::palette::{BACKGROUND, Colour, SERIES};
use super::picture::{Picture, Point};

const MARKERS: [Marker; 4] = [Marker::Circle, Marker::Square, Marker::Triangle, Marker::Diamond];

/// The outline of a marker.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Marker {
    Circle,
    Square,
    Triangle,
    Diamond,
}

/// Colour, marker and strokes of a series. Marker and strokes distinguish it also without colours.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Style {
    pub colour: Colour,
    pub marker: Marker,
    /// Lengths of strokes and of gaps between them; a whole line without.
    pub dash: Option<[f64; 2]>,
}

impl Style {
    /// The style of series number `index`: as many as there are colours, then again with strokes.
    pub fn of(index: usize) -> Self {
        let dash = [None, Some([7.0, 4.0]), Some([2.0, 3.0])][index / SERIES.len() % 3];
        Self { colour: SERIES[index % SERIES.len()], marker: MARKERS[index % MARKERS.len()], dash }
    }

    /// A line in its colour and strokes.
    pub fn line(&self, picture: &mut Picture, points: &[Point], width: f64) {
        match self.dash {
            Some(dash) => picture.dashed(points, self.colour, width, dash),
            None => picture.polyline(points.to_vec(), self.colour, width),
        }
    }

    /// A filled marker.
    pub fn marker(&self, picture: &mut Picture, at: Point, radius: f64) {
        match self.marker {
            Marker::Circle => picture.dot(at, radius, self.colour),
            _ => picture.polygon(self.corners(at, radius), self.colour),
        }
    }

    /// A hollow marker.
    pub fn hollow(&self, picture: &mut Picture, at: Point, radius: f64) {
        let mut inner = *self;
        inner.colour = BACKGROUND;
        self.marker(picture, at, radius + 0.4);
        inner.marker(picture, at, radius - 1.0);
    }

    fn corners(&self, (x, y): Point, r: f64) -> Vec<Point> {
        // As large in area as the circle.
        match self.marker {
            Marker::Circle | Marker::Square => {
                let r = 0.89 * r;
                vec![(x - r, y - r), (x + r, y - r), (x + r, y + r), (x - r, y + r)]
            }
            Marker::Triangle => {
                let r = 1.25 * r;
                vec![(x, y - r), (x + 0.95 * r, y + 0.7 * r), (x - 0.95 * r, y + 0.7 * r)]
            }
            Marker::Diamond => {
                let r = 1.25 * r;
                vec![(x, y - r), (x + r, y), (x, y + r), (x - r, y)]
            }
        }
    }
}
