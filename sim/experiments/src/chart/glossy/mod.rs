//! `quintile chart glossy`: glossy reflection and refraction on a planar receiver.
//!
//! Error is the root of the mean squared difference of the map to brute force by rays, over all texels and channels in linear light.
//! Beside one pass stands accumulation, whose samples all texels share.

mod measure;

use serde::Serialize;
use workloads::glossy::Effect;

use crate::study::table::{Sheet, Table, fixed, plain};
use crate::study::tradeoff::{Metric, TradeoffPoint};
use crate::study::{Gallery, Study, StudyError};
use output::OutputError;
use output::plot::{ChartPanel, Scale, Series};
use output::progress::Progress;

pub use measure::{Bench, Blur, Row, Wide};

/// How much is measured.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Effort {
    /// Rows of texels of the map.
    pub texels: u32,
    /// Samples per texel go from 1 to this, doubling.
    pub most_samples: u32,
    /// Sample tables of 256 samples per texel that make up the reference.
    pub reference_tables: u32,
}

/// Radius of the lens where it does not vary, scene units.
pub const ROUGHNESS: f64 = 0.25;
/// Both effects, each with its name.
pub const EFFECTS: [(&str, Effect); 2] =
    [("reflection", Effect::Reflection), ("refraction", Effect::Refraction(1.33))];

/// Everything the chart found.
#[derive(Clone, Debug, Serialize)]
pub struct GlossyChart {
    /// How much was measured.
    pub effort: Effort,
    /// By effect and samples.
    pub rows: Vec<Row>,
    /// Contact hardening: blur by height.
    pub blurs: Vec<Blur>,
    /// Where it does not work: a lens as wide as the receiver, and wider.
    pub wides: Vec<Wide>,
}

impl Study for GlossyChart {
    const NAME: &'static str = "glossy";
    const ABOUT: &'static str =
        "Glossy reflection and refraction: error over samples, contact hardening, lenses too wide";
    const PICTURES: &'static [&'static str] = &["glossy_error", "glossy_blur", "glossy_failures"];
    const FILES: &'static [&'static str] = &["glossy.csv", "glossy.json"];

    type Effort = Effort;
    /// A reference of 4096 samples.
    const FULL: Effort = Effort { texels: 32, most_samples: 256, reference_tables: 16 };
    const QUICK: Effort = Effort { texels: 16, most_samples: 64, reference_tables: 2 };

    fn measure(effort: Effort, _scenes: &[String], progress: &Progress) -> Result<Self, StudyError> {
        let counts: Vec<u32> = (0..=effort.most_samples.ilog2()).map(|power| 1 << power).collect();
        let bar = progress.bar("glossy", (EFFECTS.len() * counts.len() + 2) as u64);
        let mut rows = Vec::new();
        for effect in EFFECTS {
            let bench = Bench::new(effect, effort)?;
            let reference = bench.reference(ROUGHNESS)?;
            for &samples in &counts {
                rows.push(bench.row(samples, &reference)?);
                bar.inc();
            }
        }
        let bench = Bench::new(EFFECTS[0], effort)?;
        let blurs = bench.blurs()?;
        bar.inc();
        let wides = bench.wides()?;
        bar.inc();
        Ok(Self { effort, rows, blurs, wides })
    }

    fn draw(&self, to: &Gallery<'_>) -> Result<(), OutputError> {
        let subject = format!(
            "RMSE in linear light against {} rays a texel, a map of {} rows",
            256 * self.effort.reference_tables,
            self.effort.texels
        );
        to.chart("glossy_error", ["Glossy maps: error and cost", &subject], self.errors())?;
        let heights = "the width on the plane of the blur of an edge at some height, in a map of 64 rows; below a texel blurs are not resolved";
        to.chart("glossy_blur", ["Glossy maps: contact hardens", heights], vec![self.contact()])?;
        let title = "Where glossy maps fail: a lens wider than the receiver";
        to.chart("glossy_failures", [title, &subject], vec![self.failures()])
    }

    fn tables(&self) -> Vec<Sheet> {
        let rows = Table::of(&self.rows)
            .column("effect", "effect", |row| row.effect, plain)
            .column("samples", "samples", |row| row.samples, plain)
            .column("rmse", "RMSE", |row| row.rmse, fixed(5))
            .column("accumulated_rmse", "(accumulated)", |row| row.accumulated_rmse, fixed(5))
            .column("vertices", "vertices", |row| row.vertices, plain)
            .column("accumulated_vertices", "(accumulated)", |row| row.accumulated_vertices, plain)
            .data("samples_tested", |row| row.samples_tested)
            .data("accumulated_samples_tested", |row| row.accumulated_samples_tested)
            .column("host_s", "host s", |row| row.host_s, fixed(3))
            .column("accumulated_host_s", "(accumulated)", |row| row.accumulated_host_s, fixed(3));
        let blurs = Table::of(&self.blurs)
            .shown("height", |blur| blur.height, plain)
            .shown("blur", |blur| blur.width, fixed(4))
            .shown("expected", |blur| blur.expected, fixed(4));
        let wides = Table::of(&self.wides)
            .shown("lens over half of the receiver", |wide| wide.over_half, plain)
            .shown("RMSE of 16 samples", |wide| wide.rmse_of_samples, fixed(4))
            .shown("RMSE of the lobe", |wide| wide.rmse_of_lobe, fixed(4));
        vec![rows.csv("glossy.csv").sheet(), blurs.sheet(), wides.sheet()]
    }

    fn tradeoff(&self) -> Vec<TradeoffPoint> {
        let both = |row: &Row| {
            let level = format!("{} samples a texel", row.samples);
            let point = |method, rmse, host_s| {
                let metrics = [Metric::rmse(rmse), Metric::host_s(host_s)];
                TradeoffPoint::new(format!("glossy {}", row.effect), [method, &level], metrics)
            };
            [
                point("one pass", row.rmse, row.host_s),
                point("accumulation", row.accumulated_rmse, row.accumulated_host_s),
            ]
        };
        self.rows.iter().flat_map(both).collect()
    }
}

/// The radius, over half of the receiver's shorter side, from which on a run warns.
const WARNED: f64 = 1.0;

impl GlossyChart {
    /// For each effect the error over samples and over cost.
    fn errors(&self) -> Vec<ChartPanel> {
        let both = |effect: &'static str, of: fn(&Row) -> [(f64, f64); 2]| {
            let of_effect = move || self.rows.iter().filter(move |row| row.effect == effect);
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
        let panels = EFFECTS.iter().flat_map(|&(effect, _)| {
            let over_cost = format!("{effect}, over cost");
            [
                ChartPanel::new(effect, ["samples a texel", "RMSE"], both(effect, samples))
                    .on(Scale::Doublings, Scale::Decades),
                ChartPanel::new(&over_cost, ["samples tested", "RMSE"], both(effect, tests)),
            ]
        });
        panels.collect()
    }

    /// Contact hardening.
    fn contact(&self) -> ChartPanel {
        let of = |width: fn(&Blur) -> f64| self.blurs.iter().map(move |blur| (blur.height, width(blur)));
        let found = Series::curve("found in the map", of(|blur| blur.width));
        let expected = Series::curve("2 R h / (d + h)", of(|blur| blur.expected));
        let axes = ["height over the plane (scene units)", "width on the plane (scene units)"];
        ChartPanel::new("blur of an edge", axes, vec![found, expected])
            .failing(Some(0.0..self.thinnest()), "thinner than a texel")
    }

    /// The lowest height at which the blur of the chart is found within a tenth, less a little.
    fn thinnest(&self) -> f64 {
        let found = |blur: &&Blur| (blur.width / blur.expected - 1.0).abs() < 0.1;
        self.blurs.iter().find(found).map_or(0.0, |blur| 0.8 * blur.height)
    }

    /// Lenses that are too wide.
    fn failures(&self) -> ChartPanel {
        let of = |error: fn(&Wide) -> f64| self.wides.iter().map(move |wide| (wide.over_half, error(wide)));
        let noise = Series::curve("noise of 16 samples", of(|wide| wide.rmse_of_samples));
        let lobe =
            Series::curve("lens against a cone that is the same everywhere", of(|wide| wide.rmse_of_lobe));
        let axes = ["radius of the lens over half of the receiver's shorter side", "RMSE"];
        ChartPanel::new("error", axes, vec![noise, lobe])
            .failing(Some(WARNED..f64::INFINITY), "a run warns: lens-wider-than-receiver")
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::study::written;

    #[test]
    fn more_samples_err_less_contact_hardens_and_wide_lenses_fail() {
        let least = Effort { texels: 10, most_samples: 16, reference_tables: 1 };
        let (_folder, chart, _) = written::<GlossyChart>(least);
        for rows in chart.rows.chunks_exact(5) {
            assert!(rows[4].rmse < 0.6 * rows[0].rmse, "{rows:?}");
            assert!(rows[4].vertices < rows[4].accumulated_vertices);
        }
        assert!(chart.blurs.windows(2).all(|pair| pair[0].width < pair[1].width), "{:?}", chart.blurs);
        let (narrow, wide) = (&chart.wides[0], chart.wides.last().unwrap());
        assert!(wide.rmse_of_lobe > 2.0 * narrow.rmse_of_lobe, "{narrow:?} {wide:?}");
    }
}
