//! `--accuracy` and `--budget`: a probe chooses timing level, frames and dimensions. `--verify`: the actual errors.
//!
//! ```text
//! Requested + Plan -> Probe (a few frames, reduced, at every level) -> Choice -> Plan
//! ```
//!
//! The choice depends only on the probe, not on the name or the kind of the scene.

mod probe;

use std::collections::BTreeMap;

use output::terminal::Progress;
use pipeline::Features;
use serde::{Deserialize, Serialize};
use timing::Level;

use crate::{Distinct, FrameCost, Plan, Requested, RunError, RunFrame, Sampling, Simulated, frames_of};

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
    plan.options.timing = Some(choice.level);
    plan.chosen = choice.probe.error.get(&choice.level).copied();
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
    let decision = decide(requested, &probe.findings, distinct.numbers().len());
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
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
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
        (Some(Level::Stepped), Sampling::Every, Requested::default());
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

/// Results of the probe over its frames.
#[derive(Clone, Debug, Default)]
struct Findings {
    /// Largest error of each level, in the order of [`Level::ALL`].
    errors: [f64; 3],
    /// Host seconds of the timing model, by level.
    timing_s: [f64; 3],
    /// Host seconds of the pipeline.
    pipeline_s: f64,
    /// Largest error of omitting small motion and blur; `None` if that changes nothing.
    pub dimensions_error: Option<f64>,
    /// Multiply-adds with all dimensions, and without small motion and blur.
    madds: [u64; 2],
}

impl Findings {
    pub fn add(&mut self, level: Level, error: f64, timing_s: f64, pipeline_s: f64) {
        let at = level as usize;
        self.errors[at] = self.errors[at].max(error);
        self.timing_s[at] += timing_s;
        self.pipeline_s += pipeline_s / Level::ALL.len() as f64;
    }

    pub fn add_dimensions(&mut self, error: f64, madds: [u64; 2]) {
        self.dimensions_error = Some(self.dimensions_error.map_or(error, |worst| worst.max(error)));
        self.madds.iter_mut().zip(madds).for_each(|(sum, madds)| *sum += madds);
    }

    pub fn scale_times(&mut self, by: f64) {
        self.timing_s.iter_mut().for_each(|seconds| *seconds *= by);
        self.pipeline_s *= by;
    }

    /// Largest error of a level.
    pub fn error(&self, level: Level) -> f64 {
        self.errors[level as usize]
    }

    /// Share of multiply-adds that omitting small motion and blur saves.
    pub fn saved(&self) -> f64 {
        let [all, fewer] = self.madds;
        if all == 0 { 0.0 } else { 1.0 - fewer as f64 / all as f64 }
    }

    fn frame_s(&self, level: Level) -> f64 {
        self.pipeline_s + self.timing_s[level as usize]
    }
}

/// Level, frames and dimensions of a run.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Decision {
    pub level: Level,
    pub sampling: Sampling,
    pub fewer_dimensions: bool,
    /// Expected error of level and dimensions, without that of predicting frames.
    pub error: f64,
    /// Expected host seconds.
    pub host_s: f64,
}

/// Smallest number of distinct frames for prediction.
const MIN_FRAMES_TO_PREDICT: usize = 20;
/// Smallest share of work that omitting dimensions has to save.
const MIN_SAVED_SHARE: f64 = 0.1;
/// Time of a preview over the time of a frame.
const PREVIEW_TIME_RATIO: f64 = 0.05;

/// Decides for a run of `frames` distinct frames.
fn decide(requested: &Requested, findings: &Findings, frames: usize) -> Decision {
    let decision = match requested.accuracy {
        Some(accuracy) => by_accuracy(accuracy, findings, frames),
        None => every(Level::Stepped, findings, frames),
    };
    match requested.budget_s {
        Some(budget_s) if decision.host_s > budget_s || decision.sampling != Sampling::Every => {
            by_budget(budget_s, decision, findings, frames)
        }
        _ => decision,
    }
}

/// Cheapest level whose error is within `limit`; the reference if none is.
pub fn cheapest_level(error: impl Fn(Level) -> f64, limit: f64) -> Level {
    Level::ALL.into_iter().rev().find(|&level| error(level) <= limit).unwrap_or(Level::Stepped)
}

/// Takes the cheapest level that needs at most half of the accuracy; prediction of frames gets the rest. With
/// few frames the level may need all of it. The error of omitted dimensions is subtracted first.
fn by_accuracy(accuracy: f64, findings: &Findings, frames: usize) -> Decision {
    let saves_enough = findings.saved() >= MIN_SAVED_SHARE;
    let lost = findings.dimensions_error.filter(|lost| saves_enough && *lost <= 0.25 * accuracy);
    let left = accuracy - lost.unwrap_or(0.0);
    let predicts = frames >= MIN_FRAMES_TO_PREDICT;
    let limit = if predicts { 0.5 * left } else { left };
    let level = cheapest_level(|level| findings.error(level), limit);
    let target = left - findings.error(level);
    let mut decision = every(level, findings, frames);
    decision.fewer_dimensions = lost.is_some();
    decision.error += lost.unwrap_or(0.0);
    if predicts {
        decision.sampling = Sampling::Until { target, max_frames: frames };
        decision.host_s = some_s(level, Sampling::FIRST_FRAMES, findings, frames);
    }
    decision
}

/// Takes the most accurate option within the budget: `preferred`, perhaps with fewer frames; then every frame
/// at cheaper levels; then some frames.
fn by_budget(budget_s: f64, preferred: Decision, findings: &Findings, frames: usize) -> Decision {
    let fits = |level: Level| {
        let spare_s = budget_s - PREVIEW_TIME_RATIO * frames as f64 * findings.frame_s(level);
        (spare_s / findings.frame_s(level).max(f64::MIN_POSITIVE)).floor().clamp(0.0, frames as f64) as usize
    };
    if let Sampling::Until { target, .. } = preferred.sampling
        && fits(preferred.level) >= Sampling::FIRST_FRAMES
    {
        return Decision {
            sampling: Sampling::Until { target, max_frames: fits(preferred.level) },
            ..preferred
        };
    }
    let keep = |decision: Decision| Decision {
        fewer_dimensions: preferred.fewer_dimensions,
        error: decision.error + preferred.error - findings.error(preferred.level),
        ..decision
    };
    let exact = [Level::Stepped, Level::Packet].map(|level| every(level, findings, frames));
    if let Some(decision) = exact.into_iter().find(|decision| decision.host_s <= budget_s) {
        return keep(decision);
    }
    let level = if fits(Level::Packet) >= Sampling::MIN_FRAMES { Level::Packet } else { Level::Bound };
    let whole = every(level, findings, frames);
    if frames < MIN_FRAMES_TO_PREDICT || whole.host_s <= budget_s {
        return keep(every(Level::Bound, findings, frames));
    }
    let count = fits(level).max(Sampling::MIN_FRAMES);
    let host_s = some_s(level, count, findings, frames);
    keep(Decision { sampling: Sampling::Count(count), host_s, ..whole })
}

fn every(level: Level, findings: &Findings, frames: usize) -> Decision {
    let host_s = findings.frame_s(level) * frames as f64;
    Decision {
        level,
        sampling: Sampling::Every,
        fewer_dimensions: false,
        error: findings.error(level),
        host_s,
    }
}

fn some_s(level: Level, count: usize, findings: &Findings, frames: usize) -> f64 {
    findings.frame_s(level) * (count as f64 + PREVIEW_TIME_RATIO * frames as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Errors of 0, 0.5 and 10 %, and 1.1, 0.2 and 0.11 s per frame.
    fn findings() -> Findings {
        let mut findings = Findings::default();
        for (level, error, timing_s) in
            [(Level::Stepped, 0.0, 1.0), (Level::Packet, 0.005, 0.1), (Level::Bound, 0.1, 0.01)]
        {
            findings.add(level, error, timing_s, 0.1);
        }
        findings
    }

    fn requested(accuracy: f64, budget_s: f64) -> Requested {
        let given = |value: f64| (value > 0.0).then_some(value);
        Requested { accuracy: given(accuracy), budget_s: given(budget_s) }
    }

    #[test]
    fn the_cheapest_level_within_the_accuracy() {
        let level = |accuracy, frames| decide(&requested(accuracy, 0.0), &findings(), frames).level;
        assert_eq!(
            [0.001, 0.005, 0.09, 0.1].map(|a| level(a, 1)),
            [Level::Stepped, Level::Packet, Level::Packet, Level::Bound]
        );
        // Predicted frames get half of the accuracy.
        assert_eq!([0.009, 0.01, 0.2].map(|a| level(a, 300)), [Level::Stepped, Level::Packet, Level::Bound]);
    }

    #[test]
    fn frames_are_predicted_to_what_the_level_leaves() {
        let decision = decide(&requested(0.02, 0.0), &findings(), 300);
        assert_eq!(decision.sampling, Sampling::Until { target: 0.015, max_frames: 300 });
        assert_eq!(decide(&requested(0.02, 0.0), &findings(), 19).sampling, Sampling::Every);
    }

    #[test]
    fn the_most_accurate_option_within_the_budget() {
        let of = |budget_s| {
            let decision = decide(&requested(0.0, budget_s), &findings(), 100);
            (decision.level, decision.sampling)
        };
        assert_eq!(of(120.0), (Level::Stepped, Sampling::Every));
        assert_eq!(of(30.0), (Level::Packet, Sampling::Every));
        assert_eq!(of(11.05), (Level::Packet, Sampling::Count(50)));
        // Less than six frames fit at `packet`.
        assert_eq!(of(1.6), (Level::Bound, Sampling::Count(9)));
        assert_eq!(of(0.1), (Level::Bound, Sampling::Count(Sampling::MIN_FRAMES)));
    }

    #[test]
    fn accuracy_and_budget_limit_the_frames() {
        let decision = decide(&requested(0.02, 5.05), &findings(), 100);
        assert_eq!(decision.sampling, Sampling::Until { target: 0.015, max_frames: 20 });
    }

    #[test]
    fn dimensions_are_omitted_if_the_error_is_small_and_work_is_saved() {
        let with = |error, madds| {
            let mut findings = findings();
            findings.add_dimensions(error, madds);
            decide(&requested(0.02, 0.0), &findings, 1).fewer_dimensions
        };
        assert!(with(0.004, [100, 50]));
        assert!(!with(0.006, [100, 50]), "it costs too much of the accuracy");
        assert!(!with(0.001, [100, 95]), "it saves too little");
        assert!(!decide(&requested(0.02, 0.0), &findings(), 1).fewer_dimensions);
    }
}
