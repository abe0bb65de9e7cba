//! Printing of results. A closed pipe is not an error; a full disk is.

use std::io::{self, ErrorKind, Write};

use super::Failure;

/// Prints `text` and a line end to standard output.
pub(super) fn print(text: &str) -> Result<(), Failure> {
    let mut out = io::stdout().lock();
    match writeln!(out, "{}", text.trim_end_matches('\n')).and_then(|()| out.flush()) {
        Err(error) if error.kind() != ErrorKind::BrokenPipe => {
            Err(Failure { message: format!("standard output: cannot write to it: {error}"), code: 1 })
        }
        _ => Ok(()),
    }
}

/// Prints a value as JSON, over several lines where `pretty`.
pub(super) fn print_json(value: &impl serde::Serialize, pretty: bool) -> Result<(), Failure> {
    print(&json_text(value, pretty)?)
}

/// A value as JSON, over several lines where `pretty`.
pub(super) fn json_text(value: &impl serde::Serialize, pretty: bool) -> Result<String, Failure> {
    let text = if pretty { serde_json::to_string_pretty(value) } else { serde_json::to_string(value) };
    text.map_err(|error| Failure { message: format!("printing JSON: {error}"), code: 1 })
}
