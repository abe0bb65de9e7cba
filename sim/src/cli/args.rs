//! What can be typed. One declaration per flag makes all of its docs.

use clap::{Args, Parser, Subcommand};

use super::trace::args::TraceArgs;

mod chart;
mod run;
mod samples;
mod visibility;

pub use chart::{ChartArg, ChartArgs, StressArgs};
pub use run::{BoundArg, PacingArg, RunArgs};
pub use samples::SamplesArgs;
pub use visibility::VisibilityArgs;

/// A cycle-approximate simulator of a tile-based 5D rasterization pipeline, with an energy trace for every frame.
#[derive(Debug, Parser)]
#[command(name = "quintile", version, arg_required_else_help = true, max_term_width = 100)]
pub struct Cli {
    /// What to do.
    #[command(subcommand)]
    pub command: Command,
}

/// What to do.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Render a scene, time it, turn it into watts, record a trace and find the energy of every frame in it
    Run(Box<RunArgs>),
    /// Find the triangle each sample sees and its depth, to be held against another program sample by sample
    Visibility(VisibilityArgs),
    /// Find the pairs of moving objects that may collide
    Ccd(super::ccd::CcdArgs),
    /// Make points: apart from each other, after a density, or evenly in a volume
    Sample(super::sample::SampleArgs),
    /// Write a sample table into a file
    Samples(SamplesArgs),
    /// Try each tile test on families of triangles from harmless to hopeless: samples lost, efficiency, width of intervals, cost
    Stress(StressArgs),
    /// Measure and draw a chart of the book
    Chart(ChartArgs),
    /// Compute what a paper reports and hold it against that, row by row
    Reproduce(super::reproduce::ReproduceArgs),
    /// Analyse a power trace, recorded or synthetic: frames, energies, alignment, formats, plots, Pareto frontiers
    Trace(TraceArgs),
    /// Name the scenes, GPUs, platforms, energy tables, workloads and figures that come with the program
    List(ListArgs),
}

/// Arguments of `list`.
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  quintile list --json")]
pub struct ListArgs {
    /// Print as JSON
    #[arg(long)]
    pub json: bool,
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    #[test]
    fn the_declarations_make_sense() {
        Cli::command().debug_assert();
    }
}
