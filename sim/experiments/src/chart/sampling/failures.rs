//! Where sampling fails: three regimes, each measured.

use glam::Vec3;
use pipeline::SampleSpec;
use rayon::prelude::*;
use serde::Serialize;

use super::measure::{Point, image, point, reference, sweep, table};
use super::stages::{Fence, Stage};
use super::{Effort, Row, fitted};
use crate::chart::image::{errors, mean_square, neighbours};
use crate::study::StudyError;
use output::progress::Bar;

/// Regimes in which the default table is no better than others.
#[derive(Clone, Debug, Serialize)]
pub struct Failures {
    /// Moving scene, every number of samples one by one: low-discrepancy points come out even at powers of two only.
    pub every_number: Vec<Row>,
    /// More edges in a pixel than samples: stratification finds nothing to hold on to.
    pub many_edges: Vec<Row>,
    /// Tables that all pixels share: what one pixel gets wrong its neighbours get wrong alike.
    pub shared: Vec<Shared>,
}

/// How alike the errors of neighbours are.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Shared {
    /// The sample table.
    pub table: &'static str,
    /// Samples in a pixel.
    pub samples_per_pixel: u32,
    /// Root mean squared error.
    pub rmse: f64,
    /// Correlation of the errors of pixels side by side: 0 is noise, 1 a shift of all.
    pub neighbour_correlation: f64,
}

/// Steps of the progress bar.
pub(super) const STEPS: usize = 3;

/// Samples per pixel at which neighbours are compared.
const SHARED_SAMPLES: u32 = 16;

pub(super) fn measure(
    stages: &[Stage],
    references: &[Vec<Vec3>],
    effort: &Effort,
    bar: &Bar,
) -> Result<Failures, StudyError> {
    let every_number = every_number(&stages[0], &references[0], effort)?;
    bar.inc();
    let many_edges = many_edges(effort)?;
    bar.inc();
    let shared = shared(&stages[2], &references[2], effort)?;
    bar.inc();
    Ok(Failures { every_number, many_edges, shared })
}

fn names() -> impl Iterator<Item = &'static str> {
    SampleSpec::names().map(|(name, _)| name)
}

fn every_number(stage: &Stage, reference: &[Vec3], effort: &Effort) -> Result<Vec<Row>, StudyError> {
    let row = |table| {
        let counts = (1..=effort.every_up_to).into_par_iter();
        let points = counts.map(|n| point(stage, table, n, reference, effort));
        let points: Vec<Point> = points.collect::<Result<_, _>>()?;
        Ok(Row { scene: stage.name(), table, exponent: fitted(&points), points })
    };
    ["owen", "random", "jittered"].into_iter().map(row).collect()
}

fn many_edges(effort: &Effort) -> Result<Vec<Row>, StudyError> {
    // Every pixel is like every other: a small image does.
    let stage = Stage::Fence(Fence::new([32, 18])?);
    let reference = reference(&stage, effort)?;
    let row = |table| {
        let points = sweep(&stage, table, &reference, effort)?;
        Ok(Row { scene: stage.name(), table, exponent: fitted(&points), points })
    };
    names().map(row).collect()
}

fn shared(stage: &Stage, reference: &[Vec3], effort: &Effort) -> Result<Vec<Shared>, StudyError> {
    let row = |name| {
        let image = image(stage, &*table(name, SHARED_SAMPLES, 1)?)?;
        let errors = errors(&image, reference);
        Ok(Shared {
            table: name,
            samples_per_pixel: SHARED_SAMPLES,
            rmse: mean_square(&errors).sqrt(),
            neighbour_correlation: neighbours(&errors, effort.size[0] as usize),
        })
    };
    names().map(row).collect()
}
