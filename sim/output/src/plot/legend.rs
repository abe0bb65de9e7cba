//! Legends, and the styles that distinguish series: colour, marker and strokes.

use super::palette::{BACKGROUND, Colour, INK, MUTED, SERIES};
use super::picture::{Across, Picture, Point, Text, shortened, text, text_width};

/// Symbol of a legend entry.
#[derive(Clone, Copy, Debug)]
pub(super) enum Key {
    Area(Colour),
    Line(Colour),
    /// A line with markers.
    Curve(Style),
    /// A large marker with a cross.
    Spread(Style),
    /// A marker, filled or hollow.
    Marker(Style, bool),
    Dot(Colour),
    /// A step of a frontier.
    Steps(Colour),
    Tick(Colour),
}

/// Font size of a legend with enough room.
pub(super) const LEGEND_PX: f64 = 12.5;
/// Distance of the lines of a legend.
pub(super) const LEGEND_LINE: f64 = 22.0;
/// Width of a key, and gap between entries.
const KEY: f64 = 22.0;
const GAP: f64 = 24.0;

impl Key {
    fn draw(self, picture: &mut Picture, (x, y): Point) {
        match self {
            Self::Area(colour) => picture.rect((x, y - 6.0), (x + 14.0, y + 6.0), colour),
            Self::Line(colour) => picture.line((x - 2.0, y), (x + 16.0, y), colour, 2.0),
            Self::Curve(style) => {
                style.line(picture, &[(x - 3.0, y), (x + 17.0, y)], 1.6);
                style.marker(picture, (x + 7.0, y), 3.2);
            }
            Self::Spread(style) => {
                picture.line((x - 2.0, y), (x + 16.0, y), style.colour, 2.0);
                picture.line((x + 7.0, y - 8.0), (x + 7.0, y + 8.0), style.colour, 2.0);
                style.marker(picture, (x + 7.0, y), 5.0);
            }
            Self::Marker(style, true) => style.marker(picture, (x + 7.0, y), 4.0),
            Self::Marker(style, false) => style.hollow(picture, (x + 7.0, y), 4.0),
            Self::Dot(colour) => picture.dot((x + 7.0, y), 4.0, colour),
            Self::Steps(colour) => {
                picture.polyline(
                    vec![(x - 2.0, y - 5.0), (x + 7.0, y - 5.0), (x + 7.0, y + 5.0), (x + 16.0, y + 5.0)],
                    colour,
                    1.5,
                );
            }
            Self::Tick(colour) => picture.line((x + 7.0, y - 6.0), (x + 7.0, y + 6.0), colour, 2.0),
        }
    }
}

/// Draws a legend between the margins, in as many lines as needed, the first around `top`. Returns the height of all lines.
pub(super) fn legend_lines(picture: &mut Picture, top: f64, entries: &[(Key, String)]) -> f64 {
    let (left, right) = (picture.margin() + 2.0, picture.width() - picture.margin());
    let (mut x, mut y) = (left, top);
    for (key, label) in entries {
        let label = shortened(label, LEGEND_PX, right - left - KEY);
        let wide = KEY + text_width(&label, LEGEND_PX, false);
        if x > left && x + wide > right {
            (x, y) = (left, y + LEGEND_LINE);
        }
        key.draw(picture, (x, y));
        picture.text(Text { size: LEGEND_PX, ..text(&label, (x + KEY, y)) });
        x += wide + GAP;
    }
    if entries.is_empty() { 0.0 } else { y - top + LEGEND_LINE }
}

/// Draws a legend in one column within `height`, top entry at `from`. Each entry has a label, and a value that ends at `right`.
pub(super) fn legend_column(
    picture: &mut Picture,
    from: Point,
    right: f64,
    height: f64,
    entries: &[(Key, String, String)],
) {
    let pitch = (height / entries.len().max(1) as f64).min(LEGEND_LINE);
    let size = (pitch * 0.62).clamp(7.0, LEGEND_PX);
    for (index, (key, label, value)) in entries.iter().enumerate() {
        let y = from.1 + pitch * index as f64;
        key.draw(picture, (from.0, y));
        let room = right - from.0 - KEY - 8.0 - text_width(value, size, false);
        picture.text(Text { size, colour: INK, ..text(&shortened(label, size, room), (from.0 + KEY, y)) });
        if !value.is_empty() {
            picture.text(Text { size, colour: MUTED, across: Across::Right, ..text(value, (right, y)) });
        }
    }
}

/// White background of a legend inside a panel.
pub(super) fn plate(picture: &mut Picture, from: Point, to: Point) {
    picture.rect(from, to, BACKGROUND.alpha(0.85));
}

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
    /// Lengths of strokes and gaps; empty for a solid line.
    pub dash: Option<[f64; 2]>,
}

impl Style {
    /// Style of series number `index`. Colours repeat with other strokes.
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
