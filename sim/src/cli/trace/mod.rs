//! `quintile trace`: analysis of any power trace, recorded or synthetic.

mod align;
pub(super) mod args;
mod convert;
mod energy;
mod frames;
mod input;
mod pareto;
mod plot;
mod sample;
mod times;
mod units;

use super::Failure;
use args::{TraceArgs, TraceCommand};

pub(super) fn run(args: &TraceArgs) -> Result<(), Failure> {
    match &args.command {
        TraceCommand::Frames(args) => frames::run(args),
        TraceCommand::Energy(args) => energy::run(args),
        TraceCommand::Align(args) => align::run(args),
        TraceCommand::Convert(args) => convert::run(args),
        TraceCommand::Sample(args) => sample::run(args),
        TraceCommand::Plot(args) => plot::run(args),
        TraceCommand::Pareto(args) => pareto::run(args),
    }
}
