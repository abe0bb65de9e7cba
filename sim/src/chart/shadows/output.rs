//! The files of the chart.

use super::{Cost, Row, ShadowsChart};
use crate::output::plot::{Curve, CurvePanel, Curves, Sweep, SweepCurve, SweepPanel};
use crate::output::table::Table;
use crate::output::{OutDir, OutputError};

/// Writes pictures and numbers; `shadows.json` comes last.
pub(super) fn write(chart: &ShadowsChart, dir: &OutDir) -> Result<(), OutputError> {
    let [width, height] = chart.effort.size;
    let subject = format!(
        "{width}x{height} pixels, a map of {0}x{0} texels, RMSE in linear light against {1} rays a pixel",
        chart.effort.map_px, chart.reference_samples_per_pixel
    );
    let title = "Soft shadows: error and how alike neighbours err";
    Curves { title, subject: &subject, panels: errors(chart) }.picture().write(dir, "shadows_error")?;
    let title = "Soft shadows: one pass against accumulation";
    Curves { title, subject: &subject, panels: costs(chart) }.picture().write(dir, "shadows_cost")?;
    failures(chart, &subject).write(dir, "shadows_failures")?;
    dir.write_atomic("shadows.csv", |out| {
        let mut table = csv::WriterBuilder::new().has_headers(false).from_writer(out);
        table.write_record([
            "points",
            "rmse",
            "neighbour_correlation",
            "equal",
            "method",
            "passes",
            "vertices",
            "tiles",
            "samples_tested",
            "madds",
            "dram_bytes",
            "host_s",
        ])?;
        for row in &chart.rows {
            for (method, cost) in [("one pass", &row.one_pass), ("accumulation", &row.accumulation)] {
                table.serialize((
                    row.points,
                    row.rmse,
                    row.neighbour_correlation,
                    row.equal,
                    method,
                    cost,
                ))?;
            }
        }
        Ok(table.flush()?)
    })?;
    dir.write_json("shadows.json", chart)?;
    Ok(())
}

fn curve(name: &str, chart: &ShadowsChart, y: impl Fn(&Row) -> f64) -> Curve {
    let points = chart.rows.iter().map(|row| (f64::from(row.points), y(row))).collect();
    Curve { name: name.to_owned(), note: String::new(), points }
}

fn panel(title: &str, up: &str, curves: Vec<Curve>) -> CurvePanel {
    let across = "places (u, v, t)".to_owned();
    CurvePanel { title: title.to_owned(), across, up: up.to_owned(), doubling: true, curves }
}

fn errors(chart: &ShadowsChart) -> Vec<CurvePanel> {
    let name = "both methods";
    let over_time = |method: fn(&Row) -> &Cost, name: &str| Curve {
        name: name.to_owned(),
        note: String::new(),
        points: chart.rows.iter().map(|row| (method(row).host_s, row.rmse)).collect(),
    };
    vec![
        panel("error (bands below 16)", "RMSE", vec![curve(name, chart, |row| row.rmse)]),
        panel(
            "banding",
            "correlation of neighbours' errors",
            vec![curve(name, chart, |row| row.neighbour_correlation)],
        ),
        CurvePanel {
            title: "error over host time of the map".to_owned(),
            across: "host seconds".to_owned(),
            up: "RMSE".to_owned(),
            doubling: false,
            curves: vec![
                over_time(|row| &row.one_pass, "one pass"),
                over_time(|row| &row.accumulation, "accumulation"),
            ],
        },
    ]
}

fn costs(chart: &ShadowsChart) -> Vec<CurvePanel> {
    let both = |of: fn(&Cost) -> f64| {
        vec![
            curve("one pass", chart, |row| of(&row.one_pass)),
            curve("accumulation", chart, |row| of(&row.accumulation)),
        ]
    };
    vec![
        panel("vertex shader runs", "runs", both(|cost| cost.vertices as f64)),
        panel("multiply-adds of all tests", "multiply-adds", both(|cost| cost.madds as f64)),
        panel("memory", "bytes", both(|cost| cost.dram_bytes as f64)),
        panel("host", "seconds", both(|cost| cost.host_s)),
    ]
}

fn failures(chart: &ShadowsChart, subject: &str) -> crate::output::plot::Picture {
    let values: Vec<String> = chart.biases.iter().map(|bias| bias.texels.to_string()).collect();
    let share =
        |of: fn(&super::Bias) -> f64| chart.biases.iter().map(|bias| Some(100.0 * of(bias))).collect();
    let panels = vec![
        SweepPanel {
            name: "lit samples in shadow, %",
            log: false,
            series: vec![SweepCurve { name: "acne", points: share(|bias| bias.acne) }],
        },
        SweepPanel {
            name: "samples in shadow that are lit, %",
            log: false,
            series: vec![SweepCurve { name: "leak", points: share(|bias| bias.leak) }],
        },
    ];
    let title = "Where shadow maps fail: the bias";
    Sweep { title, subject, x: "bias in widths of a texel", values: &values, panels }.picture()
}

impl ShadowsChart {
    /// What is printed.
    pub fn text(&self) -> String {
        let mut table = Table::new([
            "places",
            "RMSE",
            "neighbours",
            "equal",
            "vertices",
            "(accumulated)",
            "madds",
            "(accumulated)",
            "host s",
            "(accumulated)",
        ]);
        for row in &self.rows {
            let (one, many) = (&row.one_pass, &row.accumulation);
            table.row([
                row.points.to_string(),
                format!("{:.5}", row.rmse),
                format!("{:.2}", row.neighbour_correlation),
                if row.equal { "yes" } else { "NO" }.to_owned(),
                one.vertices.to_string(),
                many.vertices.to_string(),
                one.madds.to_string(),
                many.madds.to_string(),
                format!("{:.3}", one.host_s),
                format!("{:.3}", many.host_s),
            ]);
        }
        let mut biases = Table::new(["bias, texels", "acne %", "leak %"]);
        for bias in &self.biases {
            let percent = |share: f64| format!("{:.2}", 100.0 * share);
            biases.row([bias.texels.to_string(), percent(bias.acne), percent(bias.leak)]);
        }
        format!("{table}\n{biases}")
    }
}
