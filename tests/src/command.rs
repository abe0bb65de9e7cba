//! Running the command as a script would: no terminal, output into pipes.

use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use tempfile::TempDir;

use crate::Results;

/// The program.
#[derive(Clone, Debug)]
pub struct Quintile {
    program: PathBuf,
}

/// How a call ended.
#[derive(Clone, Debug)]
pub struct Ended {
    /// The exit code; `None` when a signal ended it.
    pub code: Option<i32>,
    /// Everything on standard output.
    pub stdout: String,
    /// Everything on standard error.
    pub stderr: String,
}

impl Quintile {
    /// The program at `program`; tests say `quintile!()`.
    pub fn new(program: impl Into<PathBuf>) -> Self {
        Self { program: program.into() }
    }

    /// Calls it with `args`.
    ///
    /// # Panics
    /// If the program cannot be started.
    pub fn call<S: AsRef<OsStr>>(&self, args: impl IntoIterator<Item = S>) -> Ended {
        let mut command = Command::new(&self.program);
        let output = command.args(args).stdin(Stdio::null()).output();
        let output = output.unwrap_or_else(|error| panic!("starting {}: {error}", self.program.display()));
        let text = |bytes: Vec<u8>| String::from_utf8_lossy(&bytes).into_owned();
        Ended { code: output.status.code(), stdout: text(output.stdout), stderr: text(output.stderr) }
    }

    /// `quintile run SCENE ARGS...` into a folder of its own that goes away with the results.
    ///
    /// # Panics
    /// If it fails.
    pub fn run(&self, scene: &str, args: &[&str]) -> Results {
        let temporary = TempDir::new().expect("a temporary folder can be made");
        let folder = temporary.path().join("out");
        let ended = self.run_into(&folder, scene, args);
        Results::new(folder, Some(temporary), ended)
    }

    /// The same into a `folder` that stays, for results that several tests look at.
    ///
    /// # Panics
    /// If it fails.
    pub fn run_in(&self, folder: &Path, scene: &str, args: &[&str]) -> Results {
        let ended = self.run_into(folder, scene, args);
        Results::new(folder.to_path_buf(), None, ended)
    }

    fn run_into(&self, folder: &Path, scene: &str, args: &[&str]) -> Ended {
        let out = folder.display().to_string();
        let ended = self.call(["run", scene, "--out", &out].iter().chain(args));
        assert_eq!(ended.code, Some(0), "quintile run {scene} {args:?}: {}", ended.stderr);
        ended
    }
}
