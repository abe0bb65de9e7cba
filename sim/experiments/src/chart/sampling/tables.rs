//! The files of the chart.

use std::fmt::Write;

use super::{FIT_FROM, Point, Row, SamplingChart};
use output::plot::{Chart, ChartPanel, Look, Scale, Series};
use output::{Claim, OutDir, OutputError};

/// The files of the chart.
pub fn claim() -> Claim {
    Claim::new("chart sampling").plots(["sampling_error", "sampling_time", "sampling_failures"]).files([
        "sampling.csv",
        "sampling.md",
        "sampling.json",
    ])
}

/// Writes pictures and numbers; `sampling.json` comes last.
pub(super) fn write(chart: &SamplingChart, dir: &OutDir, look: &Look) -> Result<(), OutputError> {
    let seconds = |point: &Point| point.host_s;
    let samples = |point: &Point| f64::from(point.samples_per_pixel);
    let subject = subject(chart);
    let over_samples = panels(&chart.rows, "samples per pixel", true, samples);
    let title = "Image error over samples per pixel";
    Chart::new(title, &subject, over_samples).picture(look).write(dir, "sampling_error")?;
    let over_time = panels(&chart.rows, "host seconds a frame", false, seconds);
    let title = "Image error over host time";
    Chart::new(title, &subject, over_time).picture(look).write(dir, "sampling_time")?;
    let title = "Where sampling fails";
    Chart::new(title, &subject, failures(chart)).picture(look).write(dir, "sampling_failures")?;
    dir.write_file("sampling.csv", |out| {
        let mut table = csv::Writer::from_writer(out);
        table.write_record(["chart", "scene", "table", "samples_per_pixel", "rmse", "host_s"])?;
        for (name, row) in all(chart) {
            for point in &row.points {
                let Point { samples_per_pixel, rmse, host_s } = point;
                table.serialize((name, row.scene, row.table, samples_per_pixel, rmse, host_s))?;
            }
        }
        Ok(table.flush()?)
    })?;
    dir.write_file("sampling.md", |out| Ok(out.write_all(markdown(chart).as_bytes())?))?;
    dir.write_json("sampling.json", chart)?;
    Ok(())
}

fn all(chart: &SamplingChart) -> impl Iterator<Item = (&'static str, &Row)> {
    let failures = &chart.failures;
    let groups = [
        ("error", &chart.rows),
        ("every_number", &failures.every_number),
        ("many_edges", &failures.many_edges),
    ];
    groups.into_iter().flat_map(|(name, rows)| rows.iter().map(move |row| (name, row)))
}

fn subject(chart: &SamplingChart) -> String {
    let [width, height] = chart.effort.size;
    format!(
        "RMSE in linear light against {} samples per pixel, {width}x{height} pixels; exponents fitted from {FIT_FROM} samples on",
        chart.reference_samples_per_pixel
    )
}

/// A panel for each scene.
fn panels(rows: &[Row], across: &str, doubling: bool, x: fn(&Point) -> f64) -> Vec<ChartPanel> {
    let scenes = rows.chunk_by(|a, b| a.scene == b.scene);
    let scale = if doubling { Scale::Doublings } else { Scale::Decades };
    let panel = |rows: &[Row]| {
        let curves = rows.iter().map(|row| curve(row, doubling, |p| (x(p), p.rmse))).collect();
        ChartPanel::new(rows[0].scene, [across, "RMSE"], curves).on(scale.clone(), Scale::Decades)
    };
    scenes.map(panel).collect()
}

fn curve(row: &Row, noted: bool, place: impl Fn(&Point) -> (f64, f64)) -> Series {
    let note = row.exponent.filter(|_| noted).map_or(String::new(), |p| format!("{p:.2}"));
    Series { note, ..Series::curve(row.table, row.points.iter().map(place)) }
}

fn failures(chart: &SamplingChart) -> Vec<ChartPanel> {
    let scaled = |p: &Point| {
        let n = f64::from(p.samples_per_pixel);
        (n, p.rmse * n.sqrt())
    };
    // In the order of the tables' colours everywhere; those not shown here keep their place.
    let every = |name: &str| chart.failures.every_number.iter().find(|row| row.table == name);
    let named = chart.failures.many_edges.iter().map(|row| row.table);
    let curves = named
        .map(|name| every(name).map_or_else(|| Series::curve(name, []), |row| curve(row, false, scaled)));
    let axes = ["samples per pixel", "RMSE x root of samples"];
    let numbers = ChartPanel::new("motion, every number of samples", axes, curves.collect())
        .on(Scale::Doublings, Scale::Decades);
    let fence =
        panels(&chart.failures.many_edges, "samples per pixel", true, |p| f64::from(p.samples_per_pixel));
    let fence = fence
        .into_iter()
        .map(|panel| ChartPanel { title: "16 edges in a pixel (fence)".to_owned(), ..panel });
    std::iter::once(numbers).chain(fence).collect()
}

/// The tables of the book's chapter.
pub(super) fn markdown(chart: &SamplingChart) -> String {
    let mut text = String::new();
    let counts: Vec<u32> = chart.rows[0].points.iter().map(|p| p.samples_per_pixel).collect();
    let header: Vec<String> = counts.iter().map(|n| format!("n = {n}")).collect();
    // Writing into a string cannot fail.
    let _ = writeln!(text, "| scene | table | exponent | {} |", header.join(" | "));
    let _ = writeln!(text, "|---|---|---|{}", "---|".repeat(counts.len()));
    for row in chart.rows.iter().chain(&chart.failures.many_edges) {
        let errors: Vec<String> = row.points.iter().map(|p| format!("{:.4}", p.rmse)).collect();
        let exponent = row.exponent.map_or("-".to_owned(), |p| format!("{p:.2}"));
        let _ = writeln!(text, "| {} | `{}` | {exponent} | {} |", row.scene, row.table, errors.join(" | "));
    }
    let _ = writeln!(
        text,
        "\n| table | RMSE at {} samples | correlation of neighbours' errors |",
        chart.failures.shared[0].samples_per_pixel
    );
    let _ = writeln!(text, "|---|---|---|");
    for row in &chart.failures.shared {
        let _ = writeln!(text, "| `{}` | {:.4} | {:.2} |", row.table, row.rmse, row.neighbour_correlation);
    }
    text
}
