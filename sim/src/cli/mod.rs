//! The command `quintile`: what was typed, what it means, what is printed.

mod args;
mod list;
mod run;

use std::process::ExitCode;

use clap::Parser;

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
            eprintln!("quintile: {}", failure.message);
            ExitCode::from(failure.code)
        }
        Err(panic) => {
            let message = panic.downcast_ref::<String>().map(String::as_str);
            let message = message.or_else(|| panic.downcast_ref::<&str>().copied()).unwrap_or("no message");
            eprintln!("quintile: a fault of the program, please report it with the command line: {message}");
            ExitCode::FAILURE
        }
    }
}

/// A message and an exit code.
struct Failure {
    message: String,
    code: u8,
}

fn dispatch(cli: &Cli) -> Result<(), Failure> {
    match &cli.command {
        Command::Run(args) => run::run(args),
        Command::List(args) => list::list(args),
    }
}
