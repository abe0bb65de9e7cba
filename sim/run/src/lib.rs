//! A run: from a scene and a GPU to frames in joules, a power trace and a folder of results.
//!
//! ```text
//! RunOptions -> Plan -> open -> prepare -> Prepared -> run: simulate -> measure -> FinishedRun -> write
//! ```
//!
//! - [`RunOptions`]: everything that may be requested; [`Plan`]: with all inputs loaded and checked.
//! - [`GpuSpec`]: a GPU: its pipeline, its machine, and the platform and energy table it belongs to.
//! - [`Distinct`]: which frames differ.
//! - [`DrawnFrames`]: drawn frames, timed again on other machines.
//! - [`frames_of`]: frames in cycles and joules, without a trace. [`run()`]: all of it, into a folder.
//! - [`Summary`]: `summary.json`; [`compare`]: two of them side by side.
//!
//! ```
//! use run::{Plan, RunOptions, frames_of};
//! use output::terminal::Progress;
//!
//! let plan = Plan::resolve(RunOptions { scene: "tiny".into(), ..RunOptions::default() })?;
//! let frames = frames_of(&plan, &[0], &Progress::new(true))?;
//! assert!(frames[0].cycles > 0 && frames[0].cost().energy_j > 0.0);
//! # Ok::<(), run::RunError>(())
//! ```

mod changes;
mod choice;
pub mod compare;
mod dry_run;
mod frame;
mod gpu;
mod hardware;
mod heat;
mod measure;
mod options;
mod passes;
mod plan;
mod provenance;
mod recording;
mod report;
mod sampled;
mod simulated;
mod summary;
pub mod visibility;
mod warn;
mod write;

use std::fmt::Display;

use output::image::ImageError;
use output::plot::PlotError;
use output::terminal::Progress;
use output::{Destination, OutDir, OutputError};
use pipeline::PassError;
use power_model::{EnergyTable, Platform};
use rayon::prelude::*;
use timing::{Level, TimingError};
use workloads::job::JobError;
use workloads::{Overrides, Scene};

use self::frame::{FrameSimulator, SimulatedFrame, max_bins_per_frame};

pub use changes::{ChangeError, ChangedFile, InputFile};
pub use choice::{Choice, Dimensions, ProbeSummary, Verified, cheapest_level};
pub use dry_run::{DryRun, DryTimed, Expected, duration};
pub use frame::{BIN_PS, CrashedFrame, Distinct, JobFrame, PassEnergy, frames_of, panic_message};
pub use gpu::{GpuError, GpuSpec, PowerFiles};
pub use hardware::{scaling, structure};
pub use heat::HeatPicture;
pub use measure::{Checks, Measurement, Resolution};
pub use options::{Change, HeatQuantity, HeatRequest, PacingChoice, Requested, RunOptions, Sampling};
pub use passes::{PassSummary, StallShares, WorkSummary, passes_of};
pub use plan::{Plan, fits_memory, refuse_beside_images};
pub use provenance::{HardwareSummary, Host, Input, Provenance, again, area_mm2};
pub use recording::{DrawnFrames, MACHINES_IN_TURN, RecordedRun, TimedFrames};
pub use sampled::{Forecast, FramePreview, Previewer, Previews, Signatures};
pub use simulated::{
    CONFIDENCE, FrameCost, Modelled, Observed, Origin, RunFrame, RunQuantity, SampledSummary, Simulated,
    StatedError,
};
pub use summary::{Detection, Figures, FrameRow, Summary};
pub use visibility::{ImageRow, ImagesSummary};
pub use warn::warnings_of;

/// Results of a run.
pub struct FinishedRun {
    /// Options and loaded inputs.
    pub plan: Plan,
    /// Frames as simulated: the ground truth.
    pub simulated: Simulated,
    /// Frames as measured in the power trace.
    pub measurement: Measurement,
    /// Contents of `summary.json`.
    pub summary: Summary,
}

/// A run that is ready to start: inputs loaded, options checked, level and frames chosen. Nothing is
/// simulated or written yet.
pub struct Prepared {
    plan: Plan,
    provenance: Provenance,
    distinct: Distinct,
    choice: Option<Choice>,
}

/// Prepares a run: finds the distinct frames and applies the choice of `--accuracy` and `--budget`. The
/// choice is `recorded` when a run is repeated, otherwise a probe makes it. `revision` is the git revision of
/// the program.
///
/// # Errors
/// [`RunError`]; [`RunError::is_usage`] separates usage errors from failures.
pub fn prepare(
    mut plan: Plan,
    recorded: Option<Choice>,
    revision: Option<&str>,
    progress: &Progress,
) -> Result<Prepared, RunError> {
    if plan.options.timing.is_none() {
        visibility::check_job(&plan)?;
    }
    report_camera(&plan, progress);
    let provenance = Provenance::new(&plan, revision)?;
    let distinct = Distinct::new(&*plan.job)?;
    let choice = choice::choose(&mut plan, recorded, &distinct, progress)?;
    Ok(Prepared { plan, provenance, distinct, choice })
}

impl Prepared {
    /// Expected time and memory, from one frame at reduced sizes.
    ///
    /// # Errors
    /// If that frame cannot be rendered.
    pub fn expected(&self) -> Result<Expected, RunError> {
        Expected::new(&self.plan, &self.distinct)
    }

    /// Whether the estimate takes little time beside the run. Small images of a workload may take as long as a
    /// whole frame, as its passes over light or objects stay as they are.
    pub fn is_worth_estimating(&self) -> bool {
        let frames = self.distinct.numbers().len();
        dry_run::is_rendering(&self.plan) || frames >= dry_run::MIN_WORKLOAD_FRAMES
    }

    /// Simulates, measures and writes the results into `dir`.
    ///
    /// # Errors
    /// As [`prepare`]. Earlier results in `dir` then stay unchanged.
    pub fn run(self, mut dir: OutDir, progress: &Progress) -> Result<FinishedRun, RunError> {
        let Self { plan, provenance, distinct, mut choice } = self;
        let simulated = simulate(&plan, &distinct, &dir, progress)?;
        if let Some(choice) = &mut choice {
            choice.add_prediction_error(&simulated);
        }
        let verified =
            plan.options.verify.then(|| choice::verify(&plan, &simulated, progress)).transpose()?;
        let measurement = measure::measure(&plan, &simulated)?;
        let summary =
            Summary { choice, verified, ..Summary::new(&plan, provenance, &simulated, &measurement) }
                .with_error_warnings();
        let outcome = FinishedRun { plan, simulated, measurement, summary };
        write::write(&outcome, &dir, progress)?;
        dir.publish()?;
        Ok(outcome)
    }
}

/// Locks the folder `out` for the results of `plan`.
///
/// # Errors
/// As [`Destination::open`], if results cannot be written there.
pub fn open(plan: &Plan, out: &Destination) -> Result<OutDir, RunError> {
    Ok(out.open([write::claim(plan)])?)
}

/// Plans, prepares and executes a run; writes its results into `out`.
///
/// # Errors
/// As [`open`], [`prepare`] and [`Prepared::run`].
pub fn run(options: RunOptions, out: &Destination, progress: &Progress) -> Result<FinishedRun, RunError> {
    let plan = Plan::resolve(options)?;
    let dir = open(&plan, out)?;
    prepare(plan, None, None, progress)?.run(dir, progress)
}

/// Prints the camera of a scene under `--verbose`, before the simulation starts.
fn report_camera(plan: &Plan, progress: &Progress) {
    if let Some(Ok(camera)) = plan.job.scene().map(Scene::camera_used) {
        progress.detail(&format!("camera, {}: --camera '{}'", camera.source, camera.ron));
    }
}

/// Figures that a run writes into `plots/`: name and description.
pub const FIGURES: [(&str, &str); 5] = [
    ("power_run", "power over the run with found and true frame starts"),
    ("frame_power", "power over one frame, stacked by part"),
    ("unit_busy", "how busy each unit is over one frame"),
    ("frame_energy", "energy of each frame, measured and true"),
    ("stalls", "what each unit waited for in one frame (only with --timing stepped)"),
];

/// Simulates the frames that the plan requires and writes each image when its frame is done.
fn simulate(
    plan: &Plan,
    distinct: &Distinct,
    dir: &OutDir,
    progress: &Progress,
) -> Result<Simulated, RunError> {
    let max_bins = max_bins_per_frame(distinct.numbers().len());
    let simulator = FrameSimulator { plan, distinct, dir: Some(dir), max_bins, checked: 0 };
    if plan.options.sampling == Sampling::Every || has_few_distinct(distinct, plan.options.sampling) {
        return every(&simulator, progress);
    }
    sampled::simulate(simulator, progress)
}

/// Whether there are so few distinct frames that prediction would save nothing.
fn has_few_distinct(distinct: &Distinct, sampling: Sampling) -> bool {
    let (differ, all) = (distinct.numbers().len(), distinct.groups().len());
    differ == 1 || differ < all && differ <= sampling.first(all)
}

/// Simulates all distinct frames without writing files.
fn without_files(plan: &Plan, progress: &Progress) -> Result<Simulated, RunError> {
    let distinct = &Distinct::new(&*plan.job)?;
    let max_bins = max_bins_per_frame(distinct.numbers().len());
    every(&FrameSimulator { plan, distinct, dir: None, max_bins, checked: 0 }, progress)
}

/// Simulates all distinct frames. Keeps the images of the first, the middle and the last.
fn every(simulator: &FrameSimulator<'_>, progress: &Progress) -> Result<Simulated, RunError> {
    let numbers = simulator.distinct.numbers();
    let middle = numbers[numbers.len() / 2];
    let shown = [middle, numbers[0], numbers[numbers.len() - 1]];
    let bar = progress.bar("frames", numbers.len() as u64);
    let simulate = |group: usize| {
        let done = simulator.simulate(group, shown.contains(&numbers[group]))?;
        bar.inc();
        Ok(done)
    };
    let done: Vec<SimulatedFrame> =
        (0..numbers.len()).into_par_iter().map(simulate).collect::<Result<_, RunError>>()?;
    let (mut distinct, mut pictures, mut heat) = (Vec::new(), Vec::new(), Vec::new());
    for done in done {
        if done.frame.index == middle {
            heat = done.heat;
        }
        pictures.extend(done.picture.map(|picture| (done.frame.index, picture)));
        distinct.push(done.frame);
    }
    let frames = simulator.distinct.groups().to_vec();
    Ok(Simulated { distinct, frames, pictures, heat, sampled: None })
}

/// Files of a machine as RON text; `None` for those of the reference.
#[derive(Clone, Copy, Debug, Default)]
pub struct MachineTexts<'a> {
    /// The GPU file.
    pub gpu: Option<&'a str>,
    /// The platform file.
    pub platform: Option<&'a str>,
    /// The energy table.
    pub table: Option<&'a str>,
}

impl MachineTexts<'_> {
    /// Simulates one frame of the scene `tiny` at 16x12 pixels at `level`, records it and finds it in the
    /// trace. Returns its energy in the trace in joules and writes no files. Messages name the files
    /// `gpu.ron`, `platform.ron` and `table.ron`.
    ///
    /// # Errors
    /// If a file is invalid, or the files do not match.
    pub fn one_frame(&self, level: Level) -> Result<f64, RunError> {
        let gpu =
            self.gpu.map_or_else(|| GpuSpec::load("reference"), |text| GpuSpec::parse(text, "gpu.ron"))?;
        let platform = self
            .platform
            .map_or_else(|| Platform::builtin("reference"), |text| Platform::parse(text, "platform.ron"))?;
        let table = self
            .table
            .map_or_else(|| EnergyTable::builtin("28nm"), |text| EnergyTable::parse(text, "table.ron"))?;
        let overrides =
            Overrides { size: Some((16, 12)), samples: Some(1), frames: Some(0..1), ..Overrides::default() };
        let options =
            RunOptions { scene: "tiny".into(), overrides, timing: Some(level), ..RunOptions::default() };
        let plan = Plan::resolve(options)?.on(gpu, platform, table)?;
        let simulated = without_files(&plan, &Progress::new(true))?;
        let measurement = measure::measure(&plan, &simulated)?;
        Ok(measurement.frames.iter().map(|frame| frame.energy_j).sum())
    }
}

/// Error of a run.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs, reason = "the variants are the sources, documented there")]
pub enum RunError {
    #[error(transparent)]
    Scene(#[from] workloads::LoadError),
    #[error(transparent)]
    Frame(#[from] workloads::FrameError),
    #[error(transparent)]
    Job(#[from] JobError),
    /// Groups of lanes do not run on the GPU.
    #[error("GPU `{gpu}`: {source}")]
    Groups { gpu: String, source: JobError },
    #[error(transparent)]
    Pass(#[from] PassError),
    #[error(transparent)]
    Draw(#[from] pipeline::DrawError),
    #[error(transparent)]
    Camera(#[from] pipeline::CameraError),
    #[error(transparent)]
    Stress(#[from] workloads::stress::StressError),
    #[error(transparent)]
    Gpu(#[from] GpuError),
    #[error(transparent)]
    Change(#[from] ChangeError),
    #[error(transparent)]
    Platform(#[from] power_model::PlatformError),
    #[error(transparent)]
    Table(#[from] power_model::EnergyTableError),
    #[error("energy table and platform: {0}")]
    Model(#[from] power_model::ModelError),
    #[error("frame {frame}: internal error of the timing model: {source}. Please report it")]
    Timeline { frame: u32, source: power_model::TimelineError },
    #[error("timing: {0}")]
    Timing(#[from] TimingError),
    #[error("pacing: {0}")]
    Pacing(#[from] power_model::PacingError),
    #[error(transparent)]
    Samples(#[from] pipeline::sampling::SampleTableError),
    #[error(transparent)]
    Device(#[from] traces::device::DeviceError),
    #[error("sampling the power curve: {0}")]
    Sample(#[from] traces::device::SampleError),
    #[error("finding frames: {0}")]
    Marks(#[from] traces::frames::MarkError),
    #[error(transparent)]
    Output(#[from] OutputError),
    #[error("drawing a plot: {0}")]
    Plot(#[from] PlotError),
    #[error("encoding an image: {0}")]
    Image(#[from] ImageError),
    #[error("frames.csv: {0}")]
    Frames(#[from] traces::energy::FrameTableError),
    #[error("{path}: cannot read it: {source}; check the path")]
    Input { path: String, source: std::io::Error },
    #[error(transparent)]
    Spec(#[from] activity::spec::SpecError),
    /// A file is cut off or damaged.
    #[error("{path}: {message}")]
    Damaged { path: String, message: String },
    #[error("a recorded frame: {0}")]
    Stream(#[from] activity::StreamError),
    #[error(transparent)]
    Write(#[from] traces::io::WriteError),
    /// A setting is invalid, or two settings conflict.
    #[error("{0}")]
    Setting(String),
}

impl RunError {
    /// Invalid setting, with the message of `why`.
    pub fn setting(why: impl Display) -> Self {
        Self::Setting(why.to_string())
    }

    /// What is wrong with `name`: a setting, a file or what is drawn.
    pub fn invalid(name: impl Display, why: impl Display) -> Self {
        Self::Setting(format!("{name}: {why}"))
    }

    /// Error of a frame on `gpu`, with its name where it is the GPU that cannot run groups.
    pub(crate) fn on(gpu: &GpuSpec) -> impl FnOnce(JobError) -> Self {
        |source| match source {
            JobError::Pass(PassError::Compute { .. }) => Self::Groups { gpu: gpu.name.clone(), source },
            other => Self::Job(other),
        }
    }

    /// Whether the request is at fault (exit code 2): a wrong value, or an input that is missing or damaged.
    /// Other failures come while it runs (exit code 1).
    pub fn is_usage(&self) -> bool {
        match self {
            Self::Output(error) => error.is_usage(),
            Self::Pacing(error) => matches!(error, power_model::PacingError::Rate(_)),
            Self::Timing(error) => matches!(error, TimingError::TooLong),
            Self::Job(error) => matches!(error, JobError::Setting(_) | JobError::Pass(_)),
            Self::Frame(_)
            | Self::Timeline { .. }
            | Self::Plot(_)
            | Self::Image(_)
            | Self::Frames(_)
            | Self::Write(_) => false,
            _ => true,
        }
    }
}

#[cfg(test)]
mod tests {
    use pipeline::ComputeError;

    use super::*;

    #[test]
    fn a_missing_compute_unit_names_the_gpu() {
        let gpu = GpuSpec::load("mobile").unwrap();
        let pass = || "culling".to_owned();
        let missing = PassError::Compute { pass: pass(), error: ComputeError::Missing };
        let error = RunError::on(&gpu)(missing.into());
        assert!(
            error.is_usage() && error.to_string().starts_with("GPU `mobile`: pass `culling`:"),
            "{error}"
        );
        let large = PassError::Memory { pass: pass(), bytes: 0 };
        assert!(RunError::on(&gpu)(large.into()).to_string().starts_with("pass `culling`"));
    }
}
