//! Output files, checked before the work starts, and printed results. A closed pipe is not an error; a full disk is.

use std::io::{self, ErrorKind, Write};
use std::path::{Path, PathBuf};

use traces::io::{ReadOptions, Rows};

use super::Failure;

/// Checks that an output file can be written, and is neither one of the inputs nor a recording.
pub(super) fn may_hold_results<'a>(
    flag: &str,
    out: Option<&Path>,
    inputs: impl IntoIterator<Item = &'a Path>,
) -> Result<(), Failure> {
    may_hold_trace(flag, out, inputs)?;
    let is_recording = |out: &&Path| out.is_file() && Rows::open(out, &ReadOptions::default()).is_ok();
    out.filter(is_recording).map_or(Ok(()), |out| {
        let message = format!("{flag}: {} is a recording; name another file, or move it", out.display());
        Err(Failure { message, code: 2 })
    })
}

/// The same for a trace, which may replace another one.
pub(super) fn may_hold_trace<'a>(
    flag: &str,
    out: Option<&Path>,
    inputs: impl IntoIterator<Item = &'a Path>,
) -> Result<(), Failure> {
    let Some(out) = out else { return Ok(()) };
    if out.is_dir() || out.file_name().is_none() {
        let message = match out.to_str() {
            Some("") => format!("{flag}: an empty file name; name a file in an existing folder"),
            _ => format!("{flag}: {} is a folder; name a file in it", out.display()),
        };
        return Err(Failure { message, code: 2 });
    }
    not_an_input(flag, out, inputs)?;
    let folder = match out.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    };
    if !folder.is_dir() {
        let message = format!(
            "{flag}: {}: the folder {} does not exist; create it, or name a file in an existing folder",
            out.display(),
            folder.display()
        );
        return Err(Failure { message, code: 2 });
    }
    traces::io::atomic::try_place(out).map_err(|error| Failure { message: error.to_string(), code: 1 })
}

fn not_an_input<'a>(
    flag: &str,
    out: &Path,
    inputs: impl IntoIterator<Item = &'a Path>,
) -> Result<(), Failure> {
    let place = |path: &Path| -> Option<PathBuf> { std::fs::canonicalize(path).ok() };
    let Some(taken) = place(out) else { return Ok(()) };
    let refused = |input: &Path| {
        let message = format!("{flag}: {} is what is read; name another file", input.display());
        Failure { message, code: 2 }
    };
    let same = inputs.into_iter().find(|input| place(input).is_some_and(|input| input == taken));
    same.map_or(Ok(()), |input| Err(refused(input)))
}

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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn unwritable_outputs_are_refused_and_nothing_is_left_behind() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        ["old.csv", "in.csv"].iter().for_each(|name| std::fs::write(at(name), "old").unwrap());
        let refused = |name: &str| {
            let checked = may_hold_results("--out", Some(&at(name)), [at("in.csv").as_path()]);
            checked.err().map(|failure| (failure.code, failure.message))
        };
        assert_eq!([refused("new.csv"), refused("old.csv")], [None, None]);
        for (name, expected, says) in [
            ("no/new.csv", 2, "does not exist; create it"),
            ("old.csv/new.csv", 2, "does not exist; create it"),
            ("in.csv", 2, "is what is read"),
            ("", 2, "is a folder; name a file in it"),
            (".", 2, "is a folder; name a file in it"),
            ("..", 2, "is a folder; name a file in it"),
        ] {
            let (code, message) = refused(name).unwrap();
            assert!(code == expected && message.contains(says), "{message}");
        }
        assert!(may_hold_results("--csv", Some(Path::new("/")), []).is_err_and(|failure| failure.code == 2));
        std::fs::write(at("trace.csv"), "time_s,power_W\n0,1\n0.001,1\n0.002,1\n").unwrap();
        let (code, message) = refused("trace.csv").unwrap();
        assert!(code == 2 && message.contains("is a recording"), "{message}");
        assert!(may_hold_trace("--out", Some(&at("trace.csv")), []).is_ok());
        assert_eq!(std::fs::read(at("old.csv")).unwrap(), b"old");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 3);
    }
}
