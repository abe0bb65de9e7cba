//! `quintile reproduce`.

use std::path::PathBuf;
use std::time::Instant;

use clap::Args;

use super::Failure;
use super::outputs::{print, print_json};
use crate::cli::args::ThreadArgs;
use experiments::reproduce::{Options, Paper, reproduce};
use output::Destination;
use output::progress::Progress;
use output::terminal::Terminal;

/// Arguments of `reproduce`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  quintile reproduce III --quick --out claims\n  \
    quintile reproduce VI --row VI-13 --row VI-14\n  \
    quintile reproduce VI --row VI-1 --collision-data ccd\n\n\
    Each row of the paper is computed from scratch, by simulating, recording and analysing, and compared with what the paper \
    says, at every value of the settings that the paper leaves open. It holds at all of them, differs at all of them, depends \
    on them, or is not yet there because a part is missing. Rows of kind E have to hold exactly, N are numbers to be near, O \
    orders or signs that have to come out, F have figures. The settings are in sim/experiments/papers; every row names the SHA-256 \
    of its file, what was run, and what it does not exercise.\n\n\
    Results are in DIR: plots/ as SVG and PNG, reproduce_III.md and, last, reproduce_III.json with a list `rows`. Ends with 0 \
    if every row of kind E holds and every row ran something, otherwise with 1; one that is not yet there does not hold.")]
pub struct ReproduceArgs {
    /// Which paper
    #[arg(value_enum, value_name = "PAPER", ignore_case = true)]
    pub paper: Paper,
    /// Fewer values, frames and repetitions: less than a minute. Verdicts then say at how many of the settings they were reached
    #[arg(long)]
    pub quick: bool,
    /// Only this row, for example VI-13; may be given more than once
    #[arg(long, value_name = "ID")]
    pub row: Vec<String>,
    /// Settings in place of the committed ones; a copy of sim/experiments/papers/paper6.ron with other values
    #[arg(long, value_name = "FILE")]
    pub settings: Option<PathBuf>,
    /// Folder with public cases of collision detection for row VI-1 (*.mts.gz, queries/); without it none is run, and other rows refuse it
    #[arg(long, value_name = "DIR")]
    pub collision_data: Option<PathBuf>,
    /// Folder for the results; created if missing
    #[arg(long, value_name = "DIR", default_value = "out/reproduce")]
    pub out: PathBuf,
    /// Overwrite files in DIR that Quintile did not write, and a result of the paper with more rows or in full
    #[arg(long)]
    pub force: bool,
    /// Worker threads.
    #[command(flatten)]
    pub threads: ThreadArgs,
    /// Print only the JSON to standard output
    #[arg(long)]
    pub json: bool,
}

pub(super) fn run(args: &ReproduceArgs, terminal: &Terminal) -> Result<(), Failure> {
    let started = Instant::now();
    let pool = args.threads.pool()?;
    let progress = Progress::on(terminal, args.json);
    let out = Destination { folder: args.out.clone(), force: args.force };
    let options = Options {
        quick: args.quick,
        rows: args.row.clone(),
        settings: args.settings.clone(),
        collision_data: args.collision_data.clone(),
    };
    let report = pool.install(|| reproduce(args.paper, &options, &out, &progress))?;
    if args.json {
        print_json(&report, true)?;
    } else {
        let took_s = started.elapsed().as_secs_f64();
        print(&format!("{}results: {}\ntook {took_s:.1} s", report.text(), args.out.display()))?;
    }
    let failing = report.failing();
    if failing.is_empty() {
        return Ok(());
    }
    let message = format!(
        "rows of kind E that do not hold, or that ran nothing: {}; the table says why",
        failing.join(", ")
    );
    Err(Failure { message, code: 1 })
}
