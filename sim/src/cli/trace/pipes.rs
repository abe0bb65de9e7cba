//! `-` in place of a file: standard input and standard output, by way of files in a temporary folder, as a trace is read
//! several times and a file is written whole.

use std::fs::File;
use std::io::{self, ErrorKind, IsTerminal, Write};
use std::path::{Path, PathBuf};

use tempfile::TempDir;

use super::picture_file::PlotFormat;
use super::wrong;
use crate::cli::Failure;
use crate::cli::trace::{TraceArgs, TraceCommand};

/// Name of an input from a pipe in messages and plots.
const INPUT: &str = "standard input";
/// The format of tables.
const CSV: (&str, bool) = ("csv", true);
/// The files that stand in for standard input and standard output.
pub(super) struct Pipes {
    folder: Option<TempDir>,
    output: Option<PathBuf>,
}

/// An input as messages and plots call it.
pub(super) fn shown(path: &Path) -> String {
    match path.file_name().is_some_and(|name| name == INPUT) {
        true => INPUT.to_owned(),
        false => path.display().to_string(),
    }
}

fn is_dash(path: &Path) -> bool {
    path.as_os_str() == "-"
}

impl Pipes {
    /// Puts files in place of every `-` among `args`, and reads standard input where it is one of them.
    pub fn laid(args: &mut TraceArgs) -> Result<Self, Failure> {
        let mut pipes = Self { folder: None, output: None };
        match &mut args.command {
            TraceCommand::Frames(args) => {
                pipes.input(&mut args.input.trace)?;
                args.piped = pipes.optional_output(&mut args.out, args.json)?;
            }
            TraceCommand::Energy(args) => pipes.input(&mut args.input.trace)?,
            TraceCommand::Align(args) => {
                pipes.input(&mut args.input.trace)?;
                args.piped = pipes.optional_output(&mut args.out, args.json)?;
            }
            TraceCommand::Convert(args) => {
                pipes.input(&mut args.input.trace)?;
                args.out = args.last.take().or(args.named.take()).unwrap_or_default();
                let format = args.format.map(|format| (format.ending, format.is_text));
                args.piped = pipes.output(&mut args.out, format, CSV, args.json)?;
            }
            TraceCommand::Sample(args) => {
                pipes.input(&mut args.input.trace)?;
                let format = args.format.map(|format| (format.ending, format.is_text));
                args.piped = pipes.output(&mut args.out, format, CSV, args.json)?;
            }
            TraceCommand::Plot(args) => {
                pipes.input(&mut args.input.trace)?;
                let format = args.format.map(PlotFormat::ending);
                args.piped = pipes.output(&mut args.out, format, PlotFormat::Svg.ending(), args.json)?;
            }
            TraceCommand::Pareto(args) => {
                pipes.input(&mut args.table)?;
                args.piped = pipes.optional_output(&mut args.out, args.json)?;
            }
        }
        Ok(pipes)
    }

    /// Copies the result to standard output, or says why there is none.
    pub fn finish(self, done: Result<(), Failure>) -> Result<(), Failure> {
        let Some(folder) = &self.folder else { return done };
        // The folder is nothing that a user knows.
        let place = format!("{}{}", folder.path().display(), std::path::MAIN_SEPARATOR);
        done.map_err(|failure| Failure { message: failure.message.replace(&place, ""), ..failure })?;
        self.output.as_deref().map_or(Ok(()), copy_out)
    }

    fn input(&mut self, path: &mut PathBuf) -> Result<(), Failure> {
        if !is_dash(path) {
            return Ok(());
        }
        let file = self.file(INPUT)?;
        let copied = File::create(&file).and_then(|mut file| io::copy(&mut io::stdin().lock(), &mut file));
        copied.map_err(|error| Failure { message: format!("{INPUT}: cannot read it: {error}"), code: 1 })?;
        *path = file;
        Ok(())
    }

    fn optional_output(&mut self, out: &mut Option<PathBuf>, json: bool) -> Result<bool, Failure> {
        out.as_mut().map_or(Ok(false), |out| self.output(out, None, CSV, json))
    }

    /// Whether `out` is standard output. A format is its ending, and whether it is text.
    fn output(
        &mut self,
        out: &mut PathBuf,
        format: Option<(&str, bool)>,
        default: (&str, bool),
        json: bool,
    ) -> Result<bool, Failure> {
        if !is_dash(out) {
            return match format {
                Some((format, _)) => Err(wrong(format!(
                    "--format {format} goes with `-`, standard output; the name of a file says its format: {} has to end in .{format}",
                    out.display()
                ))),
                None => Ok(false),
            };
        }
        if json {
            return Err(wrong(
                "-: standard output takes the result or --json, not both; name a file, or leave --json out",
            ));
        }
        let (format, is_text) = format.unwrap_or(default);
        if !is_text && io::stdout().is_terminal() {
            return Err(wrong(format!(
                "-: {format} is binary, and standard output is a terminal; name a file, or send it into one with >"
            )));
        }
        let file = self.file(&format!("standard output.{format}"))?;
        self.output = Some(file.clone());
        *out = file;
        Ok(true)
    }

    fn file(&mut self, name: &str) -> Result<PathBuf, Failure> {
        let made = match self.folder.take() {
            Some(folder) => Ok(folder),
            None => tempfile::tempdir(),
        };
        let folder = made.map_err(|error| Failure {
            message: format!("{}: no temporary folder can be made: {error}", std::env::temp_dir().display()),
            code: 1,
        })?;
        let file = folder.path().join(name);
        self.folder = Some(folder);
        Ok(file)
    }
}

/// Copies a file to standard output; a reader that closed the pipe has what it wanted.
fn copy_out(path: &Path) -> Result<(), Failure> {
    let mut out = io::stdout().lock();
    let copied =
        File::open(path).and_then(|mut file| io::copy(&mut file, &mut out)).and_then(|_| out.flush());
    match copied {
        Err(error) if error.kind() != ErrorKind::BrokenPipe => {
            Err(Failure { message: format!("standard output: cannot write to it: {error}"), code: 1 })
        }
        _ => Ok(()),
    }
}
