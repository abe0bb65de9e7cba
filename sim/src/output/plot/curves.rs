//! Curves over one parameter, several panels side by side.

use std::ops::Range;

use super::palette::{GRID, MARK, MUTED, part_colour};
use super::panel::{Key, LEGEND_PX, Panel, legend_column, legend_line, legend_lines, wrapped};
use super::picture::{Across, Picture, Text, text};
use super::render::text_width;
use super::scale::{Scale, Way};

/// A named curve.
#[derive(Clone, Debug)]
pub struct Curve {
    /// Its name in the legend.
    pub name: String,
    /// What the panel says behind the name, for example its exponent.
    pub note: String,
    /// Its points from left to right; those that a scale has no place for are left out.
    pub points: Vec<(f64, f64)>,
}

impl Curve {
    /// A curve without a note.
    pub fn new(name: impl Into<String>, points: impl IntoIterator<Item = (f64, f64)>) -> Self {
        Self { name: name.into(), note: String::new(), points: points.into_iter().collect() }
    }
}

/// Curves over one axis.
#[derive(Clone, Debug)]
pub struct CurvePanel {
    /// What is shown.
    pub title: String,
    /// What goes across, with its unit.
    pub across: String,
    /// What goes up, with its unit.
    pub up: String,
    /// How values lie across and up.
    pub scales: [Scale; 2],
    /// Where what is shown does not work, as a range across, and what to call it.
    pub failing: Option<(Range<f64>, String)>,
    /// The curves, in the order of their colours.
    pub curves: Vec<Curve>,
}

impl CurvePanel {
    /// Curves on logarithmic scales, `[across, up]` saying what they are.
    pub fn new(title: &str, [across, up]: [&str; 2], curves: Vec<Curve>) -> Self {
        let [title, across, up] = [title, across, up].map(str::to_owned);
        Self { title, across, up, scales: [Scale::Decades; 2], failing: None, curves }
    }

    /// The same with these scales across and up.
    #[must_use]
    pub fn on(self, across: Scale, up: Scale) -> Self {
        Self { scales: [across, up], ..self }
    }

    /// The same with a range marked in which what is shown does not work.
    #[must_use]
    pub fn failing(self, range: Option<Range<f64>>, name: &str) -> Self {
        Self { failing: range.map(|range| (range, name.to_owned())), ..self }
    }
}

/// Panels side by side.
#[derive(Clone, Debug)]
pub struct Curves<'a> {
    /// What is shown.
    pub title: &'a str,
    /// Of what, for the lines below the title.
    pub subject: &'a str,
    /// The panels, from left to right.
    pub panels: Vec<CurvePanel>,
}

/// Room of a panel among several, and of one alone.
const PANEL_WIDTH: f64 = 400.0;
const ALONE_WIDTH: f64 = 760.0;
/// What a panel leaves for its axis and its neighbour.
const ASIDE: f64 = 76.0;
const HEIGHT: f64 = 372.0;
/// Distance of lines of text.
const LINE: f64 = 18.0;
const LEGEND_LINE: f64 = 22.0;
/// The room across that is not that of names in a legend below a panel.
const NAME_ASIDE: f64 = ASIDE - 40.0 + 30.0;
/// Size of the name of a marked range.
const MARK_PX: f64 = 11.5;

/// What stands above the panels, and where they are.
struct Layout {
    width: f64,
    /// Room of a panel across.
    pitch: f64,
    subject: Vec<String>,
    /// Lines of the legend that all panels share.
    legend: Vec<Vec<(Key, String)>>,
    /// Whether each panel has a legend of its own, as their curves are of different kinds.
    apart: bool,
    /// Where the lines of the legend begin, and the panels.
    tops: [f64; 2],
    bottom: f64,
}

impl Curves<'_> {
    /// Lines with a dot for each point. One legend above all panels where they show the same curves, else one below each.
    pub fn picture(&self) -> Picture {
        let layout = self.layout();
        let first = layout.subject.first().map_or("", String::as_str);
        let mut picture = Picture::new(layout.width, layout.bottom, self.title, first);
        for (line, row) in layout.subject.iter().enumerate().skip(1) {
            picture.text(Text { colour: MUTED, ..text(row, (24.0, 50.0 + LINE * line as f64)) });
        }
        if self.panels.is_empty() {
            return picture.nothing("no curves to show");
        }
        for (line, row) in layout.legend.iter().enumerate() {
            legend_line(&mut picture, (24.0, layout.tops[0] + LEGEND_LINE * line as f64), row);
        }
        for (place, panel) in self.panels.iter().enumerate() {
            panel.draw(&mut picture, 90.0 + layout.pitch * place as f64, &layout);
        }
        picture
    }

    fn layout(&self) -> Layout {
        let pitch = self.pitch();
        let width = 40.0 + (pitch * self.panels.len() as f64).max(ALONE_WIDTH);
        let width = width.max(text_width(self.title, 19.0, true) + 48.0);
        let subject = wrapped(self.subject, 13.0, false, width - 48.0);
        let shared = self.shared_curves();
        let entries = shared.iter().flat_map(|curves| curves.iter().enumerate());
        let entries: Vec<_> = entries.map(|(index, curve)| (key(index), curve.name.clone())).collect();
        let legend = legend_lines(&entries, width - 48.0);
        let most = |of: &dyn Fn(&CurvePanel) -> usize| self.panels.iter().map(of).max().unwrap_or(0) as f64;
        let above = 78.0 + LINE * (subject.len().max(1) - 1) as f64;
        let headings = LINE * most(&|panel| panel.heading(pitch).len());
        let top = above + LEGEND_LINE * legend.len() as f64 + headings + 10.0;
        let below = if shared.is_none() { LEGEND_LINE * most(&|panel| panel.curves.len()) } else { 0.0 };
        let bottom = top + HEIGHT + 70.0 + below;
        Layout { width, pitch, subject, legend, apart: shared.is_none(), tops: [above, top], bottom }
    }

    /// Room of a panel across: more than is usual where the name of an axis, or of a curve in a legend of its own, needs it.
    fn pitch(&self) -> f64 {
        let usual = if self.panels.len() == 1 { ALONE_WIDTH } else { PANEL_WIDTH };
        let apart = self.shared_curves().is_none();
        let wide = |panel: &CurvePanel| {
            let names = panel.curves.iter().filter(|_| apart);
            let name = names.map(|curve| text_width(&curve.name, LEGEND_PX, false)).fold(0.0, f64::max);
            (name + NAME_ASIDE).max(text_width(&panel.across, 13.0, false) + ASIDE)
        };
        self.panels.iter().map(wide).fold(usual, f64::max).min(ALONE_WIDTH)
    }

    /// The curves of the panel with the most, where those of all others are called like the first of them.
    fn shared_curves(&self) -> Option<&[Curve]> {
        let longest = &self.panels.iter().max_by_key(|panel| panel.curves.len())?.curves;
        let alike = |panel: &CurvePanel| panel.curves.iter().zip(longest).all(|(a, b)| a.name == b.name);
        self.panels.iter().all(alike).then_some(longest)
    }
}

fn key(index: usize) -> Key {
    Key::Line(part_colour(index, false))
}

impl CurvePanel {
    fn heading(&self, pitch: f64) -> Vec<String> {
        wrapped(&self.title, 13.0, true, pitch - 40.0)
    }

    fn draw(&self, picture: &mut Picture, left: f64, layout: &Layout) {
        let (right, top) = (left + layout.pitch - ASIDE, layout.tops[1]);
        let bottom = top + HEIGHT;
        let heading = self.heading(layout.pitch);
        for (line, row) in heading.iter().rev().enumerate() {
            picture.text(Text { bold: true, ..text(row, (left, top - 16.0 - LINE * line as f64)) });
        }
        let values = |of: fn(&(f64, f64)) -> f64| -> Vec<f64> {
            self.curves.iter().flat_map(|curve| curve.points.iter().map(of)).collect()
        };
        let x = self.scales[0].axis(&self.across, &values(|point| point.0), (Way::Across, right - left));
        let y = self.scales[1].axis(&self.up, &values(|point| point.1), (Way::Up, HEIGHT));
        let Some((x, y)) = x.zip(y) else {
            let at = (left + 20.0, (top + bottom) / 2.0);
            return picture.text(Text { colour: MUTED, ..text("nothing to show", at) });
        };
        let mut panel = Panel { left, top, right, bottom, x, y };
        if self.failing.is_some() {
            // Room for its name above the curves.
            panel.y.high += 0.07 * (panel.y.high - panel.y.low);
        }
        let marked = self.mark(picture, &panel);
        panel.grid(picture);
        for (value, _) in &panel.x.ticks {
            let x = panel.x_px(*value);
            picture.line((x, panel.top), (x, panel.bottom), GRID, 1.0);
        }
        marked.into_iter().for_each(|name| picture.text(name));
        for (index, curve) in self.curves.iter().enumerate() {
            self.curve(picture, &panel, (index, curve));
        }
        panel.axes(picture, 0.0);
        self.notes(picture, &panel);
        if layout.apart {
            let each = self.curves.iter().enumerate();
            let entries: Vec<_> =
                each.map(|(i, curve)| (key(i), curve.name.clone(), String::new())).collect();
            legend_column(picture, (left, bottom + 70.0), right + 40.0, &entries);
        }
    }

    /// The first curves are thicker, so that one below another is seen beside it.
    fn curve(&self, picture: &mut Picture, panel: &Panel, (index, curve): (usize, &Curve)) {
        let (colour, above) = (part_colour(index, false), (self.curves.len() - 1 - index).min(3) as f64);
        let at = |&(x, y): &(f64, f64)| {
            let [across, up] = self.scales;
            Some(panel.at(across.place(x, &panel.x)?, up.place(y, &panel.y)?))
        };
        let points: Vec<_> = curve.points.iter().filter_map(at).collect();
        points.iter().for_each(|&point| picture.dot(point, 2.5 + 0.7 * above, colour));
        if points.len() > 1 {
            picture.polyline(points, colour.alpha(0.8), 1.5 + 0.9 * above);
        }
    }

    /// Marks the range in which what is shown does not work; what it is called is to be drawn over the grid.
    fn mark(&self, picture: &mut Picture, panel: &Panel) -> Option<Text> {
        let (range, name) = self.failing.as_ref()?;
        let end = |value: f64, beyond: f64| {
            let place = if value.is_finite() { self.scales[0].place(value, &panel.x) } else { None };
            place.map_or(beyond, |place| panel.x_px(place))
        };
        let (from, to) = (end(range.start, panel.left), end(range.end, panel.right));
        if to <= from {
            return None;
        }
        picture.rect((from, panel.top), (to, panel.bottom), MARK.alpha(0.22));
        let y = panel.top + 10.0;
        let fits = from + 6.0 + text_width(name, MARK_PX, false) <= panel.right;
        let (x, across) = if fits { (from + 6.0, Across::Left) } else { (to - 6.0, Across::Right) };
        Some(Text { size: MARK_PX, colour: MUTED, across, ..text(name, (x, y)) })
    }

    /// The notes of the curves in the upper corner that they leave free: right where they fall, left where they rise.
    fn notes(&self, picture: &mut Picture, panel: &Panel) {
        let noted = self.curves.iter().enumerate().filter(|(_, curve)| !curve.note.is_empty());
        let entries: Vec<_> =
            noted.map(|(index, curve)| (key(index), curve.name.clone(), curve.note.clone())).collect();
        let right = if self.rises() { panel.left + 176.0 } else { panel.right };
        legend_column(picture, (right - 160.0, panel.top + 14.0), right - 6.0, &entries);
    }

    /// Whether the curves end higher than they begin, all in all.
    fn rises(&self) -> bool {
        let rise = |curve: &Curve| {
            let mut heights =
                curve.points.iter().filter(|point| point.1 > 0.0).map(|point| libm::log10(point.1));
            heights.next().zip(heights.next_back()).map_or(0.0, |(first, last)| last - first)
        };
        self.curves.iter().map(rise).sum::<f64>() > 0.0
    }
}
