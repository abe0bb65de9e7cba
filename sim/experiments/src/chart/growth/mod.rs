//! `quintile chart growth`: how the time of the visibility engine grows with triangles, samples and blur.
//!
//! Time is CPU time of one thread in [`resolve`](pipeline::visibility::resolve): set-up, binning, tests and depth, the median
//! of some repeats. Samples are made and sorted before, as they may be before any triangle is known.

mod measure;
mod tables;

use serde::Serialize;

use super::ChartError;
use super::fit::{exponent, upper_half};
use output::OutDir;
use output::plot::Look;
use output::progress::Progress;

pub use measure::Point;
pub use tables::claim;

/// How much is measured.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Effort {
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
    /// What the others are while one is swept.
    pub base: Base,
}

/// What stays while something else is swept.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Base {
    /// Triangles.
    pub triangles: u32,
    /// Samples in a pixel.
    pub samples: u32,
    /// Pixels of motion, or of the circle of confusion.
    pub blur_px: f64,
}

impl Effort {
    /// The chart of the book.
    pub const FULL: Self = Self {
        side_px: 256,
        repeats: 5,
        triangles: &[1_000, 3_000, 10_000, 30_000, 100_000, 300_000, 1_000_000],
        samples: &[1, 2, 4, 8, 16, 32, 64, 128, 256],
        blur_px: &[0.0, 1.0, 2.0, 4.0, 8.0, 16.0, 32.0, 64.0, 128.0, 256.0, 512.0],
        base: Base { triangles: 10_000, samples: 16, blur_px: 16.0 },
    };
    /// A look in seconds.
    pub const QUICK: Self = Self {
        side_px: 128,
        repeats: 3,
        triangles: &[1_000, 3_000, 10_000, 30_000, 100_000],
        samples: &[1, 4, 16, 64],
        blur_px: &[0.0, 1.0, 4.0, 16.0, 64.0],
        base: Base { triangles: 3_000, samples: 16, blur_px: 16.0 },
    };
}

/// What grows.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Sweep {
    /// Triangles that cover the same area, finer and finer.
    Triangles,
    /// Samples in a pixel.
    Samples,
    /// Motion, the circle of confusion, or both.
    Blur,
}

/// What blurs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Kind {
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
pub struct Row {
    /// What grows.
    pub sweep: Sweep,
    /// What blurs.
    pub kind: Kind,
    /// Exponent of time over what grows, from `fitted_from` on.
    pub exponent: Option<f64>,
    /// Exponent of the number of sample tests, likewise.
    pub tests_exponent: Option<f64>,
    /// Where the upper half of the curve begins on its logarithmic axis.
    pub fitted_from: f64,
    /// From little to much.
    pub points: Vec<Point>,
}

/// Everything the chart found.
#[derive(Clone, Debug, Serialize)]
pub struct GrowthChart {
    /// How much was measured.
    pub effort: Effort,
    /// Curve by curve.
    pub rows: Vec<Row>,
}

impl Sweep {
    const ALL: [Self; 3] = [Self::Triangles, Self::Samples, Self::Blur];

    /// Its name in tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Triangles => "triangles",
            Self::Samples => "samples",
            Self::Blur => "blur",
        }
    }

    /// What of a point grows.
    pub fn of(self, point: &Point) -> f64 {
        match self {
            Self::Triangles => f64::from(point.triangles),
            Self::Samples => f64::from(point.samples_per_pixel),
            Self::Blur => point.motion_px.max(point.defocus_px),
        }
    }

    /// What is resolved, from little to much.
    fn trials(self, effort: &Effort) -> Vec<Base> {
        let base = effort.base;
        match self {
            Self::Triangles => effort.triangles.iter().map(|&triangles| Base { triangles, ..base }).collect(),
            Self::Samples => effort.samples.iter().map(|&samples| Base { samples, ..base }).collect(),
            Self::Blur => effort.blur_px.iter().map(|&blur_px| Base { blur_px, ..base }).collect(),
        }
    }
}

impl Kind {
    const ALL: [Self; 4] = [Self::Still, Self::Motion, Self::Defocus, Self::Both];

    /// Its name in tables and pictures.
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

/// Measures the chart and writes it into `dir`.
///
/// # Errors
/// [`ChartError`], above all when `dir` cannot be written to.
pub fn chart(
    effort: Effort,
    dir: &OutDir,
    look: &Look,
    progress: &Progress,
) -> Result<GrowthChart, ChartError> {
    let chart = measure(effort, progress)?;
    tables::write(&chart, dir, look)?;
    Ok(chart)
}

/// Measures without writing.
///
/// # Errors
/// [`ChartError`] when a scene cannot be made or no thread started.
pub fn measure(effort: Effort, progress: &Progress) -> Result<GrowthChart, ChartError> {
    let curves = || Sweep::ALL.into_iter().flat_map(|sweep| Kind::ALL.map(|kind| (sweep, kind)));
    // What stands still has no blur to sweep.
    let curves = || curves().filter(|curve| *curve != (Sweep::Blur, Kind::Still));
    let steps: usize = curves().map(|(sweep, _)| sweep.trials(&effort).len()).sum();
    let (bar, timer) = (progress.bar("growth", steps as u64), measure::Timer::new(&effort)?);
    let row = |(sweep, kind): (Sweep, Kind)| {
        let point = |trial: Base| {
            let point = timer.point(trial, kind);
            bar.inc();
            point
        };
        let points = sweep.trials(&effort).into_iter().map(point).collect::<Result<_, _>>()?;
        Ok(Row::new(sweep, kind, points))
    };
    Ok(GrowthChart { effort, rows: curves().map(row).collect::<Result<_, ChartError>>()? })
}

impl Row {
    fn new(sweep: Sweep, kind: Kind, points: Vec<Point>) -> Self {
        let across = || points.iter().map(|point| sweep.of(point)).filter(|x| *x > 0.0);
        let ends = across().reduce(f64::min).zip(across().reduce(f64::max));
        let fitted_from = ends.map_or(0.0, |(low, high)| upper_half(low, high));
        let fit = |of: fn(&Point) -> f64| {
            let all = points.iter().map(|point| (sweep.of(point), of(point)));
            exponent(all.filter(|(x, _)| *x >= fitted_from))
        };
        let (time, tests) = (fit(|point| point.cpu_s), fit(|point| point.sample_tests as f64));
        Self { sweep, kind, exponent: time, tests_exponent: tests, fitted_from, points }
    }
}

#[cfg(test)]
mod tests;
