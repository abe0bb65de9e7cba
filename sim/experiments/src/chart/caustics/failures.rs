//! Where beams fail: too few triangles, and sides that cross.

use workloads::caustics::{MAX_CROSSED_SHARE, Method};

use super::{CausticsChart, Coarse, Crossed};
use output::plot::{ChartPanel, Scale, Series};

const CROSSING: &str = "length of beams for which their sides cross (%)";

/// Errors over the number of triangles and over how much sides cross, and what bodies lose there.
pub(super) fn panels(chart: &CausticsChart) -> Vec<ChartPanel> {
    vec![coarse(chart), error(chart), lost(chart), useful(chart)]
}

fn coarse(chart: &CausticsChart) -> ChartPanel {
    let of_slope = |slope: f64| {
        let rows = chart.coarse.iter().filter(move |row: &&Coarse| row.slope == slope);
        Series::curve(format!("slope {slope}"), rows.map(|row| (f64::from(row.cells), row.error)))
    };
    let mut slopes: Vec<f64> = chart.coarse.iter().map(|row| row.slope).collect();
    slopes.dedup();
    let curves = slopes.into_iter().map(of_slope).collect();
    ChartPanel::new("too few triangles", ["squares along a side", "error over mean"], curves)
        .on(Scale::Doublings, Scale::Decades)
        .failing(Some(0.0..chart.resolved_cells), "a run warns: caustics-coarse")
}

/// A curve for each number of triangles.
fn by_cells(chart: &CausticsChart, of: fn(&Crossed) -> f64) -> impl Iterator<Item = Series> {
    chart.effort.pleated_cells.iter().map(move |&cells| {
        let rows = chart.crossed.iter().filter(move |row| row.cells == cells);
        Series::curve(format!("{cells} squares"), rows.map(|row| (100.0 * row.crossing, of(row))))
    })
}

fn over_crossing(title: &str, up: &str, curves: Vec<Series>) -> ChartPanel {
    ChartPanel::new(title, [CROSSING, up], curves)
        .on(Scale::Even, Scale::Even)
        .failing(Some(100.0 * MAX_CROSSED_SHARE..f64::INFINITY), "caustics-crossed")
}

fn error(chart: &CausticsChart) -> ChartPanel {
    let floor = by_cells(chart, |row| row.floor_error);
    let volume = by_cells(chart, |row| row.volume_error)
        .map(|curve| Series { name: format!("{}: in the volume", curve.name), ..curve });
    over_crossing(
        "all methods: on the floor and in the volume",
        "error over mean",
        floor.chain(volume).collect(),
    )
}

fn lost(chart: &CausticsChart) -> ChartPanel {
    let named = |of: fn(&Crossed) -> f64, what: &'static str| {
        by_cells(chart, of).map(move |curve| Series { name: format!("{}: {what}", curve.name), ..curve })
    };
    let all = named(|row| 100.0 * row.missing, "all methods");
    let curves = all.chain(named(|row| 100.0 * row.lost, "lost by the uncut bound")).collect();
    over_crossing("light in the volume", "light missing (%)", curves)
}

/// What bodies are worth, at the largest number of triangles.
fn useful(chart: &CausticsChart) -> ChartPanel {
    let most = chart.effort.pleated_cells.last().copied().unwrap_or(0);
    let of = |(place, method): (usize, Method)| {
        let rows = chart.crossed.iter().filter(move |row| row.cells == most);
        Series::curve(method.name(), rows.map(move |row| (100.0 * row.crossing, row.useful[place])))
    };
    let curves = Method::ALL.into_iter().enumerate().map(of).collect();
    let title = format!("use, {most} squares along a side");
    over_crossing(&title, "share of executions that find light", curves)
}
