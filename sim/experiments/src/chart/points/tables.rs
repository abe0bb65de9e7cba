//! The files of the chart.

use std::fmt::Write;

use workloads::points::THIN;

use super::{Coarse, PointsChart, Row};
use output::plot::{Chart, ChartPanel, Look, Scale, Series};
use output::table::Table;
use output::{Claim, OutDir, OutputError};

/// The files of the chart.
pub fn claim() -> Claim {
    Claim::new("chart points").plots(["points_quality", "points_spectra", "points_failures"]).files([
        "points.csv",
        "points.md",
        "points.json",
    ])
}

/// Writes pictures and numbers; `points.json` comes last.
pub(super) fn write(chart: &PointsChart, dir: &OutDir, look: &Look) -> Result<(), OutputError> {
    let [plane, space] = chart.effort.radius;
    let subject = format!("torus, r {plane} in the plane and {space} in space; CPU time of one thread");
    let picture = |title, panels| Chart::new(title, &subject, panels).picture(look);
    picture("Largest hole and free share over speed", quality(chart)).write(dir, "points_quality")?;
    picture("Power over frequency, all directions", spectra(chart)).write(dir, "points_spectra")?;
    let (title, subject) = (
        "Where points fail",
        "points of the plane that keep their distance, on coarser and coarser numbers (marked: points-thin-voids), and candidates for points that follow a density",
    );
    Chart::new(title, subject, failures(chart)).picture(look).write(dir, "points_failures")?;
    dir.write_file("points.csv", |out| {
        let mut table = csv::Writer::from_writer(out);
        table.write_record([
            "dimensions",
            "method",
            "effort",
            "points",
            "points_per_s",
            "packing_density",
            "closer_pairs",
            "least_over_r",
            "hole_over_r",
            "free_share",
            "low_power",
            "peak_frequency",
            "peak_power",
        ])?;
        for row in &chart.rows {
            let (frequency, power) = row.peak;
            table.serialize((
                (row.dimensions, row.method, row.effort, row.points, row.points_per_s, row.packing_density),
                (row.closer_pairs, row.least_over_r, row.hole_over_r, row.free_share, row.low_power),
                (frequency, power),
            ))?;
        }
        Ok(table.flush()?)
    })?;
    dir.write_file("points.md", |out| Ok(out.write_all(markdown(chart).as_bytes())?))?;
    dir.write_json("points.json", chart)?;
    Ok(())
}

/// Rows of a dimension, a method's beside each other.
fn by_method(chart: &PointsChart, dimensions: usize) -> impl Iterator<Item = &[Row]> {
    let same = |a: &Row, b: &Row| (a.dimensions, a.method) == (b.dimensions, b.method);
    chart.rows.chunk_by(same).filter(move |rows| rows[0].dimensions == dimensions)
}

fn quality(chart: &PointsChart) -> Vec<ChartPanel> {
    let panel = |dimensions, up: &str, of: fn(&Row) -> f64| {
        let curve = |rows: &[Row]| {
            Series::curve(long_name(rows[0].method), rows.iter().map(|row| (row.points_per_s, of(row))))
        };
        let title = format!("{up}, {dimensions}D");
        ChartPanel::new(&title, ["points a second", up], by_method(chart, dimensions).map(curve).collect())
    };
    vec![
        panel(2, "largest hole over r", |row| row.hole_over_r).on(Scale::Decades, Scale::Even),
        panel(3, "largest hole over r", |row| row.hole_over_r).on(Scale::Decades, Scale::Even),
        panel(2, "share where a point would fit", |row| row.free_share),
        panel(3, "share where a point would fit", |row| row.free_share),
    ]
}

fn long_name(method: &str) -> &str {
    match method {
        "bridson" => "Bridson, more and more candidates",
        "plain" => "plain darts, more and more misses",
        _ => "voids",
    }
}

fn spectra(chart: &PointsChart) -> Vec<ChartPanel> {
    let panel = |dimensions| {
        let last = by_method(chart, dimensions).filter_map(<[Row]>::last);
        let curve = |row: &Row| Series {
            note: format!("peak {:.2}", row.peak.1),
            ..Series::curve(row.method, row.spectrum.iter().copied())
        };
        let title = format!("{dimensions}D");
        ChartPanel::new(&title, ["frequency over rate of points", "power"], last.map(curve).collect())
    };
    vec![panel(2), panel(3)]
}

/// Numbers too coarse for the disks, and columns too few for the density.
fn failures(chart: &PointsChart) -> Vec<ChartPanel> {
    let coarse = |title: &str, up: &str, of: fn(&Coarse) -> f64| {
        let curve = Series::curve("voids, 2D", chart.coarse.iter().map(|c| (c.radius_in_numbers, of(c))));
        let warned = |c: &&Coarse| c.thin_voids as f64 > THIN * c.points as f64;
        let last = chart.coarse.iter().rfind(warned);
        ChartPanel::new(title, ["r in spacings of numbers", up], vec![curve])
            .on(Scale::Doublings, Scale::Decades)
            .failing(last.map(|c| 0.0..c.radius_in_numbers), "a run warns")
    };
    let of = |dimensions: usize| {
        let rows = chart.columns.iter().filter(move |c| c.dimensions == dimensions);
        Series::curve(format!("{dimensions}D"), rows.map(|c| (f64::from(c.across), c.candidates_each)))
    };
    let columns = (1..=4).map(of).collect();
    vec![
        coarse("voids thinner than the spacing of numbers", "voids without a number, a point", |c| {
            c.thin_voids as f64 / c.points as f64
        }),
        coarse("what that costs: holes", "largest hole beyond r, share of r", |c| c.beyond),
        ChartPanel::new(
            "too few columns under a bell",
            ["columns along an axis", "candidates for a point"],
            columns,
        )
        .on(Scale::Doublings, Scale::Decades),
    ]
}

/// The tables of the book's chapter.
fn markdown(chart: &PointsChart) -> String {
    let mut text =
        "| D | method | points | points/s | density | closer | hole / r | free share | low | peak |\n\
        |---|---|---|---|---|---|---|---|---|---|\n"
            .to_owned();
    // Writing into a string cannot fail.
    for row in &chart.rows {
        let _ = writeln!(
            text,
            "| {} | {} | {} | {:.0} | {:.4} | {} | {:.6} | {:.1e} | {:.3} | {:.2} @ {:.2} |",
            row.dimensions,
            name(row),
            row.points,
            row.points_per_s,
            row.packing_density,
            row.closer_pairs,
            row.hole_over_r,
            row.free_share,
            row.low_power,
            row.peak.1,
            row.peak.0
        );
    }
    text += "\n| r in spacings | points | thin voids | hole beyond r, share of r |\n|---|---|---|---|\n";
    for c in &chart.coarse {
        let _ = writeln!(
            text,
            "| {:.0} | {} | {} | {:.1e} |",
            c.radius_in_numbers, c.points, c.thin_voids, c.beyond
        );
    }
    text += "\n| D | columns | candidates a point | p | p, low discrepancy |\n|---|---|---|---|---|\n";
    for c in &chart.columns {
        let _ = writeln!(
            text,
            "| {} | {} | {:.3} | {:.3} | {:.4} |",
            c.dimensions, c.across, c.candidates_each, c.p, c.p_low_discrepancy
        );
    }
    text
}

pub(in crate::chart) fn name(row: &Row) -> String {
    if row.effort == 0 { row.method.to_owned() } else { format!("{} {}", row.method, row.effort) }
}

impl PointsChart {
    /// What is printed.
    pub fn text(&self) -> String {
        let mut table =
            Table::new(["D", "method", "points", "points/s", "density", "hole / r", "free share", "peak"]);
        for row in &self.rows {
            table.row([
                row.dimensions.to_string(),
                name(row),
                row.points.to_string(),
                format!("{:.0}", row.points_per_s),
                format!("{:.4}", row.packing_density),
                format!("{:.5}", row.hole_over_r),
                format!("{:.1e}", row.free_share),
                format!("{:.2}", row.peak.1),
            ]);
        }
        let mut coarse = Table::new(["r in spacings of numbers", "points", "thin voids", "hole beyond r"]);
        for c in &self.coarse {
            coarse.row([
                format!("{:.0}", c.radius_in_numbers),
                c.points.to_string(),
                c.thin_voids.to_string(),
                format!("{:.1e} r", c.beyond),
            ]);
        }
        format!("{table}\n{coarse}")
    }
}
