//! A run: scene, pipeline, clock, watts, trace, frames, files.
//!
//! ```text
//! RunOptions -> Plan -> open -> prepare: Distinct -> choose -> Prepared -> run: simulate -> measure -> Outcome -> write
//! ```

mod choice;
pub mod compare;
mod dry_run;
mod error;
mod frame;
mod gpu;
mod heat;
mod measure;
mod one_frame;
mod options;
mod pictures;
mod plan;
mod provenance;
mod regime;
mod report;
mod sampled;
mod simulate;
mod simulated;
mod stalls;
mod summary;
pub mod visibility;
mod warn;
mod work;
mod write;

use output::progress::Progress;
use output::{Destination, OutDir};

pub use choice::{Choice, Dimensions, ProbeSummary, Verified, cheapest_level};
pub use dry_run::{DryRun, Expected};
pub use error::RunError;
pub use frame::{BIN_PS, CrashedFrame, frames_of};
pub use gpu::{GpuError, GpuSpec, PowerFiles};
pub use heat::HeatPicture;
pub use measure::{Checks, Measurement, Resolution};
pub use one_frame::MachineTexts;
pub use options::{Method, PacingChoice, Requested, RunOptions, Sampling};
pub use plan::{Plan, fits_memory};
pub use provenance::{Host, Input, Provenance, again};
pub use regime::Regime;
pub use sampled::{Forecast, FramePreview, Previewer, Previews, Signatures};
pub use simulated::{FrameCost, Modelled, Observed, Origin, Quantity, RunFrame, SampledSummary, Simulated};
pub use stalls::StallShares;
pub use summary::{Detection, Figures, FrameRow, Summary};
pub use work::{Distinct, Work};

/// Everything a run found out.
pub struct Outcome {
    /// What was asked for.
    pub plan: Plan,
    /// What the simulator knows.
    pub simulated: Simulated,
    /// What the trace says.
    pub measurement: Measurement,
    /// The numbers of `summary.json`.
    pub summary: Summary,
}

/// A run with everything loaded, checked and chosen, of which nothing is simulated and nothing written yet.
pub struct Prepared {
    plan: Plan,
    provenance: Provenance,
    distinct: Distinct,
    choice: Option<Choice>,
}

/// Prepares a run: finds the frames that differ, and makes the choices that were left to the program, or those `made` by the run
/// that is repeated. The program was built from `revision`.
///
/// # Errors
/// [`RunError`]; [`RunError::is_usage`] tells the caller's mistakes from failures.
pub fn prepare(
    mut plan: Plan,
    recorded: Option<Choice>,
    revision: Option<&str>,
    progress: &Progress,
) -> Result<Prepared, RunError> {
    report_camera(&plan, progress);
    let provenance = Provenance::new(&plan, revision)?;
    let distinct = Distinct::new(&plan.work)?;
    let choice = choice::choose(&mut plan, recorded, &distinct, progress)?;
    Ok(Prepared { plan, provenance, distinct, choice })
}

impl Prepared {
    /// What the run is expected to take, found by drawing a frame small; nothing for a workload.
    ///
    /// # Errors
    /// When that frame cannot be drawn.
    pub fn expected(&self) -> Result<Option<Expected>, RunError> {
        Expected::new(&self.plan, &self.distinct)
    }

    /// Simulates, measures and writes the results into `dir`.
    ///
    /// # Errors
    /// As [`prepare`]. Earlier results in `dir` are then as they were.
    pub fn run(self, mut dir: OutDir, progress: &Progress) -> Result<Outcome, RunError> {
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
        let outcome = Outcome { plan, simulated, measurement, summary };
        write::write(&outcome, &dir, progress)?;
        dir.publish()?;
        Ok(outcome)
    }
}

/// Locks the folder `out` for the results of `plan`.
///
/// # Errors
/// As [`Destination::open`]: before any work, where results cannot go there.
pub fn open(plan: &Plan, out: &Destination) -> Result<OutDir, RunError> {
    Ok(out.open([write::claim(plan)])?)
}

/// Runs the whole line and writes its results into `out`.
///
/// # Errors
/// As [`open`], [`prepare`] and [`Prepared::run`].
pub fn run(options: RunOptions, out: &Destination, progress: &Progress) -> Result<Outcome, RunError> {
    let plan = Plan::resolve(options)?;
    let dir = open(&plan, out)?;
    prepare(plan, None, None, progress)?.run(dir, progress)
}

/// Says in detail which camera sees the scene, before minutes of work are spent on it.
fn report_camera(plan: &Plan, progress: &Progress) {
    let Work::Scene(scene) = &plan.work else { return };
    if let Ok(camera) = scene.camera_used() {
        progress.detail(&format!("camera, {}: --camera '{}'", camera.source, camera.ron));
    }
}

/// The figures that every run draws into `plots/`, and what they show.
pub const FIGURES: [(&str, &str); 4] = [
    ("power_run", "power over the run with found and true frame starts"),
    ("frame_power", "power over one frame, stacked by part"),
    ("unit_busy", "how busy each unit is over one frame"),
    ("frame_energy", "energy of each frame, measured and true"),
];
