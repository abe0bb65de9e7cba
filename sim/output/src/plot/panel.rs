//! The area that data are drawn in, with its axes.

use super::axis::{Axis, RAISED, TICK_PX, Tick, label_width};
use super::palette::{AXIS, GRID, MUTED};
use super::picture::{Across, Picture, Point, Text, text};

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

/// Height of what is written below a panel.
pub(super) const BELOW: f64 = 50.0;
/// Lengths of ticks, of those with and without a label.
const TICKS: [f64; 2] = [5.0, 3.0];

/// The room left of a panel for the labels of its axis and its name.
pub(super) fn aside(y: &Axis) -> f64 {
    y.widest() + if y.label.is_empty() { 14.0 } else { 34.0 }
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

    /// Where a point is; nothing where an axis has no place for it.
    pub fn place(&self, (x, y): (f64, f64)) -> Option<Point> {
        (self.x.place(x).is_some() && self.y.place(y).is_some()).then(|| self.at(x, y))
    }

    fn tick_x(&self, tick: &Tick) -> f64 {
        self.left + (self.right - self.left) * self.x.fraction_at(tick.at)
    }

    fn tick_y(&self, tick: &Tick) -> f64 {
        self.bottom - (self.bottom - self.top) * self.y.fraction_at(tick.at)
    }

    /// Lines across at the labelled ticks of `y`, to be drawn before the data, and a break above the row of zero.
    pub fn grid(&self, picture: &mut Picture) {
        for tick in self.y.ticks.iter().filter(|tick| !tick.label.is_empty()) {
            let y = self.tick_y(tick);
            picture.line((self.left, y), (self.right, y), GRID, 1.0);
        }
        if let Some(broken) = self.y.broken_at {
            let y = self.bottom - (self.bottom - self.top) * self.y.fraction_at(broken);
            picture.dashed(&[(self.left, y), (self.right, y)], AXIS, 1.0, [3.0, 3.0]);
        }
    }

    /// Lines up at the labelled ticks of `x`.
    pub fn grid_up(&self, picture: &mut Picture) {
        for tick in self.x.ticks.iter().filter(|tick| !tick.label.is_empty()) {
            let x = self.tick_x(tick);
            picture.line((x, self.top), (x, self.bottom), GRID, 1.0);
        }
        if let Some(broken) = self.x.broken_at {
            let x = self.left + (self.right - self.left) * self.x.fraction_at(broken);
            picture.dashed(&[(x, self.top), (x, self.bottom)], AXIS, 1.0, [3.0, 3.0]);
        }
    }

    /// Axis lines, ticks, labels and names; `gap` is how far below the panel the axis across stands.
    pub fn axes(&self, picture: &mut Picture, gap: f64) {
        self.axis_across(picture, gap);
        self.axis_up(picture);
    }

    /// The axis up alone; a logarithmic one with its line and all its ticks.
    pub fn axis_up(&self, picture: &mut Picture) {
        if self.y.is_logarithmic() {
            let end = self.y.broken_at.map_or(self.bottom, |broken| {
                self.bottom - (self.bottom - self.top) * self.y.fraction_at(broken)
            });
            picture.line((self.left, self.top), (self.left, end), AXIS, 1.0);
        }
        for tick in &self.y.ticks {
            let y = self.tick_y(tick);
            if self.y.is_logarithmic() {
                let length = TICKS[usize::from(tick.label.is_empty())];
                picture.line((self.left - length, y), (self.left, y), AXIS, 1.0);
            }
            tick_label(picture, &tick.label, (self.left - 8.0, y), Across::Right);
        }
        let middle = (self.left - aside(&self.y) + 10.0, (self.top + self.bottom) / 2.0);
        picture.text(Text { across: Across::Centre, upwards: true, ..text(&self.y.label, middle) });
    }

    /// The axis across alone.
    pub fn axis_across(&self, picture: &mut Picture, gap: f64) {
        let line = self.bottom + gap;
        picture.line((self.left, line), (self.right, line), AXIS, 1.0);
        for tick in &self.x.ticks {
            let (x, length) = (self.tick_x(tick), TICKS[usize::from(tick.label.is_empty())]);
            picture.line((x, line), (x, line + length), AXIS, 1.0);
            tick_label(picture, &tick.label, (x, line + 16.0), Across::Centre);
        }
        let middle = ((self.left + self.right) / 2.0, line + 38.0);
        picture.text(Text { across: Across::Centre, ..text(&self.x.label, middle) });
    }

    /// A second axis to the right with its own labels: that of `y` times a factor, made by `axis`.
    pub fn right_axis(&self, picture: &mut Picture, axis: &Axis) {
        for tick in &axis.ticks {
            let y = self.bottom - (self.bottom - self.top) * axis.fraction_at(tick.at);
            picture.line((self.right, y), (self.right + 5.0, y), AXIS, 1.0);
            tick_label(picture, &tick.label, (self.right + 9.0, y), Across::Left);
        }
        let middle = (self.right + aside(axis) - 10.0, (self.top + self.bottom) / 2.0);
        picture.text(Text { across: Across::Centre, upwards: true, ..text(&axis.label, middle) });
    }
}

/// The label of a tick; what stands behind a `^` is raised.
pub(super) fn tick_label(picture: &mut Picture, label: &str, (x, y): Point, across: Across) {
    let (base, raised) = label.split_once('^').unwrap_or((label, ""));
    if base.is_empty() {
        return;
    }
    let left = x - match across {
        Across::Left => 0.0,
        Across::Centre => 0.5 * label_width(label),
        Across::Right => label_width(label),
    };
    let plain = |words: &str, at: Point| Text { colour: MUTED, size: TICK_PX, ..text(words, at) };
    if raised.is_empty() {
        return picture.text(Text { across, ..plain(base, (x, y)) });
    }
    picture.text(plain(base, (left, y)));
    let behind = left + super::text::text_width(base, TICK_PX, false);
    picture.text(Text { size: RAISED * TICK_PX, ..plain(raised, (behind + 0.5, y - 5.0)) });
}
