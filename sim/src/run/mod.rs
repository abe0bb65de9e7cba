//! A run: scene, pipeline, clock, watts, trace, frames, files.
//!
//! ```text
//! RunOptions -> Plan -> choose -> simulate -> measure -> Outcome -> write
//! ```

mod checks;
mod choice;
mod error;
mod facts;
mod frame_rows;
mod heat;
mod limits;
mod measure;
mod modelled;
mod options;
mod pictures;
mod regime;
mod regime_warnings;
mod report;
mod sampled;
mod simulate;
mod stalls;
mod summary;
mod timeline;
mod warnings;
mod work;
mod write;

use std::path::Path;

use crate::output::OutDir;
use crate::output::progress::Progress;

pub use checks::Checks;
pub use choice::{Choice, Verified, Wish, cheapest_level};
pub use error::RunError;
pub use frame_rows::FrameRow;
pub use heat::HeatPicture;
pub use limits::fits_memory;
pub use measure::Measurement;
pub use modelled::Modelled;
pub use options::{PacingChoice, Plan, RunOptions};
pub use regime::Regime;
pub use sampled::{Forecast, Glimpse, Preview, Quantity, SampledSummary, Scout, Signatures, Taken, taken};
pub(crate) use simulate::BIN_PS;
pub use simulate::{Simulated, SimulatedFrame, frames_of};
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

/// Runs the whole line and writes its results into `out`.
///
/// # Errors
/// [`RunError`]; [`RunError::is_usage`] tells the caller's mistakes from failures. Whatever was written before is not
/// marked as whole: `summary.json` comes last.
pub fn run(options: RunOptions, out: &Path, progress: &Progress) -> Result<Outcome, RunError> {
    let mut plan = Plan::resolve(options)?;
    let dir = OutDir::create(out)?;
    let mut choice = choice::choose(&mut plan, progress)?;
    let simulated = simulate::simulate(&plan, &dir, progress)?;
    if let Some(choice) = &mut choice {
        choice.settle(&simulated);
    }
    let verified = plan.options.verify.then(|| choice::verify(&plan, &simulated, progress)).transpose()?;
    let measurement = measure::measure(&plan, &simulated)?;
    let summary = Summary { choice, verified, ..Summary::new(&plan, &simulated, &measurement) }.warned();
    let outcome = Outcome { plan, simulated, measurement, summary };
    write::write(&outcome, dir, progress)?;
    Ok(outcome)
}

/// The figures that every run draws into `plots/`, and what they show.
pub const FIGURES: [(&str, &str); 4] = [
    ("power_run", "power over the run with found and true frame starts"),
    ("frame_power", "power over one frame, stacked by part"),
    ("unit_busy", "how busy each unit is over one frame"),
    ("frame_energy", "energy of each frame, measured and true"),
];
