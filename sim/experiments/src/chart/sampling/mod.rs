//! `quintile chart sampling`: image error against cost, for every sample table.
//!
//! Error is the root of the mean squared difference to a reference of [`Effort::reference`] samples per pixel, over all
//! pixels and the three channels, in linear light. Host time is that of one frame through the pipeline, caches and all; the
//! table is made before.

mod failures;
mod measure;
mod stages;
mod tables;

use glam::Vec3;
use pipeline::SampleSpec;
use serde::Serialize;

use super::ChartError;
use super::fit::exponent;
use output::OutDir;
use output::plot::Look;
use output::progress::Progress;

pub use failures::{Failures, Shared};
pub use measure::Point;
pub use tables::claim;

/// How much is measured.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Effort {
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
    /// Samples per pixel, one by one, up to which powers of two are held against the rest.
    pub every_up_to: u32,
}

impl Effort {
    /// The chart of the book.
    pub const FULL: Self = Self {
        scene: ("default", 18),
        size: [96, 54],
        most_samples: 256,
        reference_frames: 16,
        reference_samples: 256,
        seeds: 1,
        every_up_to: 40,
    };
    /// A look in seconds.
    pub const QUICK: Self = Self {
        size: [48, 27],
        most_samples: 32,
        reference_frames: 4,
        reference_samples: 96,
        seeds: 1,
        every_up_to: 17,
        ..Self::FULL
    };

    /// Samples per pixel of the reference.
    pub fn reference(&self) -> u32 {
        self.reference_frames * self.reference_samples
    }
}

/// Error over cost of one table on one scene.
#[derive(Clone, Debug, Serialize)]
pub struct Row {
    /// The scene.
    pub scene: &'static str,
    /// The sample table.
    pub table: &'static str,
    /// Exponent of error over samples per pixel, from [`FIT_FROM`] samples on.
    pub exponent: Option<f64>,
    /// From few samples to many.
    pub points: Vec<Point>,
}

/// Exponents are fitted from this many samples per pixel on.
pub const FIT_FROM: u32 = 4;

/// Everything the chart found.
#[derive(Clone, Debug, Serialize)]
pub struct SamplingChart {
    /// How much was measured.
    pub effort: Effort,
    /// Samples per pixel of the references.
    pub reference_samples_per_pixel: u32,
    /// Scene by scene, table by table.
    pub rows: Vec<Row>,
    /// Where it does not work.
    pub failures: Failures,
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
) -> Result<SamplingChart, ChartError> {
    let chart = measure(effort, progress)?;
    tables::write(&chart, dir, look)?;
    Ok(chart)
}

/// Measures without writing.
///
/// # Errors
/// [`ChartError`] when a scene cannot be drawn.
pub fn measure(effort: Effort, progress: &Progress) -> Result<SamplingChart, ChartError> {
    let stages = stages::scenes(&effort)?;
    let references = stages.iter().map(|stage| measure::reference(stage, &effort));
    let references: Vec<Vec<Vec3>> = references.collect::<Result<_, _>>()?;
    let tables: Vec<&str> = SampleSpec::names().map(|(name, _)| name).collect();
    let bar = progress.bar("sampling", ((stages.len() * tables.len()) + failures::STEPS) as u64);
    let mut rows = Vec::new();
    for (stage, reference) in stages.iter().zip(&references) {
        for &table in &tables {
            let points = measure::sweep(stage, table, reference, &effort)?;
            rows.push(Row { scene: stage.name(), table, exponent: fitted(&points), points });
            bar.inc();
        }
    }
    let failures = failures::measure(&stages, &references, &effort, &bar)?;
    Ok(SamplingChart { effort, reference_samples_per_pixel: effort.reference(), rows, failures })
}

/// The exponent of error over samples per pixel.
fn fitted(points: &[Point]) -> Option<f64> {
    let late = points.iter().filter(|point| point.samples_per_pixel >= FIT_FROM);
    exponent(late.map(|point| (f64::from(point.samples_per_pixel), point.rmse)))
}

#[cfg(test)]
mod tests;
