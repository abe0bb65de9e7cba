//! A plot as a list of shapes, before it is any kind of file.

use super::palette::{BACKGROUND, Colour, INK, MUTED};

/// A point in pixels of the picture, from the top left.
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

/// A plot, ready to be rendered with [`Picture::svg`], [`Picture::png`] or [`Picture::write`].
#[derive(Clone, Debug)]
pub struct Picture {
    pub(super) width: f64,
    pub(super) height: f64,
    pub(super) title: String,
    pub(super) shapes: Vec<Shape>,
}

/// Distance of the title from the left edge.
const TITLE_LEFT: f64 = 24.0;

impl Picture {
    /// A picture of `width` x `height` pixels with its title and a line below it.
    pub(super) fn new(width: f64, height: f64, title: &str, subtitle: &str) -> Self {
        let mut picture = Self { width, height, title: title.to_owned(), shapes: Vec::new() };
        picture.rect((0.0, 0.0), (width, height), BACKGROUND);
        let heading = Text { size: 19.0, bold: true, colour: INK, ..text(title, (TITLE_LEFT, 26.0)) };
        picture.text(heading);
        picture.text(Text { size: 13.0, colour: MUTED, ..text(subtitle, (TITLE_LEFT, 50.0)) });
        picture
    }

    /// Says in the middle why there is nothing to see.
    pub(super) fn nothing(mut self, why: &str) -> Self {
        let at = (self.width / 2.0, self.height / 2.0);
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

    pub(super) fn polygon(&mut self, points: Vec<Point>, fill: Colour) {
        self.shapes.push(Shape::Polygon { points, fill });
    }

    pub(super) fn dot(&mut self, centre: Point, radius: f64, fill: Colour) {
        self.shapes.push(Shape::Dot { centre, radius, fill });
    }

    pub(super) fn text(&mut self, text: Text) {
        self.shapes.push(Shape::Text(text));
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
