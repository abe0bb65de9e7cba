//! `quintile trace`: analysis of any power trace, recorded or synthetic.

mod convert;
mod energy;
mod frames;
mod input;
mod plot;

use std::path::Path;

use clap::{Args, Subcommand, ValueEnum};
use convert::{ConvertArgs, SampleArgs};
use energy::EnergyArgs;
use frames::{AlignArgs, FramesArgs};
use input::Pipes;
use output::plot::Picture;
use output::terminal::Terminal;
use plot::{ParetoArgs, PlotArgs};
use traces::frames::MarkError;
use traces::io::{ReadError, WriteError};
use traces::search::SearchError;
use traces::times::TimesError;
use warnings::Warning;

use super::{Failure, print};

/// Arguments of `trace`.
#[derive(Clone, Debug, Args)]
#[command(
    after_help = "Example:\n  quintile trace frames meter.csv --mark 2.513 --out frames.csv\n  quintile trace plot meter.csv --from 2 --to 3 --out curve.svg"
)]
pub struct TraceArgs {
    /// The subcommand.
    #[command(subcommand)]
    pub command: TraceCommand,
}

/// Subcommands of `trace`.
#[derive(Clone, Debug, Subcommand)]
pub enum TraceCommand {
    /// Find every frame that begins like a marked one, and its energy from start to start
    Frames(Box<FramesArgs>),
    /// Energy between times, idle taken off, warm-up, outliers, repeated runs, passes within frames
    Energy(Box<EnergyArgs>),
    /// Put recorded time stamps onto the time of a trace
    Align(Box<AlignArgs>),
    /// Read a trace and write it in another format
    Convert(ConvertArgs),
    /// Record a trace anew with a coarser device: rate, range, bits, errors, noise
    Sample(Box<SampleArgs>),
    /// Draw a trace or its frames
    Plot(Box<PlotArgs>),
    /// Pareto-optimal settings of a table, by time and energy
    Pareto(ParetoArgs),
}

pub(super) fn run(args: &TraceArgs, terminal: &Terminal) -> Result<(), Failure> {
    let mut args = args.clone();
    let pipes = Pipes::laid(&mut args)?;
    pipes.finish(run_on_files(&args, terminal))
}

/// Prints what was done, on standard error where standard output has the result.
fn report(line: &str, piped: bool, terminal: &Terminal) -> Result<(), Failure> {
    if !piped {
        return print(line);
    }
    terminal.detail(line);
    Ok(())
}

/// Prints a warning with what to change in the arguments.
fn warn_with(warning: &Warning, remedy: &str, terminal: &Terminal) {
    terminal.warn_of(warning.code, &format!("{}; {remedy}", warning.message));
}

fn run_on_files(args: &TraceArgs, terminal: &Terminal) -> Result<(), Failure> {
    match &args.command {
        TraceCommand::Frames(args) => frames::run(args, terminal),
        TraceCommand::Energy(args) => energy::run(args, terminal),
        TraceCommand::Align(args) => frames::align(args, terminal),
        TraceCommand::Convert(args) => convert::run(args, terminal),
        TraceCommand::Sample(args) => convert::sample(args, terminal),
        TraceCommand::Plot(args) => plot::run(args, terminal),
        TraceCommand::Pareto(args) => plot::pareto(args, terminal),
    }
}

impl From<ReadError> for Failure {
    fn from(error: ReadError) -> Self {
        wrong(error.to_string())
    }
}

impl From<MarkError> for Failure {
    fn from(error: MarkError) -> Self {
        wrong(error.to_string())
    }
}

impl From<TimesError> for Failure {
    fn from(error: TimesError) -> Self {
        wrong(error.to_string())
    }
}

impl From<SearchError> for Failure {
    fn from(error: SearchError) -> Self {
        match error {
            SearchError::Read(error) => error.into(),
            SearchError::Mark(error) => error.into(),
            SearchError::Unmarked => {
                wrong(format!("{error}: give --mark SECONDS, --mark-file FILE or --auto"))
            }
            SearchError::NoRise => wrong(format!("--auto {error}: mark one with --mark")),
            SearchError::NoRepetition { .. } => wrong(format!("--auto {error}; mark a frame with --mark")),
            SearchError::ProposalInPieces => wrong(format!("--auto: {error}; mark a frame with --mark")),
            SearchError::NotInPieces => wrong(format!("--stream: {error}; leave it out")),
        }
    }
}

impl From<WriteError> for Failure {
    fn from(error: WriteError) -> Self {
        match error {
            WriteError::Read(error) => error.into(),
            WriteError::Source(error) => wrong(error.to_string()),
            error => Self { message: error.to_string(), code: 1 },
        }
    }
}

/// Wrong arguments.
fn wrong(message: impl Into<String>) -> Failure {
    Failure { message: message.into(), code: 2 }
}

/// Formats of plots.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
#[allow(missing_docs, reason = "the names of the formats")]
pub enum PlotFormat {
    Svg,
    Png,
    Pdf,
}

impl PlotFormat {
    /// The ending of files of this format, and whether they are text.
    fn ending(self) -> (&'static str, bool) {
        match self {
            Self::Svg => ("svg", true),
            Self::Png => ("png", false),
            Self::Pdf => ("pdf", false),
        }
    }

    /// The format of a file, by its name.
    fn of(path: &Path) -> Result<Self, Failure> {
        match path.extension().and_then(|end| end.to_str()).map(str::to_ascii_lowercase).as_deref() {
            Some("svg") => Ok(Self::Svg),
            Some("png") => Ok(Self::Png),
            Some("pdf") => Ok(Self::Pdf),
            _ => Err(wrong(format!("{}: a plot has to end in .svg, .png or .pdf", path.display()))),
        }
    }
}

/// Writes a picture in a format.
pub(super) fn write_picture(picture: &Picture, path: &Path, format: PlotFormat) -> Result<(), Failure> {
    let bytes = match format {
        PlotFormat::Svg => picture.svg().map(String::into_bytes),
        PlotFormat::Png => picture.png(),
        PlotFormat::Pdf => Ok(picture.pdf()),
    }
    .map_err(|error| Failure { message: format!("{}: {error}", path.display()), code: 1 })?;
    Ok(traces::io::atomic::write_file(path, |out| std::io::Write::write_all(out, &bytes))?)
}
