//! Checks of error messages.

use std::fs;

use super::{Ended, Inputs, quintile};

/// Collects the problems of all checked messages; [`Refusals::done`] asserts that there are none.
#[derive(Default)]
pub struct Refusals {
    complaints: Vec<String>,
    done: bool,
}

impl Refusals {
    /// Checks that a call failed with `code` and one message. The message has to contain every part of `says`
    /// (the file, the place and what is wrong), and `remedy`: what to do.
    pub fn check(&mut self, ended: &Ended, code: i32, says: &[&str], remedy: &str) {
        let Ended { stdout, stderr, .. } = ended;
        let mut complain = |holds: bool, what: &str| {
            if !holds {
                self.complaints.push(format!("{what}: {}", stderr.trim_end()));
            }
        };
        complain(ended.code == Some(code), &format!("exit code {code} is due, not {:?}", ended.code));
        complain(stdout.is_empty(), "standard output has to stay empty");
        for part in says {
            complain(stderr.contains(part), &format!("it does not say `{part}`"));
        }
        for part in ["panicked", "internal error", "backtrace", "RUST_BACKTRACE", "unwrap", "Err("] {
            complain(!stderr.contains(part), part);
        }
        let messages = stderr.lines().filter(|line| line.starts_with("error: ")).count();
        complain(messages == 1, "one message is due");
        // The parser of the command line adds usage lines.
        let of_parser = stderr.contains("For more information, try '--help'");
        complain(of_parser || stderr.lines().count() == 1, "one line is due");
        assert!(!remedy.is_empty(), "the test has to state the remedy");
        complain(stderr.contains(remedy), &format!("it does not give the remedy `{remedy}`"));
    }

    /// Asserts that all messages were as they should be.
    pub fn done(mut self) {
        self.done = true;
        assert!(self.complaints.is_empty(), "{}", self.complaints.join("\n"));
    }

    /// Checks `quintile run ARGS` with a new folder, which has to stay empty.
    pub fn call(&mut self, args: &[&str], code: i32, says: &[&str], remedy: &str) {
        let inputs = Inputs::new();
        let out = inputs.path("out");
        let ended = quintile().call(["run"].iter().chain(args).chain(&["--out", &out]));
        self.check(&ended, code, says, remedy);
        if fs::read_dir(&out).is_ok_and(|mut left| left.next().is_some()) {
            self.complaints.push(format!("{args:?} left files in its folder"));
        }
    }

    /// Checks a run of a scene file with these bytes; the message has to name the file.
    pub fn file(&mut self, name: &str, bytes: impl AsRef<[u8]>, code: i32, says: &[&str], remedy: &str) {
        let inputs = Inputs::new();
        let scene = inputs.put(name, bytes);
        self.call(&[&scene], code, &[&[scene.as_str()], says].concat(), remedy);
    }
}

impl Drop for Refusals {
    /// Fails a test that has forgotten [`Refusals::done`].
    fn drop(&mut self) {
        assert!(self.done || std::thread::panicking(), "the test has to end with `done`");
    }
}
