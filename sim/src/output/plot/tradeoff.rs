//! What is gained over what it costs, a panel for each subject, with the front of what nothing else beats.

use super::axis::{Axis, is_drawable};
use super::palette::{AXIS, INK, MEASURED, MUTED, TRUTH};
use super::panel::{Key, Panel, legend_line};
use super::picture::{Picture, Text, text};

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
    for point in points.iter().filter(|point| !point.front) {
        picture.dot(at(point), 3.5, MEASURED.alpha(0.8));
        let (x, y) = at(point);
        picture.text(Text { size: 9.5, colour: AXIS, ..text(&point.label, (x + 6.0, y)) });
    }
    for point in front {
        picture.dot(at(point), 4.5, TRUTH);
        let (x, y) = at(point);
        picture.text(Text {
            size: 12.0,
            colour: MUTED,
            bold: true,
            ..text(&point.label, (x + 7.0, y - 9.0))
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
