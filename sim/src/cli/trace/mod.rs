//! `quintile trace`: analysis of any power trace, recorded or synthetic.

mod align;
mod convert;
mod energy;
mod failure;
mod frames;
mod input;
mod pareto;
mod pipes;
mod plot;
mod sample;

use super::Failure;
use super::args::trace::{TraceArgs, TraceCommand};
use super::terminal::print;
use output::terminal::Terminal;

use pipes::Pipes;

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

fn run_on_files(args: &TraceArgs, terminal: &Terminal) -> Result<(), Failure> {
    match &args.command {
        TraceCommand::Frames(args) => frames::run(args, terminal),
        TraceCommand::Energy(args) => energy::run(args, terminal),
        TraceCommand::Align(args) => align::run(args, terminal),
        TraceCommand::Convert(args) => convert::run(args, terminal),
        TraceCommand::Sample(args) => sample::run(args, terminal),
        TraceCommand::Plot(args) => plot::run(args, terminal),
        TraceCommand::Pareto(args) => pareto::run(args, terminal),
    }
}
