//! The files of the chart.

use super::{EFFECTS, GlossyChart, Row};
use output::plot::{Chart, ChartPanel, Look, Scale, Series};
use output::table::Table;
use output::{Claim, OutDir, OutputError};

/// The files of the chart.
pub fn claim() -> Claim {
    Claim::new("chart glossy")
        .plots(["glossy_error", "glossy_blur", "glossy_failures"])
        .files(["glossy.csv", "glossy.json"])
}

/// Writes pictures and numbers; `glossy.json` comes last.
pub(super) fn write(chart: &GlossyChart, dir: &OutDir, look: &Look) -> Result<(), OutputError> {
    let subject = format!(
        "RMSE in linear light against {} rays a texel, a map of {} rows",
        256 * chart.effort.reference_tables,
        chart.effort.texels
    );
    let picture = |title: &str, panels| Chart::new(title, &subject, panels).picture(look);
    picture("Glossy maps: error and cost", rows(chart)).write(dir, "glossy_error")?;
    let subject = "the width on the plane of the blur of an edge at some height, in a map of 64 rows; below a texel blurs are not resolved";
    let title = "Glossy maps: contact hardens";
    Chart::new(title, subject, vec![blurs(chart)]).picture(look).write(dir, "glossy_blur")?;
    picture("Where glossy maps fail: a lens wider than the receiver", vec![wides(chart)])
        .write(dir, "glossy_failures")?;
    dir.write_file("glossy.csv", |out| {
        let mut table = csv::Writer::from_writer(out);
        chart.rows.iter().try_for_each(|row| table.serialize(row))?;
        Ok(table.flush()?)
    })?;
    dir.write_json("glossy.json", chart)?;
    Ok(())
}

/// The radius, over half of the receiver's shorter side, from which on a run warns.
const WARNED: f64 = 1.0;

/// For each effect the error over samples and over cost.
fn rows(chart: &GlossyChart) -> Vec<ChartPanel> {
    let both = |effect: &'static str, of: fn(&Row) -> [(f64, f64); 2]| {
        let of_effect = move || chart.rows.iter().filter(move |row| row.effect == effect);
        vec![
            Series::curve("one pass", of_effect().map(|row| of(row)[0])),
            Series::curve("accumulation", of_effect().map(|row| of(row)[1])),
        ]
    };
    let samples: fn(&Row) -> [(f64, f64); 2] = |row| {
        let n = f64::from(row.samples);
        [(n, row.rmse), (n, row.accumulated_rmse)]
    };
    let tests: fn(&Row) -> [(f64, f64); 2] = |row| {
        let [one, many] = [row.samples_tested, row.accumulated_samples_tested].map(|tests| tests as f64);
        [(one, row.rmse), (many, row.accumulated_rmse)]
    };
    EFFECTS
        .iter()
        .flat_map(|&(effect, _)| {
            [
                ChartPanel::new(effect, ["samples a texel", "RMSE"], both(effect, samples))
                    .on(Scale::Doublings, Scale::Decades),
                ChartPanel::new(
                    &format!("{effect}, over cost"),
                    ["samples tested", "RMSE"],
                    both(effect, tests),
                ),
            ]
        })
        .collect()
}

fn blurs(chart: &GlossyChart) -> ChartPanel {
    let found = Series::curve("found in the map", chart.blurs.iter().map(|blur| (blur.height, blur.width)));
    let expected =
        Series::curve("2 R h / (d + h)", chart.blurs.iter().map(|blur| (blur.height, blur.expected)));
    let axes = ["height over the plane (scene units)", "width on the plane (scene units)"];
    ChartPanel::new("blur of an edge", axes, vec![found, expected])
        .failing(Some(0.0..thinnest(chart)), "thinner than a texel")
}

/// The lowest height at which the blur of the chart is found within a tenth, less a little.
fn thinnest(chart: &GlossyChart) -> f64 {
    let found = |blur: &&super::Blur| (blur.width / blur.expected - 1.0).abs() < 0.1;
    chart.blurs.iter().find(found).map_or(0.0, |blur| 0.8 * blur.height)
}

fn wides(chart: &GlossyChart) -> ChartPanel {
    let of =
        |error: fn(&super::Wide) -> f64| chart.wides.iter().map(move |wide| (wide.over_half, error(wide)));
    let noise = Series::curve("noise of 16 samples", of(|wide| wide.rmse_of_samples));
    let lobe = Series::curve("lens against a cone that is the same everywhere", of(|wide| wide.rmse_of_lobe));
    ChartPanel::new(
        "error",
        ["radius of the lens over half of the receiver's shorter side", "RMSE"],
        vec![noise, lobe],
    )
    .failing(Some(WARNED..f64::INFINITY), "a run warns: lens-wider-than-receiver")
}

impl GlossyChart {
    /// What is printed.
    pub fn text(&self) -> String {
        let mut table = Table::new([
            "effect",
            "samples",
            "RMSE",
            "(accumulated)",
            "vertices",
            "(accumulated)",
            "host s",
            "(accumulated)",
        ]);
        for row in &self.rows {
            table.row([
                row.effect.to_owned(),
                row.samples.to_string(),
                format!("{:.5}", row.rmse),
                format!("{:.5}", row.accumulated_rmse),
                row.vertices.to_string(),
                row.accumulated_vertices.to_string(),
                format!("{:.3}", row.host_s),
                format!("{:.3}", row.accumulated_host_s),
            ]);
        }
        let mut blurs = Table::new(["height", "blur", "expected"]);
        for blur in &self.blurs {
            blurs.row([
                blur.height.to_string(),
                format!("{:.4}", blur.width),
                format!("{:.4}", blur.expected),
            ]);
        }
        let mut wides =
            Table::new(["lens over half of the receiver", "RMSE of 16 samples", "RMSE of the lobe"]);
        for wide in &self.wides {
            let [noise, lobe] = [wide.rmse_of_samples, wide.rmse_of_lobe].map(|rmse| format!("{rmse:.4}"));
            wides.row([wide.over_half.to_string(), noise, lobe]);
        }
        format!("{table}\n{blurs}\n{wides}")
    }
}
