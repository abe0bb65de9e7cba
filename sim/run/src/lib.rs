//! A run: scene, pipeline, clock, watts, trace, frames, files.
//!
//! ```text
//! RunOptions -> Plan -> open -> prepare: Distinct -> choose -> Prepared -> run: simulate -> measure -> Outcome -> write
//! ```

mod again;
mod checks;
mod choice;
pub mod compare;
mod distinct;
mod draw;
mod dry_run;
mod error;
mod expected;
mod facts;
mod frame;
mod frame_rows;
mod gpu;
mod heat;
mod limits;
mod measure;
mod modelled;
mod one_frame;
mod options;
mod pairing;
mod pictures;
mod plan;
mod provenance;
mod recorder;
mod regime;
mod report;
mod sampled;
mod sampling;
mod simulate;
mod simulated;
mod stalls;
mod summary;
mod timeline;
pub mod visibility;
mod warn;
mod work;
mod write;

use output::progress::Progress;
use output::{Destination, OutDir};

pub use again::again;
pub use checks::Checks;
pub use choice::{Choice, Dimensions, ProbeSummary, Verified, cheapest_level};
pub use distinct::Distinct;
pub use dry_run::DryRun;
pub use error::RunError;
pub use expected::Expected;
pub use frame::{BIN_PS, CrashedFrame, frames_of};
pub use frame_rows::FrameRow;
pub use gpu::{GpuError, GpuSpec, PowerFiles};
pub use heat::HeatPicture;
pub use limits::fits_memory;
pub use measure::Measurement;
pub use modelled::Modelled;
pub use one_frame::MachineTexts;
pub use options::{PacingChoice, RunOptions, Wish};
pub use plan::Plan;
pub use provenance::{Host, Input, Provenance};
pub use recorder::Resolution;
pub use regime::Regime;
pub use sampled::{Forecast, Glimpse, Preview, Scout, Signatures, taken};
pub use sampling::{Method, Sampling};
pub use simulated::{Observed, Origin, Quantity, RunFrame, SampledSummary, Simulated, Taken};
pub use stalls::StallShares;
pub use summary::{Detection, Figures, Summary};
pub use work::Work;

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
    made: Option<Choice>,
    revision: Option<&str>,
    progress: &Progress,
) -> Result<Prepared, RunError> {
    say_camera(&plan, progress);
    let provenance = Provenance::new(&plan, revision)?;
    let distinct = Distinct::new(&plan.work)?;
    let choice = choice::choose(&mut plan, made, &distinct, progress)?;
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
            choice.settle(&simulated);
        }
        let verified =
            plan.options.verify.then(|| choice::verify(&plan, &simulated, progress)).transpose()?;
        let measurement = measure::measure(&plan, &simulated)?;
        let summary =
            Summary { choice, verified, ..Summary::new(&plan, provenance, &simulated, &measurement) }
                .warned();
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
fn say_camera(plan: &Plan, progress: &Progress) {
    let Work::Scene(scene) = &plan.work else { return };
    if let Ok(camera) = scene.camera_used() {
        progress.detail(&format!("camera, {}: --camera '{}'", camera.source, camera.ron));
    }
}

/// Simulates and measures as [`run`] does, and writes nothing.
///
/// # Errors
/// As [`run`].
pub fn unwritten(plan: &Plan, progress: &Progress) -> Result<(Simulated, Measurement), RunError> {
    let simulated = simulate::unwritten(plan, progress)?;
    let measurement = measure::measure(plan, &simulated)?;
    Ok((simulated, measurement))
}

/// The figures that every run draws into `plots/`, and what they show.
pub const FIGURES: [(&str, &str); 4] = [
    ("power_run", "power over the run with found and true frame starts"),
    ("frame_power", "power over one frame, stacked by part"),
    ("unit_busy", "how busy each unit is over one frame"),
    ("frame_energy", "energy of each frame, measured and true"),
];
