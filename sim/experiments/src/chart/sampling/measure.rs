//! Images of scenes, their errors and times, and failure modes of sampling.

use std::time::Instant;

use glam::{Affine3A, DVec3, Vec3};
use output::terminal::Bar;
use pipeline::sampling::SampleSource;
use pipeline::{
    Camera, Cull, Draw, Geometry, Lens, PassError, RasterPass, Rendered, SampleSpec, SampleTable, Settings,
    Viewport,
};
use rayon::prelude::*;
use run::GpuSpec;
use serde::Serialize;
use workloads::{Frame, Overrides, Scene};

use super::{SamplingEffort, SamplingRow, fitted};
use crate::chart::{White, errors, mean_square, neighbours};
use crate::study::StudyError;

/// One measurement.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct SamplingPoint {
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

/// An image of the stage, drawn by the modelled hardware.
pub(super) fn image(stage: &Stage, samples: &dyn SampleSource) -> Result<Vec<Vec3>, StudyError> {
    drawn(stage, samples, |pass| pass.render(|_, _| ()))
}

/// An image of the stage that `draw` draws.
fn drawn(
    stage: &Stage,
    samples: &dyn SampleSource,
    draw: impl FnOnce(&RasterPass<'_>) -> Result<Rendered, PassError>,
) -> Result<Vec<Vec3>, StudyError> {
    let gpu = GpuSpec::load("reference")?;
    let rendered = stage.draw(|camera, draws, viewport, background| {
        let settings = Settings { spec: &gpu.pipeline, viewport, samples, background };
        draw(&RasterPass::new(camera, draws, &settings))
    })??;
    Ok(rendered.into_image())
}

/// The mean of several images of the default table with seeds of their own.
pub(super) fn reference(stage: &Stage, effort: &SamplingEffort) -> Result<Vec<Vec3>, StudyError> {
    let frames = (0..effort.reference_frames).into_par_iter().map(|frame| {
        let table = table("owen", effort.reference_samples, REFERENCE_SEED + u64::from(frame))?;
        drawn(stage, &*table, |pass| pass.uncounted())
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
    effort: &SamplingEffort,
) -> Result<SamplingPoint, StudyError> {
    let (mut squares, mut host_s) = (0.0, f64::INFINITY);
    for seed in 1..=u64::from(effort.seeds) {
        let table = table(name, samples_per_pixel, seed)?;
        let started = Instant::now();
        let image = image(stage, &*table)?;
        host_s = host_s.min(started.elapsed().as_secs_f64());
        squares += mean_square(&errors(&image, reference));
    }
    Ok(SamplingPoint { samples_per_pixel, rmse: (squares / f64::from(effort.seeds)).sqrt(), host_s })
}

/// Error and time of one table from one sample per pixel to the most, doubling.
pub(super) fn sweep(
    stage: &Stage,
    name: &str,
    reference: &[Vec3],
    effort: &SamplingEffort,
) -> Result<Vec<SamplingPoint>, StudyError> {
    let counts = (0..=effort.most_samples.ilog2()).map(|power| 1 << power);
    counts.map(|count| point(stage, name, count, reference, effort)).collect()
}

/// Something to draw.
pub(super) enum Stage {
    /// A frame of a scene.
    Scene(Box<SceneStage>),
    /// Thin bars, many to a pixel.
    Fence(Fence),
}

/// A frame of a scene.
pub(super) struct SceneStage {
    name: &'static str,
    scene: Scene,
    frame: Frame,
    viewport: Viewport,
}

/// The scenes of the chart.
pub(super) fn scenes(effort: &SamplingEffort) -> Result<Vec<Stage>, StudyError> {
    let ([width, height], (file, frame)) = (effort.size, effort.scene);
    let scene = |name, lens_radius, shutter| -> Result<Stage, StudyError> {
        let size = Some((width, height));
        let overrides = Overrides { size, lens_radius, shutter, ..Overrides::default() };
        let scene = workloads::load(file)?.with_overrides(&overrides)?;
        let frame = scene.frame(frame)?;
        Ok(Stage::Scene(Box::new(SceneStage { name, scene, frame, viewport: viewport(overrides.size)? })))
    };
    Ok(vec![
        scene("motion", Some(0.0), None)?,
        scene("defocus", None, Some(0.0))?,
        scene("motion and defocus", None, None)?,
    ])
}

fn viewport(size: Option<(u32, u32)>) -> Result<Viewport, StudyError> {
    let (width, height) = size.unwrap_or_default();
    Viewport::new(width, height).ok_or_else(|| StudyError::Pipeline(format!("an image of {width}x{height}")))
}

impl Stage {
    /// The name in tables and pictures.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Scene(stage) => stage.name,
            Self::Fence(_) => "fence",
        }
    }

    /// Hands camera, draws, image and background to `render`.
    pub fn draw<T>(
        &self,
        render: impl FnOnce(&Camera, &[Draw<'_>], Viewport, Vec3) -> T,
    ) -> Result<T, StudyError> {
        match self {
            Self::Scene(stage) => {
                let draws = stage.frame.draws(&stage.scene)?;
                Ok(render(&stage.frame.camera, &draws, stage.viewport, stage.scene.background()))
            }
            Self::Fence(fence) => fence.draw(render),
        }
    }
}

/// Bars of a sixteenth of a pixel with gaps as wide, which slide across many pixels before an open lens: a
/// sample in any pixel sees a bar half of the time, and which depends on all of x, u and t at once.
pub(super) struct Fence {
    viewport: Viewport,
    open: Vec<Vec3>,
    close: Vec<Vec3>,
    triangles: Vec<[u32; 3]>,
}

/// Bars in a pixel.
const BARS: f32 = 8.0;
/// Pixels by which the bars slide while the shutter is open.
const SLIDE: f32 = 9.3;

impl Fence {
    /// The fence before an image of `size` pixels.
    pub fn new(size: [u32; 2]) -> Result<Self, StudyError> {
        let viewport = viewport(Some((size[0], size[1])))?;
        let (half_width, half_height) = (0.5 * size[0] as f32, 0.5 * size[1] as f32);
        let margin = 16.0;
        let bars = ((2.0 * (half_width + margin)) * BARS) as u32;
        let (mut open, mut triangles) = (Vec::new(), Vec::new());
        for bar in 0..bars {
            let left = bar as f32 / BARS - half_width - margin;
            let right = left + 0.5 / BARS;
            let first = 4 * bar;
            for (x, y) in [(left, -1.0), (right, -1.0), (right, 1.0), (left, 1.0)] {
                // A pixel of the image is a unit at depth 1, twice as much at depth 2, where the bars stand.
                open.push(Vec3::new(2.0 * x, 2.0 * y * (half_height + margin), 2.0));
            }
            triangles.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
        }
        let close = open.iter().map(|p| *p + Vec3::new(2.0 * SLIDE, 0.0, 0.0)).collect();
        Ok(Self { viewport, open, close, triangles })
    }

    fn draw<T>(
        &self,
        render: impl FnOnce(&Camera, &[Draw<'_>], Viewport, Vec3) -> T,
    ) -> Result<T, StudyError> {
        let refused = |error: &dyn std::fmt::Display| StudyError::Pipeline(error.to_string());
        let tan_half_height = 0.5 * self.viewport.height() as f32;
        let camera = Camera::new(Affine3A::IDENTITY, tan_half_height, 0.25).map_err(|e| refused(&e))?;
        // Focused at depth 1: at depth 2 the circle of confusion is 3 pixels across.
        let camera = camera.with_lens(Some(Lens::new(3.0, 1.0).map_err(|e| refused(&e))?));
        let geometry = Geometry::new(&self.open, &self.close, &self.triangles).map_err(|e| refused(&e))?;
        let draws = [Draw::new(geometry, &White, Cull::None)];
        Ok(render(&camera, &draws, self.viewport, Vec3::ZERO))
    }
}

/// Regimes in which the default table is no better than others.
#[derive(Clone, Debug, Serialize)]
pub struct Failures {
    /// Moving scene, every number of samples one by one: low-discrepancy points come out even at powers of two only.
    pub every_number: Vec<SamplingRow>,
    /// More edges in a pixel than samples: stratification finds nothing to hold on to.
    pub many_edges: Vec<SamplingRow>,
    /// Tables that all pixels share: neighbouring pixels have the same error.
    pub shared: Vec<Shared>,
}

/// Correlation of the errors of neighbours.
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

pub(super) fn failures(
    stages: &[Stage],
    references: &[Vec<Vec3>],
    effort: &SamplingEffort,
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

/// Tables that sample lens and shutter.
pub(super) fn names() -> impl Iterator<Item = &'static str> {
    SampleSpec::names().map(|(name, _)| name).filter(|name| *name != "msaa")
}

fn every_number(
    stage: &Stage,
    reference: &[Vec3],
    effort: &SamplingEffort,
) -> Result<Vec<SamplingRow>, StudyError> {
    let row = |table| {
        let counts = (1..=effort.every_up_to).into_par_iter();
        let points = counts.map(|n| point(stage, table, n, reference, effort));
        let points: Vec<SamplingPoint> = points.collect::<Result<_, _>>()?;
        Ok(SamplingRow { scene: stage.name(), table, exponent: fitted(&points), points })
    };
    ["owen", "random", "jittered"].into_iter().map(row).collect()
}

fn many_edges(effort: &SamplingEffort) -> Result<Vec<SamplingRow>, StudyError> {
    // Every pixel is like every other: a small image does.
    let stage = Stage::Fence(Fence::new([32, 18])?);
    let reference = reference(&stage, effort)?;
    let row = |table| {
        let points = sweep(&stage, table, &reference, effort)?;
        Ok(SamplingRow { scene: stage.name(), table, exponent: fitted(&points), points })
    };
    names().map(row).collect()
}

fn shared(stage: &Stage, reference: &[Vec3], effort: &SamplingEffort) -> Result<Vec<Shared>, StudyError> {
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
