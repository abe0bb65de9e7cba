//! Provenance of a run (options, input files, program, host), and repeating a run by it.

use std::collections::BTreeMap;
use std::fs;
use std::io;
use std::path::Path;

use output::dir::sha256_of;
use serde::de::IgnoredAny;
use serde::{Deserialize, Serialize};
use workloads::scene::CameraUsed;

use crate::{Choice, Plan, RunError, RunOptions, Work};

/// The version of the form of `summary.json`, described by `docs/summary.schema.json`. Within a version keys may be added; one that
/// goes, or changes its meaning or unit, makes the next version.
pub const SCHEMA: u32 = 2;

/// A file that a run was made from.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Input {
    /// Its path as it was opened.
    pub path: String,
    /// Its size; without it there was no such file.
    pub bytes: Option<u64>,
    /// The SHA-256 of its content, hexadecimal.
    pub sha256: Option<String>,
}

impl Input {
    /// The file at `path` as it is now. One that is missing or a folder has neither size nor hash.
    ///
    /// # Errors
    /// When it is there and cannot be read.
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

    /// The files of `plan`.
    pub(super) fn of_plan(plan: &Plan) -> Result<Vec<Self>, RunError> {
        plan.files.iter().map(|path| Self::now(path)).collect()
    }
}

/// The program, the call and the machine. No result depends on them but the time a run takes, and with it what `--budget` chooses.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Host {
    /// The words of the command line.
    pub command: Vec<String>,
    /// The current directory, which relative paths begin at.
    pub directory: String,
    /// The git revision of the program, with `+changes` where its sources differed from it; only in release builds within a clone.
    pub revision: Option<String>,
    /// Worker threads.
    pub threads: usize,
    /// Threads that the processor runs at once.
    pub cores: usize,
    /// The model of the processor, where the system says.
    pub cpu: Option<String>,
    /// The operating system, with its version where it is known.
    pub system: String,
    /// The kind of processor.
    pub architecture: String,
}

impl Host {
    /// This process on this machine; its program was built from `revision`.
    pub fn now(revision: Option<&str>) -> Self {
        let words = std::env::args_os().map(|word| word.to_string_lossy().into_owned());
        let version = fs::read_to_string("/proc/sys/kernel/osrelease").unwrap_or_default();
        Self {
            // How the program was found is no part of the call.
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

/// What is recorded of a run before it begins.
#[derive(Clone, Debug)]
pub struct Provenance {
    /// What was asked for.
    pub request: RunOptions,
    /// The files it was made from, by name.
    pub inputs: Vec<Input>,
    /// The camera of a scene; workloads have cameras of their own.
    pub camera: Option<CameraUsed>,
    /// The machine.
    pub host: Host,
}

impl Provenance {
    pub(super) fn new(plan: &Plan, revision: Option<&str>) -> Result<Self, RunError> {
        let camera = match &plan.work {
            Work::Scene(scene) => Some(scene.camera_used()?),
            Work::Job { .. } => None,
        };
        let inputs = Input::of_plan(plan)?;
        Ok(Self { request: plan.options.clone(), inputs, camera, host: Host::now(revision) })
    }
}

/// What of a summary a run is repeated by.
#[derive(Deserialize)]
struct Recorded {
    version: String,
    request: RunOptions,
    inputs: Vec<Input>,
    choice: Option<Choice>,
    host: Host,
}

/// The version of the form, and of whatever else there is nothing.
#[derive(Deserialize)]
struct Form {
    schema: u32,
    #[serde(flatten)]
    _other: BTreeMap<String, IgnoredAny>,
}

/// The options of the run that wrote the summary at `path`; with its choice, where `--accuracy` or `--budget` made one.
///
/// # Errors
/// When that is no summary of this version, or, without `force`, when the program (built from `revision`) or an input is another.
pub fn again(
    path: &Path,
    force: bool,
    revision: Option<&str>,
) -> Result<(RunOptions, Option<Choice>), RunError> {
    let name = path.display();
    let text = fs::read(path).map_err(|source| RunError::Input { path: name.to_string(), source })?;
    let refuse = |message: String| RunError::Setting(format!("{name}: {message}"));
    let form: Form = serde_json::from_slice(&text).map_err(|_| {
        refuse("it is not the summary of a run; give the summary.json that `quintile run` wrote".to_owned())
    })?;
    if form.schema != SCHEMA {
        let message = format!(
            "its schema is {}, this version reads {SCHEMA}; repeat the run with the version that wrote it, or by its `request`",
            form.schema
        );
        return Err(refuse(message));
    }
    let recorded: Recorded = serde_json::from_slice(&text)
        .map_err(|error| refuse(format!("it is damaged: {error}; get the file again")))?;
    if !force {
        recorded.check(revision).map_err(refuse)?;
    }
    Ok((recorded.request, recorded.choice))
}

impl Recorded {
    /// Refuses what would give other results.
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
    fn a_missing_file_is_an_input_too() {
        let missing = Input::now(Path::new("/nowhere/a.png")).unwrap();
        assert_eq!((missing.bytes, missing.sha256), (None, None));
    }
}
