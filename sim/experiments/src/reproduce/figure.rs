//! Figures of the papers, from results of the simulator.

use output::plot::{AxisSpec, Chart, ChartPanel, Look, Mark, Picture, Scale, Series};

/// A picture and its name.
pub struct Figure {
    /// Its name without ending, for example `III_fig3`.
    pub name: &'static str,
    /// Picture.
    pub picture: Picture,
}

impl Figure {
    /// Path of the SVG below the folder of results.
    pub(super) fn path(&self) -> String {
        format!("plots/{}.svg", self.name)
    }

    /// Series on two axes, each `(quantity, unit)`.
    pub(super) fn lines(
        name: &'static str,
        title: &str,
        subject: &str,
        axes: [(&str, &str); 2],
        series: Vec<Series>,
    ) -> Self {
        let axes = axes.map(|(name, unit)| AxisSpec::even(name, unit));
        Self::of(name, [title, subject], ChartPanel::over("", axes, series))
    }

    /// Points in a plane: both axes have the same scale.
    pub(super) fn plane(name: &'static str, titles: [&str; 2], axes: [&str; 2], series: Vec<Series>) -> Self {
        let axes = axes.map(|name| AxisSpec::even(name, ""));
        Self::of(name, titles, ChartPanel::over("", axes, series).equal())
    }

    /// A figure of one panel.
    pub(super) fn of(name: &'static str, [title, subject]: [&str; 2], panel: ChartPanel) -> Self {
        Self { name, picture: Chart::new(title, subject, vec![panel]).picture(&Look::default()) }
    }
}

/// Curves over a number that doubles; `axes` are the names of the horizontal and the vertical axis.
pub(super) fn over_doublings(
    name: &'static str,
    titles: [&str; 2],
    axes: [&str; 2],
    curves: Vec<Series>,
) -> Figure {
    let panel = ChartPanel::new("", axes, curves).on(Scale::Doublings, Scale::Even);
    Figure::of(name, titles, panel)
}

/// Time.
pub(super) const TIME: (&str, &str) = ("time", "s");
/// Power.
pub(super) const POWER: (&str, &str) = ("power", "W");
/// Energy of a frame.
pub(super) const ENERGY: (&str, &str) = ("energy per frame", "J");

/// A line.
pub(super) fn line(name: &str, points: Vec<(f64, f64)>) -> Series {
    Series::new(name, Mark::Line(points))
}

/// Dots without names.
pub(super) fn dots(name: &str, points: Vec<(f64, f64)>) -> Series {
    let dots = points.into_iter().map(|(x, y)| (x, y, String::new())).collect();
    Series::new(name, Mark::Dots(dots))
}

/// A horizontal line.
pub(super) fn level(name: &str, from: f64, to: f64, height: f64) -> Series {
    line(name, vec![(from, height), (to, height)])
}

/// Values over their index.
pub(super) fn by_place(values: &[f64]) -> Vec<(f64, f64)> {
    values.iter().enumerate().map(|(place, value)| (place as f64, *value)).collect()
}
