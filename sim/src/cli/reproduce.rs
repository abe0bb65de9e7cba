//! `quintile reproduce`.

use std::path::PathBuf;
use std::time::Instant;

use clap::Args;

use super::Failure;
use super::terminal::{print, print_json};
use crate::output::progress::Progress;
use crate::reproduce::{Effort, Paper, reproduce};

/// Arguments of `reproduce`.
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  quintile reproduce III --quick --out claims\n\n\
    Each row of the paper is computed from scratch, by simulating, recording and analysing, and held against what the paper\n\
    says: it holds, it differs, or it is not yet there because a part is missing. Rows of kind E have to hold exactly, N are\n\
    numbers to be near, O orders or signs that have to come out, F have figures.\n\n\
    Results are in DIR: plots/ as SVG and PNG, reproduce_III.md and, last, reproduce_III.json with a list `rows` of id, kind,\n\
    paper, ours, verdict and figure. Ends with 0 if every row of kind E holds, otherwise with 1; one that is not yet there\n\
    does not hold.")]
pub struct ReproduceArgs {
    /// Which paper
    #[arg(value_enum, value_name = "PAPER", ignore_case = true)]
    pub paper: Paper,
    /// Fewer frames and fewer repetitions: less than a minute
    #[arg(long)]
    pub quick: bool,
    /// Folder for the results; made where it is missing
    #[arg(long, value_name = "DIR", default_value = "out/reproduce")]
    pub out: PathBuf,
    /// Worker threads; all cores without it. The results do not depend on it
    #[arg(long, value_name = "N", allow_negative_numbers = true, value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub threads: Option<u16>,
    /// Print the JSON to standard output and nothing else
    #[arg(long)]
    pub json: bool,
}

pub(super) fn run(args: &ReproduceArgs) -> Result<(), Failure> {
    let started = Instant::now();
    let pool = super::threads(args.threads)?;
    let progress = Progress::new(args.json);
    let effort = if args.quick { Effort::QUICK } else { Effort::FULL };
    let report = pool.install(|| reproduce(args.paper, effort, &args.out, &progress))?;
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
    let message = format!("rows of kind E that do not hold: {}; the table says why", failing.join(", "));
    Err(Failure { message, code: 1 })
}
