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
use serde::{Deserialize, Serialize};

use super::{Distinct, Plan, RunError, Simulated, Wish};
use crate::Sampling;
use output::progress::Progress;
use timing::Level;

pub use decide::cheapest_level;
pub use verify::Verified;
pub(super) use verify::verify;

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
    made: Option<Choice>,
    distinct: &Distinct,
    progress: &Progress,
) -> Result<Option<Choice>, RunError> {
    let wish = plan.options.wish;
    if !wish.is_any() {
        return Ok(None);
    }
    let choice = match made {
        Some(choice) => Choice { expected_error: choice.level_error, meets_accuracy: None, ..choice },
        None => probed(plan, distinct, &wish, progress)?,
    };
    plan.options.timing = choice.level;
    plan.options.sampling = choice.sampling;
    if choice.dimensions == Dimensions::WithoutSmallBlur {
        plan.gpu.pipeline.features = fewer(plan.gpu.pipeline.features, 1.0);
    }
    Ok(Some(choice))
}

fn probed(plan: &Plan, distinct: &Distinct, wish: &Wish, progress: &Progress) -> Result<Choice, RunError> {
    let probe = probe::Probe::new(plan, distinct, progress)?;
    let decision = decide::decide(wish, &probe.findings, distinct.numbers().len());
    Ok(Choice {
        accuracy: wish.accuracy,
        budget_s: wish.budget_s,
        level: decision.level,
        sampling: decision.sampling,
        dimensions: if decision.fewer_dimensions { Dimensions::WithoutSmallBlur } else { Dimensions::All },
        probe: probe.summary(),
        level_error: decision.error,
        expected_error: decision.error,
        meets_accuracy: None,
        expected_host_s: wish.budget_s.map(|_| decision.host_s),
    })
}

impl Choice {
    /// Adds what is known when frames have been predicted.
    pub(super) fn settle(&mut self, simulated: &Simulated) {
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
