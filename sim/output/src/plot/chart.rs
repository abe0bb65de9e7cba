//! Series over axes, in one panel or several.

use super::axis::{Along, Extent, MarkerRoom};
use super::chart_panel::{Cell, ChartPanel, RIGHT, SMALL_GAP, draw_row};
use super::panel::{Key, LEGEND_PX, aside, legend_lines};
use super::picture::{Across, Picture, PlotStyle, Text, shortened, text, text_width};

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
const MIN_PANEL_PX: [f64; 2] = [290.0, 120.0];
/// Room for the key of a series in a legend below a panel.
const NAME_ASIDE: f64 = 44.0;
/// Largest number of panels in a row, unless they are small.
const MAX_ACROSS: usize = 3;

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
    pub fn picture(&self, plot_style: &PlotStyle) -> Picture {
        let usual = WIDTHS[self.panels.len().clamp(1, 3) - 1];
        let mut picture = Picture::titled(plot_style, (usual, 300.0), [self.title, self.subject]);
        if self.panels.is_empty() {
            return picture.nothing("nothing to show");
        }
        let legend = self.shared_legend();
        if let Some(entries) = &legend {
            let top = picture.height + 10.0;
            picture.height += legend_lines(&mut picture, top, entries) + 2.0;
        }
        let across = self.across(&picture, legend.is_none());
        let top = picture.height;
        for row in self.cells(&picture, across, legend.is_none()).chunks(across) {
            draw_row(&mut picture, row);
        }
        if self.small.is_some() {
            self.small_names(&mut picture, top);
        }
        picture
    }

    /// The panels with their positions; `across` are in a row.
    fn cells(&self, picture: &Picture, across: usize, legends: bool) -> Vec<Cell<'_>> {
        let room = picture.width() - 2.0 * picture.margin();
        let mut extents = self.extents(room / across as f64);
        let aside = self.small_aside(&extents);
        let width = (room - aside) / across as f64;
        if aside > 0.0 {
            extents = self.extents(width);
        }
        let cell = |(place, panel)| Cell {
            panel,
            left: picture.margin() + aside + width * (place % across) as f64,
            width,
            height: self.panel_height(width),
            extents: extents[place],
            labelled: match self.small {
                Some(_) => [place + across >= self.panels.len(), place % across == 0],
                None => [true; 2],
            },
            small: self.small.is_some(),
            legend: legends && self.small.is_none(),
        };
        self.panels.iter().enumerate().map(cell).collect()
    }

    /// Room left of small panels for the labels of the first ones.
    fn small_aside(&self, extents: &[Option<[Extent; 2]>]) -> f64 {
        let first = self.panels.iter().zip(extents).find_map(|(panel, extent)| Some((panel, (*extent)?[1])));
        let Some((panel, up)) = first.filter(|_| self.small.is_some()) else { return 0.0 };
        aside(&panel.axes[1].axis(up, Along::up(100.0)))
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
            Some(_) => (room / MIN_PANEL_PX[1]) as usize,
            None => (room / MIN_PANEL_PX[0].max(widest)) as usize,
        };
        let most = self.small.unwrap_or(MAX_ACROSS).min(fitting.max(1)).min(self.panels.len());
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

    /// Ranges of all panels, each `width` wide with its labels. Axes of the same quantity share a range.
    fn extents(&self, width: f64) -> Vec<Option<[Extent; 2]>> {
        let values: Vec<[Vec<f64>; 2]> = self.panels.iter().map(ChartPanel::values).collect();
        let extent = |place: usize, axis: usize, length: f64| {
            let own = &self.panels[place];
            let shares = |other: usize| {
                let same = self.panels[other].axes[axis] == own.axes[axis];
                other == place || (same && !own.equal && (axis == 1 || self.small.is_some()))
            };
            let shared: Vec<usize> = (0..self.panels.len()).filter(|&other| shares(other)).collect();
            let reach = |place: &usize| self.panels[*place].marker_reach(self.small.is_some());
            let reach = shared.iter().map(reach).fold(0.0, f64::max);
            let pad = [if reach > 0.0 { 0.035 } else { 0.0 }, 0.06][axis];
            let values = shared.iter().flat_map(|&other| values[other][axis].iter().copied());
            // A pixel between marker and frame.
            let reach = if reach > 0.0 { reach + 1.0 } else { 0.0 };
            own.axes[axis].extent(values, pad, MarkerRoom { reach, length })
        };
        let both = |place: usize| {
            let own = &self.panels[place];
            let height = self.panel_height(width);
            let mut up = extent(place, 1, height)?;
            if own.failing.is_some() {
                // Room for its name above the curves.
                up.high += 0.08 * (up.high - up.low);
            }
            let labels = match self.small {
                Some(_) => SMALL_GAP,
                None => RIGHT + aside(&own.axes[1].axis(up, Along::up(height))),
            };
            Some([extent(place, 0, width - labels)?, up])
        };
        let own = |place: usize| values[place].iter().all(|values| !values.is_empty());
        (0..self.panels.len()).map(|place| both(place).filter(|_| own(place))).collect()
    }

    /// Series of a shared legend: those of the panel with the most, if the series of all other panels have
    /// the same names in the same order. Small panels have no legend; their titles name the series.
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

#[cfg(test)]
mod tests {
    use super::super::axis::{AxisSpec, Scale};
    use super::super::picture::Shape;
    use super::super::series::{Paint, PlotMark, Series, SpreadPoint};
    use super::*;

    fn texts(picture: &Picture) -> Vec<&str> {
        let texts = picture.shapes.iter().filter_map(|shape| match shape {
            Shape::Text(text) => Some(text.text.as_str()),
            _ => None,
        });
        texts.collect()
    }

    fn dots(points: &[(f64, f64)]) -> Series {
        Series::new("dots", PlotMark::Dots(points.iter().map(|&(x, y)| (x, y, String::new())).collect()))
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
            let plot_style = PlotStyle { width_mm, ..PlotStyle::default() };
            let picture = Chart::new("t", "s", vec![even(vec![dots(&points)]).equal()]).picture(&plot_style);
            // The last four are the points; one more is in the legend.
            let [a, b, c, _] = centres(&picture)[1..] else { panic!("four points") };
            assert!(((b.0 - a.0) - 2.0 * (a.1 - c.1)).abs() < 1e-9, "{a:?} {b:?} {c:?}");
        }
    }

    /// Panels of the same quantity share a range.
    #[test]
    fn panels_of_the_same_quantity_share_their_range() {
        let panel = |high: f64| even(vec![dots(&[(0.0, 0.0), (1.0, high)])]);
        let picture = Chart::new("t", "s", vec![panel(10.0), panel(1.0)]).picture(&PlotStyle::default());
        let [_, _, ten, _, one] = centres(&picture)[..] else { panic!("four points and one in the legend") };
        assert!(one.1 > ten.1 + 100.0, "1 is lower than 10");
        let other = ChartPanel { axes: [AxisSpec::even("x", ""), AxisSpec::even("z", "")], ..panel(1.0) };
        let picture = Chart::new("t", "s", vec![panel(10.0), other]).picture(&PlotStyle::default());
        let [_, _, ten, _, one] = centres(&picture)[..] else { panic!("four points and one in the legend") };
        assert!((one.1 - ten.1).abs() < 1.0, "another quantity has its own range");
    }

    #[test]
    fn points_keep_off_the_frame() {
        let picture = Chart::new("t", "s", vec![even(vec![dots(&[(0.0, 0.0), (7.0, 3.0)])])])
            .picture(&PlotStyle::default());
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
    fn markers_of_every_kind_stay_within_their_panel() {
        let places = [(0.0, 0.0), (1.0, 5.0), (19.0, 1e-3), (19.0, 900.0)];
        let named = || places.map(|(x, y)| (x, y, String::new())).to_vec();
        let spread = |(x, y)| SpreadPoint { at: (x, y), across: [x, x], up: [y, y], name: String::new() };
        let marks = || {
            [
                PlotMark::Dots(named()),
                PlotMark::Rings(named()),
                PlotMark::Curve(places.into()),
                PlotMark::Spreads(places.map(spread).into()),
            ]
        };
        let names = (0..20).map(|number| number.to_string()).collect();
        for scale in [Scale::Decades, Scale::Even, Scale::FromZero, Scale::Listed(names)] {
            for (count, small) in [(1, None), (3, None), (6, Some(3)), (12, Some(12))] {
                let up = if matches!(scale, Scale::Listed(_)) { Scale::FromZero } else { scale.clone() };
                let series: Vec<Series> = marks().map(|mark| Series::new("s", mark)).into();
                let panel = ChartPanel::new("", ["x", "y"], series).on(scale.clone(), up);
                let chart = Chart { small, ..Chart::new("t", "s", vec![panel; count]) };
                let picture = Picture::titled(&PlotStyle::default(), (WIDTHS[0], 300.0), ["t", "s"]);
                for cell in chart.cells(&picture, chart.across(&picture, true), true) {
                    let area = cell.area(0.0).unwrap();
                    for (index, series) in cell.panel.series.iter().enumerate() {
                        let above = if small.is_some() { 0 } else { cell.panel.series.len() - 1 - index };
                        let reach = series.mark.reach(above);
                        for (x, y) in series.mark.markers(&area) {
                            let inside = x - reach >= area.left && x + reach <= area.right;
                            assert!(
                                inside && y - reach >= area.top && y + reach <= area.bottom,
                                "{scale:?} {count} {x} {y}"
                            );
                        }
                    }
                }
            }
        }
    }

    #[test]
    fn a_marker_below_another_is_larger() {
        let series = [[(0.0, 0.0), (3.0, 3.0)], [(1.0, 1.0), (3.0, 3.0)], [(2.0, 0.0), (3.0, 3.0)]];
        let series = series.map(|points| dots(&points).painted(Paint::Like(0)));
        let picture = Chart::new("t", "s", vec![even(series.into())]).picture(&PlotStyle::default());
        let radius = |shape: &Shape| match shape {
            Shape::Dot { radius, .. } => Some(*radius),
            _ => None,
        };
        let radii: Vec<f64> = picture.shapes.iter().filter_map(radius).collect();
        // The first are those of the legend; then two points of each series.
        let [.., alone, lowest, _, middle, _, top] = radii[..] else { panic!("{radii:?}") };
        assert!(lowest > middle && middle > top && top == alone, "{radii:?}");
    }

    #[test]
    fn small_panels_are_labelled_at_the_edges_alone() {
        let panel = |name: &str| ChartPanel {
            title: name.to_owned(),
            ..even(vec![
                Series::new("", PlotMark::Faint(vec![vec![(0.0, 0.0), (1.0, 1.0)]])).painted(Paint::Grey),
                Series::curve(name, [(0.0, 0.0), (1.0, 1.0)]),
            ])
        };
        let panels: Vec<_> = ["a", "b", "c", "d", "e", "f"].map(panel).into();
        let picture = Chart::new("title", "s", panels).small(3).picture(&PlotStyle::default());
        let texts = texts(&picture);
        let count = |word: &str| texts.iter().filter(|text| **text == word).count();
        assert_eq!([count("y"), count("x"), count("a"), count("f")], [1, 1, 1, 1]);
    }

    #[test]
    fn a_row_for_zero_is_called_as_requested() {
        let axes = [AxisSpec::default(), AxisSpec { zero: "exact".to_owned(), ..AxisSpec::default() }];
        let panel = ChartPanel::over("", axes, vec![dots(&[(1.0, 0.0), (2.0, 5.0), (3.0, 200.0)])]);
        let picture = Chart::new("t", "s", vec![panel]).picture(&PlotStyle::default());
        assert!(texts(&picture).contains(&"exact"));
        let [_, exact, five, _] = centres(&picture)[..] else { panic!("three points and one in the legend") };
        assert!(exact.1 > five.1 + 20.0, "zero is not left out");
    }
}
