//! What is gained over what it costs, a panel for each subject, with the front of what nothing else beats.

use super::axis::{Axis, is_drawable};
use super::palette::{INK, MEASURED, MUTED, TRUTH};
use super::panel::{Key, Panel, legend_line};
use super::picture::{Picture, Point, Text, text};

/// Panels in rows of three.
#[derive(Clone, Debug)]
pub struct Tradeoff<'a> {
    /// The title.
    pub title: &'a str,
    /// The line below the title.
    pub subject: &'a str,
    /// What it costs, with its unit; drawn on a logarithmic axis.
    pub x: &'a str,
    /// What is gained, with its unit.
    pub y: &'a str,
    /// One for each subject.
    pub panels: Vec<TradeoffPanel<'a>>,
}

/// The points of one subject.
#[derive(Clone, Debug)]
pub struct TradeoffPanel<'a> {
    /// The subject.
    pub name: &'a str,
    /// Its points; costs are above zero.
    pub points: Vec<TradeoffPoint>,
}

/// One point.
#[derive(Clone, Debug, PartialEq)]
pub struct TradeoffPoint {
    /// What it is, in a few letters; written beside points of the front.
    pub label: String,
    /// Its cost.
    pub x: f64,
    /// Its gain.
    pub y: f64,
    /// Whether no other point costs no more and gains no less.
    pub front: bool,
}

const ACROSS: usize = 3;
const PITCH: (f64, f64) = (460.0, 380.0);

impl Tradeoff<'_> {
    /// The panels, row by row.
    pub fn picture(&self) -> Picture {
        let rows = self.panels.len().div_ceil(ACROSS).max(1);
        let (width, height) = (40.0 + PITCH.0 * ACROSS as f64, 100.0 + PITCH.1 * rows as f64);
        let mut picture = Picture::new(width, height, self.title, self.subject);
        if self.panels.is_empty() {
            return picture.nothing("nothing to compare");
        }
        let keys = [(Key::Dot(TRUTH), "on the front"), (Key::Dot(MEASURED), "beaten by another")];
        legend_line(&mut picture, (95.0, 78.0), &keys.map(|(key, label)| (key, label.to_owned())));
        for (place, panel) in self.panels.iter().enumerate() {
            let left = 95.0 + PITCH.0 * (place % ACROSS) as f64;
            let top = 124.0 + PITCH.1 * (place / ACROSS) as f64;
            self.panel(panel, (left, top), &mut picture);
        }
        picture
    }

    fn panel(&self, subject: &TradeoffPanel<'_>, (left, top): (f64, f64), picture: &mut Picture) {
        picture.text(Text { bold: true, colour: INK, ..text(subject.name, (left, top - 14.0)) });
        let drawn = |point: &&TradeoffPoint| point.x > 0.0 && is_drawable(point.x, point.y);
        let points: Vec<_> = subject.points.iter().filter(drawn).collect();
        let costs = || points.iter().map(|point| libm::log10(point.x));
        let Some((low, high)) = costs().reduce(f64::min).zip(costs().reduce(f64::max)) else {
            return picture.text(text("nothing to show", (left, top + 100.0)));
        };
        let most = points.iter().map(|point| point.y).fold(0.0, f64::max);
        let panel = Panel {
            left,
            top,
            right: left + PITCH.0 - 120.0,
            bottom: top + PITCH.1 - 100.0,
            x: Axis::log(self.x, low, high),
            y: Axis::from_zero(self.y, "", most),
        };
        panel.grid(picture);
        dots(&panel, &points, picture);
        panel.axes(picture, 0.0);
    }
}

fn dots(panel: &Panel, points: &[&TradeoffPoint], picture: &mut Picture) {
    let at = |point: &TradeoffPoint| panel.at(libm::log10(point.x), point.y);
    let mut front: Vec<_> = points.iter().filter(|point| point.front).collect();
    front.sort_by(|a, b| a.x.total_cmp(&b.x));
    if front.len() > 1 {
        picture.polyline(front.iter().map(|point| at(point)).collect(), TRUTH.alpha(0.5), 1.5);
    }
    for (colour, radius, of_front) in [(MEASURED.alpha(0.8), 3.5, false), (TRUTH, 4.5, true)] {
        let chosen = || points.iter().filter(|point| point.front == of_front);
        chosen().for_each(|point| picture.dot(at(point), radius, colour));
        for (place, label) in labels(chosen().map(|point| (at(point), point.label.as_str()))) {
            let place = (place.0 + 7.0, if of_front { place.1 - 10.0 } else { place.1 + 10.0 });
            let (size, colour) = if of_front { (12.0, INK) } else { (10.0, MUTED) };
            picture.text(Text { size, colour, bold: of_front, ..text(&label, place) });
        }
    }
}

/// Labels of points that almost fall together share a place, the first two of them in full.
fn labels<'a>(points: impl Iterator<Item = (Point, &'a str)>) -> Vec<(Point, String)> {
    let mut placed: Vec<(Point, Vec<&str>)> = Vec::new();
    for (at, label) in points {
        let near = |place: &Point| (place.0 - at.0).abs() < 60.0 && (place.1 - at.1).abs() < 11.0;
        match placed.iter_mut().find(|(place, _)| near(place)) {
            Some((_, names)) => names.push(label),
            None => placed.push((at, vec![label])),
        }
    }
    let joined =
        |names: &[&str]| names[..names.len().min(2)].join(", ") + if names.len() > 2 { ", …" } else { "" };
    placed.iter().map(|(at, names)| (*at, joined(names))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn labels_of_points_that_fall_together_are_joined() {
        let points = [(0.0, "a"), (3.0, "b"), (200.0, "c"), (5.0, "d")];
        let placed = labels(points.into_iter().map(|(x, label)| ((x, 10.0), label)));
        assert_eq!(placed, [((0.0, 10.0), "a, b, …".to_owned()), ((200.0, 10.0), "c".to_owned())]);
    }

    #[test]
    fn points_of_the_front_are_named() {
        let point = |label: &str, x, front| TradeoffPoint { label: label.to_owned(), x, y: 0.5, front };
        let points = vec![point("best", 10.0, true), point("worse", 1000.0, false), point("odd", 0.0, false)];
        let panels =
            vec![TradeoffPanel { name: "scene", points }, TradeoffPanel { name: "empty", points: vec![] }];
        let svg =
            Tradeoff { title: "t", subject: "s", x: "cost", y: "gain", panels }.picture().svg().unwrap();
        assert!(svg.contains("best") && svg.contains("worse") && svg.contains("nothing to show"));
        assert!(!svg.contains("odd"));
    }
}
