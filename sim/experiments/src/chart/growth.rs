//! `quintile chart growth`: how the time of the visibility engine grows with triangles, samples and blur.
//!
//! Time is CPU time of one thread in [`resolve`]: set-up, binning, tests and depth, the median
//! of some repeats. Samples are made and sorted before, as they may be before any triangle is known.

use cpu_time::ThreadTime;
use output::OutputError;
use output::plot::{ChartPanel, Scale, Series};
use output::terminal::Progress;
use pipeline::sampling::HashedSamples;
use pipeline::visibility::{SampleLayout, StepTally, Visibility, resolve};
use pipeline::{Cull, Geometry, LensShape};
use rayon::{ThreadPool, ThreadPoolBuilder};
use serde::Serialize;
use workloads::stress::{Size, Soup, StressError, StressScene};

use super::{exponent, upper_half};
use crate::study::table::{Sheet, TableBuilder, fixed, millis, optional, plain};
use crate::study::{Gallery, Study, StudyError};

/// Effort of the measurement.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct GrowthEffort {
    /// Side of the image in pixels, a power of two.
    pub side_px: u32,
    /// Times are medians of so many.
    pub repeats: usize,
    /// Numbers of triangles.
    pub triangles: &'static [u32],
    /// Samples in a pixel.
    pub samples: &'static [u32],
    /// Motion, or the diameter of the circle of confusion, or both, in pixels.
    pub blur_px: &'static [f64],
    /// Values of the others while one is swept.
    pub base: Base,
}

/// Values that stay while another is swept.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Base {
    /// Triangles.
    pub triangles: u32,
    /// Samples in a pixel.
    pub samples: u32,
    /// Pixels of motion, or of the circle of confusion.
    pub blur_px: f64,
}

/// The quantity that grows.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum GrowthSweep {
    /// Triangles that cover the same area, finer and finer.
    Triangles,
    /// Samples in a pixel.
    Samples,
    /// Motion, the circle of confusion, or both.
    Blur,
}

/// The source of blur.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum GrowthBlur {
    /// Nothing.
    Still,
    /// Motion: three dimensions.
    Motion,
    /// The lens: four dimensions.
    Defocus,
    /// Motion and lens, each by as many pixels: five dimensions.
    Both,
}

/// One curve.
#[derive(Clone, Debug, Serialize)]
pub struct GrowthRow {
    /// The quantity that grows.
    pub sweep: GrowthSweep,
    /// The source of blur.
    pub kind: GrowthBlur,
    /// Exponent of time over what grows, from `fitted_from` on.
    pub exponent: Option<f64>,
    /// Exponent of the number of sample tests, likewise.
    pub tests_exponent: Option<f64>,
    /// Where the upper half of the curve begins on its logarithmic axis.
    pub fitted_from: f64,
    /// From little to much.
    pub points: Vec<GrowthPoint>,
}

/// Everything the chart found.
#[derive(Clone, Debug, Serialize)]
pub struct GrowthChart {
    /// Effort of the measurement.
    pub effort: GrowthEffort,
    /// Curve by curve.
    pub rows: Vec<GrowthRow>,
}

impl GrowthSweep {
    const ALL: [Self; 3] = [Self::Triangles, Self::Samples, Self::Blur];

    /// Name of the sweep in tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Triangles => "triangles",
            Self::Samples => "samples",
            Self::Blur => "blur",
        }
    }

    /// The value of a point that grows.
    pub fn of(self, point: &GrowthPoint) -> f64 {
        match self {
            Self::Triangles => f64::from(point.triangles),
            Self::Samples => f64::from(point.samples_per_pixel),
            Self::Blur => point.motion_px.max(point.defocus_px),
        }
    }

    /// The work of each trial, from little to much.
    fn trials(self, effort: &GrowthEffort) -> Vec<Base> {
        let base = effort.base;
        match self {
            Self::Triangles => effort.triangles.iter().map(|&triangles| Base { triangles, ..base }).collect(),
            Self::Samples => effort.samples.iter().map(|&samples| Base { samples, ..base }).collect(),
            Self::Blur => effort.blur_px.iter().map(|&blur_px| Base { blur_px, ..base }).collect(),
        }
    }
}

impl GrowthBlur {
    const ALL: [Self; 4] = [Self::Still, Self::Motion, Self::Defocus, Self::Both];

    /// Name of the kind in tables and pictures.
    pub fn name(self) -> &'static str {
        match self {
            Self::Still => "still",
            Self::Motion => "motion",
            Self::Defocus => "defocus",
            Self::Both => "both",
        }
    }

    /// Pixels of motion and of the circle of confusion.
    fn blur_px(self, px: f64) -> [f64; 2] {
        match self {
            Self::Still => [0.0, 0.0],
            Self::Motion => [px, 0.0],
            Self::Defocus => [0.0, px],
            Self::Both => [px, px],
        }
    }
}

impl Study for GrowthChart {
    const NAME: &'static str = "growth";
    const ABOUT: &'static str =
        "Time of the visibility engine over triangles, samples a pixel and blur, with exponents";
    const PICTURES: &'static [&'static str] = &["growth"];
    const FILES: &'static [&'static str] = &["growth.csv", "growth.json"];

    type Effort = GrowthEffort;
    const FULL: GrowthEffort = GrowthEffort {
        side_px: 256,
        repeats: 5,
        triangles: &[1_000, 3_000, 10_000, 30_000, 100_000, 300_000, 1_000_000],
        samples: &[1, 2, 4, 8, 16, 32, 64, 128, 256],
        blur_px: &[0.0, 1.0, 2.0, 4.0, 8.0, 16.0, 32.0, 64.0, 128.0, 256.0, 512.0],
        base: Base { triangles: 10_000, samples: 16, blur_px: 16.0 },
    };
    const QUICK: GrowthEffort = GrowthEffort {
        side_px: 128,
        repeats: 3,
        triangles: &[1_000, 3_000, 10_000, 30_000, 100_000],
        samples: &[1, 4, 16, 64],
        blur_px: &[0.0, 1.0, 4.0, 16.0, 64.0],
        base: Base { triangles: 3_000, samples: 16, blur_px: 16.0 },
    };

    fn measure(effort: GrowthEffort, _scenes: &[String], progress: &Progress) -> Result<Self, StudyError> {
        let curves =
            || GrowthSweep::ALL.into_iter().flat_map(|sweep| GrowthBlur::ALL.map(|kind| (sweep, kind)));
        // What stands still has no blur to sweep.
        let curves = || curves().filter(|curve| *curve != (GrowthSweep::Blur, GrowthBlur::Still));
        let steps: usize = curves().map(|(sweep, _)| sweep.trials(&effort).len()).sum();
        let (bar, timer) = (progress.bar("growth", steps as u64), Timer::new(&effort)?);
        let row = |(sweep, kind): (GrowthSweep, GrowthBlur)| {
            let point = |trial: Base| {
                let point = timer.point(trial, kind);
                bar.inc();
                point
            };
            let points = sweep.trials(&effort).into_iter().map(point).collect::<Result<_, _>>()?;
            Ok(GrowthRow::new(sweep, kind, points))
        };
        let rows = curves().map(row).collect::<Result<_, StudyError>>()?;
        Ok(Self { effort, rows })
    }

    fn draw(&self, to: &Gallery<'_>) -> Result<(), OutputError> {
        let panels = GrowthSweep::ALL.map(|sweep| self.panel(sweep)).into();
        to.chart("growth", ["Time of the visibility engine", &self.subject()], panels)
    }

    fn tables(&self) -> Vec<Sheet> {
        let exponents = TableBuilder::of(&self.rows)
            .shown("growing", |row| row.sweep.name(), plain)
            .shown("what blurs", |row| row.kind.name(), plain)
            .shown("exponent of time", |row| row.exponent, optional(fixed(2)))
            .shown("of sample tests", |row| row.tests_exponent, optional(fixed(2)))
            .shown("fitted", |row| row.fitted(), optional(|(low, high)| format!("{low:.0} to {high:.0}")))
            .shown("ms, first", |row| row.points.first().map(|point| point.cpu_s), optional(millis(2)))
            .shown("ms, last", |row| row.points.last().map(|point| point.cpu_s), optional(millis(2)))
            .after(format!("\n{}\n", self.subject()));
        let each = self.rows.iter().flat_map(|row| row.points.iter().map(move |point| (row, point)));
        let points = TableBuilder::of(each)
            .data("sweep", |(row, _)| row.sweep.name())
            .data("kind", |(row, _)| row.kind.name())
            .data("exponent", |(row, _)| row.exponent)
            .data("fitted_from", |(row, _)| row.fitted_from)
            .data("triangles", |(_, point)| point.triangles)
            .data("samples_per_pixel", |(_, point)| point.samples_per_pixel)
            .data("motion_px", |(_, point)| point.motion_px)
            .data("defocus_px", |(_, point)| point.defocus_px)
            .data("cpu_s", |(_, point)| point.cpu_s)
            .data("sample_tests", |(_, point)| point.sample_tests)
            .data("hits", |(_, point)| point.hits)
            .csv("growth.csv");
        vec![exponents.sheet(), points.sheet()]
    }
}

impl GrowthChart {
    fn subject(&self) -> String {
        let (side, repeats) = (self.effort.side_px, self.effort.repeats);
        format!(
            "CPU time of one thread, median of {repeats}; {side}x{side} pixels, triangles cover them {LAYERS} times; \
             numbers are exponents, fitted over the upper half of each axis"
        )
    }

    fn panel(&self, sweep: GrowthSweep) -> ChartPanel {
        let base = &self.effort.base;
        let (triangles, samples, blur) = (
            format!("{} triangles", base.triangles),
            format!("{} samples a pixel", base.samples),
            format!("blur {} px", base.blur_px),
        );
        let (across, title) = match sweep {
            GrowthSweep::Triangles => ("triangles", format!("{samples}, {blur}")),
            GrowthSweep::Samples => ("samples a pixel", format!("{triangles}, {blur}")),
            GrowthSweep::Blur => ("motion or circle of confusion (px)", format!("{triangles}, {samples}")),
        };
        let scale = if sweep == GrowthSweep::Triangles { Scale::Decades } else { Scale::Doublings };
        let curves = GrowthBlur::ALL.map(|kind| self.curve(sweep, kind)).into();
        ChartPanel::new(&title, [across, "CPU time (ms)"], curves).on(scale, Scale::Decades)
    }

    /// A curve without points where there is none, so that the others keep their colours.
    fn curve(&self, sweep: GrowthSweep, kind: GrowthBlur) -> Series {
        let row = self.rows.iter().find(|row| row.sweep == sweep && row.kind == kind);
        let points = row.iter().flat_map(|row| &row.points);
        let note = row.and_then(|row| row.exponent).map_or(String::new(), |p| format!("{p:.2}"));
        Series {
            note,
            ..Series::curve(kind.name(), points.map(|point| (sweep.of(point), 1e3 * point.cpu_s)))
        }
    }
}

impl GrowthRow {
    fn new(sweep: GrowthSweep, kind: GrowthBlur, points: Vec<GrowthPoint>) -> Self {
        let across = || points.iter().map(|point| sweep.of(point)).filter(|x| *x > 0.0);
        let ends = across().reduce(f64::min).zip(across().reduce(f64::max));
        let fitted_from = ends.map_or(0.0, |(low, high)| upper_half(low, high));
        let fit = |of: fn(&GrowthPoint) -> f64| {
            let all = points.iter().map(|point| (sweep.of(point), of(point)));
            exponent(all.filter(|(x, _)| *x >= fitted_from))
        };
        let (time, tests) = (fit(|point| point.cpu_s), fit(|point| point.sample_tests as f64));
        Self { sweep, kind, exponent: time, tests_exponent: tests, fitted_from, points }
    }

    /// The least and the greatest value that exponents are fitted over.
    fn fitted(&self) -> Option<(f64, f64)> {
        let fitted = self.points.iter().map(|point| self.sweep.of(point)).filter(|x| *x >= self.fitted_from);
        fitted.clone().reduce(f64::min).zip(fitted.reduce(f64::max))
    }
}

/// One measurement.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct GrowthPoint {
    /// Triangles.
    pub triangles: u32,
    /// Samples in a pixel.
    pub samples_per_pixel: u32,
    /// Motion while the shutter is open, in pixels.
    pub motion_px: f64,
    /// Diameter of the circle of confusion, in pixels.
    pub defocus_px: f64,
    /// CPU time of one thread: the median of the repeats.
    pub cpu_s: f64,
    /// Samples tested, sixteen to a packet.
    pub sample_tests: u64,
    /// Samples hit, hidden or not.
    pub hits: u64,
}

/// Depth complexity.
const LAYERS: f64 = 4.0;
/// Decides where triangles are and where samples look.
const SEED: u64 = 1;

/// Times the engine on a thread of its own; samples are sorted on all others.
struct Timer<'a> {
    effort: &'a GrowthEffort,
    thread: ThreadPool,
}

impl<'a> Timer<'a> {
    pub fn new(effort: &'a GrowthEffort) -> Result<Self, StudyError> {
        Ok(Self { effort, thread: ThreadPoolBuilder::new().num_threads(1).build()? })
    }

    pub fn point(&self, trial: Base, kind: GrowthBlur) -> Result<GrowthPoint, StudyError> {
        let [motion_px, defocus_px] = kind.blur_px(trial.blur_px);
        let size = Size { side_px: self.effort.side_px, triangles: trial.triangles };
        let scene = Soup { size, layers: LAYERS, motion_px, defocus_px }.scene(SEED)?;
        let (cpu_s, tally) = self.time(&scene, trial.samples)?;
        Ok(GrowthPoint {
            triangles: trial.triangles,
            samples_per_pixel: trial.samples,
            motion_px,
            defocus_px,
            cpu_s,
            sample_tests: 16 * tally.packets,
            hits: tally.hits,
        })
    }

    fn time(&self, scene: &StressScene, samples: u32) -> Result<(f64, StepTally), StudyError> {
        let refused = |what: &str| StudyError::Pipeline(what.to_owned());
        let samples = HashedSamples::new(SEED, self.effort.side_px, samples, LensShape::Disk)
            .ok_or_else(|| refused("1 to 256 samples a pixel"))?;
        // One array twice is a still mesh.
        let close = if scene.open == scene.close { &scene.open } else { &scene.close };
        let geometry = Geometry::new(&scene.open, close, &scene.triangles).map_err(StressError::from)?;
        let layout = SampleLayout::new(&scene.camera, scene.viewport, &samples, !geometry.is_still())
            .ok_or_else(|| refused("an orthographic camera"))?;
        let mut visibility = Visibility::new(&layout);
        let once = || {
            let start = ThreadTime::now();
            let tally = resolve(&layout, &geometry, Cull::None, &mut visibility);
            (start.elapsed().as_secs_f64(), tally)
        };
        let mut runs = self.thread.install(|| -> Vec<_> {
            std::iter::repeat_with(once).take(self.effort.repeats.max(1)).collect()
        });
        // What is counted is the same each time.
        runs.sort_by(|a, b| a.0.total_cmp(&b.0));
        Ok(runs[runs.len() / 2])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::study::written;

    /// No more than there has to be.
    const MIN_EFFORT: GrowthEffort = GrowthEffort {
        side_px: 32,
        repeats: 1,
        triangles: &[50, 100, 200],
        samples: &[1, 4],
        blur_px: &[0.0, 2.0, 8.0, 32.0],
        base: Base { triangles: 50, samples: 4, blur_px: 4.0 },
    };

    fn point(triangles: u32, cpu_s: f64) -> GrowthPoint {
        let (motion_px, defocus_px) = (0.0, 0.0);
        GrowthPoint {
            triangles,
            samples_per_pixel: 1,
            motion_px,
            defocus_px,
            cpu_s,
            sample_tests: 7,
            hits: 0,
        }
    }

    #[test]
    fn the_upper_half_is_fitted_and_no_more() {
        // A floor of 1 s up to a hundred, beyond it n^1.5.
        let time = |n: u32| (n, f64::from(n).powf(1.5) / 1e3);
        let points = [1, 10, 100, 1_000, 10_000].map(time).map(|(n, s)| point(n, s.max(1.0)));
        let row = GrowthRow::new(GrowthSweep::Triangles, GrowthBlur::Still, points.into());
        assert!((row.fitted_from - 100.0).abs() < 1e-9);
        assert!((row.exponent.unwrap() - 1.5).abs() < 1e-12, "{:?}", row.exponent);
        assert!(row.tests_exponent.unwrap().abs() < 1e-12);
        assert_eq!(GrowthRow::new(GrowthSweep::Triangles, GrowthBlur::Still, Vec::new()).exponent, None);
    }

    #[test]
    fn what_is_counted_is_the_same_each_time_and_grows_with_blur() {
        let tests = |chart: &GrowthChart| -> Vec<Vec<u64>> {
            let points = |row: &GrowthRow| row.points.iter().map(|point| point.sample_tests).collect();
            chart.rows.iter().map(points).collect()
        };
        let with = |threads| {
            let pool = ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| GrowthChart::measure(MIN_EFFORT, &[], &Progress::new(true))).unwrap()
        };
        let chart = with(1);
        assert_eq!(tests(&chart), tests(&with(3)));
        for row in &chart.rows {
            assert!(row.points.iter().all(|point| point.cpu_s > 0.0 && point.hits > 0), "{row:?}");
            if row.sweep == GrowthSweep::Blur {
                let [still, .., much] = &row.points[..] else { panic!("{row:?}") };
                assert_eq!(still.motion_px + still.defocus_px, 0.0);
                assert!(much.sample_tests > still.sample_tests, "{row:?}");
            }
        }
    }

    #[test]
    fn the_files_are_all_there_and_agree() {
        let (folder, chart, done) = written::<GrowthChart>(MIN_EFFORT);
        let read = |name: &str| std::fs::read_to_string(folder.path().join(name)).unwrap();
        let json: serde_json::Value = serde_json::from_str(&read("growth.json")).unwrap();
        // Triangles and samples in four kinds, blur in three.
        assert_eq!(json["rows"].as_array().unwrap().len(), 11);
        assert_eq!(json["rows"][0]["exponent"].as_f64(), chart.rows[0].exponent);
        assert_eq!(read("growth.csv").lines().count(), 1 + 4 * 3 + 4 * 2 + 3 * 4);
        assert!(read("growth.csv").lines().nth(1).unwrap().starts_with("triangles,still,"));
        assert!(read("growth.md").contains("| blur | both |") && done.text.contains("32x32 pixels"));
        assert!(read("growth.svg").ends_with("</svg>\n"));
    }
}
