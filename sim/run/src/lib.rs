//! A run: from a scene and a GPU to frames in joules, a power trace and a folder of results.
//!
//! ```text
//! RunOptions -> Plan -> open -> prepare -> Prepared -> run: simulate -> measure -> FinishedRun -> write
//! ```
//!
//! - [`RunOptions`]: everything that may be requested; [`Plan`]: with all inputs loaded and checked.
//! - [`GpuSpec`]: a GPU: its pipeline, its machine, and the platform and energy table it belongs to.
//! - [`Distinct`]: which frames differ.
//! - [`Recording`]: drawn frames, timed again on other machines.
//! - [`frames_of`]: frames in cycles and joules, without a trace. [`run()`]: all of it, into a folder.
//! - [`Summary`]: `summary.json`; [`compare`]: two of them side by side.
//!
//! ```
//! use run::{Plan, RunOptions, frames_of};
//! use output::progress::Progress;
//!
//! let plan = Plan::resolve(RunOptions { scene: "tiny".into(), ..RunOptions::default() })?;
//! let frames = frames_of(&plan, &[0], &Progress::new(true))?;
//! assert!(frames[0].cycles > 0 && frames[0].cost().energy_j > 0.0);
//! # Ok::<(), run::RunError>(())
//! ```

mod changes;
mod choice;
pub mod compare;
mod distinct;
mod dry_run;
mod error;
mod frame;
mod gpu;
mod hardware;
mod heat;
mod images;
mod job_frame;
mod machine;
mod measure;
mod options;
mod passes;
mod pictures;
mod plan;
mod provenance;
mod recording;
mod report;
mod sampled;
mod simulate;
mod simulated;
mod stalls;
mod stated;
mod summary;
pub mod visibility;
mod warn;
mod write;

use output::progress::Progress;
use output::{Destination, OutDir};
use workloads::Scene;

pub use changes::{ChangeError, ChangedFile, InputFile};
pub use choice::{Choice, Dimensions, ProbeSummary, Verified, cheapest_level};
pub use distinct::Distinct;
pub use dry_run::{DryRun, DryTimed, Expected, duration};
pub use error::RunError;
pub use frame::{CrashedFrame, frames_of, panic_message};
pub use gpu::{GpuError, GpuSpec, PowerFiles};
pub use hardware::{scaling, structure};
pub use heat::HeatPicture;
pub use images::{ImageRow, ImagesSummary};
pub use job_frame::{BIN_PS, JobFrame, PassEnergy};
pub use machine::{HardwareSummary, area_mm2};
pub use measure::{Checks, Measurement, Resolution};
pub use options::{Change, HeatQuantity, PacingChoice, Requested, RunOptions, Sampling};
pub use passes::{PassSummary, WorkSummary, passes_of};
pub use plan::{Plan, fits_memory, refuse_beside_images};
pub use provenance::{Host, Input, Provenance, again};
pub use recording::{MACHINES_IN_TURN, RecordedRun, Recording, TimedFrames};
pub use sampled::{Forecast, FramePreview, Previewer, Previews, Signatures};
pub use simulate::MachineTexts;
pub use simulated::{FrameCost, Modelled, Observed, Origin, Quantity, RunFrame, SampledSummary, Simulated};
pub use stalls::StallShares;
pub use stated::{CONFIDENCE, StatedError};
pub use summary::{Detection, Figures, FrameRow, Summary};
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
        images::check_job(&plan)?;
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
        let simulated = simulate::simulate(&plan, &distinct, &dir, progress)?;
        if let Some(choice) = &mut choice {
            choice.add_prediction_error(&simulated);
        }
        let verified =
            plan.options.verify.then(|| choice::verify(&plan, &simulated, progress)).transpose()?;
        let measurement = measure::measure(&plan, &simulated)?;
        let summary =
            Summary { choice, verified, ..Summary::new(&plan, provenance, &simulated, &measurement) }
                .with_choice_warnings();
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
