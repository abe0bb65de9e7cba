//! Subcommands of `quintile`: arguments in, results and messages out. Output files are checked before the
//! work starts. On printing a closed pipe is not an error; a full disk is.

mod args;
mod ccd;
mod chart;
mod compare;
mod crash;
mod info;
mod list;
mod lists;
mod parse;
mod record;
mod run;
mod sample;
mod signals;
mod sweep;
mod trace;
mod visibility;

use std::ffi::OsString;
use std::io::{self, Write};
use std::panic::AssertUnwindSafe;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use ::run::RunError;
use ::run::compare::CompareError;
use ::sweep::SweepError;
use args::MessageArgs;
use chart::{ChartArgs, StressArgs};
use clap::error::ErrorKind;
use clap::{Args, CommandFactory, FromArgMatches, Parser, Subcommand};
use clap_mangen::Man;
use compare::CompareArgs;
use crash::Crashes;
use info::InfoArgs;
use output::terminal::Terminal;
use run::RunArgs;
use signals::Stop;
use trace::TraceArgs;
use traces::align::AlignError;
use traces::frames::MarkError;
use traces::io::{ReadError, ReadOptions, Rows, atomic};
use traces::pareto::ParetoError;
use traces::table::TableReadError;
use traces::times::TimesError;
use visibility::{SamplesArgs, VisibilityArgs};

/// A cycle-approximate simulator of a tile-based 5D rasterization pipeline, with an energy trace for every frame.
#[derive(Debug, Parser)]
#[command(name = "quintile", version, arg_required_else_help = true, max_term_width = 100)]
pub struct Cli {
    /// The subcommand.
    #[command(subcommand)]
    pub command: Command,
    /// Amount and colours of messages.
    #[command(flatten)]
    pub messages: MessageArgs,
}

/// The subcommand.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Render a scene, time it, turn it into watts, record a trace and find the energy of every frame in it
    Run(Box<RunArgs>),
    /// Describe a scene: contents, camera in use, ignored features
    Info(InfoArgs),
    /// Compare two runs, two images or two folders of images
    Compare(CompareArgs),
    /// Draw the frames of a run once and keep them, to be timed on many machines
    Record(record::RecordArgs),
    /// Time recorded frames on GPUs with the pipeline that drew them
    Time(record::TimeArgs),
    /// Plan, run and merge many runs from one file: design-space exploration
    Sweep(sweep::SweepArgs),
    /// Compute the visible triangle and depth of every sample, for comparison with another renderer
    Visibility(VisibilityArgs),
    /// Find the pairs of moving objects that may collide
    Ccd(ccd::CcdArgs),
    /// Generate points: Poisson disk, following a density, or uniform in a volume
    Sample(sample::SampleArgs),
    /// Write a sample table to a file
    Samples(SamplesArgs),
    /// Try each tile test on families of triangles from easy to hard: samples lost, efficiency, width of
    /// intervals, cost
    Stress(StressArgs),
    /// Measure and draw a chart of the book
    Chart(ChartArgs),
    /// Compute what a paper reports and compare it with the paper, row by row
    Reproduce(chart::ReproduceArgs),
    /// Analyse a power trace, recorded or synthetic: frames, energies, alignment, formats, plots, Pareto frontiers
    Trace(TraceArgs),
    /// Print a script that completes commands and options in a shell
    Completions(CompletionsArgs),
    /// Print the manual page, or write one for each command into a folder
    Man(ManArgs),
    /// List the built-in scenes, GPUs, platforms, energy tables, workloads and figures, or the options of a workload
    List(ListArgs),
}

/// Arguments of `completions`.
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  quintile completions bash > ~/.local/share/bash-completion/completions/quintile\n  \
    quintile completions zsh > ~/.zfunc/_quintile\n  quintile completions fish > ~/.config/fish/completions/quintile.fish"
)]
pub struct CompletionsArgs {
    /// The shell
    #[arg(value_enum, value_name = "SHELL")]
    pub shell: clap_complete::Shell,
}

/// Arguments of `man`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  quintile man | man -l -\n  quintile man ~/.local/share/man/man1")]
pub struct ManArgs {
    /// Folder for the pages of all commands, such as quintile-run.1; without it the main page is printed
    #[arg(value_name = "DIR")]
    pub folder: Option<PathBuf>,
    /// The same as DIR
    #[arg(long, value_name = "FOLDER", conflicts_with = "folder")]
    pub out: Option<PathBuf>,
}

/// Arguments of `list`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  quintile list --json\n  quintile list glossy")]
pub struct ListArgs {
    /// A workload whose options are listed, with defaults, ranges and meanings
    #[arg(value_name = "WORKLOAD")]
    pub workload: Option<String>,
    /// Print as JSON
    #[arg(long)]
    pub json: bool,
}

/// Executes the command line of this process. Exit code: 0 for success, 2 for a usage error, 1 for a failure.
pub fn main() -> ExitCode {
    let cli = parse(std::env::args_os().collect()).unwrap_or_else(|error| error.exit());
    let terminal = cli.messages.terminal();
    let stop = Stop::default();
    let follows_stop = matches!(&cli.command, Command::Sweep(args) if args.follows_stop());
    signals::handle(terminal.clone(), follows_stop.then(|| stop.clone()));
    let crashes = Crashes::record();
    match std::panic::catch_unwind(AssertUnwindSafe(|| dispatch(&cli, &terminal, &stop))) {
        Ok(Ok(())) => ExitCode::SUCCESS,
        Ok(Err(failure)) => {
            terminal.error(&failure.message);
            ExitCode::from(failure.code)
        }
        Err(panic) => {
            let arguments: Vec<String> =
                std::env::args_os().skip(1).map(|word| word.to_string_lossy().into_owned()).collect();
            terminal.error(&crashes.report(&*panic, &arguments));
            ExitCode::FAILURE
        }
    }
}

/// Parses the command line. Errors of the parser follow `--color`, too.
fn parse(args: Vec<OsString>) -> Result<Cli, clap::Error> {
    let mut command = Cli::command().color(args::color_of(&args));
    let matches = command.try_get_matches_from_mut(args)?;
    let cli = Cli::from_arg_matches(&matches).map_err(|error| error.format(&mut command))?;
    if let Some(("run", given)) = matches.subcommand() {
        run::check_given(given).map_err(|error| command.error(ErrorKind::ArgumentConflict, error))?;
    }
    // Global options may stand before and after the subcommand; the parser checks conflicts only within each.
    if cli.messages.quiet && cli.messages.verbose {
        let message = "the argument '--quiet' cannot be used with '--verbose'";
        return Err(command.error(ErrorKind::ArgumentConflict, message));
    }
    Ok(cli)
}

/// Error message with an exit code.
struct Failure {
    message: String,
    code: u8,
}

/// Failures with the message of an error, and an exit code that depends on it.
macro_rules! failures {
    ($code:expr => $($error:ty),+) => {$(
        impl From<$error> for Failure {
            fn from(error: $error) -> Self {
                let code: fn(&$error) -> u8 = $code;
                Self { message: error.to_string(), code: code(&error) }
            }
        }
    )+};
}

failures!(|error| if error.is_usage() { 2 } else { 1 } => RunError, CompareError, SweepError);
failures!(|_| 2 => AlignError, MarkError, ParetoError, ReadError, TableReadError, TimesError);

impl From<workloads::LoadError> for Failure {
    fn from(error: workloads::LoadError) -> Self {
        RunError::from(error).into()
    }
}

fn dispatch(cli: &Cli, terminal: &Terminal, stop: &Stop) -> Result<(), Failure> {
    match &cli.command {
        Command::Run(args) => run::run(args, terminal),
        Command::Info(args) => info::run(args),
        Command::Compare(args) => compare::run(args),
        Command::Record(args) => record::record(args, terminal),
        Command::Time(args) => record::time(args),
        Command::Sweep(args) => sweep::run(args, terminal, stop),
        Command::Completions(args) => completions(args),
        Command::Man(args) => man(args),
        Command::List(args) => list::list(args),
        Command::Visibility(args) => visibility::run(args, terminal),
        Command::Ccd(args) => ccd::run(args, terminal),
        Command::Sample(args) => sample::run(args, terminal),
        Command::Samples(args) => visibility::write_table(args),
        Command::Stress(args) => chart::stress(args, terminal),
        Command::Chart(args) => chart::run(args, terminal),
        Command::Reproduce(args) => chart::reproduce(args, terminal),
        Command::Trace(args) => trace::run(args, terminal),
    }
}

fn completions(args: &CompletionsArgs) -> Result<(), Failure> {
    let mut script = Vec::new();
    clap_complete::generate(args.shell, &mut Cli::command(), "quintile", &mut script);
    print(&String::from_utf8_lossy(&script))
}

fn man(args: &ManArgs) -> Result<(), Failure> {
    let mut command = Cli::command();
    command.build();
    let Some(folder) = args.folder.as_ref().or(args.out.as_ref()) else {
        return print(&String::from_utf8_lossy(
            &page(&command).map_err(|error| failed("manual page", &error))?,
        ));
    };
    std::fs::create_dir_all(folder).map_err(|error| failed(&folder.display().to_string(), &error))?;
    let pages = write_pages(&command, folder)?;
    print(&format!("{}: {pages} manual pages", folder.display()))
}

/// Writes the pages of `command` and its subcommands; returns their number.
fn write_pages(command: &clap::Command, folder: &Path) -> Result<usize, Failure> {
    // The built name of a subcommand contains that of its parent, separated by a hyphen.
    let name = command.get_display_name().unwrap_or_else(|| command.get_name());
    let path = folder.join(format!("{name}.1"));
    let bytes = page(command).map_err(|error| failed(&path.display().to_string(), &error))?;
    atomic::write_file(&path, |file| file.write_all(&bytes))?;
    let below = command.get_subcommands().filter(|below| below.get_name() != "help" && !below.is_hide_set());
    below.map(|below| write_pages(below, folder)).try_fold(1, |pages, more| Ok(pages + more?))
}

fn page(command: &clap::Command) -> io::Result<Vec<u8>> {
    let mut page = Vec::new();
    Man::new(command.clone()).render(&mut page)?;
    Ok(page)
}

fn failed(what: &str, error: &io::Error) -> Failure {
    Failure { message: format!("{what}: cannot be written: {error}"), code: 1 }
}

/// Checks that an output file can be written, and is neither one of the inputs nor a recording.
fn may_hold_results<'a>(
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
fn may_hold_trace<'a>(
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
    atomic::try_place(out).map_err(|error| Failure { message: error.to_string(), code: 1 })
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
fn print(text: &str) -> Result<(), Failure> {
    let mut out = io::stdout().lock();
    match writeln!(out, "{}", text.trim_end_matches('\n')).and_then(|()| out.flush()) {
        Err(error) if error.kind() != io::ErrorKind::BrokenPipe => {
            Err(Failure { message: format!("standard output: cannot write to it: {error}"), code: 1 })
        }
        _ => Ok(()),
    }
}

/// Prints a value as JSON, over several lines where `pretty`.
fn print_json(value: &impl serde::Serialize, pretty: bool) -> Result<(), Failure> {
    print(&json_text(value, pretty)?)
}

/// A value as JSON, over several lines where `pretty`.
fn json_text(value: &impl serde::Serialize, pretty: bool) -> Result<String, Failure> {
    let text = if pretty { serde_json::to_string_pretty(value) } else { serde_json::to_string(value) };
    text.map_err(|error| Failure { message: format!("printing JSON: {error}"), code: 1 })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_declarations_are_consistent() {
        Cli::command().debug_assert();
    }

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
