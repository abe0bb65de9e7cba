//! `--accuracy` and `--budget`: which level of timing, how many frames and which dimensions this scene needs, found by a probe.
//!
//! ```text
//! Wish + Plan -> Probe (a few frames, reduced, at every level) -> Choice -> Plan
//! ```
//!
//! Nothing is known of a scene but what the probe finds.

mod decide;
mod probe;
mod verify;

use std::collections::BTreeMap;

use pipeline::Features;
use serde::Serialize;

use super::{Plan, RunError, Simulated};
use crate::output::progress::Progress;
use crate::timing::{Level, Sampling};

pub use decide::cheapest_level;
pub use verify::Verified;
pub(super) use verify::verify;

/// What the caller wants of a run, instead of a level of timing.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Wish {
    /// The largest relative error of cycles and energy of the run, against every frame at the reference.
    pub accuracy: Option<f64>,
    /// The longest that simulating may take, in seconds by the clock.
    pub budget_s: Option<f64>,
}

impl Wish {
    /// Whether anything was asked for.
    pub fn is_any(&self) -> bool {
        self.accuracy.is_some() || self.budget_s.is_some()
    }
}

/// What was chosen, why, and how wrong it is expected to be.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Choice {
    /// The accuracy that was asked for.
    pub accuracy_percent: Option<f64>,
    /// The time that was asked for.
    pub budget_s: Option<f64>,
    /// The level of timing.
    pub level: Level,
    /// How that level models memory.
    pub memory: &'static str,
    /// Whether frames are simulated only until intervals are narrow enough, and the others predicted.
    pub sampled: bool,
    /// Dimensions: those of each triangle as they are, or those left out that hardly show.
    pub dimensions: &'static str,
    /// What the probe found.
    pub probe: ProbeSummary,
    /// Expected error of cycles and energy of the run: of the level and of the dimensions in the probe, and half of the widest interval
    /// where frames are predicted.
    pub expected_error_percent: f64,
    /// Whether that is within the accuracy asked for, where one was.
    pub meets_accuracy: Option<bool>,
    /// Seconds that simulating was expected to take; only where a budget was given, as it is no property of the scene.
    pub expected_host_s: Option<f64>,
}

/// What the probe found. Errors are the worst of its frames, of cycles and energy, against `stepped`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ProbeSummary {
    /// Frames that were looked at.
    pub frames: Vec<u32>,
    /// Width and height of the image.
    pub size: [u32; 2],
    /// The error of each level.
    pub error_percent: BTreeMap<&'static str, f64>,
    /// The error of leaving out dimensions that hardly show, where any triangle has some.
    pub dimensions_error_percent: Option<f64>,
    /// Multiply-adds of tests that this saves.
    pub dimensions_saved_percent: Option<f64>,
}

/// Probes the scene and changes the plan to what it needs; nothing where nothing was wished.
pub(super) fn choose(plan: &mut Plan, progress: &Progress) -> Result<Option<Choice>, RunError> {
    let wish = plan.options.wish;
    if !wish.is_any() {
        return Ok(None);
    }
    let probe = probe::Probe::new(plan, progress)?;
    let decision = decide::decide(&wish, &probe.findings, probe.run_frames);
    plan.options.timing = decision.level;
    plan.options.sampling = decision.sampling;
    if decision.fewer_dimensions {
        plan.gpu.pipeline.features = fewer(plan.gpu.pipeline.features, 1.0);
    }
    Ok(Some(Choice {
        accuracy_percent: wish.accuracy.map(|accuracy| accuracy * 100.0),
        budget_s: wish.budget_s,
        level: decision.level,
        memory: memory(decision.level),
        sampled: decision.sampling != Sampling::Every,
        dimensions: if decision.fewer_dimensions {
            "without motion and blur of less than a quarter pixel"
        } else {
            "all"
        },
        probe: probe.summary(),
        expected_error_percent: decision.error * 100.0,
        meets_accuracy: None,
        expected_host_s: wish.budget_s.map(|_| decision.host_s),
    }))
}

impl Choice {
    /// Adds what is known when frames have been predicted.
    pub(super) fn settle(&mut self, simulated: &Simulated) {
        if let Some(sampled) = &simulated.sampled {
            self.expected_error_percent += sampled.worst_percent();
        }
        self.meets_accuracy = self.accuracy_percent.map(|asked| self.expected_error_percent <= asked);
    }

    /// A line for the terminal and the report.
    pub fn line(&self) -> String {
        let frames = if self.sampled { "some frames, the others predicted" } else { "every frame" };
        let asked = self.accuracy_percent.map(|asked| format!(" of {asked} % asked for")).unwrap_or_default();
        let time =
            self.expected_host_s.map(|s| format!(", about {s:.1} s on this machine")).unwrap_or_default();
        format!(
            "{}, {frames}, dimensions: {}, memory: {}; expected error {:.2} %{asked}{time}",
            self.level.name(),
            self.dimensions,
            self.memory,
            self.expected_error_percent
        )
    }
}

/// Motion and blur below this many pixels may be left out.
const QUARTER_PX: f32 = 0.25;

/// The features with thresholds for motion and blur, in an image that is `by` times smaller; never lower than they are.
fn fewer(features: Features, by: f32) -> Features {
    let least = QUARTER_PX / by;
    Features {
        still_px: features.still_px.max(least),
        in_focus_px: features.in_focus_px.max(least),
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
