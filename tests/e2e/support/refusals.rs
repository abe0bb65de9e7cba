//! Checks of error messages.

use std::fs;

use super::{Ended, Inputs, quintile};

/// Beginnings of remedies: a message has to state what to do.
const REMEDIES: [&str; 40] = [
    "--help",
    "0 to 1",
    "; up to ",
    "above 0",
    "above zero",
    "add ",
    "ask for",
    "at least",
    "built in:",
    "check ",
    "choose ",
    "convert it",
    "create it",
    "did you mean",
    "due",
    "end of RON",
    "Expected ",
    "export it",
    "finite",
    "fix ",
    "from ",
    "get it again",
    "get the file again",
    "give ",
    "go up to",
    "has to",
    "have to",
    "known here",
    "leave it out",
    "fix ",
    "move one",
    "name a file",
    "name another",
    "needs",
    "put ",
    "remove ",
    "takes",
    "to 256",
    "with anything in it",
    "write it as",
];

/// Collects the problems of all checked messages and panics with the list when dropped.
#[derive(Default)]
pub struct Refusals {
    complaints: Vec<String>,
}

impl Refusals {
    /// Checks that a call failed with `code` and one message that contains every part of `says` and a remedy.
    pub fn check(&mut self, ended: &Ended, code: i32, says: &[&str]) {
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
        complain(REMEDIES.iter().any(|remedy| stderr.contains(remedy)), "it names no remedy");
    }

    /// Checks `quintile run ARGS` with a new folder, which has to stay empty.
    pub fn call(&mut self, args: &[&str], code: i32, says: &[&str]) {
        let inputs = Inputs::new();
        let out = inputs.path("out");
        let ended = quintile().call(["run"].iter().chain(args).chain(&["--out", &out]));
        self.check(&ended, code, says);
        if fs::read_dir(&out).is_ok_and(|mut left| left.next().is_some()) {
            self.complaints.push(format!("{args:?} left files in its folder"));
        }
    }

    /// Checks a run of a scene file with these bytes; the message has to name the file.
    pub fn file(&mut self, name: &str, bytes: impl AsRef<[u8]>, code: i32, says: &[&str]) {
        let inputs = Inputs::new();
        let scene = inputs.put(name, bytes);
        self.call(&[&scene], code, &[&[scene.as_str()], says].concat());
    }
}

impl Drop for Refusals {
    fn drop(&mut self) {
        let complaints = self.complaints.join("\n");
        assert!(complaints.is_empty() || std::thread::panicking(), "{complaints}");
    }
}
