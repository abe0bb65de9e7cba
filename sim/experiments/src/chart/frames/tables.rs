//! The files of the chart.

use std::fmt::Write as _;

use super::{Axis, FAILS_BELOW, FramesChart, Outcome, Row, Way};
use output::dir::BoxError;
use output::plot::{Chart, ChartPanel, Look, Mark, Paint, Scale, Series};
use output::table::Table;
use output::{Claim, OutDir, OutputError};

/// The files of the chart.
pub fn claim() -> Claim {
    Claim::new("chart frames").plots(["frames_rate", "frames_noise", "frames_bits", "frames_time"]).files([
        "frames.csv",
        "frames.md",
        "frames.json",
    ])
}

/// Writes pictures and numbers; `frames.json` comes last.
pub(super) fn write(chart: &FramesChart, dir: &OutDir, look: &Look) -> Result<(), OutputError> {
    let effort = &chart.effort;
    let (scenes, seeds) = (traces::synth::SCENARIOS.len(), effort.seeds.len());
    let subject = format!(
        "means over {scenes} scenes of {} frames, {seeds} of each; 50 kHz, 30 dB and 14 bits where not said otherwise",
        effort.frames
    );
    for axis in Axis::ALL {
        let (title, x, unit) = match axis {
            Axis::Rate => ("Frames found over sampling rate", "sampling rate, kHz", 1e3),
            Axis::Noise => ("Frames found over signal to noise", "signal to noise, dB", 1.0),
            Axis::Bits => ("Frames found over resolution", "bits", 1.0),
        };
        let values: Vec<String> =
            chart.values(axis).into_iter().map(|value| format!("{}", value / unit)).collect();
        let panels: [fn(&FramesChart, Axis) -> ChartPanel; 2] = [found, energy];
        let panels = panels.map(|panel| panel(chart, axis).along(x, &values));
        Chart::new(title, &subject, panels.into())
            .picture(look)
            .write(dir, &format!("frames_{}", axis.name()))?;
    }
    let panels = vec![host_time(chart), found_over_time(chart)];
    Chart::new("Host time of finding frames", &subject, panels).picture(look).write(dir, "frames_time")?;
    dir.write_file("frames.csv", |out| csv(chart, out))?;
    dir.write_file("frames.md", |out| Ok(out.write_all(markdown(chart).as_bytes())?))?;
    dir.write_json("frames.json", chart)?;
    Ok(())
}

/// A curve over the places of the values, without those at which nothing is known.
fn along(chart: &FramesChart, axis: Axis, way: Way, of: fn(&Outcome) -> Option<f64>) -> Series {
    let means = chart.values(axis).into_iter().map(|value| chart.mean(axis, value, way, of)).enumerate();
    Series::curve(way.name(), means.filter_map(|(place, mean)| Some((place as f64, mean?))))
}

/// F1, with the line below which a method fails.
fn found(chart: &FramesChart, axis: Axis) -> ChartPanel {
    let last = chart.values(axis).len().saturating_sub(1) as f64;
    let limit = Series::new("fails below", Mark::Line(vec![(0.0, FAILS_BELOW), (last, FAILS_BELOW)]));
    let curves = Way::ALL.into_iter().map(|way| along(chart, axis, way, |o| Some(o.f1)));
    let series = curves.chain([limit.painted(Paint::Ink)]).collect();
    ChartPanel::new("", ["", "F1 of starts within 0.5 ms"], series).on(Scale::Even, Scale::FromZero)
}

fn energy(chart: &FramesChart, axis: Axis) -> ChartPanel {
    let percent: fn(&Outcome) -> Option<f64> = |o| o.energy_error.map(|error| 100.0 * error);
    let curves = Way::ALL.into_iter().map(|way| along(chart, axis, way, percent)).collect();
    ChartPanel::new("", ["", "median energy error (%)"], curves)
}

fn host_time(chart: &FramesChart) -> ChartPanel {
    let of = |way: Way| timed(chart, way).into_iter().map(|(rate_hz, host_s, _)| (rate_hz, host_s));
    let axes = ["sampling rate, Hz", "host seconds for a million samples"];
    let curves = Way::ALL.map(|way| Series::curve(way.name(), of(way)));
    ChartPanel::new("time over sampling rate", axes, curves.into())
}

fn found_over_time(chart: &FramesChart) -> ChartPanel {
    let curve = |way: Way| {
        let mut points: Vec<(f64, f64)> =
            timed(chart, way).into_iter().map(|(_, host_s, f1)| (host_s, f1)).collect();
        points.sort_by(|a, b| a.0.total_cmp(&b.0));
        Series::curve(way.name(), points)
    };
    let axes = ["host seconds for a million samples", "F1"];
    ChartPanel::new("F1 over time, a dot for each rate", axes, Way::ALL.map(curve).into())
}

/// Rate, host seconds for a million samples, and F1.
fn timed(chart: &FramesChart, way: Way) -> Vec<(f64, f64, f64)> {
    let point = |rate_hz: f64| {
        let mean = |of| chart.mean(Axis::Rate, rate_hz, way, of);
        Some((rate_hz, mean(|o| Some(o.host_s_per_1e6))?, mean(|o| Some(o.f1))?))
    };
    chart.values(Axis::Rate).into_iter().filter_map(point).collect()
}

fn csv(chart: &FramesChart, out: &mut dyn std::io::Write) -> Result<(), BoxError> {
    let mut table = csv::Writer::from_writer(out);
    table.write_record([
        "axis",
        "value",
        "scene",
        "method",
        "f1",
        "fails",
        "energy_error",
        "wrong",
        "wrong_flagged",
        "right",
        "right_flagged",
        "host_s_per_1e6",
    ])?;
    for Row { axis, value, scene, way, outcome: o, fails } in &chart.rows {
        table.serialize((
            (axis.name(), value, scene, way.name(), o.f1, fails, o.energy_error),
            (o.wrong, o.wrong_flagged, o.right, o.right_flagged, o.host_s_per_1e6),
        ))?;
    }
    Ok(table.flush()?)
}

impl FramesChart {
    /// Mean F1 by axis, value and method; a star where it fails, and on how many of the scenes it does.
    pub fn text(&self) -> Table {
        let mut table = Table::new(["axis", "value"].into_iter().chain(Way::ALL.map(Way::name)));
        for axis in Axis::ALL {
            for value in self.values(axis) {
                let cell = |way: Way| self.cell(axis, value, way, "*", "");
                table.row([axis.name().to_owned(), axis.shown(value)].into_iter().chain(Way::ALL.map(cell)));
            }
        }
        table
    }

    /// F1 with the number of scenes that fail; marked where the mean does.
    fn cell(&self, axis: Axis, value: f64, way: Way, mark: &str, before: &str) -> String {
        let f1 = self.mean(axis, value, way, |o| Some(o.f1)).unwrap_or(0.0);
        let failed = self.at(axis, value, way).filter(|row| row.fails).count();
        let told = if failed == 0 { String::new() } else { format!(" ({failed})") };
        if f1 < FAILS_BELOW { format!("{before}{f1:.3}{mark}{told}") } else { format!("{f1:.3}{told}") }
    }
}

/// The tables of the book's chapter.
pub(super) fn markdown(chart: &FramesChart) -> String {
    let mut text = String::new();
    let ways = Way::ALL.map(Way::name).join(" | ");
    // Writing into a string cannot fail.
    let usual = chart.values(Axis::Rate).into_iter().rfind(|&rate_hz| rate_hz <= 50e3).unwrap_or(0.0);
    let rows: Vec<&Row> =
        chart.rows.iter().filter(|row| row.axis == Axis::Rate && row.value == usual).collect();
    let _ = writeln!(text, "| scene | {ways} | energy error, auto |\n|---|---|---|---|---|---|---|");
    for rows in rows.chunk_by(|a, b| a.scene == b.scene) {
        let cell = |row: &&Row| {
            if row.fails { format!("**{:.3}**", row.outcome.f1) } else { format!("{:.3}", row.outcome.f1) }
        };
        let cells: Vec<String> = rows.iter().map(cell).collect();
        let error = rows.last().and_then(|row| row.outcome.energy_error);
        let _ = writeln!(text, "| {} | {} | {} |", rows[0].scene, cells.join(" | "), percent(error));
    }
    for axis in Axis::ALL {
        let _ = writeln!(
            text,
            "\n| {} | {ways} | energy error, auto | wrong frames flagged | right ones flagged |",
            axis.name()
        );
        let _ = writeln!(text, "|---|---|---|---|---|---|---|---|---|");
        for value in chart.values(axis) {
            let cells = Way::ALL.map(|way| chart.cell(axis, value, way, "**", "**")).join(" | ");
            let error = chart.mean(axis, value, Way::Auto, |o| o.energy_error);
            let sum = |of: fn(&Outcome) -> usize| -> usize {
                chart.at(axis, value, Way::Auto).map(|row| of(&row.outcome)).sum()
            };
            let _ = writeln!(
                text,
                "| {} | {cells} | {} | {} of {} | {} of {} |",
                axis.shown(value),
                percent(error),
                sum(|o| o.wrong_flagged),
                sum(|o| o.wrong),
                sum(|o| o.right_flagged),
                sum(|o| o.right)
            );
        }
    }
    text
}

fn percent(error: Option<f64>) -> String {
    error.map_or("-".to_owned(), |error| format!("{:.3} %", 100.0 * error))
}
