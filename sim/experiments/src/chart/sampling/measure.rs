//! Images, their errors and how long they took.

use std::time::Instant;

use glam::{DVec3, Vec3};
use pipeline::sampling::SampleSource;
use pipeline::{SampleSpec, SampleTable, Settings};
use rayon::prelude::*;
use serde::Serialize;

use super::Effort;
use super::stages::Stage;
use crate::chart::image::{errors, mean_square};
use crate::study::StudyError;
use run::GpuSpec;

/// One measurement.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Point {
    /// Samples in a pixel.
    pub samples_per_pixel: u32,
    /// Root mean squared error, linear radiance.
    pub rmse: f64,
    /// Seconds of the host for a frame.
    pub host_s: f64,
}

/// Seeds of references start here, those of what is measured at 1, so that none is shared.
const REFERENCE_SEED: u64 = 1_000;

/// The table called `name`.
pub(super) fn table(name: &str, samples: u32, seed: u64) -> Result<Box<dyn SampleSource>, StudyError> {
    let spec = SampleSpec::named(name).unwrap_or_default();
    Ok(Box::new(SampleTable::new(&spec, samples, seed)?))
}

/// An image of the stage.
pub(super) fn image(stage: &Stage, samples: &dyn SampleSource) -> Result<Vec<Vec3>, StudyError> {
    let gpu = GpuSpec::load("reference")?;
    stage
        .draw(|camera, draws, viewport, background| {
            let settings = Settings { spec: &gpu.pipeline, viewport, samples, background };
            pipeline::render(camera, draws, &settings, |_| ()).map(|rendered| rendered.image)
        })?
        .map_err(|error| StudyError::Pipeline(error.to_string()))
}

/// The mean of several images of the default table with seeds of their own.
pub(super) fn reference(stage: &Stage, effort: &Effort) -> Result<Vec<Vec3>, StudyError> {
    let frames = (0..effort.reference_frames).into_par_iter().map(|frame| {
        image(stage, &*table("owen", effort.reference_samples, REFERENCE_SEED + u64::from(frame))?)
    });
    let frames: Vec<Vec<Vec3>> = frames.collect::<Result<_, StudyError>>()?;
    let mean = |pixel: usize| {
        let sum: DVec3 = frames.iter().map(|image: &Vec<Vec3>| image[pixel].as_dvec3()).sum();
        (sum / frames.len() as f64).as_vec3()
    };
    Ok((0..frames[0].len()).map(mean).collect())
}

/// Error and time of one table at one number of samples.
pub(super) fn point(
    stage: &Stage,
    name: &str,
    samples_per_pixel: u32,
    reference: &[Vec3],
    effort: &Effort,
) -> Result<Point, StudyError> {
    let (mut squares, mut host_s) = (0.0, f64::INFINITY);
    for seed in 1..=u64::from(effort.seeds) {
        let table = table(name, samples_per_pixel, seed)?;
        let started = Instant::now();
        let image = image(stage, &*table)?;
        host_s = host_s.min(started.elapsed().as_secs_f64());
        squares += mean_square(&errors(&image, reference));
    }
    Ok(Point { samples_per_pixel, rmse: (squares / f64::from(effort.seeds)).sqrt(), host_s })
}

/// Error and time of one table from one sample per pixel to the most, doubling.
pub(super) fn sweep(
    stage: &Stage,
    name: &str,
    reference: &[Vec3],
    effort: &Effort,
) -> Result<Vec<Point>, StudyError> {
    let counts = (0..=effort.most_samples.ilog2()).map(|power| 1 << power);
    counts.map(|count| point(stage, name, count, reference, effort)).collect()
}
