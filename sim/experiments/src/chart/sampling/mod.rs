//! `quintile chart sampling`: image error against cost, for every sample table.
//!
//! Error is the root of the mean squared difference to a reference of [`SamplingEffort::reference`] samples
//! per pixel, over all pixels and the three channels, in linear light. Host time is that of one frame through
//! the pipeline, caches and all; the table is made before.

mod measure;

use glam::Vec3;
use output::OutputError;
use output::plot::{ChartPanel, Scale, Series};
use output::terminal::Progress;
use serde::Serialize;

use super::exponent;
use crate::study::table::{Sheet, TableBuilder, fixed, optional, plain};
use crate::study::tradeoff::{Metric, TradeoffPoint};
use crate::study::{Gallery, Study, StudyError};

pub use measure::{Failures, SamplingPoint, Shared};

/// Effort of the measurement.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct SamplingEffort {
    /// The built-in scene, and its frame.
    pub scene: (&'static str, u32),
    /// Pixels of each image, across and down.
    pub size: [u32; 2],
    /// Samples per pixel go from 1 to this, doubling.
    pub most_samples: u32,
    /// Frames of other seeds that make up the reference.
    pub reference_frames: u32,
    /// Samples per pixel of each of these.
    pub reference_samples: u32,
    /// Seeds that an error is the root mean square of.
    pub seeds: u32,
    /// Samples per pixel, one by one, up to which powers of two are compared with the rest.
    pub every_up_to: u32,
}

impl SamplingEffort {
    /// Samples per pixel of the reference.
    pub fn reference(&self) -> u32 {
        self.reference_frames * self.reference_samples
    }
}

/// Error over cost of one table on one scene.
#[derive(Clone, Debug, Serialize)]
pub struct SamplingRow {
    /// The scene.
    pub scene: &'static str,
    /// The sample table.
    pub table: &'static str,
    /// Exponent of error over samples per pixel, from `FIT_FROM` samples on.
    pub exponent: Option<f64>,
    /// From few samples to many.
    pub points: Vec<SamplingPoint>,
}

/// Exponents are fitted from this many samples per pixel on.
const FIT_FROM: u32 = 4;

/// Everything the chart found.
#[derive(Clone, Debug, Serialize)]
pub struct SamplingChart {
    /// Effort of the measurement.
    pub effort: SamplingEffort,
    /// Samples per pixel of the references.
    pub reference_samples_per_pixel: u32,
    /// Scene by scene, table by table.
    pub rows: Vec<SamplingRow>,
    /// Failure cases.
    pub failures: Failures,
}

impl Study for SamplingChart {
    const NAME: &'static str = "sampling";
    const ABOUT: &'static str =
        "Image error over samples per pixel and over host time, for every sample table";
    const PICTURES: &'static [&'static str] = &["sampling_error", "sampling_time", "sampling_failures"];
    const FILES: &'static [&'static str] = &["sampling.csv", "sampling.json"];
    const SHOWS_TIME: bool = true;

    type Effort = SamplingEffort;
    const FULL: SamplingEffort = SamplingEffort {
        scene: ("default", 18),
        size: [96, 54],
        most_samples: 256,
        reference_frames: 16,
        reference_samples: 256,
        seeds: 1,
        every_up_to: 40,
    };
    const QUICK: SamplingEffort = SamplingEffort {
        size: [48, 27],
        most_samples: 32,
        reference_frames: 4,
        reference_samples: 96,
        seeds: 1,
        every_up_to: 17,
        ..Self::FULL
    };

    fn measure(effort: SamplingEffort, _scenes: &[String], progress: &Progress) -> Result<Self, StudyError> {
        let stages = measure::scenes(&effort)?;
        let references = stages.iter().map(|stage| measure::reference(stage, &effort));
        let references: Vec<Vec<Vec3>> = references.collect::<Result<_, _>>()?;
        let tables: Vec<&str> = measure::names().collect();
        let bar = progress.bar("sampling", ((stages.len() * tables.len()) + measure::STEPS) as u64);
        let mut rows = Vec::new();
        for (stage, reference) in stages.iter().zip(&references) {
            for &table in &tables {
                let points = measure::sweep(stage, table, reference, &effort)?;
                rows.push(SamplingRow { scene: stage.name(), table, exponent: fitted(&points), points });
                bar.inc();
            }
        }
        let failures = measure::failures(&stages, &references, &effort, &bar)?;
        Ok(Self { effort, reference_samples_per_pixel: effort.reference(), rows, failures })
    }

    fn draw(&self, to: &Gallery<'_>) -> Result<(), OutputError> {
        let [width, height] = self.effort.size;
        let subject = format!(
            "RMSE in linear light against {} samples per pixel, {width}x{height} pixels; exponents fitted from {FIT_FROM} samples on",
            self.reference_samples_per_pixel
        );
        let over_samples = panels(&self.rows, "samples per pixel", true, SamplingPoint::samples);
        to.chart("sampling_error", ["Image error over samples per pixel", &subject], over_samples)?;
        let over_time = panels(&self.rows, "host seconds a frame", false, |point| point.host_s);
        to.chart("sampling_time", ["Image error over host time", &subject], over_time)?;
        to.chart("sampling_failures", ["Where sampling fails", &subject], self.failures())
    }

    fn tables(&self) -> Vec<Sheet> {
        let exponents = self.rows.iter().chain(&self.failures.many_edges);
        let most = format!("RMSE at {} samples", self.effort.most_samples);
        let rmse = |point: Option<&SamplingPoint>| point.map(|point| point.rmse);
        let mut exponents = TableBuilder::of(exponents)
            .shown("scene", |row| row.scene, plain)
            .shown("table", |row| row.table, plain)
            .shown("exponent", |row| row.exponent, optional(fixed(2)))
            .shown("RMSE at 1 sample", |row| rmse(row.points.first()), optional(fixed(5)))
            .shown(&most, |row| rmse(row.points.last()), optional(fixed(5)))
            .shown("seconds then", |row| row.points.last().map(|point| point.host_s), optional(fixed(2)));
        for (place, point) in self.rows[0].points.iter().enumerate() {
            let heading = format!("n = {}", point.samples_per_pixel);
            exponents = exponents.detail(&heading, |row| rmse(row.points.get(place)), optional(fixed(4)));
        }
        let shared = TableBuilder::of(&self.failures.shared)
            .detail("table", |row| row.table, plain)
            .detail("samples", |row| row.samples_per_pixel, plain)
            .detail("RMSE", |row| row.rmse, fixed(4))
            .detail("correlation of neighbours' errors", |row| row.neighbour_correlation, fixed(2));
        let points = TableBuilder::of(self.points())
            .data("chart", |(chart, ..)| *chart)
            .data("scene", |(_, row, _)| row.scene)
            .data("table", |(_, row, _)| row.table)
            .data("samples_per_pixel", |(.., point)| point.samples_per_pixel)
            .data("rmse", |(.., point)| point.rmse)
            .data("host_s", |(.., point)| point.host_s)
            .csv("sampling.csv");
        vec![exponents.sheet(), shared.sheet(), points.sheet()]
    }

    fn tradeoff(&self) -> Vec<TradeoffPoint> {
        let point = |(row, point): (&SamplingRow, &SamplingPoint)| {
            let level = format!("{} samples a pixel", point.samples_per_pixel);
            let metrics = [Metric::rmse(point.rmse), Metric::host_s(point.host_s)];
            TradeoffPoint::new(format!("an image ({})", row.scene), [row.table, &level], metrics)
        };
        let all = self.rows.iter().flat_map(|row| row.points.iter().map(move |point| (row, point)));
        all.map(point).collect()
    }
}

impl SamplingChart {
    /// Every measurement with the part of the chart that it is for.
    fn points(&self) -> impl Iterator<Item = (&'static str, &SamplingRow, &SamplingPoint)> {
        let groups = [
            ("error", &self.rows),
            ("every_number", &self.failures.every_number),
            ("many_edges", &self.failures.many_edges),
        ];
        let rows = groups.into_iter().flat_map(|(name, rows)| rows.iter().map(move |row| (name, row)));
        rows.flat_map(|(name, row)| row.points.iter().map(move |point| (name, row, point)))
    }

    fn failures(&self) -> Vec<ChartPanel> {
        let scaled = |p: &SamplingPoint| {
            let n = p.samples();
            (n, p.rmse * n.sqrt())
        };
        // In the order of the tables' colours everywhere; those not shown here keep their place.
        let every = |name: &str| self.failures.every_number.iter().find(|row| row.table == name);
        let named = self.failures.many_edges.iter().map(|row| row.table);
        let curves = named
            .map(|name| every(name).map_or_else(|| Series::curve(name, []), |row| curve(row, false, scaled)));
        let axes = ["samples per pixel", "RMSE x root of samples"];
        let numbers = ChartPanel::new("motion, every number of samples", axes, curves.collect())
            .on(Scale::Doublings, Scale::Decades);
        let fence = panels(&self.failures.many_edges, "samples per pixel", true, SamplingPoint::samples);
        let fence = fence
            .into_iter()
            .map(|panel| ChartPanel { title: "16 edges in a pixel (fence)".to_owned(), ..panel });
        std::iter::once(numbers).chain(fence).collect()
    }
}

impl SamplingPoint {
    fn samples(&self) -> f64 {
        f64::from(self.samples_per_pixel)
    }
}

/// A panel for each scene.
fn panels(
    rows: &[SamplingRow],
    across: &str,
    doubling: bool,
    x: fn(&SamplingPoint) -> f64,
) -> Vec<ChartPanel> {
    let scenes = rows.chunk_by(|a, b| a.scene == b.scene);
    let scale = if doubling { Scale::Doublings } else { Scale::Decades };
    let panel = |rows: &[SamplingRow]| {
        let curves = rows.iter().map(|row| curve(row, doubling, |p| (x(p), p.rmse))).collect();
        ChartPanel::new(rows[0].scene, [across, "RMSE"], curves).on(scale.clone(), Scale::Decades)
    };
    scenes.map(panel).collect()
}

fn curve(row: &SamplingRow, noted: bool, place: impl Fn(&SamplingPoint) -> (f64, f64)) -> Series {
    let note = row.exponent.filter(|_| noted).map_or(String::new(), |p| format!("{p:.2}"));
    Series { note, ..Series::curve(row.table, row.points.iter().map(place)) }
}

/// The exponent of error over samples per pixel.
fn fitted(points: &[SamplingPoint]) -> Option<f64> {
    let late = points.iter().filter(|point| point.samples_per_pixel >= FIT_FROM);
    exponent(late.map(|point| (f64::from(point.samples_per_pixel), point.rmse)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::chart::neighbours;
    use crate::study::written;

    /// Small enough for a test.
    const SMALL: SamplingEffort = SamplingEffort {
        scene: ("tiny", 1),
        size: [64, 48],
        most_samples: 32,
        reference_frames: 4,
        seeds: 2,
        every_up_to: 2,
        ..SamplingChart::FULL
    };

    /// No more than there has to be.
    const MIN_EFFORT: SamplingEffort =
        SamplingEffort { size: [16, 9], most_samples: 2, reference_frames: 1, reference_samples: 8, ..SMALL };

    fn row<'a>(rows: &'a [SamplingRow], scene: &str, table: &str) -> &'a SamplingRow {
        rows.iter().find(|row| row.scene == scene && row.table == table).unwrap()
    }

    #[test]
    fn random_converges_as_theory_says_and_the_default_faster() {
        let chart = SamplingChart::measure(SMALL, &[], &Progress::new(true)).unwrap();
        for scene in ["motion", "defocus", "motion and defocus"] {
            // Independent samples: the error of the mean falls with the root of their number.
            let random = row(&chart.rows, scene, "random").exponent.unwrap();
            assert!((random + 0.5).abs() < 0.06, "{scene}: {random}");
            let owen = row(&chart.rows, scene, "owen");
            assert!(owen.exponent.unwrap() < -0.6, "{scene}: {:?}", owen.exponent);
            let last = |row: &SamplingRow| row.points[row.points.len() - 1].rmse;
            assert!(last(owen) < 0.8 * last(row(&chart.rows, scene, "random")), "{scene}");
        }
        // The fence: half of it seen at random, so one sample errs by a half in every channel.
        let fence = row(&chart.failures.many_edges, "fence", "random");
        assert!((fence.points[0].rmse - 0.5).abs() < 0.02, "{}", fence.points[0].rmse);
        let owen = row(&chart.failures.many_edges, "fence", "owen").exponent.unwrap();
        assert!(owen > -0.6, "the default table has nothing to gain there: {owen}");
    }

    #[test]
    fn the_numbers_do_not_depend_on_threads() {
        let with = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let chart =
                pool.install(|| SamplingChart::measure(MIN_EFFORT, &[], &Progress::new(true))).unwrap();
            let errors = chart.rows.iter().flat_map(|row| &row.points).map(|point| point.rmse.to_bits());
            errors.collect::<Vec<_>>()
        };
        assert_eq!(with(1), with(3));
    }

    #[test]
    fn equal_errors_are_correlated_and_alternating_ones_opposite() {
        let row = |signs: [f64; 4]| signs.iter().flat_map(|s| [*s; 3]).collect::<Vec<_>>();
        assert_eq!(neighbours(&row([1.0; 4]), 4), 1.0);
        assert_eq!(neighbours(&row([1.0, -1.0, 1.0, -1.0]), 4), -1.0);
        assert_eq!(neighbours(&row([0.0; 4]), 4), 0.0);
        assert_eq!(neighbours(&row([1.0; 4]), 1), 0.0, "a column has no neighbours");
    }

    #[test]
    fn the_files_are_all_there_and_agree() {
        let (folder, chart, _) = written::<SamplingChart>(MIN_EFFORT);
        let read = |name: &str| std::fs::read_to_string(folder.path().join(name)).unwrap();
        let json: serde_json::Value = serde_json::from_str(&read("sampling.json")).unwrap();
        assert_eq!(json["rows"].as_array().unwrap().len(), chart.rows.len());
        assert_eq!(json["reference_samples_per_pixel"], 8);
        let (three, five, two) = (3, 5, 2);
        // Header; scene, table, samples; numbers of samples one by one; the fence.
        assert_eq!(read("sampling.csv").lines().count(), 1 + three * five * two + three * two + five * two);
        assert!(read("sampling.md").contains("| motion | owen |"));
        for stem in SamplingChart::PICTURES {
            assert!(read(&format!("{stem}.svg")).ends_with("</svg>\n"));
        }
    }
}
