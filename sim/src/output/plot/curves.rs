//! Curves on logarithmic axes, several panels side by side.

use super::axis::{Axis, is_drawable};
use super::palette::{GRID, MUTED, part_colour};
use super::panel::{Key, Panel, legend_column, legend_line};
use super::picture::{Picture, Text, text};
use crate::output::table::power_of_ten;

/// A named curve.
#[derive(Clone, Debug)]
pub struct Curve {
    /// Its name; the first word names it in the legend above all panels.
    pub name: String,
    /// What the legend of its panel says behind the name, for example its exponent.
    pub note: String,
    /// Its points from left to right; those that are not above zero are left out.
    pub points: Vec<(f64, f64)>,
}

/// Curves over one axis.
#[derive(Clone, Debug)]
pub struct CurvePanel {
    /// What is shown.
    pub title: String,
    /// What goes across.
    pub across: String,
    /// What goes up.
    pub up: String,
    /// Whether ticks across are powers of two rather than of ten.
    pub doubling: bool,
    /// The curves, in the order of their colours.
    pub curves: Vec<Curve>,
}

/// Panels side by side.
#[derive(Clone, Debug)]
pub struct Curves<'a> {
    /// What is shown.
    pub title: &'a str,
    /// Of what, for the line below the title.
    pub subject: &'a str,
    /// The panels, from left to right.
    pub panels: Vec<CurvePanel>,
}

const PANEL_WIDTH: f64 = 400.0;
/// What a panel leaves for its axis and its neighbour.
const ASIDE: f64 = 76.0;
const TOP: f64 = 128.0;
const BOTTOM: f64 = 500.0;

impl Curves<'_> {
    /// Lines with a dot for each point.
    pub fn picture(&self) -> Picture {
        let width = 40.0 + PANEL_WIDTH * self.panels.len().max(2) as f64;
        let mut picture = Picture::new(width, 570.0, self.title, self.subject);
        if self.panels.is_empty() {
            return picture.nothing("no curves to show");
        }
        let names = self.panels[0].curves.iter().enumerate();
        let legend: Vec<_> = names.map(|(i, curve)| (key(i), curve.name.clone())).collect();
        legend_line(&mut picture, (24.0, 78.0), &legend);
        for (place, panel) in self.panels.iter().enumerate() {
            panel.draw(&mut picture, 90.0 + PANEL_WIDTH * place as f64);
        }
        picture
    }
}

fn key(index: usize) -> Key {
    Key::Line(part_colour(index, false))
}

impl CurvePanel {
    fn draw(&self, picture: &mut Picture, left: f64) {
        let right = left + PANEL_WIDTH - ASIDE;
        picture.text(Text { bold: true, ..text(&self.title, (left, TOP - 18.0)) });
        let Some([x, y]) = self.axes() else {
            picture.text(Text {
                colour: MUTED,
                ..text("nothing above zero", (left + 20.0, (TOP + BOTTOM) / 2.0))
            });
            return;
        };
        let panel = Panel { left, top: TOP, right, bottom: BOTTOM, x, y };
        panel.grid(picture);
        for (value, _) in &panel.x.ticks {
            let x = panel.x_px(*value);
            picture.line((x, panel.top), (x, panel.bottom), GRID, 1.0);
        }
        for (index, curve) in self.curves.iter().enumerate() {
            let colour = part_colour(index, false);
            let points: Vec<_> = curve.logarithms().map(|(x, y)| panel.at(x, y)).collect();
            points.iter().for_each(|&point| picture.dot(point, 2.5, colour));
            if points.len() > 1 {
                picture.polyline(points, colour.alpha(0.8), 1.5);
            }
        }
        panel.axes(picture, 0.0);
        self.notes(picture, right);
    }

    /// The notes of the curves in the upper corner that they leave free: right where they fall, left where they rise.
    fn notes(&self, picture: &mut Picture, right: f64) {
        let noted = self.curves.iter().enumerate().filter(|(_, curve)| !curve.note.is_empty());
        let entries: Vec<_> =
            noted.map(|(index, curve)| (key(index), curve.name.clone(), curve.note.clone())).collect();
        let right = if self.rises() { right - (PANEL_WIDTH - ASIDE) + 176.0 } else { right };
        legend_column(picture, (right - 160.0, TOP + 14.0), right - 6.0, &entries);
    }

    /// Whether the curves end higher than they begin, all in all.
    fn rises(&self) -> bool {
        let rise = |curve: &Curve| {
            let mut heights = curve.logarithms().map(|(_, y)| y);
            heights.next().zip(heights.last()).map_or(0.0, |(first, last)| last - first)
        };
        self.curves.iter().map(rise).sum::<f64>() > 0.0
    }

    /// Axes of the logarithms, or `None` where there is nothing to show.
    fn axes(&self) -> Option<[Axis; 2]> {
        let all = || self.curves.iter().flat_map(Curve::logarithms);
        let ends = |of: fn((f64, f64)) -> f64| {
            let (low, high) = (all().map(of).reduce(f64::min)?, all().map(of).reduce(f64::max)?);
            (is_drawable(low, high) && high < 90.0 && low > -90.0).then_some((low, high))
        };
        let (left, right) = ends(|point| point.0)?;
        let (low, high) = ends(|point| point.1)?;
        Some([
            logarithmic(&self.across, left - 0.05, right + 0.05, self.doubling),
            logarithmic(&self.up, low - 0.05, high + 0.05, false),
        ])
    }
}

impl Curve {
    /// The decimal logarithms of the points that have any.
    fn logarithms(&self) -> impl Iterator<Item = (f64, f64)> + '_ {
        let positive =
            self.points.iter().filter(|(x, y)| *x > 0.0 && *y > 0.0 && x.is_finite() && y.is_finite());
        positive.map(|(x, y)| (libm::log10(*x), libm::log10(*y)))
    }
}

/// An axis of decimal logarithms, ticks at powers of two or at round multiples of powers of ten.
fn logarithmic(label: &str, low: f64, high: f64, doubling: bool) -> Axis {
    let values: Vec<f64> = if doubling {
        (0..40).map(|power| f64::from(1_u32 << power.min(31))).collect()
    } else {
        let steps: &[f64] = match high - low {
            span if span > 2.5 => &[1.0],
            span if span > 0.8 => &[1.0, 2.0, 5.0],
            _ => &[1.0, 1.2, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 8.0],
        };
        let powers = libm::floor(low) as i32..=libm::ceil(high) as i32;
        powers.flat_map(|power| steps.iter().map(move |step| step * power_of_ten(power))).collect()
    };
    let ticks = values.into_iter().map(|value| (libm::log10(value), plain(value)));
    let mut ticks: Vec<_> = ticks.filter(|(at, _)| (low..=high).contains(at)).collect();
    ticks.dedup();
    Axis { low, high: high.max(low + 0.01), ticks, label: label.to_owned() }
}

fn plain(value: f64) -> String {
    if (1e-4..1e6).contains(&value) { format!("{}", value as f32) } else { format!("{value:.0e}") }
}
