//! Calls of the command as by a script: no terminal, output into pipes.

use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
#[cfg(unix)]
use std::sync::{Arc, Once, atomic::AtomicBool};
use std::time::Duration;

use tempfile::TempDir;

use super::Results;

/// The program.
#[derive(Clone, Debug)]
pub struct Quintile {
    program: PathBuf,
}

/// Result of a finished call.
#[derive(Clone, Debug)]
pub struct Ended {
    /// The exit code; `None` when a signal ended it.
    pub code: Option<i32>,
    /// Everything on standard output.
    pub stdout: String,
    /// Everything on standard error.
    pub stderr: String,
}

/// A running call.
#[derive(Debug)]
pub struct Running {
    child: Child,
}

impl Running {
    /// Waits for its end.
    ///
    /// # Panics
    /// If its output cannot be read.
    pub fn end(self) -> Ended {
        let output = self.child.wait_with_output().expect("the output of a call");
        let text = |bytes: Vec<u8>| String::from_utf8_lossy(&bytes).into_owned();
        Ended { code: output.status.code(), stdout: text(output.stdout), stderr: text(output.stderr) }
    }

    /// Waits until `begun` holds.
    ///
    /// # Panics
    /// If the call ends before.
    #[must_use]
    pub fn once(mut self, begun: impl Fn() -> bool) -> Self {
        while !begun() {
            let ended = self.child.try_wait().expect("the state of a call");
            assert!(ended.is_none(), "it ended too early: {:?}", self.end());
            std::thread::sleep(Duration::from_millis(5));
        }
        self
    }

    /// Sends it the signal called `name`, such as `INT`.
    ///
    /// # Panics
    /// If that fails.
    #[must_use]
    pub fn signal(self, name: &str) -> Self {
        let sent = Command::new("kill").args(["-s", name, &self.child.id().to_string()]).status();
        assert!(sent.is_ok_and(|status| status.success()), "SIG{name} could not be sent");
        self
    }
}

impl Quintile {
    /// The program at `program`; tests say `quintile()`.
    pub fn new(program: impl Into<PathBuf>) -> Self {
        Self { program: program.into() }
    }

    /// Calls it with `args`.
    ///
    /// # Panics
    /// If the program cannot be started.
    pub fn call<S: AsRef<OsStr>>(&self, args: impl IntoIterator<Item = S>) -> Ended {
        self.spawn(args).end()
    }

    /// Calls it with `args` in the current directory `folder`.
    ///
    /// # Panics
    /// If the program cannot be started.
    pub fn call_in<S: AsRef<OsStr>>(&self, folder: &Path, args: impl IntoIterator<Item = S>) -> Ended {
        self.start(Command::new(&self.program).current_dir(folder).args(args)).end()
    }

    /// Starts it with `args` and does not wait.
    ///
    /// # Panics
    /// If the program cannot be started.
    pub fn spawn<S: AsRef<OsStr>>(&self, args: impl IntoIterator<Item = S>) -> Running {
        self.start(Command::new(&self.program).args(args))
    }

    fn start(&self, command: &mut Command) -> Running {
        #[cfg(unix)]
        handle_signals();
        let child = command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn();
        Running {
            child: child.unwrap_or_else(|error| panic!("starting {}: {error}", self.program.display())),
        }
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

    /// The same into a `folder` that stays, for results that several tests share.
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

/// Handles interrupt and termination as they are by default, so that calls do not inherit that they are ignored: scripts
/// start background jobs, such as these tests, with interrupts ignored. A signal with a handler is not ignored, and a new
/// program starts with its default.
#[cfg(unix)]
fn handle_signals() {
    use signal_hook::consts::{SIGINT, SIGTERM};

    static ONCE: Once = Once::new();
    ONCE.call_once(|| {
        for signal in [SIGINT, SIGTERM] {
            let always = Arc::new(AtomicBool::new(true));
            signal_hook::flag::register_conditional_default(signal, always).expect("a signal can be handled");
        }
    });
}
