//! Plot area with its axes, and labels beside points that overlap nothing. Legends, and the styles that
//! distinguish series: colour, marker and strokes.

use super::axis::{Axis, EXPONENT_SIZE_RATIO, TICK_PX, Tick, label_width};
use super::picture::{Across, Picture, Point, Text, shortened, text, text_width};
use super::{AXIS, BACKGROUND, Colour, GRID, INK, MUTED, SERIES};

/// Rectangle of the picture, and its two axes.
#[derive(Clone, Debug)]
pub(super) struct Panel {
    pub left: f64,
    pub top: f64,
    pub right: f64,
    pub bottom: f64,
    pub x: Axis,
    pub y: Axis,
}

/// Height of the labels below a panel.
pub(super) const BELOW: f64 = 50.0;
/// Lengths of ticks with and without a label.
const TICKS: [f64; 2] = [5.0, 3.0];

/// Room left of a panel for labels and name of its axis.
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

    /// Position of a point; `None` if an axis cannot show it.
    pub fn place(&self, (x, y): (f64, f64)) -> Option<Point> {
        (self.x.place(x).is_some() && self.y.place(y).is_some()).then(|| self.at(x, y))
    }

    fn tick_x(&self, tick: &Tick) -> f64 {
        self.left + (self.right - self.left) * self.x.fraction_at(tick.at)
    }

    fn tick_y(&self, tick: &Tick) -> f64 {
        self.bottom - (self.bottom - self.top) * self.y.fraction_at(tick.at)
    }

    /// Draws grid lines at the labelled ticks of `y`, and a break above the row of zero. Called before the
    /// data are drawn.
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

    /// Draws grid lines at the labelled ticks of `x`.
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

    /// Draws axis lines, ticks, labels and names. The horizontal axis is `gap` below the panel.
    pub fn axes(&self, picture: &mut Picture, gap: f64) {
        self.axis_across(picture, gap);
        self.axis_up(picture);
    }

    /// Draws only the vertical axis; a logarithmic one with its line and all ticks.
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

    /// Draws only the horizontal axis.
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

    /// Draws a second vertical axis on the right, with its own labels: `y` times a factor, made by `axis`.
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

/// Draws a tick label. Digits after `^` are raised.
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
    let behind = left + text_width(base, TICK_PX, false);
    picture.text(Text { size: EXPONENT_SIZE_RATIO * TICK_PX, ..plain(raised, (behind + 0.5, y - 5.0)) });
}

/// A name, the point it belongs to, and the radius of the point's marker.
#[derive(Clone, Copy, Debug)]
pub(super) struct Label<'a> {
    pub name: &'a str,
    pub at: Point,
    pub radius: f64,
    pub colour: Colour,
    pub bold: bool,
}

/// Size of names in pixels.
const NAME_PX: f64 = 11.5;
/// Half the height of the free box around a name.
const HALF: f64 = 6.5;
/// Distances tried between marker and name, from near to far.
const REACHES: [f64; 6] = [3.0, 8.0, 16.0, 28.0, 44.0, 64.0];
/// Directions tried at each distance.
const DIRECTIONS: u32 = 16;
/// Names at this distance or farther have a line to their point.
const LEADER: f64 = 12.0;

/// Left, top, right, bottom.
type Box4 = [f64; 4];

fn overlaps(a: &Box4, b: &Box4) -> bool {
    a[0] < b[2] && b[0] < a[2] && a[1] < b[3] && b[1] < a[3]
}

/// Writes the names in order. Each is at the nearest position in the panel that overlaps no name, marker or
/// line (`obstacles`). Returns the number of names without such a position; they are omitted.
pub(super) fn write(
    picture: &mut Picture,
    panel: &Panel,
    labels: &[Label<'_>],
    obstacles: &[Point],
) -> usize {
    let mut taken: Vec<Box4> = obstacles.iter().map(|(x, y)| [x - 2.5, y - 2.5, x + 2.5, y + 2.5]).collect();
    taken.extend(labels.iter().map(|Label { at: (x, y), radius: r, .. }| [x - r, y - r, x + r, y + r]));
    let mut left_out = 0;
    for label in labels {
        let Some((place, reach)) = nearest(label, panel, &taken) else {
            left_out += 1;
            continue;
        };
        if reach >= LEADER {
            let (x, y) = label.at;
            let end = (x.clamp(place[0], place[2]), y.clamp(place[1], place[3]));
            let length = libm::hypot(end.0 - x, end.1 - y).max(1.0);
            let start = (x + (end.0 - x) / length * label.radius, y + (end.1 - y) / length * label.radius);
            picture.line(start, end, AXIS, 0.8);
        }
        let at = (place[0] + 1.0, 0.5 * (place[1] + place[3]));
        let (colour, bold) = (label.colour, label.bold);
        picture.text(Text { size: NAME_PX, colour, bold, ..text(label.name, at) });
        taken.push(place);
    }
    left_out
}

/// Nearest free box of a name, and its distance from the marker.
fn nearest(label: &Label<'_>, panel: &Panel, taken: &[Box4]) -> Option<(Box4, f64)> {
    let width = text_width(label.name, NAME_PX, label.bold) + 2.0;
    let is_free = |place: &Box4| {
        let inside = place[0] >= panel.left
            && place[2] <= panel.right
            && place[1] >= panel.top
            && place[3] <= panel.bottom;
        inside && !taken.iter().any(|other| overlaps(place, other))
    };
    REACHES.iter().find_map(|&reach| {
        let from_marker = label.radius + reach;
        (0..DIRECTIONS).find_map(|number| {
            // To the right first, then on both sides of it.
            let turn = if number % 2 == 0 { number / 2 } else { DIRECTIONS - 1 - number / 2 };
            let angle = std::f64::consts::TAU * f64::from(turn) / f64::from(DIRECTIONS);
            let (sin, cos) = libm::sincos(angle);
            let (x, y) = (label.at.0 + from_marker * cos, label.at.1 - (from_marker + 0.5 * HALF) * sin);
            // The box touches the circle with the side that faces it.
            let left = x - 0.5 * width * (1.0 - cos);
            let middle = y - 0.7 * HALF * sin;
            let place = [left, middle - HALF, left + width, middle + HALF];
            is_free(&place).then_some((place, reach))
        })
    })
}

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

/// Draws a legend between the margins, in as many lines as needed, the first around `top`. Returns the height
/// of all lines.
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

/// Draws a legend in one column within `height`, top entry at `from`. Each entry has a label, and a value
/// that ends at `right`.
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

#[cfg(test)]
mod tests {
    use super::super::INK;
    use super::super::axis::{Along, Axis};
    use super::super::picture::{PlotStyle, Shape};
    use super::*;

    fn panel() -> Panel {
        let x = Axis::new("x", "", (0.0, 1.0), Along::across(400.0));
        let y = Axis::new("y", "", (0.0, 1.0), Along::up(300.0));
        Panel { left: 0.0, top: 0.0, right: 400.0, bottom: 300.0, x, y }
    }

    fn placed(points: &[Point]) -> (usize, Vec<Box4>) {
        let mut picture = Picture::titled(&PlotStyle::default(), (400.0, 300.0), ["", ""]);
        let labels: Vec<Label<'_>> = points
            .iter()
            .map(|&at| Label { name: "lens-and-motion", at, radius: 3.0, colour: INK, bold: false })
            .collect();
        let left_out = write(&mut picture, &panel(), &labels, points);
        let boxes = picture.shapes.iter().filter_map(|shape| match shape {
            Shape::Text(text) => {
                let (x, y) = text.at;
                Some([x, y - 5.0, x + text_width(&text.text, text.size, text.bold), y + 5.0])
            }
            _ => None,
        });
        (left_out, boxes.collect())
    }

    #[test]
    fn names_are_on_no_other_name_and_on_no_point() {
        // Points in a heap, along an edge and in a corner.
        let heap = (0..8).map(|i| (200.0 + f64::from(i % 3) * 9.0, 150.0 + f64::from(i) * 4.0));
        let edge = (0..6).map(|i| (398.0, 20.0 + f64::from(i) * 15.0));
        let points: Vec<Point> = heap.chain(edge).chain([(1.0, 299.0), (0.0, 0.0)]).collect();
        let (left_out, boxes) = placed(&points);
        assert_eq!((left_out, boxes.len()), (0, points.len()));
        for (index, place) in boxes.iter().enumerate() {
            assert!(boxes[..index].iter().all(|other| !overlaps(place, other)), "{place:?}");
            assert!(
                points.iter().all(|(x, y)| !overlaps(place, &[x - 1.0, y - 1.0, x + 1.0, y + 1.0])),
                "{place:?}"
            );
            assert!(
                place[0] >= 0.0 && place[2] <= 400.0 && place[1] >= 0.0 && place[3] <= 300.0,
                "{place:?}"
            );
        }
    }

    #[test]
    fn names_without_room_are_counted() {
        let (left_out, boxes) = placed(&[(200.0, 150.0); 300]);
        assert!(left_out > 100 && left_out + boxes.len() == 300);
    }
}
