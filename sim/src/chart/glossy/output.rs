//! The files of the chart.

use super::{EFFECTS, GlossyChart, Row};
use crate::output::plot::{Curve, CurvePanel, Curves};
use crate::output::table::Table;
use crate::output::{OutDir, OutputError};

/// Writes pictures and numbers; `glossy.json` comes last.
pub(super) fn write(chart: &GlossyChart, dir: &OutDir) -> Result<(), OutputError> {
    let subject = format!(
        "RMSE in linear light against {} rays a texel, a map of {} rows",
        256 * chart.effort.reference_tables,
        chart.effort.texels
    );
    let picture = |title: &str, panels| Curves { title, subject: &subject, panels }.picture();
    picture("Glossy maps: error and cost", rows(chart)).write(dir, "glossy_error")?;
    picture("Contact hardens", vec![blurs(chart)]).write(dir, "glossy_blur")?;
    picture("Where the lens fails: wider than the receiver", vec![wides(chart)])
        .write(dir, "glossy_failures")?;
    dir.write_atomic("glossy.csv", |out| {
        let mut table = csv::Writer::from_writer(out);
        chart.rows.iter().try_for_each(|row| table.serialize(row))?;
        Ok(table.flush()?)
    })?;
    dir.write_json("glossy.json", chart)?;
    Ok(())
}

fn curve(name: &str, points: impl Iterator<Item = (f64, f64)>) -> Curve {
    Curve { name: name.to_owned(), note: String::new(), points: points.collect() }
}

fn panel(title: &str, [across, up]: [&str; 2], doubling: bool, curves: Vec<Curve>) -> CurvePanel {
    let [title, across, up] = [title, across, up].map(str::to_owned);
    CurvePanel { title, across, up, doubling, curves }
}

/// For each effect the error over samples and over host time, and vertices.
fn rows(chart: &GlossyChart) -> Vec<CurvePanel> {
    let both = |effect: &'static str, of: fn(&Row) -> [(f64, f64); 2]| {
        let of_effect = move || chart.rows.iter().filter(move |row| row.effect == effect);
        vec![
            curve("one pass", of_effect().map(|row| of(row)[0])),
            curve("accumulation", of_effect().map(|row| of(row)[1])),
        ]
    };
    let samples: fn(&Row) -> [(f64, f64); 2] = |row| {
        let n = f64::from(row.samples);
        [(n, row.rmse), (n, row.accumulated_rmse)]
    };
    let time: fn(&Row) -> [(f64, f64); 2] =
        |row| [(row.host_s, row.rmse), (row.accumulated_host_s, row.accumulated_rmse)];
    EFFECTS
        .iter()
        .flat_map(|&(effect, _)| {
            [
                panel(effect, ["samples a texel", "RMSE"], true, both(effect, samples)),
                panel(&format!("{effect}, host time"), ["seconds", "RMSE"], false, both(effect, time)),
            ]
        })
        .collect()
}

fn blurs(chart: &GlossyChart) -> CurvePanel {
    let found = curve("found in the map", chart.blurs.iter().map(|blur| (blur.height, blur.width)));
    let expected = curve("2 R h / (d + h)", chart.blurs.iter().map(|blur| (blur.height, blur.expected)));
    panel("blur of an edge", ["height over the plane", "width on the plane"], false, vec![found, expected])
}

fn wides(chart: &GlossyChart) -> CurvePanel {
    let noise =
        curve("noise of 16 samples", chart.wides.iter().map(|wide| (wide.over_half, wide.rmse_of_samples)));
    let lobe = curve(
        "lens against a cone that is the same everywhere",
        chart.wides.iter().map(|wide| (wide.over_half, wide.rmse_of_lobe)),
    );
    panel("error", ["lens radius over half of the receiver", "RMSE"], false, vec![noise, lobe])
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
