//! What a run was made from and where: for repeating it.

use std::fs;
use std::io;
use std::path::Path;

use serde::{Deserialize, Serialize};
use workloads::scene::CameraUsed;

use super::{Plan, RunError, Work};
use output::dir::sha256_of;

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
    pub request: super::RunOptions,
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_missing_file_is_an_input_too() {
        let missing = Input::now(Path::new("/nowhere/a.png")).unwrap();
        assert_eq!((missing.bytes, missing.sha256), (None, None));
    }
}
