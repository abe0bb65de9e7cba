//! Subcommands of `quintile`: arguments in, results and messages out.

mod args;
mod ccd;
mod chart;
mod compare;
mod crash;
mod info;
mod interrupt;
mod list;
mod manual;
mod outputs;
mod parse;
mod quantity;
mod reproduce;
mod run;
mod sample;
mod samples;
mod terminal;
mod trace;
mod visibility;

use std::ffi::OsString;
use std::panic::AssertUnwindSafe;
use std::process::ExitCode;

use clap::error::ErrorKind;
use clap::{CommandFactory, FromArgMatches};

use ::run::RunError;
use crash::Crashes;
use output::terminal::Terminal;

pub use args::{Cli, Command};

/// Executes the command line of this process. Exit code: 0 for success, 2 for a usage error, 1 for a failure.
pub fn main() -> ExitCode {
    let cli = parse(std::env::args_os().collect()).unwrap_or_else(|error| error.exit());
    let terminal = cli.messages.terminal();
    interrupt::handle(terminal.clone());
    let crashes = Crashes::record();
    match std::panic::catch_unwind(AssertUnwindSafe(|| dispatch(&cli, &terminal))) {
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

impl From<RunError> for Failure {
    fn from(error: RunError) -> Self {
        Self { message: error.to_string(), code: if error.is_usage() { 2 } else { 1 } }
    }
}

impl From<workloads::LoadError> for Failure {
    fn from(error: workloads::LoadError) -> Self {
        RunError::from(error).into()
    }
}

/// Pool of worker threads; one per core without a number.
fn threads(number: Option<u16>) -> Result<rayon::ThreadPool, Failure> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(usize::from(number.unwrap_or(0))).build();
    pool.map_err(|error| Failure { message: format!("starting worker threads: {error}"), code: 1 })
}

fn dispatch(cli: &Cli, terminal: &Terminal) -> Result<(), Failure> {
    match &cli.command {
        Command::Run(args) => run::run(args, terminal),
        Command::Info(args) => info::run(args),
        Command::Compare(args) => compare::run(args),
        Command::Completions(args) => manual::completions(args),
        Command::Man(args) => manual::man(args),
        Command::List(args) => list::list(args),
        Command::Visibility(args) => visibility::run(args, terminal),
        Command::Ccd(args) => ccd::run(args, terminal),
        Command::Sample(args) => sample::run(args, terminal),
        Command::Samples(args) => samples::run(args),
        Command::Stress(args) => chart::stress(args, terminal),
        Command::Chart(args) => chart::run(args, terminal),
        Command::Reproduce(args) => reproduce::run(args, terminal),
        Command::Trace(args) => trace::run(args, terminal),
    }
}
