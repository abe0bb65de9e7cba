//! The files of the chart.

use super::{Bias, Cost, Row, ShadowsChart};
use output::plot::{Chart, ChartPanel, Look, Picture, Scale, Series};
use output::table::Table;
use output::{Claim, OutDir, OutputError};

/// The files of the chart.
pub fn claim() -> Claim {
    Claim::new("chart shadows")
        .plots(["shadows_error", "shadows_cost", "shadows_failures"])
        .files(["shadows.csv", "shadows.json"])
}

/// Writes pictures and numbers; `shadows.json` comes last.
pub(super) fn write(chart: &ShadowsChart, dir: &OutDir, look: &Look) -> Result<(), OutputError> {
    let [width, height] = chart.effort.size;
    let subject = format!(
        "{width}x{height} pixels, a map of {0}x{0} texels, RMSE in linear light against {1} rays a pixel",
        chart.effort.map_px, chart.reference_samples_per_pixel
    );
    let title = "Soft shadows: error and how alike neighbours err";
    Chart::new(title, &subject, errors(chart)).picture(look).write(dir, "shadows_error")?;
    let title = "Soft shadows: one pass against accumulation";
    Chart::new(title, &subject, costs(chart)).picture(look).write(dir, "shadows_cost")?;
    failures(chart, look).write(dir, "shadows_failures")?;
    dir.write_file("shadows.csv", |out| {
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

fn curve(name: &str, chart: &ShadowsChart, y: impl Fn(&Row) -> f64) -> Series {
    Series::curve(name, chart.rows.iter().map(|row| (f64::from(row.points), y(row))))
}

fn panel(title: &str, up: &str, curves: Vec<Series>) -> ChartPanel {
    ChartPanel::new(title, ["places (u, v, t)", up], curves).on(Scale::Doublings, Scale::Decades)
}

/// So many places on the light, and a run does not warn any more.
const BANDS_BELOW: f64 = 16.0;

fn errors(chart: &ShadowsChart) -> Vec<ChartPanel> {
    let name = "both methods: equal to the bit";
    let over_cost = |method: fn(&Row) -> &Cost, name: &str| {
        Series::curve(name, chart.rows.iter().map(|row| (method(row).madds as f64, row.rmse)))
    };
    let banding = vec![curve(name, chart, |row| row.neighbour_correlation)];
    let costs =
        vec![over_cost(|row| &row.one_pass, "one pass"), over_cost(|row| &row.accumulation, "accumulation")];
    let bands = |panel: ChartPanel| panel.failing(Some(0.0..BANDS_BELOW), "a run warns: shadow-banding");
    vec![
        bands(panel("error", "RMSE", vec![curve(name, chart, |row| row.rmse)])),
        bands(panel("banding", "correlation of neighbours' errors", banding))
            .on(Scale::Doublings, Scale::Even),
        ChartPanel::new("error over cost of the map", ["multiply-adds of all tests", "RMSE"], costs),
    ]
}

fn costs(chart: &ShadowsChart) -> Vec<ChartPanel> {
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

/// Wrong shadows over the bias; a bias of none is at zero.
fn failures(chart: &ShadowsChart, look: &Look) -> Picture {
    let of =
        |share: fn(&Bias) -> f64| chart.biases.iter().map(move |bias| (bias.texels, 100.0 * share(bias)));
    let across = "bias (widths of a texel)";
    let panel = |title: &str, up: &str, curve, failing| {
        ChartPanel::new(title, [across, up], vec![curve])
            .on(Scale::Doublings, Scale::Even)
            .failing(Some(failing), "a run warns")
    };
    let panels = vec![
        panel(
            "too small: acne",
            "lit samples in shadow (%)",
            Series::curve("acne", of(|b| b.acne)),
            0.0..0.5,
        ),
        panel(
            "too large: leak",
            "samples in shadow that are lit (%)",
            Series::curve("leak", of(|b| b.leak)),
            8.0..f64::INFINITY,
        ),
    ];
    let subject = "wrong shadows of a map of 16 places against rays; marked: where a run warns (shadow-bias)";
    Chart::new("Where shadow maps fail: the bias", subject, panels).picture(look)
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
