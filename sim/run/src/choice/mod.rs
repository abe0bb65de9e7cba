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

/// What was chosen, why, and how wrong it is expected to be. Errors are relative.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Choice {
    /// The accuracy that was asked for.
    pub accuracy: Option<f64>,
    /// The time that was asked for.
    pub budget_s: Option<f64>,
    /// The level of timing.
    pub level: Level,
    /// Which frames are simulated; the others are predicted.
    pub sampling: Sampling,
    /// The dimensions of each triangle that are drawn.
    pub dimensions: Dimensions,
    /// What the probe found.
    pub probe: ProbeSummary,
    /// Expected error of cycles and energy of the run by the level and the dimensions, as the probe found it.
    pub level_error: f64,
    /// Expected error of cycles and energy of the run: that of level and dimensions, and half of the widest interval where frames are
    /// predicted.
    pub expected_error: f64,
    /// Whether that is within the accuracy asked for, where one was.
    pub meets_accuracy: Option<bool>,
    /// Seconds that simulating was expected to take; only where a budget was given, as it is no property of the scene.
    pub expected_host_s: Option<f64>,
}

/// The dimensions of each triangle that are drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Dimensions {
    /// As they are.
    All,
    /// Motion and blur of less than a quarter pixel are left out.
    WithoutSmallBlur,
}

impl Dimensions {
    const fn words(self) -> &'static str {
        match self {
            Self::All => "all",
            Self::WithoutSmallBlur => "without motion and blur of less than a quarter pixel",
        }
    }
}

/// What the probe found. Errors are relative, the worst of its frames, of cycles and energy, against `stepped`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ProbeSummary {
    /// Frames that were looked at.
    pub frames: Vec<u32>,
    /// Width and height of the image.
    pub size: [u32; 2],
    /// The error of each level.
    pub error: BTreeMap<Level, f64>,
    /// The error of leaving out dimensions that hardly show, where any triangle has some.
    pub dimensions_error: Option<f64>,
    /// The share of multiply-adds of tests that this saves.
    pub dimensions_saved: Option<f64>,
}

/// Probes the scene, or takes the choice `made` by the run that is repeated, and changes the plan to it; nothing where nothing was
/// wished.
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
    /// Adds what is known when frames have been predicted.
    pub(super) fn add_prediction_error(&mut self, simulated: &Simulated) {
        if let Some(sampled) = &simulated.sampled {
            self.expected_error += sampled.worst();
        }
        self.meets_accuracy = self.accuracy.map(|asked| self.expected_error <= asked);
    }

    /// A line for the terminal and the report.
    pub fn line(&self) -> String {
        let frames = match self.sampling {
            Sampling::Every => "every frame",
            _ => "some frames, the others predicted",
        };
        let asked =
            self.accuracy.map(|asked| format!(" of {} % asked for", asked * 100.0)).unwrap_or_default();
        let time =
            self.expected_host_s.map(|s| format!(", about {s:.1} s on this machine")).unwrap_or_default();
        format!(
            "{}, {frames}, dimensions: {}, memory: {}; expected error {:.2} %{asked}{time}",
            self.level.name(),
            self.dimensions.words(),
            memory(self.level),
            self.expected_error * 100.0
        )
    }
}

/// Motion and blur below this many pixels may be left out.
const MAX_OMITTED_BLUR_PX: f32 = 0.25;

/// The features with thresholds for motion and blur, in an image that is `by` times smaller; never lower than they are.
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

/// Actual errors of the run against `stepped`, frame for frame.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Verified {
    /// Error of the cycles of all frames together.
    pub cycles_error: f64,
    /// Error of their energy, idle not counted.
    pub energy_error: f64,
    /// Error of mean power while busy.
    pub power_error: f64,
    /// The larger of the errors of cycles and energy.
    pub error: f64,
    /// The worst error of the cycles of a single frame.
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

/// Simulates every frame that differs once more, at the reference.
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

/// Compares frames found with true ones; `frames` holds for each frame of the run its index in both.
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
