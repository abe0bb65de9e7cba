//! Without timing: the visible triangle of every sample of a scene, and the rate of finding them; and images
//! alone, drawn by the visibility engine where it gives the same bytes.

use std::time::Instant;

use cpu_time::ProcessTime;
use glam::Vec3;
use output::OutDir;
use output::dir::SUMMARY;
use output::report::{FactRow, FileLink, RunReport};
use output::table::{counted, grouped};
use output::terminal::Progress;
use pipeline::sampling::SampleSource;
use pipeline::visibility::{SampleLayout, Visibility, VisibleTriangle, resolve};
use pipeline::{Cull, Draw, Features, Geometry, Gpu, PipelineSpec, RasterPass, Settings};
use rayon::prelude::*;
use serde::Serialize;
use warnings::{Code, Warning};
use workloads::Regime;
use workloads::job::Drawn;
use workloads::scene::CameraUsed;
use workloads::visibility::{Unshaded, VisibilityScene};

use crate::dry_run::is_rendering;
use crate::frame::{caught, image_name, write_image};
use crate::gpu::GpuSpec;
use crate::provenance::SCHEMA;
use crate::summary::SettingsSummary;
use crate::{Distinct, Host, Input, Plan, Prepared, Provenance, RunError, RunOptions, report, warn};

/// Rates in samples of the image per second.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct SampleRates {
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
pub struct VisibilityResult {
    /// Triangle and depth of each sample, in the order `(y width + x) per_pixel + index`.
    pub seen: Vec<VisibleTriangle>,
    /// Rates.
    pub rates: SampleRates,
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
) -> Result<VisibilityResult, String> {
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
        "triangles have coordinates whose products leave the range of 32-bit numbers ({} of {} in view): they may not be seen, or at \
         wrong depths; scale mesh and camera to ordinary lengths",
        regime.extreme, regime.in_view
    );
    let empty =
        "no triangle is in view, so no sample can see one; look at the mesh and where the camera points";
    let coarse = format!(
        "triangles have coordinates so large that 32-bit numbers move them by more than a quarter of a pixel ({} of {} in view): \
         they are drawn out of place; move what the camera sees to the origin",
        regime.coarse, regime.in_view
    );
    let cut = format!(
        "the near plane cuts triangles in front of the camera away, or parts of them ({} in view); give the camera a smaller `near`, or \
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
) -> Option<VisibilityResult> {
    let before = Instant::now();
    let layout = SampleLayout::new(&scene.camera, scene.viewport, source, !geometry.is_still())?;
    let mut visibility = Visibility::new(&layout);
    let before_s = before.elapsed().as_secs_f64();
    let timed =
        (0..runs).map(|_| timed(|| resolve(&layout, geometry, Cull::None, &mut visibility)).1).collect();
    let after = Instant::now();
    let seen = visibility.in_image_order(&layout);
    Some(VisibilityResult { rates: rates(seen.len(), timed, before_s + after.elapsed().as_secs_f64()), seen })
}

fn modelled(
    scene: &VisibilityScene,
    source: &dyn SampleSource,
    geometry: Geometry<'_>,
    features: Features,
    runs: u16,
) -> Result<VisibilityResult, String> {
    let gpu = GpuSpec::load("reference").map_err(|error| error.to_string())?;
    let spec = PipelineSpec { features, ..gpu.pipeline };
    let background = Vec3::ZERO;
    let settings = Settings { spec: &spec, viewport: scene.viewport, samples: source, background };
    let draws = [Draw::new(geometry, &Unshaded, Cull::None)];
    let (mut seen, mut all) = (Vec::new(), Vec::new());
    for _ in 0..runs {
        let (found, run) = timed(|| RasterPass::new(&scene.camera, &draws, &settings).visibility());
        seen = found.map_err(|error| error.to_string())?;
        all.push(run);
    }
    let rates = rates(seen.len(), all, 0.0);
    Ok(VisibilityResult {
        seen: seen.into_iter().map(|(id, depth)| (id, f32::from_bits(depth))).collect(),
        rates,
    })
}

fn timed<T>(work: impl FnOnce() -> T) -> (T, RunTime) {
    let (cpu, wall) = (ProcessTime::now(), Instant::now());
    let result = work();
    (result, RunTime { cpu_s: cpu.elapsed().as_secs_f64(), wall_s: wall.elapsed().as_secs_f64() })
}

/// Rates of runs over `samples`. `outside_s` are the seconds before and after the runs.
fn rates(samples: usize, mut runs: Vec<RunTime>, outside_s: f64) -> SampleRates {
    let (samples, threads) = (samples as f64, rayon::current_num_threads());
    runs.sort_by(|a, b| a.cpu_s.total_cmp(&b.cpu_s));
    let rate = |run: &RunTime| samples * threads as f64 / run.cpu_s.max(f64::MIN_POSITIVE);
    let median = &runs[runs.len() / 2];
    SampleRates {
        samples_per_s: rate(median),
        best_samples_per_s: rate(&runs[0]),
        end_to_end_samples_per_s: samples / (outside_s + median.wall_s),
        runs: runs.len() as u16,
        threads,
    }
}

/// What a run of images alone has, said wherever its results are.
const HAS: &str = "images alone: nothing was counted or timed, so there are no cycles and no joules";

/// Contents of `summary.json` of a run of images alone.
#[derive(Clone, Debug, Serialize)]
pub struct ImagesSummary {
    /// Schema version.
    pub schema: u32,
    /// Version of the program.
    pub version: &'static str,
    /// Name of the scene.
    pub scene: String,
    /// Name of the GPU, whose shading the images have.
    pub gpu: String,
    /// Options of the run. Results depend on these and on the contents of `inputs`.
    pub request: RunOptions,
    /// Input files, sorted by name.
    pub inputs: Vec<Input>,
    /// Settings in use.
    pub settings: SettingsSummary,
    /// Camera of the first frame.
    pub camera: Option<CameraUsed>,
    /// Images of all frames, in order.
    pub images: Vec<ImageRow>,
    /// Warnings.
    pub warnings: Vec<Warning>,
    /// Program, command line and host. All other keys are equal on every machine.
    pub host: Host,
}

/// Image of a frame.
#[derive(Clone, Debug, Serialize)]
pub struct ImageRow {
    /// Frame number in the scene.
    pub frame: u32,
    /// Image file.
    pub image: String,
}

impl ImagesSummary {
    /// Lines for the terminal.
    pub fn lines(&self) -> Vec<String> {
        let SettingsSummary { width, height, samples, frames, triangles, .. } = &self.settings;
        let drawn = format!(
            "{}, {width}x{height}, {} per pixel, {}, {}",
            self.scene,
            counted(*samples as usize, "sample"),
            counted(*frames as usize, "frame"),
            counted(*triangles, "triangle")
        );
        vec![drawn, HAS.to_owned()]
    }
}

/// Checks that a job is a rendering of a scene: what others find are counts.
pub(super) fn check_job(plan: &Plan) -> Result<(), RunError> {
    if is_rendering(plan) {
        return Ok(());
    }
    let why = format!(
        "it draws scenes, and `{}` is a workload, whose results are counts; take another timing level",
        plan.name
    );
    Err(RunError::invalid("--timing none", why))
}

/// A frame as drawn.
struct Frame {
    number: u32,
    triangles: usize,
    warnings: Vec<Warning>,
    /// Linear image, if it is kept for the report.
    picture: Option<Vec<Vec3>>,
}

impl Prepared {
    /// Draws the images and writes the results of a run of images alone into `dir`.
    ///
    /// # Errors
    /// As [`super::prepare`]. Earlier results in `dir` then stay unchanged.
    pub fn draw(self, mut dir: OutDir, progress: &Progress) -> Result<ImagesSummary, RunError> {
        let Self { plan, provenance, distinct, .. } = self;
        let numbers = distinct.numbers();
        let bar = progress.bar("frames", numbers.len() as u64);
        let draw = |group: usize| {
            let frame = caught(numbers[group], || frame(&plan, &distinct, group, &dir))?;
            bar.inc();
            Ok(frame)
        };
        let frames = (0..numbers.len()).into_par_iter().map(draw).collect::<Result<Vec<_>, RunError>>()?;
        let summary = summary(&plan, provenance, &frames);
        for changed in &plan.changed {
            dir.write_file(changed.file.result(), |out| Ok(out.write_all(changed.text.as_bytes())?))?;
        }
        page(&plan, &summary, frames)?.write(&dir, "report.html")?;
        dir.write_json(SUMMARY, &summary)?;
        dir.publish()?;
        Ok(summary)
    }
}

/// Draws the frame of a group, and writes the image of each of its members.
fn frame(plan: &Plan, distinct: &Distinct, group: usize, dir: &OutDir) -> Result<Frame, RunError> {
    let numbers = distinct.numbers();
    let number = numbers[group];
    let mut gpu = Gpu::images_only(&plan.gpu.pipeline)?;
    let Drawn { image, warnings, .. } = plan.job.frame(number, &mut gpu).map_err(RunError::on(&plan.gpu))?;
    distinct.members(group).try_for_each(|number| write_image(plan, dir, number, &image))?;
    let shown = [numbers[0], numbers[numbers.len() / 2], numbers[numbers.len() - 1]];
    let triangles = gpu.finish().triangles();
    Ok(Frame { number, triangles, warnings, picture: shown.contains(&number).then_some(image) })
}

fn summary(plan: &Plan, provenance: Provenance, frames: &[Frame]) -> ImagesSummary {
    let Provenance { request, inputs, camera, host } = provenance;
    let image = |frame: u32| ImageRow { frame, image: format!("{}.png", image_name(frame)) };
    ImagesSummary {
        schema: SCHEMA,
        version: env!("CARGO_PKG_VERSION"),
        scene: plan.name.clone(),
        gpu: plan.gpu.name.clone(),
        request,
        inputs,
        settings: SettingsSummary::new(plan, frames.first().map_or(0, |frame| frame.triangles)),
        camera,
        images: plan.job.settings().frames.clone().map(image).collect(),
        warnings: warn::of_images(plan, frames.iter().map(|frame| (frame.number, &frame.warnings[..]))),
        host,
    }
}

/// The report.
fn page(plan: &Plan, summary: &ImagesSummary, frames: Vec<Frame>) -> Result<RunReport<'static>, RunError> {
    let pictures: Vec<_> =
        frames.into_iter().filter_map(|frame| Some((frame.number, frame.picture?))).collect();
    let file = |(path, what): (&str, &str)| FileLink { path: path.to_owned(), what: what.to_owned() };
    let files = [
        ("summary.json", "settings and images of the run, for scripts"),
        ("images/", "every frame"),
        ("manifest.json", "these files with their sizes and hashes"),
    ];
    Ok(RunReport {
        title: plan.name.clone().into(),
        facts: vec![
            FactRow::new("scene", plan.name.clone()),
            FactRow::new("triangles", grouped(summary.settings.triangles as u64)),
            FactRow::new("modelled", HAS),
            FactRow::new("shaded as on", format!("{}: {}", plan.gpu.name, plan.gpu.doc)),
            FactRow::new("Quintile", summary.version),
        ],
        warnings: report::warnings(&summary.warnings),
        images: report::images(plan, &pictures)?,
        settings: report::view(plan, &summary.settings, summary.camera.as_ref()),
        inputs: report::inputs(&summary.inputs),
        files: files.map(file).into(),
        host: report::host(&summary.host),
        ..RunReport::default()
    })
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
