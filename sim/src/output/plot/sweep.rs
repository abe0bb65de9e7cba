//! Several measures along one parameter, a panel each.

use super::axis::{Axis, is_drawable};
use super::palette::part_colour;
use super::panel::{Key, Panel, legend_column};
use super::picture::{Picture, text};

/// Panels side by side over the same values.
#[derive(Clone, Debug)]
pub struct Sweep<'a> {
    /// The title.
    pub title: &'a str,
    /// The line below the title.
    pub subject: &'a str,
    /// What the values are.
    pub x: &'a str,
    /// The values, evenly spaced whatever they are.
    pub values: &'a [String],
    /// The measures.
    pub panels: Vec<SweepPanel<'a>>,
}

/// One measure.
#[derive(Clone, Debug)]
pub struct SweepPanel<'a> {
    /// What is measured, with its unit.
    pub name: &'a str,
    /// Whether the axis is logarithmic; what is not above zero is then left out.
    pub log: bool,
    /// The curves.
    pub series: Vec<SweepCurve<'a>>,
}

/// One curve.
#[derive(Clone, Debug)]
pub struct SweepCurve<'a> {
    /// Its name in the legend.
    pub name: &'a str,
    /// A point for each value.
    pub points: Vec<Option<f64>>,
}

const PITCH: f64 = 450.0;
const TOP: f64 = 90.0;
const BOTTOM: f64 = 400.0;

impl Sweep<'_> {
    /// The panels from left to right, each with its legend below.
    pub fn picture(&self) -> Picture {
        let most = self.panels.iter().map(|panel| panel.series.len()).max().unwrap_or(0);
        let width = 40.0 + PITCH * self.panels.len().max(1) as f64;
        let mut picture = Picture::new(width, BOTTOM + 90.0 + 22.0 * most as f64, self.title, self.subject);
        for (place, panel) in self.panels.iter().enumerate() {
            self.panel(panel, 95.0 + PITCH * place as f64, &mut picture);
        }
        picture
    }

    fn panel(&self, curves: &SweepPanel<'_>, left: f64, picture: &mut Picture) {
        let right = left + PITCH - 110.0;
        let scaled = |value: f64| if curves.log { libm::log10(value) } else { value };
        let all = || curves.series.iter().flat_map(|c| c.points.iter().flatten().map(|&v| scaled(v)));
        let finite = || all().filter(|value| value.is_finite());
        let range = finite().reduce(f64::min).zip(finite().reduce(f64::max));
        let Some((low, high)) = range.filter(|(low, high)| is_drawable(*low, *high)) else {
            let at = (left, 0.5 * (TOP + BOTTOM));
            return picture.text(text(&format!("{}: nothing to show", curves.name), at));
        };
        let y = if curves.log {
            Axis::log(curves.name, low, high)
        } else {
            Axis::from_zero(curves.name, "", high)
        };
        let panel = Panel { left, top: TOP, right, bottom: BOTTOM, x: self.across(), y };
        panel.grid(picture);
        for (index, curve) in curves.series.iter().enumerate() {
            let points = curve.points.iter().enumerate();
            let points: Vec<_> = points
                .filter_map(|(place, value)| value.map(scaled).map(|value| (place, value)))
                .filter(|(_, value)| value.is_finite())
                .map(|(place, value)| panel.at(place as f64, value))
                .collect();
            let colour = part_colour(index, false);
            points.iter().for_each(|&point| picture.dot(point, 3.0, colour));
            if points.len() > 1 {
                picture.polyline(points, colour.alpha(0.8), 1.5);
            }
        }
        panel.axes(picture, 0.0);
        self.legend(curves, left, right, picture);
    }

    fn across(&self) -> Axis {
        let ticks = self.values.iter().enumerate().map(|(place, value)| (place as f64, value.clone()));
        let (low, high) = (-0.3, self.values.len() as f64 - 0.7);
        Axis { low, high, ticks: ticks.collect(), label: self.x.to_owned() }
    }

    fn legend(&self, curves: &SweepPanel<'_>, left: f64, right: f64, picture: &mut Picture) {
        let entry = |(index, curve): (usize, &SweepCurve<'_>)| {
            (Key::Line(part_colour(index, false)), curve.name.to_owned(), String::new())
        };
        let entries: Vec<_> = curves.series.iter().enumerate().map(entry).collect();
        legend_column(picture, (left, BOTTOM + 72.0), right, &entries);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn powers_of_ten_are_told_and_gaps_are_left() {
        let points = vec![Some(10.0), None, Some(0.0), Some(1e4)];
        let panels = vec![
            SweepPanel { name: "cost", log: true, series: vec![SweepCurve { name: "one", points }] },
            SweepPanel { name: "none", log: false, series: vec![] },
        ];
        let values = ["0", "1", "2", "3"].map(str::to_owned);
        let curves = Sweep { title: "t", subject: "s", x: "parameter", values: &values, panels };
        let svg = curves.picture().svg().unwrap();
        for word in ["1e2", "parameter", "none: nothing to show", "one"] {
            assert!(svg.contains(word), "{word}: {svg}");
        }
    }
}
