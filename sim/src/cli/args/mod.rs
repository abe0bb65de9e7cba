//! Declarations of all arguments; help texts and manual pages are made from them.

use std::path::PathBuf;

use clap::{Args, Parser, Subcommand};

mod chart;
mod compare;
mod info;
mod look;
mod messages;
mod run;
mod samples;
mod scene;
pub(super) mod trace;
mod visibility;

pub use chart::{ChartArg, ChartArgs, StressArgs};
pub use compare::CompareArgs;
pub use info::InfoArgs;
pub use look::LookArgs;
pub use messages::MessageArgs;
pub(super) use messages::color_of;
pub use run::RunArgs;
pub use samples::SamplesArgs;
pub use scene::SceneArgs;
pub use trace::TraceArgs;
pub use visibility::VisibilityArgs;

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
    /// Compute the visible triangle and depth of every sample, for comparison with another renderer
    Visibility(VisibilityArgs),
    /// Find the pairs of moving objects that may collide
    Ccd(super::ccd::CcdArgs),
    /// Generate points: Poisson disk, following a density, or uniform in a volume
    Sample(super::sample::SampleArgs),
    /// Write a sample table to a file
    Samples(SamplesArgs),
    /// Try each tile test on families of triangles from easy to hard: samples lost, efficiency, width of
    /// intervals, cost
    Stress(StressArgs),
    /// Measure and draw a chart of the book
    Chart(ChartArgs),
    /// Compute what a paper reports and compare it with the paper, row by row
    Reproduce(super::reproduce::ReproduceArgs),
    /// Analyse a power trace, recorded or synthetic: frames, energies, alignment, formats, plots, Pareto frontiers
    Trace(TraceArgs),
    /// Print a script that completes commands and options in a shell
    Completions(CompletionsArgs),
    /// Print the manual page, or write one for each command into a folder
    Man(ManArgs),
    /// List the built-in scenes, GPUs, platforms, energy tables, workloads and figures
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
    fn the_declarations_are_consistent() {
        Cli::command().debug_assert();
    }
}
