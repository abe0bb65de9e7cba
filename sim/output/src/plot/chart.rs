//! Series over axes, in one panel or several.

use std::ops::Range;

use super::axis::{Axis, AxisSpec, Extent, Scale, Way};
use super::legend::{Key, LEGEND_LINE, LEGEND_PX, legend_column, legend_lines, plate};
use super::palette::{INK, MARK, MUTED};
use super::panel::{self, BELOW, Label, Panel, aside};
use super::picture::Look;
use super::picture::{Across, Picture, Text, text};
use super::series::{Mark, Series};
use super::text::text_width;
use super::text::{shortened, wrapped};

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

/// Panels with a title. Panels whose vertical axes have the same quantity share its range.
#[derive(Clone, Debug)]
pub struct Chart<'a> {
    /// Title.
    pub title: &'a str,
    /// Subject, for the lines below the title.
    pub subject: &'a str,
    /// The panels, row by row.
    pub panels: Vec<ChartPanel>,
    /// Number of small panels in a row. They share the horizontal range, and only the outer ones have labels.
    pub small: Option<usize>,
}

/// Picture widths for one panel, two panels, and more.
const WIDTHS: [f64; 3] = [820.0, 900.0, 1240.0];
/// Smallest widths of a panel and of a small panel, with labels.
const LEAST: [f64; 2] = [290.0, 120.0];
/// Room for the key of a series in a legend below a panel.
const NAME_ASIDE: f64 = 44.0;
/// Largest number of panels in a row, unless they are small.
const MOST_ACROSS: usize = 3;
/// Line height of a panel's title.
const LINE: f64 = 18.0;
/// Free space right of a panel.
const RIGHT: f64 = 18.0;
/// Distance of small panels.
const SMALL_GAP: f64 = 16.0;
/// Largest height of a panel with equal axes.
const MOST_HIGH: f64 = 640.0;
/// Font size of the label of a marked range.
const MARK_PX: f64 = 11.5;

/// Position of a panel, and what it shares with others.
struct Cell<'a> {
    panel: &'a ChartPanel,
    left: f64,
    width: f64,
    /// Height of the panel itself.
    height: f64,
    extents: Option<[Extent; 2]>,
    /// Whether its horizontal and its vertical axis are labelled.
    labelled: [bool; 2],
    /// Whether it is a small panel.
    small: bool,
    /// Whether it has its own legend.
    legend: bool,
}

impl<'a> Chart<'a> {
    /// Panels with a title and a line below it.
    pub fn new(title: &'a str, subject: &'a str, panels: Vec<ChartPanel>) -> Self {
        Self { title, subject, panels, small: None }
    }

    /// Makes the panels small, with this many in a row.
    #[must_use]
    pub fn small(self, across: usize) -> Self {
        Self { small: Some(across), ..self }
    }

    /// Draws one legend above all panels if they show the same series, otherwise one below each.
    pub fn picture(&self, look: &Look) -> Picture {
        let usual = WIDTHS[self.panels.len().clamp(1, 3) - 1];
        let mut picture = Picture::titled(look, (usual, 300.0), [self.title, self.subject]);
        if self.panels.is_empty() {
            return picture.nothing("nothing to show");
        }
        let legend = self.shared_legend();
        if let Some(entries) = &legend {
            let top = picture.height + 10.0;
            picture.height += legend_lines(&mut picture, top, entries) + 2.0;
        }
        let across = self.across(&picture, legend.is_none());
        let extents = self.extents();
        let aside = self.small_aside(&extents);
        let top = picture.height;
        for row in 0..self.panels.len().div_ceil(across) {
            let places = row * across..((row + 1) * across).min(self.panels.len());
            let cells = places.map(|place| {
                let width = (picture.width() - 2.0 * picture.margin() - aside) / across as f64;
                let last = place + across >= self.panels.len();
                Cell {
                    panel: &self.panels[place],
                    left: picture.margin() + aside + width * (place % across) as f64,
                    width,
                    height: self.panel_height(width),
                    extents: extents[place],
                    labelled: self.small.map_or([true; 2], |_| [last, place % across == 0]),
                    small: self.small.is_some(),
                    legend: legend.is_none() && self.small.is_none(),
                }
            });
            let cells: Vec<Cell<'_>> = cells.collect();
            draw_row(&mut picture, &cells);
        }
        if self.small.is_some() {
            self.small_names(&mut picture, top);
        }
        picture
    }

    /// Room left of small panels for the labels of the first ones.
    fn small_aside(&self, extents: &[Option<[Extent; 2]>]) -> f64 {
        let first = self.panels.iter().zip(extents).find_map(|(panel, extent)| Some((panel, (*extent)?[1])));
        let Some((panel, up)) = first.filter(|_| self.small.is_some()) else { return 0.0 };
        aside(&panel.axes[1].axis(up, (Way::Up, 100.0)))
    }

    /// Draws the axis names of small panels, once for all.
    fn small_names(&self, picture: &mut Picture, top: f64) {
        let [across, up] = &self.panels[0].axes;
        picture.height += 20.0;
        let at = (0.5 * picture.width(), picture.height - 12.0);
        let name = shortened(&across.name, 13.0, picture.width() - 20.0);
        picture.text(Text { across: Across::Centre, ..text(&name, at) });
        let at = (picture.margin() + 6.0, 0.5 * (top + picture.height - 30.0));
        let name = shortened(&up.name, 13.0, picture.height - 40.0 - top);
        picture.text(Text { across: Across::Centre, upwards: true, ..text(&name, at) });
    }

    /// Number of panels in a row: as many as fit, with the legends below them.
    fn across(&self, picture: &Picture, legends: bool) -> usize {
        let room = picture.width() - 2.0 * picture.margin();
        let names = self.panels.iter().flat_map(|panel| &panel.series).filter(|_| legends);
        let widest =
            names.map(|series| text_width(&series.name, LEGEND_PX, false) + NAME_ASIDE).fold(0.0, f64::max);
        let fitting = match self.small {
            Some(_) => (room / LEAST[1]) as usize,
            None => (room / LEAST[0].max(widest)) as usize,
        };
        let most = self.small.unwrap_or(MOST_ACROSS).min(fitting.max(1)).min(self.panels.len());
        // As even rows as there are: four panels in two rows of two.
        let rows = self.panels.len().div_ceil(most);
        if self.small.is_some() { most } else { self.panels.len().div_ceil(rows) }
    }

    fn panel_height(&self, width: f64) -> f64 {
        match self.small {
            Some(_) => (0.66 * width).clamp(70.0, 130.0),
            None => (0.5 * width + 100.0).clamp(180.0, 380.0),
        }
    }

    /// Ranges of all panels. Axes of the same quantity share a range.
    fn extents(&self) -> Vec<Option<[Extent; 2]>> {
        let values: Vec<[Vec<f64>; 2]> = self.panels.iter().map(ChartPanel::values).collect();
        let extent = |place: usize, axis: usize| {
            let own = &self.panels[place];
            let shares = |other: usize| {
                let same = self.panels[other].axes[axis] == own.axes[axis];
                other == place || (same && !own.equal && (axis == 1 || self.small.is_some()))
            };
            let shared = (0..self.panels.len()).filter(|&other| shares(other));
            let markers = own.series.iter().any(|series| series.mark.has_markers());
            let pad = if axis == 1 {
                0.06
            } else if markers {
                0.035
            } else {
                0.0
            };
            own.axes[axis].extent(shared.flat_map(|other| values[other][axis].iter().copied()), pad, markers)
        };
        let both = |place: usize| {
            let (across, mut up) = (extent(place, 0)?, extent(place, 1)?);
            if self.panels[place].failing.is_some() {
                // Room for its name above the curves.
                up.high += 0.08 * (up.high - up.low);
            }
            Some([across, up])
        };
        let own = |place: usize| values[place].iter().all(|values| !values.is_empty());
        (0..self.panels.len()).map(|place| both(place).filter(|_| own(place))).collect()
    }

    /// Series of a shared legend: those of the panel with the most, if the series of all other panels have the same names in the
    /// same order. Small panels have no legend; their titles name the series.
    fn shared_legend(&self) -> Option<Vec<(Key, String)>> {
        let longest = self.panels.iter().max_by_key(|panel| panel.series.len())?;
        let is_same = |panel: &ChartPanel| {
            panel.series.iter().zip(&longest.series).all(|(a, b)| a.name == b.name && a.paint == b.paint)
        };
        if self.small.is_some() || !self.panels.iter().all(is_same) {
            return None;
        }
        Some(longest.named().map(|(key, series)| (key, series.name.clone())).collect())
    }
}

/// Draws panels side by side at the bottom of the picture, and increases its height.
fn draw_row(picture: &mut Picture, cells: &[Cell<'_>]) {
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
        let curves = self.panel.series.len();
        for (index, series) in self.panel.series.iter().enumerate() {
            let beneath = if self.small { 0 } else { curves - 1 - index };
            series.mark.draw(&area, series.style(index), beneath, picture);
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
    fn area(&self, top: f64) -> Option<Panel> {
        let [across, up] = self.extents?;
        let y = self.panel.axes[1].axis(up, (Way::Up, self.height));
        let left = self.left + if self.small { 0.0 } else { aside(&y) };
        let right = self.left + self.width - if self.small { SMALL_GAP } else { RIGHT };
        if !self.panel.equal {
            let x = self.panel.axes[0].axis(across, (Way::Across, right - left));
            return Some(Panel { left, top, right, bottom: top + self.height, x, y });
        }
        let (wide, high) = (across.high - across.low, up.high - up.low);
        let px = ((right - left) / wide).min(MOST_HIGH / high);
        let [x, y]: [Axis; 2] = [(0, across, Way::Across, px * wide), (1, up, Way::Up, px * high)]
            .map(|(axis, extent, way, length)| self.panel.axes[axis].axis(extent, (way, length)));
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
        legend_column(picture, from, (self.left + self.width, height), &entries);
        height + 4.0
    }
}

impl ChartPanel {
    /// All values of both axes.
    fn values(&self) -> [Vec<f64>; 2] {
        let mut all = [Vec::new(), Vec::new()];
        for series in &self.series {
            for (all, values) in all.iter_mut().zip(series.mark.values()) {
                all.extend(values);
            }
        }
        all
    }

    /// Named series with their keys.
    fn named(&self) -> impl Iterator<Item = (Key, &Series)> {
        let all = self.series.iter().enumerate();
        all.filter(|(_, series)| !series.name.is_empty())
            .map(|(index, series)| (series.mark.key(series.style(index)), series))
    }

    /// Marks the range in which the method fails. Returns its label, which is drawn over the grid.
    fn mark(&self, picture: &mut Picture, area: &Panel) -> Option<Text> {
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
    fn write_names(&self, picture: &mut Picture, area: &Panel) {
        let mut labels = Vec::new();
        for series in self.series.iter().rev() {
            let bold = matches!(series.mark, Mark::Spreads(_));
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
    fn write_notes(&self, picture: &mut Picture, area: &Panel) {
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
        legend_column(picture, (left, top + 0.5 * LEGEND_LINE), (left + width, height), &entries);
    }
}

#[cfg(test)]
mod tests {
    use super::super::picture::Shape;
    use super::super::series::Paint;
    use super::*;

    fn texts(picture: &Picture) -> Vec<&str> {
        let texts = picture.shapes.iter().filter_map(|shape| match shape {
            Shape::Text(text) => Some(text.text.as_str()),
            _ => None,
        });
        texts.collect()
    }

    fn dots(points: &[(f64, f64)]) -> Series {
        Series::new("dots", Mark::Dots(points.iter().map(|&(x, y)| (x, y, String::new())).collect()))
    }

    fn even(series: Vec<Series>) -> ChartPanel {
        ChartPanel::over("", [AxisSpec::even("x", ""), AxisSpec::even("y", "")], series)
    }

    fn centres(picture: &Picture) -> Vec<(f64, f64)> {
        let centre = |shape: &Shape| match shape {
            Shape::Dot { centre, .. } => Some(*centre),
            _ => None,
        };
        picture.shapes.iter().filter_map(centre).collect()
    }

    /// In a figure about distances both axes need the same scale.
    #[test]
    fn distances_are_the_same_both_ways_on_equal_axes() {
        let points = [(0.0, 0.0), (0.8, 0.0), (0.0, 0.4), (0.8, 0.4)];
        for width_mm in [None, Some(85.0)] {
            let look = Look { width_mm, ..Look::default() };
            let picture = Chart::new("t", "s", vec![even(vec![dots(&points)]).equal()]).picture(&look);
            // The last four are the points; one more is in the legend.
            let [a, b, c, _] = centres(&picture)[1..] else { panic!("four points") };
            assert!(((b.0 - a.0) - 2.0 * (a.1 - c.1)).abs() < 1e-9, "{a:?} {b:?} {c:?}");
        }
    }

    /// Panels of the same quantity share a range.
    #[test]
    fn panels_of_the_same_quantity_share_their_range() {
        let panel = |high: f64| even(vec![dots(&[(0.0, 0.0), (1.0, high)])]);
        let picture = Chart::new("t", "s", vec![panel(10.0), panel(1.0)]).picture(&Look::default());
        let [_, _, ten, _, one] = centres(&picture)[..] else { panic!("four points and one in the legend") };
        assert!(one.1 > ten.1 + 100.0, "1 is lower than 10");
        let other = ChartPanel { axes: [AxisSpec::even("x", ""), AxisSpec::even("z", "")], ..panel(1.0) };
        let picture = Chart::new("t", "s", vec![panel(10.0), other]).picture(&Look::default());
        let [_, _, ten, _, one] = centres(&picture)[..] else { panic!("four points and one in the legend") };
        assert!((one.1 - ten.1).abs() < 1.0, "another quantity has its own range");
    }

    #[test]
    fn points_keep_off_the_frame() {
        let picture =
            Chart::new("t", "s", vec![even(vec![dots(&[(0.0, 0.0), (7.0, 3.0)])])]).picture(&Look::default());
        let line = picture.shapes.iter().rev().find_map(|shape| match shape {
            Shape::Polyline { points, .. } if points[1].0 - points[0].0 > 300.0 => Some(points.clone()),
            _ => None,
        });
        let (left, right) = {
            let line = line.unwrap();
            (line[0], line[1])
        };
        assert!(
            centres(&picture)[1..]
                .iter()
                .all(|at| at.0 > left.0 + 4.0 && at.0 < right.0 - 4.0 && at.1 < left.1 - 4.0)
        );
    }

    #[test]
    fn small_panels_are_labelled_at_the_edges_alone() {
        let panel = |name: &str| ChartPanel {
            title: name.to_owned(),
            ..even(vec![
                Series::new("", Mark::Faint(vec![vec![(0.0, 0.0), (1.0, 1.0)]])).painted(Paint::Grey),
                Series::curve(name, [(0.0, 0.0), (1.0, 1.0)]),
            ])
        };
        let panels: Vec<_> = ["a", "b", "c", "d", "e", "f"].map(panel).into();
        let picture = Chart::new("title", "s", panels).small(3).picture(&Look::default());
        let texts = texts(&picture);
        let count = |word: &str| texts.iter().filter(|text| **text == word).count();
        assert_eq!([count("y"), count("x"), count("a"), count("f")], [1, 1, 1, 1]);
    }

    #[test]
    fn a_row_for_zero_is_called_as_requested() {
        let axes = [AxisSpec::default(), AxisSpec { zero: "exact".to_owned(), ..AxisSpec::default() }];
        let panel = ChartPanel::over("", axes, vec![dots(&[(1.0, 0.0), (2.0, 5.0), (3.0, 200.0)])]);
        let picture = Chart::new("t", "s", vec![panel]).picture(&Look::default());
        assert!(texts(&picture).contains(&"exact"));
        let [_, exact, five, _] = centres(&picture)[..] else { panic!("three points and one in the legend") };
        assert!(exact.1 > five.1 + 20.0, "zero is not left out");
    }
}
