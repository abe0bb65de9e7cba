//! Soups, and how long the engine takes.

use cpu_time::ThreadTime;
use pipeline::sampling::HashedSamples;
use pipeline::visibility::{SampleLayout, Tally, Visibility, resolve};
use pipeline::{Cull, Geometry, LensShape};
use rayon::{ThreadPool, ThreadPoolBuilder};
use serde::Serialize;
use workloads::stress::{Size, Soup, StressError, StressScene};

use super::{Base, Effort, Kind};
use crate::study::StudyError;

/// One measurement.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Point {
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

/// How often triangles cover the image.
pub(super) const LAYERS: f64 = 4.0;
/// Decides where triangles are and where samples look.
const SEED: u64 = 1;

/// Times the engine on a thread of its own; samples are sorted on all others.
pub(super) struct Timer<'a> {
    effort: &'a Effort,
    thread: ThreadPool,
}

impl<'a> Timer<'a> {
    pub fn new(effort: &'a Effort) -> Result<Self, StudyError> {
        Ok(Self { effort, thread: ThreadPoolBuilder::new().num_threads(1).build()? })
    }

    pub fn point(&self, trial: Base, kind: Kind) -> Result<Point, StudyError> {
        let [motion_px, defocus_px] = kind.blur_px(trial.blur_px);
        let size = Size { side_px: self.effort.side_px, triangles: trial.triangles };
        let scene = Soup { size, layers: LAYERS, motion_px, defocus_px }.scene(SEED)?;
        let (cpu_s, tally) = self.time(&scene, trial.samples)?;
        Ok(Point {
            triangles: trial.triangles,
            samples_per_pixel: trial.samples,
            motion_px,
            defocus_px,
            cpu_s,
            sample_tests: 16 * tally.packets,
            hits: tally.hits,
        })
    }

    fn time(&self, scene: &StressScene, samples: u32) -> Result<(f64, Tally), StudyError> {
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
