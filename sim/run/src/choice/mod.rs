//! `--accuracy` and `--budget`: a probe chooses timing level, frames and dimensions. `--verify`: the actual errors.
//!
//! ```text
//! Requested + Plan -> Probe (a few frames, reduced, at every level) -> Choice -> Plan
//! ```
//!
//! The choice depends only on the probe, not on the name or the kind of the scene.

mod decide;
mod probe;

use std::collections::BTreeMap;

use output::progress::Progress;
use pipeline::Features;
use serde::{Deserialize, Serialize};
use timing::Level;

use crate::{Distinct, FrameCost, Plan, Requested, RunError, RunFrame, Sampling, Simulated, frames_of};

pub use decide::cheapest_level;

/// Choice of level, frames and dimensions, with the expected relative error.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Choice {
    /// Requested accuracy.
    pub accuracy: Option<f64>,
    /// Time budget in seconds.
    pub budget_s: Option<f64>,
    /// Timing level.
    pub level: Level,
    /// Simulated frames; the others are predicted.
    pub sampling: Sampling,
    /// Dimensions of the rasterizer in use.
    pub dimensions: Dimensions,
    /// Results of the probe.
    pub probe: ProbeSummary,
    /// Expected error of cycles and energy due to level and dimensions, from the probe.
    pub level_error: f64,
    /// Expected error of cycles and energy: `level_error`, plus the half-width of the widest interval if
    /// frames are predicted.
    pub expected_error: f64,
    /// Whether `expected_error` is within the requested accuracy, if given.
    pub meets_accuracy: Option<bool>,
    /// Expected time of the simulation in seconds, only with a budget: it depends on the host.
    pub expected_host_s: Option<f64>,
}

/// Dimensions of the rasterizer in use.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Dimensions {
    /// All dimensions.
    All,
    /// Motion and blur below a quarter pixel are omitted.
    WithoutSmallBlur,
}

impl Dimensions {
    const fn description(self) -> &'static str {
        match self {
            Self::All => "all",
            Self::WithoutSmallBlur => "without motion and blur of less than a quarter pixel",
        }
    }
}

/// Results of the probe. Errors are relative to `stepped`: the largest of its frames, of cycles and energy.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ProbeSummary {
    /// Frames of the probe.
    pub frames: Vec<u32>,
    /// Width and height of the image.
    pub size: [u32; 2],
    /// Error of each timing level.
    pub error: BTreeMap<Level, f64>,
    /// Error of omitting small motion and blur; `None` if no triangle has any.
    pub dimensions_error: Option<f64>,
    /// Share of the tests' multiply-adds that this saves.
    pub dimensions_saved: Option<f64>,
}

/// Chooses by a probe, or takes the `recorded` choice of a repeated run, and changes the plan accordingly.
/// `None` without a requested accuracy or budget.
pub(super) fn choose(
    plan: &mut Plan,
    recorded: Option<Choice>,
    distinct: &Distinct,
    progress: &Progress,
) -> Result<Option<Choice>, RunError> {
    let requested = plan.options.requested;
    if !requested.is_any() {
        return Ok(None);
    }
    let choice = match recorded {
        Some(choice) => Choice { expected_error: choice.level_error, meets_accuracy: None, ..choice },
        None => probed(plan, distinct, &requested, progress)?,
    };
    plan.options.timing = choice.level;
    plan.options.sampling = choice.sampling;
    if choice.dimensions == Dimensions::WithoutSmallBlur {
        plan.gpu.pipeline.features = with_blur_thresholds(plan.gpu.pipeline.features, 1.0);
    }
    Ok(Some(choice))
}

fn probed(
    plan: &Plan,
    distinct: &Distinct,
    requested: &Requested,
    progress: &Progress,
) -> Result<Choice, RunError> {
    let probe = probe::Probe::new(plan, distinct, progress)?;
    let decision = decide::decide(requested, &probe.findings, distinct.numbers().len());
    Ok(Choice {
        accuracy: requested.accuracy,
        budget_s: requested.budget_s,
        level: decision.level,
        sampling: decision.sampling,
        dimensions: if decision.fewer_dimensions { Dimensions::WithoutSmallBlur } else { Dimensions::All },
        probe: probe.summary(),
        level_error: decision.error,
        expected_error: decision.error,
        meets_accuracy: None,
        expected_host_s: requested.budget_s.map(|_| decision.host_s),
    })
}

impl Choice {
    /// Adds the error of predicted frames and compares with the requested accuracy.
    pub(super) fn add_prediction_error(&mut self, simulated: &Simulated) {
        if let Some(sampled) = &simulated.sampled {
            self.expected_error += sampled.worst();
        }
        self.meets_accuracy = self.accuracy.map(|accuracy| self.expected_error <= accuracy);
    }

    /// A line for the terminal and the report.
    pub fn line(&self) -> String {
        let frames = match self.sampling {
            Sampling::Every => "every frame",
            _ => "some frames, the others predicted",
        };
        let requested =
            self.accuracy.map(|accuracy| format!(" of {} % requested", accuracy * 100.0)).unwrap_or_default();
        let time =
            self.expected_host_s.map(|s| format!(", about {s:.1} s on this machine")).unwrap_or_default();
        format!(
            "{}, {frames}, dimensions: {}, memory: {}; expected error {:.2} %{requested}{time}",
            self.level.name(),
            self.dimensions.description(),
            memory(self.level),
            self.expected_error * 100.0
        )
    }
}

/// Largest motion and blur in pixels that may be omitted.
const MAX_OMITTED_BLUR_PX: f32 = 0.25;

/// Raises the thresholds for motion and blur, for an image that is `by` times smaller.
fn with_blur_thresholds(features: Features, by: f32) -> Features {
    let threshold = MAX_OMITTED_BLUR_PX / by;
    Features {
        still_px: features.still_px.max(threshold),
        in_focus_px: features.in_focus_px.max(threshold),
        ..features
    }
}

fn memory(level: Level) -> &'static str {
    match level {
        Level::Stepped => "channels, banks and rows, first ready first come",
        Level::Packet => "channels, banks and rows, in the order of the stream",
        Level::Bound => "lines over rates",
    }
}

/// Actual relative errors of a run, compared with `stepped` frame by frame.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Verified {
    /// Error of the sum of cycles.
    pub cycles_error: f64,
    /// Error of the sum of energies, without idle time.
    pub energy_error: f64,
    /// Error of mean power while busy.
    pub power_error: f64,
    /// Larger of the errors of cycles and energy.
    pub error: f64,
    /// Largest error of the cycles of a frame.
    pub worst_frame_error: f64,
}

impl Verified {
    /// A line for the terminal and the report.
    pub fn line(&self) -> String {
        format!(
            "cycles {:+.2} %, energy {:+.2} %, power {:+.2} %, worst frame {:.2} %, against every frame at `stepped`",
            self.cycles_error * 100.0,
            self.energy_error * 100.0,
            self.power_error * 100.0,
            self.worst_frame_error * 100.0
        )
    }
}

/// Simulates all distinct frames again at the reference level, with all dimensions.
pub(super) fn verify(plan: &Plan, simulated: &Simulated, progress: &Progress) -> Result<Verified, RunError> {
    let mut options = plan.options.clone();
    (options.timing, options.sampling, options.requested) =
        (Level::Stepped, Sampling::Every, Requested::default());
    options.heat = Vec::new();
    let reference = Plan::resolve(options)?;
    let numbers: Vec<u32> = simulated.distinct.iter().map(|frame| frame.index).collect();
    let truth = frames_of(&reference, &numbers, progress)?;
    Ok(compare(&simulated.distinct, &truth, &simulated.frames))
}

/// Compares frames with reference frames. `frames` holds the index of each frame of the run in both.
fn compare(found: &[RunFrame], truth: &[RunFrame], frames: &[usize]) -> Verified {
    let total = |distinct: &[RunFrame]| {
        let costs = frames.iter().map(|&index| distinct[index].cost());
        costs.fold(FrameCost { cycles: 0.0, energy_j: 0.0 }, |sum, frame| FrameCost {
            cycles: sum.cycles + frame.cycles,
            energy_j: sum.energy_j + frame.energy_j,
        })
    };
    let relative = |found: f64, truth: f64| if found == truth { 0.0 } else { found / truth - 1.0 };
    let (all, right) = (total(found), total(truth));
    let cycles = relative(all.cycles, right.cycles);
    let energy = relative(all.energy_j, right.energy_j);
    let frames = found.iter().zip(truth).map(|(a, b)| relative(a.cycles as f64, b.cycles as f64).abs());
    Verified {
        cycles_error: cycles,
        energy_error: energy,
        power_error: relative(all.energy_j / all.cycles, right.energy_j / right.cycles),
        error: cycles.abs().max(energy.abs()),
        worst_frame_error: frames.fold(0.0, f64::max),
    }
}
