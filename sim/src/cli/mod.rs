//! The command `quintile`: what was typed, what it means, what is printed.

mod args;
mod ccd;
mod chart;
mod list;
mod outputs;
mod parse;
mod reproduce;
mod run;
mod sample;
mod samples;
mod stress;
mod terminal;
mod trace;
mod visibility;

use std::process::ExitCode;

use clap::Parser;

use crate::run::RunError;

pub use args::{Cli, Command};

/// Runs the command line of this process and says how it ended: 0 for success, 2 for a mistake of the caller, 1 for a
/// failure.
pub fn main() -> ExitCode {
    // A panic is a fault of the program; it is told once, in one line, below.
    std::panic::set_hook(Box::new(|_| ()));
    let cli = Cli::parse();
    match std::panic::catch_unwind(|| dispatch(&cli)) {
        Ok(Ok(())) => ExitCode::SUCCESS,
        Ok(Err(failure)) => {
            terminal::complain(&failure.message);
            ExitCode::from(failure.code)
        }
        Err(panic) => {
            let message = panic.downcast_ref::<String>().map(String::as_str);
            let message = message.or_else(|| panic.downcast_ref::<&str>().copied()).unwrap_or("no message");
            terminal::complain(&format!(
                "a fault of the program, please report it with the command line: {message}"
            ));
            ExitCode::FAILURE
        }
    }
}

/// A message and an exit code.
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

/// Worker threads as asked for, all cores where nothing was.
fn threads(asked: Option<u16>) -> Result<rayon::ThreadPool, Failure> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(usize::from(asked.unwrap_or(0))).build();
    pool.map_err(|error| Failure { message: format!("starting worker threads: {error}"), code: 1 })
}

fn dispatch(cli: &Cli) -> Result<(), Failure> {
    match &cli.command {
        Command::Run(args) => run::run(args),
        Command::List(args) => list::list(args),
        Command::Visibility(args) => visibility::run(args),
        Command::Ccd(args) => ccd::run(args),
        Command::Sample(args) => sample::run(args),
        Command::Samples(args) => samples::run(args),
        Command::Stress(args) => stress::run(args),
        Command::Chart(args) => chart::run(args),
        Command::Reproduce(args) => reproduce::run(args),
        Command::Trace(args) => trace::run(args),
    }
}
