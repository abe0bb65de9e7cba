//! `quintile chart shadows`: soft shadows from a five-dimensional shadow map against accumulation buffering.
//!
//! Error is the root of the mean squared difference to an image in which every sample asks the light by rays, over all pixels and
//! channels in linear light. Cost is that of making the map, in one pass and in as many passes as light samples.

mod measure;

use serde::Serialize;

use crate::study::table::{Sheet, Table, fixed, plain};
use crate::study::tradeoff::{Metric, TradeoffPoint};
use crate::study::{Gallery, Study, StudyError};
use output::OutputError;
use output::plot::{ChartPanel, Scale, Series};
use output::progress::Progress;

pub use measure::{Bias, Cost, Row};

/// How much is measured.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Effort {
    /// Pixels of the image, across and down.
    pub size: [u32; 2],
    /// Texels of the map across and down.
    pub map_px: u32,
    /// Places `(u, v, t)` go from 1 to this, doubling.
    pub most_points: u32,
    /// Sample tables of 256 samples per pixel that make up the reference.
    pub reference_tables: u32,
    /// Depth bias, scene units.
    pub bias: f64,
}

/// Everything the chart found.
#[derive(Clone, Debug, Serialize)]
pub struct ShadowsChart {
    /// How much was measured.
    pub effort: Effort,
    /// Samples per pixel of the reference.
    pub reference_samples_per_pixel: u32,
    /// By light samples, from few to many.
    pub rows: Vec<Row>,
    /// Where it does not work: too small and too large a bias, by its size.
    pub biases: Vec<Bias>,
}

impl Study for ShadowsChart {
    const NAME: &'static str = "shadows";
    const ABOUT: &'static str =
        "Soft shadows: error over light samples, one pass against accumulation, and the bias";
    const PICTURES: &'static [&'static str] = &["shadows_error", "shadows_cost", "shadows_failures"];
    const FILES: &'static [&'static str] = &["shadows.csv", "shadows.json"];

    type Effort = Effort;
    const FULL: Effort =
        Effort { size: [96, 54], map_px: 256, most_points: 256, reference_tables: 4, bias: 0.06 };
    const QUICK: Effort =
        Effort { size: [48, 27], map_px: 128, most_points: 64, reference_tables: 1, bias: 0.1 };

    fn measure(effort: Effort, _scenes: &[String], progress: &Progress) -> Result<Self, StudyError> {
        let counts: Vec<u32> = (0..=effort.most_points.ilog2()).map(|power| 1 << power).collect();
        let bar = progress.bar("shadows", counts.len() as u64 + 2);
        let stage = measure::Stage::new(&effort)?;
        stage.with(|world| {
            let reference = world.reference()?;
            bar.inc();
            let row = |&points: &u32| {
                let row = world.row(points, &reference);
                bar.inc();
                row
            };
            let rows = counts.iter().map(row).collect::<Result<_, _>>()?;
            let biases = world.biases()?;
            bar.inc();
            let reference_samples_per_pixel = 256 * effort.reference_tables;
            Ok(Self { effort, reference_samples_per_pixel, rows, biases })
        })
    }

    fn draw(&self, to: &Gallery<'_>) -> Result<(), OutputError> {
        let [width, height] = self.effort.size;
        let subject = format!(
            "{width}x{height} pixels, a map of {0}x{0} texels, RMSE in linear light against {1} rays a pixel",
            self.effort.map_px, self.reference_samples_per_pixel
        );
        let title = "Soft shadows: error and how alike neighbours err";
        to.chart("shadows_error", [title, &subject], self.errors())?;
        let title = "Soft shadows: one pass against accumulation";
        to.chart("shadows_cost", [title, &subject], self.costs())?;
        let subject =
            "wrong shadows of a map of 16 places against rays; marked: where a run warns (shadow-bias)";
        to.chart("shadows_failures", ["Where shadow maps fail: the bias", subject], self.failures())
    }

    fn tables(&self) -> Vec<Sheet> {
        let rows = Table::of(&self.rows)
            .shown("places", |row| row.points, plain)
            .shown("RMSE", |row| row.rmse, fixed(5))
            .shown("neighbours", |row| row.neighbour_correlation, fixed(2))
            .shown("equal", |row| if row.equal { "yes" } else { "NO" }, plain)
            .shown("vertices", |row| row.one_pass.vertices, plain)
            .shown("(accumulated)", |row| row.accumulation.vertices, plain)
            .shown("madds", |row| row.one_pass.madds, plain)
            .shown("(accumulated)", |row| row.accumulation.madds, plain)
            .shown("host s", |row| row.one_pass.host_s, fixed(3))
            .shown("(accumulated)", |row| row.accumulation.host_s, fixed(3));
        let biases = Table::of(&self.biases)
            .shown("bias, texels", |bias| bias.texels, plain)
            .shown("acne %", |bias| 100.0 * bias.acne, fixed(2))
            .shown("leak %", |bias| 100.0 * bias.leak, fixed(2));
        let by_method = Table::of(self.rows.iter().flat_map(methods))
            .data("points", |(row, ..)| row.points)
            .data("rmse", |(row, ..)| row.rmse)
            .data("neighbour_correlation", |(row, ..)| row.neighbour_correlation)
            .data("equal", |(row, ..)| row.equal)
            .data("method", |(_, method, _)| *method)
            .data("passes", |(.., cost)| cost.passes)
            .data("vertices", |(.., cost)| cost.vertices)
            .data("tiles", |(.., cost)| cost.tiles)
            .data("samples_tested", |(.., cost)| cost.samples_tested)
            .data("madds", |(.., cost)| cost.madds)
            .data("dram_bytes", |(.., cost)| cost.dram_bytes)
            .data("host_s", |(.., cost)| cost.host_s)
            .csv("shadows.csv");
        vec![rows.sheet(), biases.sheet(), by_method.sheet()]
    }

    fn tradeoff(&self) -> Vec<TradeoffPoint> {
        let point = |(row, method, cost): (&Row, &str, &Cost)| {
            let level = format!("{} light samples", row.points);
            let host_s = Metric::host_s(cost.host_s).beside(row.accumulation.host_s);
            TradeoffPoint::new("soft shadows", [method, &level], [Metric::rmse(row.rmse), host_s])
        };
        self.rows.iter().flat_map(methods).map(point).collect()
    }

    fn fault(&self) -> Option<String> {
        (!self.is_equal()).then(|| "one pass and accumulation differ; please report it".to_owned())
    }
}

/// Both ways to make a map, with what they cost.
fn methods(row: &Row) -> [(&Row, &'static str, &Cost); 2] {
    [(row, "one pass", &row.one_pass), (row, "accumulation", &row.accumulation)]
}

/// Light samples from which on a run does not warn.
const BANDS_BELOW: f64 = 16.0;

fn panel(title: &str, up: &str, curves: Vec<Series>) -> ChartPanel {
    ChartPanel::new(title, ["places (u, v, t)", up], curves).on(Scale::Doublings, Scale::Decades)
}

impl ShadowsChart {
    /// Whether the map of one pass was that of accumulation to the bit, everywhere.
    pub fn is_equal(&self) -> bool {
        self.rows.iter().all(|row| row.equal)
    }

    fn curve(&self, name: &str, y: impl Fn(&Row) -> f64) -> Series {
        Series::curve(name, self.rows.iter().map(|row| (f64::from(row.points), y(row))))
    }

    fn errors(&self) -> Vec<ChartPanel> {
        let name = "both methods: equal to the bit";
        let over_cost = |method: fn(&Row) -> &Cost, name: &str| {
            Series::curve(name, self.rows.iter().map(|row| (method(row).madds as f64, row.rmse)))
        };
        let banding = vec![self.curve(name, |row| row.neighbour_correlation)];
        let costs = vec![
            over_cost(|row| &row.one_pass, "one pass"),
            over_cost(|row| &row.accumulation, "accumulation"),
        ];
        let bands = |panel: ChartPanel| panel.failing(Some(0.0..BANDS_BELOW), "a run warns: shadow-banding");
        vec![
            bands(panel("error", "RMSE", vec![self.curve(name, |row| row.rmse)])),
            bands(panel("banding", "correlation of neighbours' errors", banding))
                .on(Scale::Doublings, Scale::Even),
            ChartPanel::new("error over cost of the map", ["multiply-adds of all tests", "RMSE"], costs),
        ]
    }

    fn costs(&self) -> Vec<ChartPanel> {
        let both = |of: fn(&Cost) -> f64| {
            vec![
                self.curve("one pass", |row| of(&row.one_pass)),
                self.curve("accumulation", |row| of(&row.accumulation)),
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
    fn failures(&self) -> Vec<ChartPanel> {
        let panel = |[title, up, name]: [&str; 3], share: fn(&Bias) -> f64, failing| {
            let points = self.biases.iter().map(|bias| (bias.texels, 100.0 * share(bias)));
            ChartPanel::new(title, ["bias (widths of a texel)", up], vec![Series::curve(name, points)])
                .on(Scale::Doublings, Scale::Even)
                .failing(Some(failing), "a run warns")
        };
        let acne = ["too small: acne", "lit samples in shadow (%)", "acne"];
        let leak = ["too large: leak", "samples in shadow that are lit (%)", "leak"];
        vec![panel(acne, |b| b.acne, 0.0..0.5), panel(leak, |b| b.leak, 8.0..f64::INFINITY)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::study::written;

    #[test]
    fn more_places_err_less_one_pass_costs_less_and_is_equal() {
        let least = Effort { size: [32, 18], map_px: 64, most_points: 16, reference_tables: 1, bias: 0.2 };
        let (_folder, chart, _) = written::<ShadowsChart>(least);
        assert!(chart.is_equal());
        let (first, last) = (&chart.rows[0], chart.rows.last().unwrap());
        assert!(last.rmse < 0.6 * first.rmse, "{} {}", first.rmse, last.rmse);
        assert!(last.one_pass.vertices * 16 == last.accumulation.vertices);
        assert!(last.one_pass.dram_bytes <= last.accumulation.dram_bytes);
        let (least, most) = (&chart.biases[0], chart.biases.last().unwrap());
        assert!(least.acne > 0.05 && most.acne < 0.01, "{} {}", least.acne, most.acne);
        assert!(most.leak > 0.2 && least.leak < most.leak, "{} {}", least.leak, most.leak);
    }
}
