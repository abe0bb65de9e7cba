//! Visible triangle of every sample of a scene, and the rate of finding them.

use std::time::Instant;

use cpu_time::ProcessTime;
use pipeline::sampling::SampleSource;
use pipeline::visibility::{SampleLayout, Visibility, VisibleTriangle, resolve};
use pipeline::{Cull, Draw, Features, Geometry, PipelineSpec, RasterPass, Settings};
use serde::Serialize;
use warnings::{Code, Warning};
use workloads::Regime;
use workloads::visibility::{Unshaded, VisibilityScene};

use crate::gpu::GpuSpec;

/// Rates in samples of the image per second.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Rates {
    /// By CPU time per thread in set-up, binning, tests and depth: median of all runs.
    pub samples_per_s: f64,
    /// The same of the fastest run.
    pub best_samples_per_s: f64,
    /// By wall-clock time of the median run, including preparation of samples and reordering of results.
    pub end_to_end_samples_per_s: f64,
    /// Number of runs.
    pub runs: u16,
    /// Number of threads.
    pub threads: usize,
}

/// Visible triangles and rates.
pub struct Found {
    /// Triangle and depth of each sample, in the order `(y width + x) per_pixel + index`.
    pub seen: Vec<VisibleTriangle>,
    /// Rates.
    pub rates: Rates,
}

/// Time of one run: CPU seconds of all threads, and wall-clock seconds.
struct RunTime {
    cpu_s: f64,
    wall_s: f64,
}

/// Computes the visible triangle and depth of every sample of `source`, `runs` times, on the threads of the
/// current pool. `tests` selects the modelled hardware with these tile tests; `None` selects the fast engine.
/// The fast engine does not support orthographic cameras; for these all tile tests are modelled.
///
/// # Errors
/// If the mesh cannot be rendered, as text.
pub fn find(
    scene: &VisibilityScene,
    source: &dyn SampleSource,
    tests: Option<Features>,
    runs: u16,
) -> Result<Found, String> {
    // The same array at both ends is a still mesh.
    let close = if scene.open == scene.close { &scene.open } else { &scene.close };
    let geometry = Geometry::new(&scene.open, close, &scene.triangles).map_err(|error| error.to_string())?;
    let fast = if tests.is_none() { fastest(scene, source, &geometry, runs) } else { None };
    match fast {
        Some(found) => Ok(found),
        None => modelled(scene, source, geometry, tests.unwrap_or(Features::ALL), runs),
    }
}

/// Warnings about an empty image or coordinates out of range.
pub fn warnings(scene: &VisibilityScene) -> Vec<Warning> {
    let Ok(geometry) = Geometry::new(&scene.open, &scene.close, &scene.triangles) else { return Vec::new() };
    let draws = [Draw::new(geometry, &Unshaded, Cull::None)];
    let regime = Regime::of(&scene.camera, &draws, scene.viewport, scene.per_pixel);
    let extreme = format!(
        "{} of {} triangles in view have coordinates whose products leave the range of 32-bit numbers: they may not be seen, or at \
         wrong depths; scale mesh and camera to ordinary lengths",
        regime.extreme, regime.in_view
    );
    let empty =
        "no triangle is in view, so no sample can see one; look at the mesh and where the camera points";
    let coarse = format!(
        "{} of {} triangles in view have coordinates so large that 32-bit numbers move them by more than a quarter of a pixel: \
         they are drawn out of place; move what the camera sees to the origin",
        regime.coarse, regime.in_view
    );
    let cut = format!(
        "the near plane cuts {} triangles in front of the camera away, or parts of them; give the camera a smaller `near`, or \
         move it",
        regime.cut
    );
    let found = [
        (regime.extreme > 0).then(|| Warning::new(Code::CoordinatesOutOfRange, extreme)),
        (regime.coarse > 0).then(|| Warning::new(Code::CoordinatesCoarse, coarse)),
        (regime.cut > 0).then(|| Warning::new(Code::NearPlaneCuts, cut)),
        (regime.in_view == 0).then(|| Warning::new(Code::EmptyFrame, empty)),
    ];
    found.into_iter().flatten().collect()
}

/// Runs the fast engine; `None` if it does not support the camera.
fn fastest(
    scene: &VisibilityScene,
    source: &dyn SampleSource,
    geometry: &Geometry<'_>,
    runs: u16,
) -> Option<Found> {
    let before = Instant::now();
    let layout = SampleLayout::new(&scene.camera, scene.viewport, source, !geometry.is_still())?;
    let mut visibility = Visibility::new(&layout);
    let before_s = before.elapsed().as_secs_f64();
    let timed =
        (0..runs).map(|_| timed(|| resolve(&layout, geometry, Cull::None, &mut visibility)).1).collect();
    let after = Instant::now();
    let seen = visibility.in_image_order(&layout);
    Some(Found { rates: rates(seen.len(), timed, before_s + after.elapsed().as_secs_f64()), seen })
}

fn modelled(
    scene: &VisibilityScene,
    source: &dyn SampleSource,
    geometry: Geometry<'_>,
    features: Features,
    runs: u16,
) -> Result<Found, String> {
    let gpu = GpuSpec::load("reference").map_err(|error| error.to_string())?;
    let spec = PipelineSpec { features, ..gpu.pipeline };
    let background = glam::Vec3::ZERO;
    let settings = Settings { spec: &spec, viewport: scene.viewport, samples: source, background };
    let draws = [Draw::new(geometry, &Unshaded, Cull::None)];
    let (mut seen, mut all) = (Vec::new(), Vec::new());
    for _ in 0..runs {
        let (found, run) = timed(|| RasterPass::new(&scene.camera, &draws, &settings).visibility());
        seen = found.map_err(|error| error.to_string())?;
        all.push(run);
    }
    let rates = rates(seen.len(), all, 0.0);
    Ok(Found { seen: seen.into_iter().map(|(id, depth)| (id, f32::from_bits(depth))).collect(), rates })
}

fn timed<T>(work: impl FnOnce() -> T) -> (T, RunTime) {
    let (cpu, wall) = (ProcessTime::now(), Instant::now());
    let result = work();
    (result, RunTime { cpu_s: cpu.elapsed().as_secs_f64(), wall_s: wall.elapsed().as_secs_f64() })
}

/// Rates of runs over `samples`. `outside_s` are the seconds before and after the runs.
fn rates(samples: usize, mut runs: Vec<RunTime>, outside_s: f64) -> Rates {
    let (samples, threads) = (samples as f64, rayon::current_num_threads());
    runs.sort_by(|a, b| a.cpu_s.total_cmp(&b.cpu_s));
    let rate = |run: &RunTime| samples * threads as f64 / run.cpu_s.max(f64::MIN_POSITIVE);
    let median = &runs[runs.len() / 2];
    Rates {
        samples_per_s: rate(median),
        best_samples_per_s: rate(&runs[0]),
        end_to_end_samples_per_s: samples / (outside_s + median.wall_s),
        runs: runs.len() as u16,
        threads,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rates_are_per_thread_and_of_the_median_run() {
        let runs = [(3.0, 2.0), (1.0, 0.5), (2.0, 1.0)].map(|(cpu_s, wall_s)| RunTime { cpu_s, wall_s });
        let pool = rayon::ThreadPoolBuilder::new().num_threads(2).build().unwrap();
        let rates = pool.install(|| rates(100, runs.into(), 3.0));
        assert_eq!((rates.samples_per_s, rates.best_samples_per_s), (100.0, 200.0));
        assert_eq!((rates.end_to_end_samples_per_s, rates.runs, rates.threads), (25.0, 3, 2));
    }
}
