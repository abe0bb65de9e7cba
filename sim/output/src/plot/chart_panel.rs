//! A panel of a chart: axes, series and the marked range.

use std::ops::Range;

use super::axis::{AxisSpec, Scale};
use super::legend::{Key, LEGEND_LINE, LEGEND_PX, legend_column, plate};
use super::palette::{INK, MARK, MUTED};
use super::panel::{self, Label, Panel};
use super::picture::{Across, Picture, Text, text};
use super::series::{Mark, Series};
use super::text::{shortened, text_width};

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
        legend_column(picture, (left, top + 0.5 * LEGEND_LINE), (left + width, height), &entries);
    }
}
