//! Series: the data drawn in a panel, each with its style; many samples are reduced to few columns.

use super::panel::{Key, Panel, Style};
use super::picture::{Picture, Point};
use super::{BACKGROUND, FAINT, INK};

/// Kind and data of a series.
#[derive(Clone, Debug)]
pub enum PlotMark {
    /// A filled band from the lowest to the highest value at each position.
    Band(Vec<(f64, f64, f64)>),
    /// A line through points.
    Line(Vec<(f64, f64)>),
    /// A line through points, each with a marker.
    Curve(Vec<(f64, f64)>),
    /// Many faint lines.
    Faint(Vec<Vec<(f64, f64)>>),
    /// Markers, each with a name that may be empty.
    Dots(Vec<(f64, f64, String)>),
    /// Hollow markers, each with a name that may be empty.
    Rings(Vec<(f64, f64, String)>),
    /// Large markers, each with a cross that shows its spread.
    Spreads(Vec<SpreadPoint>),
    /// Pareto frontier as a staircase: level until the next point.
    Steps(Vec<(f64, f64)>),
    /// Bars from zero, `(from, to, height)`.
    Bars(Vec<(f64, f64, f64)>),
    /// Vertical lines.
    Uprights(Vec<f64>),
}

/// A point with its spread.
#[derive(Clone, Debug, PartialEq)]
pub struct SpreadPoint {
    /// Position.
    pub at: (f64, f64),
    /// Horizontal range.
    pub across: [f64; 2],
    /// Vertical range.
    pub up: [f64; 2],
    /// Name; may be empty.
    pub name: String,
}

impl SpreadPoint {
    /// The lines of its cross.
    fn cross(&self) -> [[(f64, f64); 2]; 2] {
        let ((x, y), [x0, x1], [y0, y1]) = (self.at, self.across, self.up);
        [[(x0, y), (x1, y)], [(x, y0), (x, y1)]]
    }

    /// Draws its cross and its marker, both with an edge in the colour of the background.
    fn draw(&self, panel: &Panel, style: Style, picture: &mut Picture) {
        for line in self.cross() {
            let line: Vec<Point> = line.iter().filter_map(|&point| panel.place(point)).collect();
            picture.polyline(line.clone(), BACKGROUND, 4.5);
            picture.polyline(line, style.colour, 2.0);
        }
        let Some(at) = panel.place(self.at) else { return };
        Style { colour: BACKGROUND, ..style }.marker(picture, at, RADII[2] + 1.5);
        style.marker(picture, at, RADII[2]);
    }
}

/// Choice of colour and marker of a series.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Paint {
    /// By its index in the panel.
    #[default]
    Own,
    /// Colour and marker of the series with this index.
    Like(usize),
    /// The colour of text.
    Ink,
    /// The colour of background lines.
    Grey,
}

/// A named mark.
#[derive(Clone, Debug)]
pub struct Series {
    /// Name in the legend; without a name the series is not in the legend.
    pub name: String,
    /// Note in the panel, for example an exponent.
    pub note: String,
    /// Data. Connected points are ordered from left to right. Points that an axis cannot show are omitted.
    pub mark: PlotMark,
    /// Colour and marker.
    pub paint: Paint,
}

impl Series {
    /// A series in the default style.
    pub fn new(name: impl Into<String>, mark: PlotMark) -> Self {
        Self { name: name.into(), note: String::new(), mark, paint: Paint::Own }
    }

    /// A line with markers.
    pub fn curve(name: impl Into<String>, points: impl IntoIterator<Item = (f64, f64)>) -> Self {
        Self::new(name, PlotMark::Curve(points.into_iter().collect()))
    }

    /// The same with another style.
    #[must_use]
    pub fn painted(self, paint: Paint) -> Self {
        Self { paint, ..self }
    }

    /// Style of the series with this index in a panel.
    pub(super) fn style(&self, index: usize) -> Style {
        match self.paint {
            Paint::Own => Style::of(index),
            Paint::Like(place) => Style::of(place),
            Paint::Ink => Style { colour: INK, ..Style::of(0) },
            Paint::Grey => Style { colour: FAINT, ..Style::of(0) },
        }
    }
}

/// Radius of a marker of a point among many, of a named one, and of the middle of a spread.
const RADII: [f64; 3] = [2.4, 3.0, 5.5];
/// A series of more points has smaller markers.
const MANY: usize = 60;
/// Distance of the corners of triangles and diamonds from their point, relative to the radius.
const CORNER_REACH: f64 = 1.25;
/// Growth of a marker for each marker of a later series at the same place, so that its rim stays visible.
const RIM_PX: f64 = 1.2;
/// Markers this close are at the same place.
const SAME_PLACE_PX: f64 = 2.0;
/// Largest number of markers above one whose rim stays visible.
const MAX_ABOVE: usize = 3;

/// Radius of the markers of a curve below `above` others.
fn curve_radius(above: usize) -> f64 {
    2.8 + 0.4 * above.min(MAX_ABOVE) as f64
}

/// Radius of one of `count` dots below `above` others.
fn dot_radius(count: usize, above: usize) -> f64 {
    RADII[usize::from(count <= MANY)] + RIM_PX * above.min(MAX_ABOVE) as f64
}

impl PlotMark {
    /// All values of `x` and `y` that the axes must include.
    pub(super) fn values(&self) -> [Vec<f64>; 2] {
        let points: Vec<Point> = match self {
            Self::Band(band) => band.iter().flat_map(|&(x, low, high)| [(x, low), (x, high)]).collect(),
            Self::Line(points) | Self::Curve(points) | Self::Steps(points) => points.clone(),
            Self::Faint(lines) => lines.concat(),
            Self::Dots(dots) | Self::Rings(dots) => dots.iter().map(|&(x, y, _)| (x, y)).collect(),
            Self::Spreads(spreads) => spreads.iter().flat_map(|spread| spread.cross().concat()).collect(),
            Self::Bars(bars) => bars.iter().flat_map(|&(from, to, y)| [(from, 0.0), (to, y)]).collect(),
            Self::Uprights(places) => return [places.clone(), Vec::new()],
        };
        let finite = points.into_iter().filter(|(x, y)| x.is_finite() && y.is_finite());
        finite.unzip::<f64, f64, Vec<f64>, Vec<f64>>().into()
    }

    /// Largest distance of the outline of a marker from its point, with `above` series drawn later; 0 without
    /// markers. Axes leave room for it.
    pub(super) fn reach(&self, above: usize) -> f64 {
        CORNER_REACH
            * match self {
                Self::Curve(_) => curve_radius(above),
                Self::Dots(dots) | Self::Rings(dots) => dot_radius(dots.len(), above),
                Self::Spreads(_) => RADII[2] + 1.5,
                _ => 0.0,
            }
    }

    /// Positions of its markers.
    pub(super) fn markers(&self, panel: &Panel) -> Vec<Point> {
        let placed = |points: &mut dyn Iterator<Item = (f64, f64)>| {
            points.filter_map(|point| panel.place(point)).collect()
        };
        match self {
            Self::Curve(points) => placed(&mut points.iter().copied()),
            Self::Dots(dots) | Self::Rings(dots) => placed(&mut dots.iter().map(|&(x, y, _)| (x, y))),
            Self::Spreads(spreads) => placed(&mut spreads.iter().map(|spread| spread.at)),
            _ => Vec::new(),
        }
    }

    /// Entry of the series in a legend.
    pub(super) fn key(&self, style: Style) -> Key {
        match self {
            Self::Band(_) => Key::Area(style.colour.alpha(0.55)),
            Self::Bars(_) => Key::Area(style.colour),
            Self::Line(_) | Self::Faint(_) => Key::Line(style.colour),
            Self::Curve(_) => Key::Curve(style),
            Self::Dots(_) => Key::Marker(style, true),
            Self::Spreads(_) => Key::Spread(style),
            Self::Rings(_) => Key::Marker(style, false),
            Self::Steps(_) => Key::Steps(style.colour),
            Self::Uprights(_) => Key::Tick(style.colour),
        }
    }

    /// Names of points with positions, and the radius that stays free around them.
    pub(super) fn names(&self, panel: &Panel) -> Vec<(Point, f64, &str)> {
        let named =
            |x: f64, y: f64, name: &'_ String| (!name.is_empty()).then(|| panel.place((x, y))).flatten();
        match self {
            Self::Dots(dots) | Self::Rings(dots) => dots
                .iter()
                .filter_map(|(x, y, name)| Some((named(*x, *y, name)?, RADII[1], name.as_str())))
                .collect(),
            Self::Spreads(spreads) => spreads
                .iter()
                .filter_map(|s| Some((named(s.at.0, s.at.1, &s.name)?, RADII[2], s.name.as_str())))
                .collect(),
            _ => Vec::new(),
        }
    }

    /// Positions of its markers and along its lines, which labels must not overlap.
    pub(super) fn obstacles(&self, panel: &Panel) -> Vec<Point> {
        let path =
            |points: &[(f64, f64)]| points.iter().filter_map(|&point| panel.place(point)).collect::<Vec<_>>();
        match self {
            Self::Dots(dots) | Self::Rings(dots) => {
                dots.iter().filter_map(|&(x, y, _)| panel.place((x, y))).collect()
            }
            Self::Spreads(spreads) => {
                spreads.iter().flat_map(SpreadPoint::cross).flat_map(|line| along(&path(&line))).collect()
            }
            Self::Line(points) | Self::Curve(points) => along(&path(points)),
            Self::Steps(points) => along(&stairs(&path(points))),
            Self::Band(_) | Self::Faint(_) | Self::Bars(_) | Self::Uprights(_) => Vec::new(),
        }
    }

    /// Draws it. Curves and markers below those of the series `above`, which are drawn later, are larger, so
    /// that they stay visible.
    pub(super) fn draw(&self, panel: &Panel, style: Style, above: &[Series], picture: &mut Picture) {
        let path =
            |points: &[(f64, f64)]| points.iter().filter_map(|&point| panel.place(point)).collect::<Vec<_>>();
        let colour = style.colour;
        match self {
            Self::Band(band) => {
                for (index, &(_, low, high)) in band.iter().enumerate() {
                    let (top, bottom) = (panel.y_px(high), panel.y_px(low));
                    let (left, right) = width_px(band, index, panel);
                    picture.rect((left, top - 0.5), (right, bottom.max(top) + 0.5), colour.alpha(0.55));
                }
            }
            Self::Line(line) => style.line(picture, &path(line), 1.6),
            Self::Curve(points) => {
                let points = path(points);
                if points.len() > 1 {
                    style.line(picture, &points, 1.5 + 0.5 * above.len().min(MAX_ABOVE) as f64);
                }
                let radius = curve_radius(above.len());
                points.iter().for_each(|&at| style.marker(picture, at, radius));
            }
            Self::Faint(lines) => {
                let alpha =
                    if colour == FAINT { 1.0 } else { (3.0 / lines.len().max(1) as f64).clamp(0.04, 0.6) };
                lines.iter().for_each(|line| picture.polyline(path(line), colour.alpha(alpha), 1.0));
            }
            Self::Dots(dots) | Self::Rings(dots) => {
                let later: Vec<Vec<Point>> = above.iter().map(|series| series.mark.markers(panel)).collect();
                for at in self.markers(panel) {
                    let covers = |other: &Point| libm::hypot(other.0 - at.0, other.1 - at.1) < SAME_PLACE_PX;
                    let covering = later.iter().filter(|markers| markers.iter().any(covers)).count();
                    let radius = dot_radius(dots.len(), covering);
                    match self {
                        Self::Dots(_) => style.marker(picture, at, radius),
                        _ => style.hollow(picture, at, radius),
                    }
                }
            }
            Self::Spreads(spreads) => spreads.iter().for_each(|spread| spread.draw(panel, style, picture)),
            Self::Steps(points) => picture.polyline(stairs(&path(points)), colour, 1.3),
            Self::Bars(bars) => {
                for &(from, to, y) in bars {
                    picture.rect(panel.at(from, y), (panel.x_px(to) - 1.0, panel.y_px(0.0)), colour);
                }
            }
            Self::Uprights(places) => {
                for x in places.iter().filter(|place| panel.x.place(**place).is_some()) {
                    let x = panel.x_px(*x);
                    picture.dashed(&[(x, panel.top), (x, panel.bottom)], colour, 1.2, [5.0, 3.0]);
                }
            }
        }
    }
}

/// Staircase: level from each point to the next, then vertical.
fn stairs(points: &[Point]) -> Vec<Point> {
    let corners = points.windows(2).flat_map(|pair| [pair[0], (pair[1].0, pair[0].1)]);
    corners.chain(points.last().copied()).collect()
}

/// Positions along a path, some pixels apart.
fn along(path: &[Point]) -> Vec<Point> {
    let between = |pair: &[Point]| {
        let ((ax, ay), (bx, by)) = (pair[0], pair[1]);
        let steps = (libm::hypot(bx - ax, by - ay) / 6.0).min(400.0) as u32 + 1;
        let at = move |step: u32| f64::from(step) / f64::from(steps);
        (0..=steps)
            .map(move |step| (ax + (bx - ax) * at(step), ay + (by - ay) * at(step)))
            .collect::<Vec<_>>()
    };
    path.windows(2).flat_map(between).chain(path.first().copied()).collect()
}

/// Horizontal extent of a position of a band: halfway to its neighbours, and at least a pixel, so that a single spike
/// is visible.
fn width_px(band: &[(f64, f64, f64)], index: usize, panel: &Panel) -> (f64, f64) {
    let x_px = |index: usize| band.get(index).map(|place| panel.x_px(place.0));
    let x = panel.x_px(band[index].0);
    let before = index.checked_sub(1).and_then(x_px).map(|before| 0.5 * (x - before));
    let after = x_px(index + 1).map(|after| 0.5 * (after - x));
    let reach = |side: Option<f64>, other: Option<f64>| side.or(other).unwrap_or(0.0).max(0.5);
    ((x - reach(before, after)).max(panel.left), (x + reach(after, before)).min(panel.right))
}

/// Lowest and highest finite value of the samples in a column.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Extremes {
    pub low: f64,
    pub high: f64,
}

/// Splits `values` into `columns` segments of (almost) equal length and gives the extremes of each; `None` where a
/// segment has no finite value. Every value is in a segment. There are at most as many segments as values.
pub(super) fn extremes(values: &[f64], columns: usize) -> Vec<Option<Extremes>> {
    segments(values.len(), columns)
        .map(|(from, to)| {
            let finite = || values[from..to].iter().copied().filter(|value| value.is_finite());
            let low = finite().reduce(f64::min)?;
            let high = finite().reduce(f64::max)?;
            Some(Extremes { low, high })
        })
        .collect()
}

/// Splits `values` in the same way and gives the mean of each segment. Values that are not finite count as 0.
pub(super) fn means(values: &[f64], columns: usize) -> Vec<f64> {
    segments(values.len(), columns)
        .map(|(from, to)| values[from..to].iter().filter(|v| v.is_finite()).sum::<f64>() / (to - from) as f64)
        .collect()
}

/// Moving mean of the finite `values`: for the middle of each of `columns` segments, its position in samples
/// and the mean over `width` samples around it.
pub(super) fn moving_mean(values: &[f64], width: usize, columns: usize) -> Vec<(f64, f64)> {
    let width = width.clamp(1, values.len().max(1));
    let mut sums = Vec::with_capacity(values.len() + 1);
    let mut sum = (0.0, 0_usize);
    sums.push(sum);
    for value in values {
        if value.is_finite() {
            sum = (sum.0 + value, sum.1 + 1);
        }
        sums.push(sum);
    }
    segments(values.len(), columns)
        .filter_map(|(from, to)| {
            let middle = (from + to) / 2;
            // At the ends the window stays whole and stops moving: a shorter one would show a part of a frame.
            let first = middle.saturating_sub(width / 2).min(values.len() - width);
            let end = first + width;
            let count = sums[end].1 - sums[first].1;
            (count > 0).then(|| ((from + to) as f64 / 2.0, (sums[end].0 - sums[first].0) / count as f64))
        })
        .collect()
}

fn segments(length: usize, columns: usize) -> impl Iterator<Item = (usize, usize)> {
    let columns = columns.min(length);
    let edge = move |i: usize| (i as u128 * length as u128 / columns.max(1) as u128) as usize;
    (0..columns).map(move |i| (edge(i), edge(i + 1)))
}

#[cfg(test)]
mod tests {
    use super::super::axis::{Along, Axis};
    use super::*;

    fn panel(right: f64) -> Panel {
        let x = Axis::new("time", "s", (0.0, 4.0), Along::across(right));
        let y = Axis::new("power", "W", (0.0, 1.0), Along::up(100.0));
        Panel { left: 0.0, top: 0.0, right, bottom: 100.0, x, y }
    }

    #[test]
    fn places_of_a_band_touch_however_few_there_are() {
        let band = [(1.0, 0.0, 1.0), (2.0, 0.0, 1.0), (3.0, 0.0, 1.0)];
        let ends: Vec<_> = (0..3).map(|index| width_px(&band, index, &panel(400.0))).collect();
        assert_eq!(ends, [(50.0, 150.0), (150.0, 250.0), (250.0, 350.0)]);
        let (left, right) = width_px(&band[..1], 0, &panel(400.0));
        assert_eq!(right - left, 1.0);
        let (left, right) = width_px(&band, 1, &panel(1.0));
        assert!(right - left >= 0.75, "{left} {right}");
    }

    /// Between two settings of a frontier there is none: the better of them holds until the next one.
    #[test]
    fn a_frontier_goes_in_steps() {
        assert_eq!(stairs(&[(0.0, 9.0), (5.0, 4.0)]), [(0.0, 9.0), (5.0, 9.0), (5.0, 4.0)]);
        assert_eq!(stairs(&[(1.0, 1.0)]), [(1.0, 1.0)]);
        assert!(stairs(&[]).is_empty());
    }

    #[test]
    fn no_two_of_two_dozen_series_look_the_same() {
        let styles: Vec<Style> = (0..24).map(Style::of).collect();
        assert!((0..24).all(|a| (0..a).all(|b| styles[a] != styles[b])));
    }

    #[test]
    fn no_spike_is_missed() {
        for place in [0, 1, 499, 9_999] {
            let mut values = vec![1.0; 10_000];
            values[place] = 9.0;
            let columns = extremes(&values, 333);
            assert_eq!(columns.len(), 333);
            assert_eq!(columns.iter().flatten().filter(|column| column.high == 9.0).count(), 1);
        }
    }

    #[test]
    fn few_values_have_a_column_each_and_none_have_none() {
        assert_eq!(extremes(&[1.0, f64::NAN], 100), [Some(Extremes { low: 1.0, high: 1.0 }), None]);
        assert!(
            extremes(&[], 100).is_empty() && means(&[], 10).is_empty() && moving_mean(&[], 3, 5).is_empty()
        );
    }

    #[test]
    fn means_keep_the_energy() {
        let values: Vec<f64> = (0..1000).map(f64::from).collect();
        let mean = means(&values, 10).iter().sum::<f64>() / 10.0;
        assert!((mean - 499.5).abs() < 1e-9);
    }

    #[test]
    fn the_moving_mean_of_a_constant_is_the_constant() {
        assert!(moving_mean(&[2.0; 100], 7, 30).iter().all(|(_, mean)| *mean == 2.0));
    }
}
