//! One point: its run, and what is kept of it: sums, passes, and both ends of the energy table.

use std::collections::{BTreeMap, BTreeSet};
use std::panic::{AssertUnwindSafe, catch_unwind};

use activity::{Bin, Event};
use output::terminal::Progress;
use power_model::{Bound, FramePower, ModelError, pace};
use run::{
    Distinct, Plan, RunError, RunFrame, Simulated, StatedError, area_mm2, frames_of, panic_message,
    passes_of, warnings_of,
};
use serde::{Deserialize, Serialize};
use timing::Checked;

use crate::setting::{self, Setting};

/// Result of a point.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct PointResult {
    /// Id of the point.
    pub id: String,
    #[serde(flatten)]
    pub outcome: Outcome,
}

/// What came of a run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Outcome {
    /// The point was measured.
    Measured(Box<Measured>),
    /// The point failed, for this reason.
    Error(String),
    /// The point did not run, as a coarser timing level gave a reason.
    ScreenedOut(String),
    /// The point did not run, as a coarser timing level cannot distinguish it from a design that did.
    Undecided(String),
}

impl Outcome {
    /// Whether the point ran, be it to a failure.
    pub(crate) const fn ran(&self) -> bool {
        !matches!(self, Self::ScreenedOut(_) | Self::Undecided(_))
    }

    /// Why there are no numbers.
    pub fn reason(self) -> Option<String> {
        match self {
            Self::Measured(_) => None,
            Self::Error(reason) | Self::ScreenedOut(reason) | Self::Undecided(reason) => Some(reason),
        }
    }

    /// The numbers of a run that did not fail.
    pub fn measured(&self) -> Option<&Measured> {
        match self {
            Self::Measured(measured) => Some(measured),
            Self::Error(_) | Self::ScreenedOut(_) | Self::Undecided(_) => None,
        }
    }
}

impl From<Result<Measured, String>> for Outcome {
    fn from(result: Result<Measured, String>) -> Self {
        result.map_or_else(Self::Error, |measured| Self::Measured(Box::new(measured)))
    }
}

/// Numbers of a run. Sums are over all its frames, means are per frame.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Measured {
    /// Settings in use, by name: those of the sweep and of the inputs.
    pub used: BTreeMap<String, String>,
    /// Cycles of the core clock, sum.
    pub cycles: u64,
    /// Busy time in milliseconds, mean.
    pub busy_ms: f64,
    /// Time from the start to the next start in milliseconds, mean.
    pub frame_ms: f64,
    /// Energy while busy in millijoules, mean.
    pub busy_mj: f64,
    /// `busy_mj` with all energies of the table at their low end.
    pub busy_low_mj: f64,
    /// `busy_mj` with all energies of the table at their high end.
    pub busy_high_mj: f64,
    /// Energy from the start to the next start in millijoules, mean.
    pub frame_mj: f64,
    /// `frame_mj` over the pixels of a frame, in nanojoules.
    pub nj_per_pixel: f64,
    /// Bytes read from and written to memory, sum.
    pub dram_bytes: u64,
    /// Area of the GPU in square millimetres: nominal, low, high.
    pub area_mm2: [f64; 3],
    /// Codes of accuracy warnings of the timing level, sorted, comma-separated.
    pub accuracy_warnings: String,
    /// Codes of all warnings but those about a recorded trace, sorted, comma-separated.
    pub warnings: String,
    /// Stated error of the cycles by the timing level, relative.
    pub cycles_error: f64,
    /// Stated error of the busy energy by the timing level, relative.
    pub energy_error: f64,
    /// Passes by name.
    pub passes: Vec<PassMeans>,
    /// Event counts, sums.
    pub counts: EventCounts,
}

/// Counts of the reported events, in files by name.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(from = "BTreeMap<String, u64>", into = "BTreeMap<String, u64>")]
pub struct EventCounts(Box<[Option<u64>; Event::COUNT]>);

impl EventCounts {
    /// Count of an event; `None` if the GPU has no such unit.
    pub fn get(&self, event: Event) -> Option<u64> {
        self.0[event as usize]
    }

    fn of(frames: &[&RunFrame]) -> Self {
        let mut sums = Self(Box::new([None; Event::COUNT]));
        let observed = frames.iter().filter_map(|frame| frame.observed());
        for (event, count) in observed.flat_map(|observed| observed.counts.reported()) {
            *sums.0[event as usize].get_or_insert(0) += count;
        }
        sums
    }
}

impl From<BTreeMap<String, u64>> for EventCounts {
    fn from(counts: BTreeMap<String, u64>) -> Self {
        Self(Box::new(Event::ALL.map(|event| counts.get(event.name()).copied())))
    }
}

impl From<EventCounts> for BTreeMap<String, u64> {
    fn from(counts: EventCounts) -> Self {
        Event::ALL
            .into_iter()
            .filter_map(|event| Some((event.name().to_owned(), counts.get(event)?)))
            .collect()
    }
}

/// Runs the point `id` with these settings. A failure and a panic are results, too.
pub(crate) fn execute(id: &str, settings: &[Setting]) -> PointResult {
    let run = || setting::planned(settings).and_then(|plan| drawn(&plan));
    PointResult { id: id.to_owned(), outcome: guarded(run).into() }
}

/// The result of `run`, or why it failed. A panic is a failure, too.
pub(crate) fn guarded<T>(run: impl FnOnce() -> Result<T, RunError>) -> Result<T, String> {
    match catch_unwind(AssertUnwindSafe(run)) {
        Ok(result) => result.map_err(|error| error.to_string()),
        Err(panic) => Err(format!("internal error, please report it: {}", panic_message(&*panic))),
    }
}

/// Draws and measures all frames of a run.
fn drawn(plan: &Plan) -> Result<Measured, RunError> {
    let distinct = Distinct::new(&*plan.job)?;
    let drawn = frames_of(plan, distinct.numbers(), &Progress::new(true))?;
    measured(plan, drawn, distinct.groups())
}

/// Numbers of a run of `plan` whose frames are those of `distinct` that `groups` names, in order.
///
/// # Errors
/// If the frames cannot follow each other at the pace of the plan.
pub fn measured(plan: &Plan, distinct: Vec<RunFrame>, groups: &[usize]) -> Result<Measured, RunError> {
    let (frames, pictures, heat) = (groups.to_vec(), Vec::new(), Vec::new());
    let simulated = Simulated { distinct, frames, pictures, heat, sampled: None };
    let frames: &[&RunFrame] = &simulated.in_order().collect::<Vec<_>>();
    let powers: Vec<&FramePower> = frames.iter().map(|frame| &frame.power).collect();
    let paced = pace(&powers, plan.platform(), plan.pacing)?;
    let count = frames.len() as f64;
    let cycles: u64 = frames.iter().map(|frame| frame.cycles).sum();
    let frame_j = paced.energy().total_j() / count;
    let busy_j = frames.iter().map(|frame| frame.cost().energy_j).sum::<f64>() / count;
    let busy_s = paced.frames.iter().map(|frame| frame.busy_end_s - frame.start_s).sum::<f64>() / count;
    let counts = EventCounts::of(frames);
    let area = area_mm2(plan);
    let bytes = |event: Event| counts.get(event).unwrap_or(0);
    let [low_j, high_j] = energy_ends(plan, frames)?;
    let checked = frames.iter().filter_map(|frame| frame.observed()?.checked);
    let stated = StatedError::of_frames(plan.options.level(), frames.iter().copied());
    Ok(Measured {
        used: used(plan),
        cycles,
        busy_ms: busy_s * 1e3,
        frame_ms: (paced.end_s - paced.start_s) / count * 1e3,
        busy_mj: busy_j * 1e3,
        busy_low_mj: low_j * 1e3,
        busy_high_mj: high_j * 1e3,
        frame_mj: frame_j * 1e3,
        nj_per_pixel: frame_j / plan.pixels() as f64 * 1e9,
        dram_bytes: bytes(Event::DramReadBytes) + bytes(Event::DramWriteBytes),
        area_mm2: [area.nominal, area.low, area.high],
        accuracy_warnings: joined(checked.filter(|of| of.is_far()).map(|_| Checked::CODE.name())),
        warnings: joined(warnings_of(plan, &simulated, &paced).iter().map(|warning| warning.code.name())),
        cycles_error: stated.cycles,
        energy_error: stated.energy,
        passes: passes(plan, frames),
        counts,
    })
}

/// Names and sizes in use, so that each row says what it is of.
fn used(plan: &Plan) -> BTreeMap<String, String> {
    let (options, settings) = (&plan.options, plan.job.settings());
    let texts = [
        ("scene", plan.name.clone()),
        ("gpu", plan.gpu().name.clone()),
        ("platform", plan.platform().name.clone()),
        ("energy", plan.table().name().to_owned()),
        ("bound", format!("{:?}", options.bound).to_lowercase()),
        ("timing", options.level().name().to_owned()),
        ("pacing", options.pacing.name().to_owned()),
        ("seed", options.seed.to_string()),
        ("width", settings.width.to_string()),
        ("height", settings.height.to_string()),
        ("samples", settings.samples.to_string()),
        ("frame_count", settings.frames.len().to_string()),
    ];
    texts.into_iter().map(|(name, text)| (name.to_owned(), text)).collect()
}

/// Each of some codes once, sorted, comma-separated.
fn joined(codes: impl Iterator<Item = &'static str>) -> String {
    codes.collect::<BTreeSet<_>>().into_iter().collect::<Vec<_>>().join(",")
}

/// Time and energy of the passes of one name, mean per frame.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PassMeans {
    /// Name of the pass.
    pub name: String,
    /// Milliseconds.
    pub ms: f64,
    /// Millijoules.
    pub mj: f64,
}

/// Passes of a run in the order of their first use. Their times add up to the busy time, their energies to
/// the busy energy.
pub(crate) fn passes(plan: &Plan, frames: &[&RunFrame]) -> Vec<PassMeans> {
    let count = frames.len().max(1) as f64;
    let means = |pass: run::PassSummary| PassMeans {
        name: pass.name,
        ms: pass.all.time_s / count * 1e3,
        mj: pass.all.energy_j / count * 1e3,
    };
    passes_of(plan, frames.iter().copied()).into_iter().map(means).collect()
}

/// Busy energy in joules, mean per frame, with all energies and watts at their low and at their high end.
/// Nothing is timed again.
///
/// # Errors
/// If table and platform do not match.
fn energy_ends(plan: &Plan, frames: &[&RunFrame]) -> Result<[f64; 2], ModelError> {
    let count = frames.len().max(1) as f64;
    let at = |bound: Bound| {
        let model = plan.model_at(bound)?;
        let energy_j = |frame: &&RunFrame| {
            let counts = frame.observed().map(|observed| observed.counts).unwrap_or_default();
            model.energy_of(&Bin { counts, busy_ps: frame.busy_ps }, frame.power.duration_ps()).total_j()
        };
        Ok::<f64, ModelError>(frames.iter().map(energy_j).sum::<f64>() / count)
    };
    Ok([at(Bound::Low)?, at(Bound::High)?])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn outcome(settings: &[(&str, &str)]) -> Outcome {
        let settings = [("scene", "tiny"), ("frames", "0..2")].iter().chain(settings);
        let settings: Vec<Setting> = settings.map(|(path, value)| Setting::new(*path, *value)).collect();
        execute("a", &settings).outcome
    }

    fn numbers(settings: &[(&str, &str)]) -> Measured {
        match outcome(settings) {
            Outcome::Measured(measured) => *measured,
            other => panic!("{:?}", other.reason()),
        }
    }

    fn near(a: f64, b: f64) -> bool {
        (a / b - 1.0).abs() < 1e-9
    }

    #[test]
    fn ends_of_the_energy_are_those_of_runs_at_either_bound() {
        // The GPU of the platform, and one whose watts are scaled.
        for cores in ["2", "8"] {
            let at = |bound| numbers(&[("gpu.units.shader.cores", cores), ("bound", bound)]);
            let (low, high) = (at("low").busy_mj, at("high").busy_mj);
            for bound in ["low", "nominal", "high"] {
                let measured = at(bound);
                let ends = [measured.busy_low_mj, measured.busy_high_mj];
                assert!(
                    near(ends[0], low) && near(ends[1], high),
                    "{cores}, {bound}: {ends:?}, {low} to {high}"
                );
            }
        }
    }

    #[test]
    fn a_point_is_measured() {
        let measured = numbers(&[("samples", "2")]);
        assert!(measured.cycles > 0 && measured.busy_mj > 0.0 && measured.frame_mj > measured.busy_mj);
        assert_eq!((&*measured.used["samples"], &*measured.used["frame_count"]), ("2", "2"));
        // 64 x 48 pixels.
        assert!(
            (measured.nj_per_pixel - measured.frame_mj * 1e6 / 3072.0).abs() < 1e-9 * measured.nj_per_pixel
        );
        let sum = |of: fn(&PassMeans) -> f64| measured.passes.iter().map(of).sum::<f64>();
        assert!(near(sum(|pass| pass.ms), measured.busy_ms) && near(sum(|pass| pass.mj), measured.busy_mj));
        assert!((measured.frame_ms - 1e3 / 60.0).abs() < 1e-3, "{}", measured.frame_ms);
    }

    #[test]
    fn all_warnings_of_a_run_are_kept() {
        assert_eq!(numbers(&[]).warnings, "");
        assert_eq!(numbers(&[("gpu", "mobile"), ("platform", "reference")]).warnings, "platform-mismatch");
        let both = numbers(&[("gpu", "discrete"), ("timing", "bound"), ("frames", "0..1")]);
        let codes: Vec<&str> = both.warnings.split(',').collect();
        assert!(codes.contains(&"platform-mismatch") && codes.is_sorted(), "{codes:?}");
        assert!(
            both.accuracy_warnings.split(',').all(|code| code.is_empty() || codes.contains(&code)),
            "{codes:?}"
        );
    }

    #[test]
    fn a_failure_is_a_result_with_its_reason() {
        let Outcome::Error(reason) = outcome(&[("gpu.pipeline.tile_px", "7")]) else { panic!() };
        assert!(reason.starts_with("--set gpu.pipeline.tile_px=7: "), "{reason}");
    }
}
