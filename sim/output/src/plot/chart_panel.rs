//! A panel of a chart in its place: heading, axes, series and legend.

use std::ops::Range;

use super::axis::{Along, Axis, AxisSpec, Extent, Scale};
use super::panel::{self, BELOW, Key, LEGEND_LINE, LEGEND_PX, Label, Panel, aside, legend_column, plate};
use super::picture::{Across, Picture, Text, shortened, text, text_width, wrapped};
use super::series::{PlotMark, Series};
use super::{INK, MARK, MUTED};

/// Font size of the label of a marked range.
const MARK_PX: f64 = 11.5;

/// Series over two axes.
#[derive(Clone, Debug)]
pub struct ChartPanel {
    /// Title.
    pub title: String,
    /// Horizontal and vertical axis.
    pub axes: [AxisSpec; 2],
    /// Series; the first is at the bottom.
    pub series: Vec<Series>,
    /// Range of the horizontal axis in which the method fails, and its label.
    pub failing: Option<(Range<f64>, String)>,
    /// Whether both axes have the same scale in pixels.
    pub equal: bool,
}

impl ChartPanel {
    /// Series on logarithmic axes with these names, `[horizontal, vertical]`.
    pub fn new(title: &str, names: [&str; 2], series: Vec<Series>) -> Self {
        let axes = names.map(|name| AxisSpec { name: name.to_owned(), ..AxisSpec::default() });
        Self::over(title, axes, series)
    }

    /// Series on these axes.
    pub fn over(title: &str, axes: [AxisSpec; 2], series: Vec<Series>) -> Self {
        Self { title: title.to_owned(), axes, series, failing: None, equal: false }
    }

    /// Sets the scales of both axes.
    #[must_use]
    pub fn on(mut self, across: Scale, up: Scale) -> Self {
        (self.axes[0].scale, self.axes[1].scale) = (across, up);
        self
    }

    /// Sets the units of both axes, without prefixes.
    #[must_use]
    pub fn in_units(mut self, units: [&str; 2]) -> Self {
        [self.axes[0].unit, self.axes[1].unit] = units.map(str::to_owned);
        self
    }

    /// Sets the labels of zero on both axes; `0` where one is empty.
    #[must_use]
    pub fn zeros(mut self, labels: [&str; 2]) -> Self {
        [self.axes[0].zero, self.axes[1].zero] = labels.map(str::to_owned);
        self
    }

    /// Makes the horizontal axis a list of these values of `name`, at positions 0, 1, ...
    #[must_use]
    pub fn along(mut self, name: &str, values: &[String]) -> Self {
        self.axes[0] =
            AxisSpec { name: name.to_owned(), scale: Scale::Listed(values.to_vec()), ..AxisSpec::default() };
        self
    }

    /// Marks the range in which the method fails.
    #[must_use]
    pub fn failing(self, range: Option<Range<f64>>, name: &str) -> Self {
        Self { failing: range.map(|range| (range, name.to_owned())), ..self }
    }

    /// Gives both axes the same scale in pixels, for points in a plane.
    #[must_use]
    pub fn equal(self) -> Self {
        Self { equal: true, ..self }
    }
}

impl ChartPanel {
    /// All values of both axes.
    pub(super) fn values(&self) -> [Vec<f64>; 2] {
        let mut all = [Vec::new(), Vec::new()];
        for series in &self.series {
            for (all, values) in all.iter_mut().zip(series.mark.values()) {
                all.extend(values);
            }
        }
        all
    }

    /// Largest distance of the outline of a marker from its point. Markers of small panels do not grow.
    pub(super) fn marker_reach(&self, small: bool) -> f64 {
        let count = self.series.len();
        let above = |index: usize| if small { 0 } else { count - 1 - index };
        let reaches = self.series.iter().enumerate().map(|(index, series)| series.mark.reach(above(index)));
        reaches.fold(0.0, f64::max)
    }

    /// Named series with their keys.
    pub(super) fn named(&self) -> impl Iterator<Item = (Key, &Series)> {
        let all = self.series.iter().enumerate();
        all.filter(|(_, series)| !series.name.is_empty())
            .map(|(index, series)| (series.mark.key(series.style(index)), series))
    }

    /// Marks the range in which the method fails. Returns its label, which is drawn over the grid.
    pub(super) fn mark(&self, picture: &mut Picture, area: &Panel) -> Option<Text> {
        let (range, name) = self.failing.as_ref()?;
        let end = |value: f64, beyond: f64| {
            let place = if value.is_finite() { area.x.place(value) } else { None };
            place.map_or(beyond, |_| area.x_px(value))
        };
        let (from, to) = (end(range.start, area.left), end(range.end, area.right));
        if to <= from {
            return None;
        }
        picture.rect((from, area.top), (to, area.bottom), MARK.alpha(0.22));
        let name = shortened(name, MARK_PX, area.right - area.left - 12.0);
        let fits = from + 6.0 + text_width(&name, MARK_PX, false) <= area.right;
        let (x, across) = if fits {
            (from + 6.0, Across::Left)
        } else {
            (to.max(area.left + 0.5 * (area.right - area.left)) - 6.0, Across::Right)
        };
        Some(Text { size: MARK_PX, colour: MUTED, across, ..text(&name, (x, area.top + 10.0)) })
    }

    /// Labels of points; those of the last series first.
    pub(super) fn write_names(&self, picture: &mut Picture, area: &Panel) {
        let mut labels = Vec::new();
        for series in self.series.iter().rev() {
            let bold = matches!(series.mark, PlotMark::Spreads(_));
            let colour = if bold || labels.is_empty() { INK } else { MUTED };
            let names = series.mark.names(area).into_iter();
            labels.extend(names.map(|(at, radius, name)| Label { name, at, radius, colour, bold }));
        }
        let obstacles: Vec<_> = self.series.iter().flat_map(|series| series.mark.obstacles(area)).collect();
        let left_out = panel::write(picture, area, &labels, &obstacles);
        if left_out > 0 {
            let at = (area.right, area.bottom + 38.0);
            let words = format!("{left_out} {} without room", if left_out == 1 { "name" } else { "names" });
            picture.text(Text { size: MARK_PX, colour: MUTED, across: Across::Right, ..text(&words, at) });
        }
    }

    /// Draws the notes of the series, in the corner where they cover least.
    pub(super) fn write_notes(&self, picture: &mut Picture, area: &Panel) {
        let noted = self.named().filter(|(_, series)| !series.note.is_empty());
        let entries: Vec<_> =
            noted.map(|(key, series)| (key, series.name.clone(), series.note.clone())).collect();
        let wide = |entry: &(Key, String, String)| {
            44.0 + text_width(&entry.1, LEGEND_PX, false) + text_width(&entry.2, LEGEND_PX, false)
        };
        let width = entries.iter().map(wide).fold(0.0, f64::max);
        if entries.is_empty() || width > area.right - area.left - 12.0 {
            return;
        }
        let height = LEGEND_LINE * entries.len() as f64;
        let lefts = [area.left + 6.0, area.right - 6.0 - width];
        let tops = [area.top + 6.0, area.bottom - 6.0 - height];
        let obstacles: Vec<_> = self.series.iter().flat_map(|series| series.mark.obstacles(area)).collect();
        let hidden = |(left, top): (f64, f64)| {
            let is_in =
                |(x, y): &(f64, f64)| (left..left + width).contains(x) && (top..top + height).contains(y);
            obstacles.iter().filter(|point| is_in(point)).count()
        };
        let corners = tops.into_iter().flat_map(|top| lefts.into_iter().map(move |left| (left, top)));
        let Some((left, top)) = corners.min_by_key(|&corner| hidden(corner)) else { return };
        plate(picture, (left - 4.0, top), (left + width + 4.0, top + height));
        legend_column(picture, (left, top + 0.5 * LEGEND_LINE), left + width, height, &entries);
    }
}

/// Line height of a panel's title.
const LINE: f64 = 18.0;
/// Free space right of a panel.
pub(super) const RIGHT: f64 = 18.0;
/// Distance of small panels.
pub(super) const SMALL_GAP: f64 = 16.0;
/// Largest height of a panel with equal axes.
const MAX_HIGH: f64 = 640.0;

/// Position of a panel, and what it shares with others.
pub(super) struct Cell<'a> {
    pub panel: &'a ChartPanel,
    pub left: f64,
    pub width: f64,
    /// Height of the panel itself.
    pub height: f64,
    pub extents: Option<[Extent; 2]>,
    /// Whether its horizontal and its vertical axis are labelled.
    pub labelled: [bool; 2],
    /// Whether it is a small panel.
    pub small: bool,
    /// Whether it has its own legend.
    pub legend: bool,
}

/// Draws panels side by side at the bottom of the picture, and increases its height.
pub(super) fn draw_row(picture: &mut Picture, cells: &[Cell<'_>]) {
    let titles = cells.iter().map(|cell| cell.heading().len()).max().unwrap_or(0);
    let top = picture.height + 8.0 + LINE * titles as f64;
    let mut bottom = picture.height;
    for cell in cells {
        bottom = cell.draw(picture, top).max(bottom);
    }
    picture.height = bottom;
}

impl Cell<'_> {
    fn heading(&self) -> Vec<String> {
        let room = self.area(0.0).map_or(self.width - 24.0, |area| self.left + self.width - area.left);
        if self.small {
            return vec![shortened(&self.panel.title, 1.1 * self.heading_px(), room)];
        }
        wrapped(&self.panel.title, self.heading_px(), true, room)
    }

    fn heading_px(&self) -> f64 {
        if self.small { 11.0 } else { 13.0 }
    }

    /// Draws the panel whose area begins at `top`. Returns the bottom of its labels and legend.
    fn draw(&self, picture: &mut Picture, top: f64) -> f64 {
        let Some(area) = self.area(top) else {
            let at = (self.left + 20.0, top + 0.5 * self.height);
            picture.text(Text { colour: MUTED, ..text("nothing to show", at) });
            self.write_heading(picture, self.left + 20.0, top);
            return top + self.height + BELOW;
        };
        self.write_heading(picture, area.left, top);
        let marked = self.panel.mark(picture, &area);
        area.grid(picture);
        if area.x.is_logarithmic() || matches!(self.panel.axes[0].scale, Scale::Listed(_)) {
            area.grid_up(picture);
        }
        marked.into_iter().for_each(|name| picture.text(name));
        for (index, series) in self.panel.series.iter().enumerate() {
            let above = if self.small { &[] } else { &self.panel.series[index + 1..] };
            series.mark.draw(&area, series.style(index), above, picture);
        }
        self.axes(picture, &area);
        self.panel.write_names(picture, &area);
        self.panel.write_notes(picture, &area);
        let below = match (self.small, self.labelled[0]) {
            (true, true) => 30.0,
            (true, false) => 8.0,
            _ => BELOW,
        };
        area.bottom + below + self.own_legend(picture, &area)
    }

    fn write_heading(&self, picture: &mut Picture, left: f64, top: f64) {
        for (line, row) in self.heading().iter().rev().enumerate() {
            let size = self.heading_px();
            picture.text(Text { bold: true, size, ..text(row, (left, top - 12.0 - LINE * line as f64)) });
        }
    }

    /// Area of the panel with its axes; `None` without data.
    pub fn area(&self, top: f64) -> Option<Panel> {
        let [across, up] = self.extents?;
        let y = self.panel.axes[1].axis(up, Along::up(self.height));
        let left = self.left + if self.small { 0.0 } else { aside(&y) };
        let right = self.left + self.width - if self.small { SMALL_GAP } else { RIGHT };
        if !self.panel.equal {
            let x = self.panel.axes[0].axis(across, Along::across(right - left));
            return Some(Panel { left, top, right, bottom: top + self.height, x, y });
        }
        let (wide, high) = (across.high - across.low, up.high - up.low);
        let px = ((right - left) / wide).min(MAX_HIGH / high);
        let [x, y]: [Axis; 2] = [(0, across, Along::across(px * wide)), (1, up, Along::up(px * high))]
            .map(|(axis, extent, along)| self.panel.axes[axis].axis(extent, along));
        Some(Panel { left, top, right: left + px * wide, bottom: top + px * high, x, y })
    }

    fn axes(&self, picture: &mut Picture, area: &Panel) {
        let mut area = area.clone();
        if self.small {
            // Once for all of them.
            area.x.label.clear();
            area.y.label.clear();
        }
        for (axis, labelled) in [&mut area.x, &mut area.y].into_iter().zip(self.labelled) {
            if !labelled {
                axis.ticks.iter_mut().for_each(|tick| tick.label.clear());
            }
        }
        area.axis_across(picture, 0.0);
        area.axis_up(picture);
    }

    /// Draws a legend below the panel. Returns its height.
    fn own_legend(&self, picture: &mut Picture, area: &Panel) -> f64 {
        if !self.legend {
            return 0.0;
        }
        let entries: Vec<_> =
            self.panel.named().map(|(key, series)| (key, series.name.clone(), String::new())).collect();
        let height = LEGEND_LINE * entries.len() as f64;
        let from = (area.left.min(self.left + 8.0), area.bottom + BELOW + 8.0);
        legend_column(picture, from, self.left + self.width, height, &entries);
        height + 4.0
    }
}
