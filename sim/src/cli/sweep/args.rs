//! Arguments of `quintile sweep`.

use std::path::PathBuf;

use clap::{Args, Subcommand};
use sweep::{Folder, Shard};

use crate::cli::args::{PlotStyleArgs, ThreadArgs};
use crate::cli::parse::percent;

/// Arguments of `sweep`.
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  quintile sweep run tiles.ron --out tiles --dry-run\n  quintile sweep run tiles.ron --out tiles\n  \
    quintile sweep merge tiles\n  quintile sweep report tiles\n  sbatch --array=0-7 --wrap 'quintile sweep run tiles.ron --out tiles'\n\n\
    `sweep run` may be stopped at any moment and called again: finished points are skipped. Points are finished when their \
    file is in DIR/points; a point that fails is finished, too, with its reason, and the exit code is 1 if one has. After USR1 or TERM no further points are begun, those \
    in flight are finished (after TERM, if they can within 20 s), and the exit code is 138 or 143 if points are left."
)]
pub struct SweepArgs {
    /// What to do
    #[command(subcommand)]
    pub step: Step,
}

impl SweepArgs {
    /// Whether signals of a scheduler end it between two points.
    pub(in crate::cli) const fn follows_stop(&self) -> bool {
        matches!(self.step, Step::Run(_))
    }
}

/// Step of a sweep.
#[derive(Debug, Subcommand)]
pub enum Step {
    /// Check a sweep file, write its points into DIR/plan.jsonl, and print their number and the expected time
    Plan(PlanArgs),
    /// Run the points that are not finished, on all cores
    Run(RunStepArgs),
    /// Plan, and write scripts for Slurm: DIR/array.sh, whose tasks run the points, and DIR/merge.sh
    Slurm(SlurmArgs),
    /// Print how many points are finished, from the files of the sweep alone
    Status(StatusArgs),
    /// Answer an optimizer: read places on the axes from standard input, a line of JSON each, and print what
    /// a point there costs
    Ask(AskArgs),
    /// Write DIR/results.parquet, with a row for each point
    Merge(MergeArgs),
    /// Remove results in DIR that are not of its plan: of other builds of the program, settings or inputs
    Clean(CleanArgs),
    /// Write DIR/report.html, with tables and a picture beside it: frontiers of time, energy and area, best
    /// designs, effects and interactions of settings; and print the frontiers
    Report(ReportArgs),
}

/// A sweep file and its folder.
#[derive(Debug, Args)]
pub struct FileArgs {
    /// The sweep file
    #[arg(value_name = "FILE.ron")]
    pub file: PathBuf,
    /// Folder of the sweep; created if missing
    #[arg(long, value_name = "DIR", default_value = "sweep")]
    pub out: PathBuf,
    /// Take the settings under `quick` of the sweep file, which make the runs small
    #[arg(long)]
    pub quick: bool,
    /// Worker threads
    #[command(flatten)]
    pub threads: ThreadArgs,
    /// Print as JSON
    #[arg(long)]
    pub json: bool,
}

/// Arguments of `sweep plan`.
#[derive(Debug, Args)]
pub struct PlanArgs {
    /// The sweep
    #[command(flatten)]
    pub sweep: FileArgs,
}

/// Arguments of `sweep run`.
#[derive(Debug, Args)]
pub struct RunStepArgs {
    /// The sweep
    #[command(flatten)]
    pub sweep: FileArgs,
    /// Run part i of n of the points, such as 1/8 [default: that of the task by the variables of Slurm, PBS
    /// or HyperQueue; all points outside of a task]
    #[arg(long, value_name = "i/n", value_parser = Shard::parse, conflicts_with = "shards")]
    pub shard: Option<Shard>,
    /// Number of tasks, for PBS and HyperQueue, which do not give it
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    pub shards: Option<u32>,
    /// Run points that failed again
    #[arg(long)]
    pub retry: bool,
    /// Print number and expected time of the runs, and stop before anything is written
    #[arg(long)]
    pub dry_run: bool,
}

/// Arguments of `sweep slurm`.
#[derive(Debug, Args)]
pub struct SlurmArgs {
    /// The sweep
    #[command(flatten)]
    pub sweep: FileArgs,
    /// Number of tasks, at most 1000 [default: as many as take ten minutes each, by the expected time]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1000))]
    pub tasks: Option<u32>,
    /// Threads of a task
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub task_threads: u16,
    /// Submit both scripts by `sbatch`, and print the numbers of the jobs
    #[arg(long)]
    pub submit: bool,
}

/// Arguments of `sweep ask`.
#[derive(Debug, Args)]
#[command(
    after_help = "Example:\n  echo '{\"at\": [0.5, 0.25]}' | quintile sweep ask caches.ron --out caches\n\n\
    The first line printed has the axes: the settings of each, and the number of its values. A place on an axis is from 0 to 1; \
    value i of n is at (i + 0.5) / n. Each line read is answered by a line. Points are kept in DIR as those of `sweep run`, so that \
    nothing runs twice, and `sweep merge` and `sweep report` have them. sim/sweep/drivers/optuna_sweep.py searches by this."
)]
pub struct AskArgs {
    /// The sweep file, with the space of the search
    #[arg(value_name = "FILE.ron")]
    pub file: PathBuf,
    /// Folder of the search; created if missing
    #[arg(long, value_name = "DIR", default_value = "sweep")]
    pub out: PathBuf,
    /// Take the settings under `quick` of the sweep file
    #[arg(long)]
    pub quick: bool,
    /// Worker threads
    #[command(flatten)]
    pub threads: ThreadArgs,
}

/// The folder of a sweep.
#[derive(Debug, Args)]
pub struct FolderArgs {
    /// The folder of the sweep; or its file, and --out for the folder
    #[arg(value_name = "DIR|FILE.ron")]
    pub sweep: PathBuf,
    /// Folder of the sweep, if its file is given
    #[arg(long, value_name = "DIR", default_value = "sweep")]
    pub out: PathBuf,
    /// Print as JSON
    #[arg(long)]
    pub json: bool,
}

/// Arguments of `sweep status`.
#[derive(Debug, Args)]
pub struct StatusArgs {
    /// The sweep
    #[command(flatten)]
    pub folder: FolderArgs,
}

/// Arguments of `sweep clean`.
#[derive(Debug, Args)]
pub struct CleanArgs {
    /// The sweep
    #[command(flatten)]
    pub folder: FolderArgs,
}

/// Arguments of `sweep merge`.
#[derive(Debug, Args)]
pub struct MergeArgs {
    /// The sweep
    #[command(flatten)]
    pub folder: FolderArgs,
    /// Write points that are not finished as rows with that reason
    #[arg(long)]
    pub partial: bool,
}

/// Arguments of `sweep report`.
#[derive(Debug, Args)]
pub struct ReportArgs {
    /// The sweep
    #[command(flatten)]
    pub folder: FolderArgs,
    /// How far from the best a design may be to be chosen for what else it costs, for example 5%
    #[arg(long, value_name = "P%", default_value = "5%", value_parser = percent, allow_hyphen_values = true)]
    pub within: f64,
    /// Style of the plot
    #[command(flatten)]
    pub plot_style: PlotStyleArgs,
}

impl FolderArgs {
    /// The folder.
    pub(super) fn folder(&self) -> Folder {
        let is_file = self.sweep.extension().is_some_and(|ending| ending == "ron") && !self.sweep.is_dir();
        Folder::at(if is_file { &self.out } else { &self.sweep })
    }
}
