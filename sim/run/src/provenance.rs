//! Provenance of a run (options, input files, program, host), and repeating a run by it.

use std::collections::BTreeMap;
use std::fs;
use std::io;
use std::path::Path;

use output::dir::sha256_of;
use serde::de::IgnoredAny;
use serde::{Deserialize, Serialize};
use serde_json::error::Category;
use workloads::Scene;
use workloads::scene::CameraUsed;

use crate::{Choice, Plan, RunError, RunOptions};

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
    pub(super) fn of_plan(plan: &Plan) -> Result<Vec<Self>, RunError> {
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
    let refuse = |message: String| RunError::Setting(format!("{name}: {message}"));
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_missing_file_has_neither_size_nor_hash() {
        let missing = Input::now(Path::new("/nowhere/a.png")).unwrap();
        assert_eq!((missing.bytes, missing.sha256), (None, None));
    }
}
