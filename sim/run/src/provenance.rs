//! Provenance of a run (options, input files, program, host, hardware), and repeating a run by it.

use std::collections::BTreeMap;
use std::path::Path;
use std::{fs, io};

use activity::Unit;
use output::dir::sha256_of;
use power_model::{PowerModel, UncertainValue};
use serde::de::IgnoredAny;
use serde::{Deserialize, Serialize};
use serde_json::error::Category;
use workloads::Scene;
use workloads::scene::CameraUsed;

use crate::{Choice, Plan, RunError, RunOptions, structure};

/// Schema version of `summary.json`, described by `docs/summary.schema.json`. A version may gain keys.
/// Removing a key or changing its meaning or unit needs a new version.
pub const SCHEMA: u32 = 3;

/// Input file of a run.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Input {
    /// Path as it was opened.
    pub path: String,
    /// Size in bytes; `None` for a missing file.
    pub bytes: Option<u64>,
    /// SHA-256 of the contents, hexadecimal.
    pub sha256: Option<String>,
}

impl Input {
    /// Reads the file at `path`. A missing file and a folder have neither size nor hash.
    ///
    /// # Errors
    /// If the file exists and cannot be read.
    pub fn now(path: &Path) -> Result<Self, RunError> {
        let name = path.display().to_string();
        let absent = |path| Self { path, bytes: None, sha256: None };
        let of_file = |path: &Path| io::Result::Ok((fs::metadata(path)?.len(), sha256_of(path)?));
        match of_file(path) {
            Ok((bytes, sha256)) => Ok(Self { path: name, bytes: Some(bytes), sha256: Some(sha256) }),
            Err(error) if error.kind() == io::ErrorKind::NotFound || path.is_dir() => Ok(absent(name)),
            Err(source) => Err(RunError::Input { path: name, source }),
        }
    }

    /// Input files of `plan`.
    fn of_plan(plan: &Plan) -> Result<Vec<Self>, RunError> {
        plan.files.iter().map(|path| Self::now(path)).collect()
    }
}

/// Program, command line and host of a run. Results do not depend on them, except for the choice of
/// `--budget`.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Host {
    /// Command line, one word per entry.
    pub command: Vec<String>,
    /// Current directory, the base of relative paths.
    pub directory: String,
    /// Git revision of the program, with `+changes` if the sources were modified; only in release builds from
    /// a clone.
    pub revision: Option<String>,
    /// Worker threads.
    pub threads: usize,
    /// Hardware threads of the processor.
    pub cores: usize,
    /// Processor model, if known.
    pub cpu: Option<String>,
    /// Operating system, with its version if known.
    pub system: String,
    /// Processor architecture.
    pub architecture: String,
}

impl Host {
    /// Describes this process; `revision` is the git revision of the program.
    pub fn now(revision: Option<&str>) -> Self {
        let words = std::env::args_os().map(|word| word.to_string_lossy().into_owned());
        let version = fs::read_to_string("/proc/sys/kernel/osrelease").unwrap_or_default();
        Self {
            // The path of the program is not recorded.
            command: ["quintile".to_owned()].into_iter().chain(words.skip(1)).collect(),
            directory: std::env::current_dir().unwrap_or_default().display().to_string(),
            revision: revision.map(str::to_owned),
            threads: rayon::current_num_threads(),
            cores: std::thread::available_parallelism().map_or(1, usize::from),
            cpu: cpu(),
            system: format!("{} {version}", std::env::consts::OS).trim_end().to_owned(),
            architecture: std::env::consts::ARCH.to_owned(),
        }
    }
}

fn cpu() -> Option<String> {
    let text = fs::read_to_string("/proc/cpuinfo").ok()?;
    let line = text.lines().find(|line| line.starts_with("model name"))?;
    Some(line.split_once(':')?.1.trim().to_owned())
}

/// Provenance of a run, recorded before it starts.
#[derive(Clone, Debug)]
pub struct Provenance {
    /// The options.
    pub request: RunOptions,
    /// The input files, sorted by name.
    pub inputs: Vec<Input>,
    /// Camera of a scene; `None` for workloads without one.
    pub camera: Option<CameraUsed>,
    /// The host.
    pub host: Host,
}

impl Provenance {
    pub(super) fn new(plan: &Plan, revision: Option<&str>) -> Result<Self, RunError> {
        let camera = plan.job.scene().map(Scene::camera_used).transpose()?;
        let inputs = Input::of_plan(plan)?;
        Ok(Self { request: plan.options.clone(), inputs, camera, host: Host::now(revision) })
    }
}

/// Parts of a summary that are needed to repeat a run.
#[derive(Deserialize)]
struct Recorded {
    version: String,
    request: RunOptions,
    inputs: Vec<Input>,
    choice: Option<Choice>,
    host: Host,
}

/// Schema version of a summary; all other keys are skipped.
#[derive(Deserialize)]
struct Schema {
    schema: u32,
    #[serde(flatten)]
    _other: BTreeMap<String, IgnoredAny>,
}

/// Reads the options of a run from its summary at `path`, and its choice if `--accuracy` or `--budget` was
/// given.
///
/// # Errors
/// If the file is not a summary of this schema. Without `force` also if the program (of `revision`) or an
/// input changed.
pub fn again(
    path: &Path,
    force: bool,
    revision: Option<&str>,
) -> Result<(RunOptions, Option<Choice>), RunError> {
    let path = if path.is_dir() { &path.join("summary.json") } else { path };
    let name = path.display();
    let text = fs::read(path).map_err(|source| RunError::Input { path: name.to_string(), source })?;
    let refuse = |message: String| RunError::invalid(&name, message);
    let damaged = |error: serde_json::Error| RunError::Damaged {
        path: name.to_string(),
        message: format!("it is cut off or damaged: {error}; get the file again"),
    };
    let summary: Schema = serde_json::from_slice(&text).map_err(|error| match error.classify() {
        Category::Data => refuse(
            "it is not the summary of a run; give the summary.json that `quintile run` wrote".to_owned(),
        ),
        _ => damaged(error),
    })?;
    if summary.schema != SCHEMA {
        let message = format!(
            "its schema is {}, this version reads {SCHEMA}; repeat the run with the version that wrote it, or by its `request`",
            summary.schema
        );
        return Err(refuse(message));
    }
    let recorded: Recorded = serde_json::from_slice(&text).map_err(damaged)?;
    if !force {
        recorded.check(revision).map_err(refuse)?;
    }
    Ok((recorded.request, recorded.choice))
}

impl Recorded {
    /// Checks that version, revision and inputs are those of the recorded run.
    fn check(&self, revision: Option<&str>) -> Result<(), String> {
        let of = |version: &str, revision: Option<&str>| {
            revision.map_or(version.to_owned(), |revision| format!("{version} ({revision})"))
        };
        let (then, now) =
            (of(&self.version, self.host.revision.as_deref()), of(env!("CARGO_PKG_VERSION"), revision));
        if then != now {
            return Err(format!(
                "Quintile {then} made this run, and this is {now}: results may differ; take that version, or repeat it with --force"
            ));
        }
        self.inputs.iter().try_for_each(|then| self.check_input(then))
    }

    fn check_input(&self, then: &Input) -> Result<(), String> {
        let now = Input::now(Path::new(&then.path)).map_err(|error| error.to_string())?;
        let changed = match (&then.sha256, &now.sha256) {
            (then, now) if then == now => return Ok(()),
            (Some(_), None) => format!("is missing; the run was made in {}", self.host.directory),
            (None, Some(_)) => "was missing when the run was made".to_owned(),
            _ => "was changed after the run was made".to_owned(),
        };
        Err(format!(
            "its input {} {changed}: put that file as it was, or repeat the run with --force",
            then.path
        ))
    }
}

/// Area of the GPU of `plan` on the node of its platform, in square millimetres.
pub fn area_mm2(plan: &Plan) -> UncertainValue {
    structure(&plan.gpu).area_mm2(plan.platform.node_nm)
}

/// Hardware of a run, in `summary.json`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct HardwareSummary {
    /// Process node in nanometres.
    pub node_nm: u32,
    /// GPU for which the numbers of the platform hold.
    pub made_for: String,
    /// Area in square millimetres.
    pub area_mm2: UncertainValue,
    /// Leakage in watts, of the core.
    pub leakage_w: f64,
    /// Leakage over that of the GPU of the platform.
    pub leakage_ratio: UncertainValue,
    /// Power between frames in watts.
    pub idle_w: f64,
    /// Power of each unit while it is busy in watts, without its events.
    pub clock_tree_w: BTreeMap<&'static str, f64>,
    /// Power of each unit while it is idle in watts.
    pub idle_unit_w: BTreeMap<&'static str, f64>,
}

impl HardwareSummary {
    /// Hardware of `plan`.
    pub(super) fn new(plan: &Plan) -> Self {
        let units = Unit::ALL.into_iter().filter(|&unit| plan.gpu.units.has(unit));
        let watts = |state: usize, model: &PowerModel| {
            units.clone().map(|unit| (unit.name(), model.unit_w(unit)[state])).collect()
        };
        Self {
            node_nm: plan.platform.node_nm,
            made_for: plan.platform.made_for.clone(),
            area_mm2: area_mm2(plan),
            leakage_w: plan.model.leakage_w(),
            leakage_ratio: plan.scaling.leakage,
            idle_w: plan.platform.idle_w.value(),
            clock_tree_w: watts(0, &plan.model),
            idle_unit_w: watts(1, &plan.model),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hardware::tests::{GROW, set};

    #[test]
    fn a_missing_file_has_neither_size_nor_hash() {
        let missing = Input::now(Path::new("/nowhere/a.png")).unwrap();
        assert_eq!((missing.bytes, missing.sha256), (None, None));
    }

    /// Energy of the first frame of `scene` in joules on the reference GPU with changes, until it ends.
    fn frame_j(scene: &str, size: (u32, u32), changes: &[(&str, f64)]) -> f64 {
        let options = RunOptions {
            scene: scene.into(),
            overrides: workloads::Overrides {
                size: Some(size),
                samples: Some(4),
                ..workloads::Overrides::default()
            },
            changes: set(changes),
            ..RunOptions::default()
        };
        let plan = Plan::resolve(options).unwrap();
        let frames = crate::frames_of(&plan, &[0], &output::terminal::Progress::new(true)).unwrap();
        frames[0].cost().energy_j
    }

    /// Every rate, the cores and all caches, 64 times.
    fn sixty_fourfold() -> Vec<(&'static str, f64)> {
        let is_speed = |path: &&(&str, f64)| {
            path.0.contains("rates")
                || path.0.contains("entries")
                || path.0.ends_with("cores")
                || path.0.ends_with("lines_per_cycle")
        };
        GROW.iter().filter(is_speed).map(|&(path, start)| (path, 64.0 * start)).collect()
    }

    #[test]
    fn the_machine_of_64_times_the_hardware_loses_on_energy() {
        for (scene, size) in [("tiny", (64, 48)), ("default", (320, 180))] {
            let [own, large] =
                [&[("core_hz", 400e6)][..], &sixty_fourfold()].map(|set| frame_j(scene, size, set));
            println!("{scene}: {own} J, 64 times the hardware {large} J");
            assert!(large > 1.5 * own, "{scene}: {own} J, {large} J");
        }
    }
}
