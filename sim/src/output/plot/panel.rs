//! The area that data are drawn in, with its axes, and legends.

use super::axis::Axis;
use super::palette::{AXIS, Colour, GRID, INK, MUTED};
use super::picture::{Across, Picture, Point, Text, text};
use super::render::text_width;

/// A rectangle of the picture and the values at its edges.
#[derive(Clone, Debug)]
pub(super) struct Panel {
    pub left: f64,
    pub top: f64,
    pub right: f64,
    pub bottom: f64,
    pub x: Axis,
    pub y: Axis,
}

impl Panel {
    pub fn x_px(&self, value: f64) -> f64 {
        self.left + (self.right - self.left) * self.x.fraction(value)
    }

    pub fn y_px(&self, value: f64) -> f64 {
        self.bottom - (self.bottom - self.top) * self.y.fraction(value)
    }

    pub fn at(&self, x: f64, y: f64) -> Point {
        (self.x_px(x), self.y_px(y))
    }

    /// Lines across at the ticks of `y`, to be drawn before the data.
    pub fn grid(&self, picture: &mut Picture) {
        for (value, _) in &self.y.ticks {
            let y = self.y_px(*value);
            picture.line((self.left, y), (self.right, y), GRID, 1.0);
        }
    }

    /// Axis lines, ticks, labels and names; `gap` is how far below the panel the axis across stands.
    pub fn axes(&self, picture: &mut Picture, gap: f64) {
        self.axis_across(picture, gap);
        for (value, label) in &self.y.ticks {
            let at = (self.left - 8.0, self.y_px(*value));
            picture.text(Text { across: Across::Right, colour: MUTED, size: 12.0, ..text(label, at) });
        }
        let aside = widest(&self.y).max(30.0);
        let middle = (self.left - 8.0 - aside - 16.0, (self.top + self.bottom) / 2.0);
        picture.text(Text { across: Across::Centre, upwards: true, ..text(&self.y.label, middle) });
    }

    /// The axis across alone.
    pub fn axis_across(&self, picture: &mut Picture, gap: f64) {
        let line = self.bottom + gap;
        picture.line((self.left, line), (self.right, line), AXIS, 1.0);
        for (value, label) in &self.x.ticks {
            let x = self.x_px(*value);
            picture.line((x, line), (x, line + 5.0), AXIS, 1.0);
            let at = (x, line + 16.0);
            picture.text(Text { across: Across::Centre, colour: MUTED, size: 12.0, ..text(label, at) });
        }
        let middle = ((self.left + self.right) / 2.0, line + 38.0);
        picture.text(Text { across: Across::Centre, ..text(&self.x.label, middle) });
    }

    /// A second axis to the right with its own labels at the same height: `factor` times the values of `y`.
    pub fn right_axis(&self, picture: &mut Picture, name: &str, unit: &str, factor: f64) {
        let axis = Axis::new(name, unit, self.y.low * factor, self.y.high * factor);
        for (value, label) in &axis.ticks {
            let y = self.bottom - (self.bottom - self.top) * axis.fraction(*value);
            picture.line((self.right, y), (self.right + 5.0, y), AXIS, 1.0);
            picture.text(Text { colour: MUTED, size: 12.0, ..text(label, (self.right + 9.0, y)) });
        }
        let aside = widest(&axis).max(30.0);
        let middle = (self.right + 9.0 + aside + 16.0, (self.top + self.bottom) / 2.0);
        picture.text(Text { across: Across::Centre, upwards: true, ..text(&axis.label, middle) });
    }
}

/// The width of the widest label of a tick.
fn widest(axis: &Axis) -> f64 {
    axis.ticks.iter().map(|(_, label)| text_width(label, 12.0, false)).fold(0.0, f64::max)
}

/// How an entry of a legend is drawn.
#[derive(Clone, Copy, Debug)]
pub(super) enum Key {
    Area(Colour),
    Line(Colour),
    Dot(Colour),
    Tick(Colour),
}

impl Key {
    fn draw(self, picture: &mut Picture, (x, y): Point) {
        match self {
            Self::Area(colour) => picture.rect((x, y - 6.0), (x + 14.0, y + 6.0), colour),
            Self::Line(colour) => picture.line((x - 2.0, y), (x + 16.0, y), colour, 2.0),
            Self::Dot(colour) => picture.dot((x + 7.0, y), 4.0, colour),
            Self::Tick(colour) => picture.line((x + 7.0, y - 6.0), (x + 7.0, y + 6.0), colour, 2.0),
        }
    }
}

/// A legend in one line, starting at `from`.
pub(super) fn legend_line(picture: &mut Picture, from: Point, entries: &[(Key, String)]) {
    let (mut x, y) = from;
    for (key, label) in entries {
        key.draw(picture, (x, y));
        picture.text(Text { size: 12.5, ..text(label, (x + 22.0, y)) });
        x += 22.0 + text_width(label, 12.5, false) + 26.0;
    }
}

/// Entries of a legend, as many to a line as have room in `width` pixels.
pub(super) fn legend_lines(entries: &[(Key, String)], width: f64) -> Vec<Vec<(Key, String)>> {
    let (mut lines, mut x) = (Vec::<Vec<_>>::new(), f64::INFINITY);
    for (key, label) in entries {
        let wide = 22.0 + text_width(label, 12.5, false) + 26.0;
        if x + wide > width + 26.0 {
            lines.push(Vec::new());
            x = 0.0;
        }
        x += wide;
        if let Some(line) = lines.last_mut() {
            line.push((*key, label.clone()));
        }
    }
    lines
}

/// `label` in lines of at most `room` pixels, broken between words.
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

/// Size of the names in a legend, where there is room.
pub(super) const LEGEND_PX: f64 = 12.5;

/// A legend in one column, top entry at `from`; each entry has a label and a value that ends at `right`.
pub(super) fn legend_column(
    picture: &mut Picture,
    from: Point,
    right: f64,
    entries: &[(Key, String, String)],
) {
    let pitch = (470.0 / entries.len().max(1) as f64).min(22.0);
    let size = (pitch * 0.62).clamp(7.0, LEGEND_PX);
    for (index, (key, label, value)) in entries.iter().enumerate() {
        let y = from.1 + pitch * index as f64;
        key.draw(picture, (from.0, y));
        let room = right - from.0 - 30.0 - text_width(value, size, false);
        picture.text(Text { size, colour: INK, ..text(&shortened(label, size, room), (from.0 + 22.0, y)) });
        if !value.is_empty() {
            picture.text(Text { size, colour: MUTED, across: Across::Right, ..text(value, (right, y)) });
        }
    }
}

/// `label`, cut with `…` where it is wider than `room` pixels.
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
