//! A plot as a list of shapes, independent of the file format; its width, font size and title.
//!
//! Text has the width of the embedded font, and is shortened where it is too wide. The font is a subset of
//! DejaVu Sans, so no system font is needed.

use std::sync::OnceLock;

use plotters::style::{FontFamily, FontStyle, IntoFont, register_font};
use serde::{Deserialize, Serialize};

use super::{Colour, INK, MUTED};

/// A point in pixels of the layout, from the top left.
pub(super) type Point = (f64, f64);

/// Horizontal alignment of a text at its position.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Across {
    Left,
    Centre,
    Right,
}

/// A line of text. Its position is at half the height of capitals.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Text {
    pub text: String,
    pub at: Point,
    /// Font size (em) in pixels.
    pub size: f64,
    pub colour: Colour,
    pub bold: bool,
    pub across: Across,
    /// Whether the text is rotated to read upwards.
    pub upwards: bool,
}

/// A shape.
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

/// Pictures narrower than this have margins and titles for a column of a paper.
const NARROW: f64 = 600.0;
/// Font size of the line below the title.
const SUBTITLE_PX: f64 = 13.0;
/// Line height of it.
const SUBTITLE_LINE: f64 = 18.0;

impl Picture {
    /// A picture with a title and a line below it. It is `usual` pixels wide unless `look` sets the width,
    /// and at least `least`. Its height is that of the titles; later drawing increases it.
    pub(super) fn titled(
        plot_style: &PlotStyle,
        (usual, least): (f64, f64),
        [title, subtitle]: [&str; 2],
    ) -> Self {
        let title = plot_style.title.as_deref().unwrap_or(title);
        let paper = plot_style.paper(usual, least);
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

    /// Whether it is for a column of a paper.
    pub(super) fn is_narrow(&self) -> bool {
        self.width() < NARROW
    }

    /// Empty pixels left and right.
    pub(super) fn margin(&self) -> f64 {
        if self.is_narrow() { 8.0 } else { 24.0 }
    }

    /// Shows why the plot is empty.
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

    /// A path with strokes of `[on, off]` pixels.
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

/// A text in the default style: 13 px, ink, left-aligned.
pub(super) fn text(text: &str, at: Point) -> Text {
    Text {
        text: drawable(text),
        at,
        size: 13.0,
        colour: INK,
        bold: false,
        across: Across::Left,
        upwards: false,
    }
}

/// Width of a column in a two-column paper.
pub const COLUMN_MM: f64 = 85.0;
/// Font size of pictures of a given width, in points.
const PAPER_LETTERS_PT: f64 = 8.0;
/// Font size of ordinary text, in pixels of the layout.
const LETTERS_PX: f64 = 13.0;
/// PNG pixels per inch for pictures of a given width.
const PNG_PER_INCH: f64 = 300.0;
/// Pixels per inch of a screen.
const SCREEN_PER_INCH: f64 = 96.0;

/// Width, font size and title of pictures, as set by the user. The default is each picture's own.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PlotStyle {
    /// Width in millimetres.
    pub width_mm: Option<f64>,
    /// Font size of ordinary text in points.
    pub font_pt: Option<f64>,
    /// Title in place of the picture's own. An empty one omits title and subtitle, for papers with captions.
    pub title: Option<String>,
}

/// Size of one picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Paper {
    /// Width in pixels of the layout, in which ordinary text is 13 pixels high.
    pub width: f64,
    /// PNG pixels per pixel of the layout.
    pub zoom: f64,
    /// Width in millimetres, if the user set it.
    pub width_mm: Option<f64>,
}

impl PlotStyle {
    /// Size of a picture that is `usual` pixels wide by default and needs at least `least`. For a narrower
    /// one the font is smaller than requested.
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

/// Resolution of text measurement and SVG over that of the picture; PNG is drawn with it and then halved.
pub(super) const SCALE: f64 = 2.0;

/// Font size of `plotters` over the em of the font.
pub(super) const SIZE_OVER_EM: f64 = 1.24;

/// Registers the embedded fonts with `plotters`, once. Returns whether this succeeded.
pub(super) fn register() -> bool {
    static DONE: OnceLock<bool> = OnceLock::new();
    *DONE.get_or_init(|| {
        register_font(FAMILY, FontStyle::Normal, REGULAR).is_ok()
            && register_font(FAMILY, FontStyle::Bold, BOLD).is_ok()
    })
}

/// The font with an em of `size` steps of the backend.
pub(super) fn plotters_font(size: f64, bold: bool) -> plotters::style::FontDesc<'static> {
    let style = if bold { FontStyle::Bold } else { FontStyle::Normal };
    (FontFamily::Name(FAMILY), size * SIZE_OVER_EM, style).into_font()
}

/// The width in pixels of `text` in letters of `size`.
pub(super) fn text_width(text: &str, size: f64, bold: bool) -> f64 {
    // A damaged font is reported when the picture is rendered; until then about half an em a letter will do.
    let guess = text.chars().count() as f64 * size * 0.6;
    if !register() {
        return guess;
    }
    plotters_font(size * SCALE, bold).box_size(text).map_or(guess, |(width, _)| f64::from(width) / SCALE)
}

/// Breaks `label` between words into lines of at most `room` pixels.
pub(super) fn wrapped(label: &str, size: f64, bold: bool, room: f64) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for word in label.split_whitespace() {
        match lines.last_mut() {
            Some(line) if text_width(&format!("{line} {word}"), size, bold) <= room => {
                line.push(' ');
                line.push_str(word);
            }
            _ => lines.push(word.to_owned()),
        }
    }
    lines
}

/// Shortens `label` with `…` if it is wider than `room` pixels.
pub(super) fn shortened(label: &str, size: f64, room: f64) -> String {
    let mut short: Vec<char> = label.chars().collect();
    if text_width(label, size, false) <= room {
        return label.to_owned();
    }
    while !short.is_empty() {
        short.pop();
        let candidate: String = short.iter().chain(['…'].iter()).collect();
        if text_width(&candidate, size, false) <= room {
            return candidate;
        }
    }
    String::new()
}

/// Regular font with Latin-1, Latin Extended-A and the symbols of plots. See `assets/README.md`.
const REGULAR: &[u8] = include_bytes!("../../assets/DejaVuSans-subset.ttf");

/// Bold font with the same characters.
const BOLD: &[u8] = include_bytes!("../../assets/DejaVuSans-Bold-subset.ttf");

/// Font family in SVG: DejaVu if installed, otherwise fonts of similar width.
const FAMILY: &str = "DejaVu Sans, Verdana, Segoe UI, Helvetica, Arial, sans-serif";

/// Characters of the subset beyond the Latin letters.
const SYMBOLS: &str = "–—…→←−≤≥≈ΩσμΔ∞";

/// Whether the subset has `letter`.
fn has(letter: char) -> bool {
    matches!(letter, ' '..='~' | '\u{a0}'..='\u{17f}') || SYMBOLS.contains(letter)
}

/// The first character of `text` that pictures cannot show.
pub fn undrawable(text: &str) -> Option<char> {
    text.chars().find(|letter| !has(*letter))
}

/// Replaces every character that the subset lacks with `?`.
pub(super) fn drawable(text: &str) -> String {
    text.chars().map(|c| if has(c) { c } else { '?' }).collect()
}

#[cfg(test)]
mod tests {
    use ab_glyph::{Font, FontRef};

    use super::*;

    #[test]
    fn letters_of_a_column_are_eight_points() {
        let paper = PlotStyle { width_mm: Some(COLUMN_MM), ..PlotStyle::default() }.paper(1200.0, 300.0);
        let points_per_px = COLUMN_MM / 25.4 * 72.0 / paper.width;
        assert!((LETTERS_PX * points_per_px - PAPER_LETTERS_PT).abs() < 0.05, "{paper:?}");
        assert!((paper.width * paper.zoom - COLUMN_MM / 25.4 * 300.0).abs() < 1e-9);
    }

    #[test]
    fn larger_letters_leave_less_room_on_the_same_screen() {
        assert_eq!(
            PlotStyle::default().paper(1200.0, 300.0),
            Paper { width: 1200.0, zoom: 1.0, width_mm: None }
        );
        let paper = PlotStyle { font_pt: Some(19.5), ..PlotStyle::default() }.paper(1200.0, 300.0);
        assert_eq!((paper.width, paper.zoom), (600.0, 2.0));
        assert_eq!(
            PlotStyle { font_pt: Some(39.0), ..PlotStyle::default() }.paper(1200.0, 700.0).width,
            700.0
        );
    }

    #[test]
    fn the_subset_has_all_declared_letters() {
        for font in [REGULAR, BOLD].map(|bytes| FontRef::try_from_slice(bytes).unwrap()) {
            let named = |letter: char| font.glyph_id(letter).0 != 0;
            let lacking: String =
                ('\0'..'\u{3000}').filter(|&letter| has(letter) && !named(letter)).collect();
            assert_eq!(lacking, "");
            assert!(!has('\u{4e2d}') && !named('\u{4e2d}'));
        }
        assert_eq!(drawable("Größe Łódź 中"), "Größe Łódź ?");
        assert_eq!([undrawable("Größe 中文"), undrawable("Größe")], [Some('中'), None]);
    }
}
