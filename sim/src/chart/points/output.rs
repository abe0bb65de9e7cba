//! The files of the chart.

use std::fmt::Write;

use super::{PointsChart, Row};
use crate::output::plot::{Curve, CurvePanel, Curves};
use crate::output::table::Table;
use crate::output::{OutDir, OutputError};

/// What an earlier chart left: should this one die on the way, nothing old may stand in for it.
pub(super) fn remove_stale(dir: &OutDir) -> Result<(), OutputError> {
    dir.remove_stale("", "points", &["svg", "png", "csv", "json", "md"])
}

/// Writes pictures and numbers; `points.json` comes last.
pub(super) fn write(chart: &PointsChart, dir: &OutDir) -> Result<(), OutputError> {
    let [plane, space] = chart.effort.radius;
    let subject = format!("torus, r {plane} in the plane and {space} in space; CPU time of one thread");
    let picture = |title, panels| Curves { title, subject: &subject, panels }.picture();
    picture("Largest hole and free share over speed", quality(chart)).write(dir, "points_quality")?;
    picture("Power over frequency, all directions", spectra(chart)).write(dir, "points_spectra")?;
    picture("Where points fail", failures(chart)).write(dir, "points_failures")?;
    dir.write_atomic("points.csv", |out| {
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
    dir.write_atomic("points.md", |out| Ok(out.write_all(markdown(chart).as_bytes())?))?;
    dir.write_json("points.json", chart)?;
    Ok(())
}

/// Rows of a dimension, a method's beside each other.
fn by_method(chart: &PointsChart, dimensions: usize) -> impl Iterator<Item = &[Row]> {
    let same = |a: &Row, b: &Row| (a.dimensions, a.method) == (b.dimensions, b.method);
    chart.rows.chunk_by(same).filter(move |rows| rows[0].dimensions == dimensions)
}

fn quality(chart: &PointsChart) -> Vec<CurvePanel> {
    let panel = |dimensions, up: &str, of: fn(&Row) -> f64| CurvePanel {
        title: format!("{up} in {dimensions}D"),
        across: "points a second".to_owned(),
        up: up.to_owned(),
        doubling: false,
        curves: by_method(chart, dimensions)
            .map(|rows| Curve {
                name: rows[0].method.to_owned(),
                note: String::new(),
                points: rows.iter().map(|row| (row.points_per_s, of(row))).collect(),
            })
            .collect(),
    };
    vec![
        panel(2, "largest hole over r", |row| row.hole_over_r),
        panel(3, "largest hole over r", |row| row.hole_over_r),
        panel(2, "free share (none: not shown)", |row| row.free_share),
    ]
}

fn spectra(chart: &PointsChart) -> Vec<CurvePanel> {
    let panel = |dimensions| CurvePanel {
        title: format!("{dimensions}D"),
        across: "frequency over rate of points".to_owned(),
        up: "power".to_owned(),
        doubling: false,
        curves: by_method(chart, dimensions)
            .filter_map(<[Row]>::last)
            .map(|row| Curve {
                name: row.method.to_owned(),
                note: format!("peak {:.2}", row.peak.1),
                points: row.spectrum.clone(),
            })
            .collect(),
    };
    vec![panel(2), panel(3)]
}

fn failures(chart: &PointsChart) -> Vec<CurvePanel> {
    let curve =
        |name: &str, points: Vec<(f64, f64)>| Curve { name: name.to_owned(), note: String::new(), points };
    let single =
        |of: fn(&super::Single) -> f64| chart.single.iter().map(|s| (s.radius_in_numbers, of(s))).collect();
    let thin = CurvePanel {
        title: "f32: voids thinner than numbers".to_owned(),
        across: "r in spacings of numbers".to_owned(),
        up: "thin voids a point; hole beyond r, spacings".to_owned(),
        doubling: false,
        curves: vec![
            curve("voids", single(|s| s.thin_voids as f64 / s.points as f64)),
            curve("beyond", single(|s| s.beyond_in_numbers)),
        ],
    };
    let of = |dimensions: usize| {
        let rows = chart.columns.iter().filter(move |c| c.dimensions == dimensions);
        curve(&format!("{dimensions}D"), rows.map(|c| (f64::from(c.across), c.candidates_each)).collect())
    };
    let columns = CurvePanel {
        title: "candidates by columns (bell): 1D to 4D from below".to_owned(),
        across: "columns along an axis".to_owned(),
        up: "candidates for a point".to_owned(),
        doubling: true,
        curves: (1..=4).map(of).collect(),
    };
    vec![thin, columns]
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
    text += "\n| f32: r in spacings | points | thin voids | hole beyond r, spacings |\n|---|---|---|---|\n";
    for s in &chart.single {
        let _ = writeln!(
            text,
            "| {:.0} | {} | {} | {:.3} |",
            s.radius_in_numbers, s.points, s.thin_voids, s.beyond_in_numbers
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
        table.to_string()
    }
}
