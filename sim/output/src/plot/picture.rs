//! A plot as a list of shapes, before it is any kind of file.

use super::look::{Look, Paper};
use super::palette::{Colour, INK, MUTED};
use super::text::wrapped;

/// A point in pixels of the layout, from the top left.
pub(super) type Point = (f64, f64);

/// Which point of a text its position names, across.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Across {
    Left,
    Centre,
    Right,
}

/// A line of text; its position is half way up its capitals.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Text {
    pub text: String,
    pub at: Point,
    /// Height of the letters' em in pixels.
    pub size: f64,
    pub colour: Colour,
    pub bold: bool,
    pub across: Across,
    /// Turned a quarter to read upwards.
    pub upwards: bool,
}

/// Something to draw.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Shape {
    Rect { from: Point, to: Point, fill: Colour },
    Polyline { points: Vec<Point>, stroke: Colour, width: f64 },
    Polygon { points: Vec<Point>, fill: Colour },
    Dot { centre: Point, radius: f64, fill: Colour },
    Text(Text),
}

/// A plot, ready to be rendered with [`Picture::svg`], [`Picture::png`], [`Picture::pdf`] or [`Picture::write`].
#[derive(Clone, Debug)]
pub struct Picture {
    pub(super) paper: Paper,
    /// Height in pixels of the layout.
    pub(super) height: f64,
    pub(super) title: String,
    pub(super) shapes: Vec<Shape>,
}

/// Width below which margins and titles are those of a paper's column.
const NARROW: f64 = 600.0;
/// Size of the line below the title.
const SUBTITLE_PX: f64 = 13.0;
/// Distance of its lines.
const SUBTITLE_LINE: f64 = 18.0;

impl Picture {
    /// A picture with its title and a line below it, `usual` pixels wide unless `look` says otherwise, and `least` at least. It ends below
    /// these; whatever is drawn under them sets the height anew.
    pub(super) fn titled(look: &Look, (usual, least): (f64, f64), [title, subtitle]: [&str; 2]) -> Self {
        let title = look.title.as_deref().unwrap_or(title);
        let paper = look.paper(usual, least);
        let mut picture = Self { paper, height: 12.0, title: title.to_owned(), shapes: Vec::new() };
        if !title.is_empty() {
            picture.heading(title, subtitle);
        }
        picture
    }

    fn heading(&mut self, title: &str, subtitle: &str) {
        let (size, line) = if self.is_narrow() { (15.0, 20.0) } else { (19.0, 24.0) };
        let room = self.width() - 2.0 * self.margin();
        let mut y = 0.5 * line + if self.is_narrow() { 6.0 } else { 14.0 };
        for row in wrapped(title, size, true, room) {
            self.text(Text { size, bold: true, ..text(&row, (self.margin(), y)) });
            y += line;
        }
        for row in wrapped(subtitle, SUBTITLE_PX, false, room) {
            self.text(Text { size: SUBTITLE_PX, colour: MUTED, ..text(&row, (self.margin(), y)) });
            y += SUBTITLE_LINE;
        }
        self.height = y + 2.0;
    }

    /// Width in pixels of the layout.
    pub(super) fn width(&self) -> f64 {
        self.paper.width
    }

    /// Whether it is for a paper's column rather than a page or a screen.
    pub(super) fn is_narrow(&self) -> bool {
        self.width() < NARROW
    }

    /// Empty pixels left and right.
    pub(super) fn margin(&self) -> f64 {
        if self.is_narrow() { 8.0 } else { 24.0 }
    }

    /// Says why there is nothing to see.
    pub(super) fn nothing(mut self, why: &str) -> Self {
        let at = (self.width() / 2.0, self.height + 60.0);
        self.height += 120.0;
        self.text(Text { size: 17.0, across: Across::Centre, colour: MUTED, ..text(why, at) });
        self
    }

    pub(super) fn rect(&mut self, from: Point, to: Point, fill: Colour) {
        self.shapes.push(Shape::Rect { from, to, fill });
    }

    pub(super) fn line(&mut self, from: Point, to: Point, stroke: Colour, width: f64) {
        self.polyline(vec![from, to], stroke, width);
    }

    pub(super) fn polyline(&mut self, points: Vec<Point>, stroke: Colour, width: f64) {
        self.shapes.push(Shape::Polyline { points, stroke, width });
    }

    /// A path in strokes of `[on, off]` pixels.
    pub(super) fn dashed(&mut self, points: &[Point], stroke: Colour, width: f64, dash: [f64; 2]) {
        let mut place = 0.0;
        for pair in points.windows(2) {
            let ((ax, ay), (bx, by)) = (pair[0], pair[1]);
            let length = libm::hypot(bx - ax, by - ay);
            let at = |s: f64| (ax + (bx - ax) * s / length, ay + (by - ay) * s / length);
            let mut from = 0.0;
            while from < length {
                let phase = place % (dash[0] + dash[1]);
                let (on, left) = if phase < dash[0] {
                    (true, dash[0] - phase)
                } else {
                    (false, dash[0] + dash[1] - phase)
                };
                let to = (from + left.max(0.1)).min(length);
                if on {
                    self.line(at(from), at(to), stroke, width);
                }
                (place, from) = (place + to - from, to);
            }
        }
    }

    pub(super) fn polygon(&mut self, points: Vec<Point>, fill: Colour) {
        self.shapes.push(Shape::Polygon { points, fill });
    }

    pub(super) fn dot(&mut self, centre: Point, radius: f64, fill: Colour) {
        self.shapes.push(Shape::Dot { centre, radius, fill });
    }

    pub(super) fn text(&mut self, text: Text) {
        if !text.text.is_empty() {
            self.shapes.push(Shape::Text(text));
        }
    }
}

/// A text with the usual looks: 13 px, ink, from the left.
pub(super) fn text(text: &str, at: Point) -> Text {
    Text {
        text: super::super::font::drawable(text),
        at,
        size: 13.0,
        colour: INK,
        bold: false,
        across: Across::Left,
        upwards: false,
    }
}
