//! `quintile trace align`.

use std::io::Write;
use std::path::PathBuf;

use clap::Args;
use output::terminal::Terminal;
use serde_json::json;
use traces::align::{AlignError, Alignment};
use traces::io::TraceHeader;
use traces::io::atomic::write_file;
use traces::times::read_times;
use traces::trace::is_within;
use warnings::{Code, Warning};

use super::report;
use super::warn_with;
use super::wrong;
use crate::cli::Failure;
use crate::cli::outputs::may_hold_results;
use crate::cli::outputs::print_json;
use crate::cli::trace::input::{FindArgs, InputArgs, anchor, warn_of_frames};

/// Arguments of `trace align`.
#[derive(Clone, Debug, Args)]
#[command(
    after_help = "Examples:\n  quintile trace align meter.csv stamps.csv --anchor 0.0=2.513 --anchor 33.1=35.613\n  quintile trace align meter.csv stamps.csv --mark 2.513"
)]
pub struct AlignArgs {
    /// The trace.
    #[command(flatten)]
    pub input: InputArgs,
    /// Recorded stamps: a number in each line, in seconds, or a table with a column start, time, mark or stamp, its unit in its name (time_s, stamp_ms)
    #[arg(value_name = "STAMPS")]
    pub stamps: PathBuf,
    /// A stamp and its time in the trace, twice; without them the best fit to the frames found
    #[arg(long, value_name = "STAMP=TIME", value_parser = anchor, allow_hyphen_values = true)]
    pub anchor: Vec<(f64, f64)>,
    /// The frames.
    #[command(flatten)]
    pub find: FindArgs,
    /// File for the stamps with their times; `-` prints them and nothing else
    #[arg(long, value_name = "FILE")]
    pub out: Option<PathBuf>,
    /// Print as JSON and nothing else
    #[arg(long)]
    pub json: bool,
    /// Whether the result goes to standard output.
    #[arg(skip)]
    pub piped: bool,
}

/// Root mean square of rounding to whole samples, in sample periods, as 1 / sqrt 12: starts are at best known to half a sample.
const ROUNDING_PERIODS: f64 = 0.289;

impl From<AlignError> for Failure {
    fn from(error: AlignError) -> Self {
        Self { message: error.to_string(), code: 2 }
    }
}

/// Refuses an anchor at a time outside the trace.
fn check_anchor((stamp_s, time_s): (f64, f64), trace: &TraceHeader) -> Result<(), Failure> {
    let (start_s, end_s) = (trace.start_s, trace.end_s());
    if is_within([start_s, end_s], time_s) {
        return Ok(());
    }
    Err(wrong(format!(
        "--anchor {stamp_s}={time_s}: {time_s} s is not within the trace, {start_s} s to {end_s} s; write STAMP=TIME"
    )))
}

pub(super) fn run(args: &AlignArgs, terminal: &Terminal) -> Result<(), Failure> {
    may_hold_results("--out", args.out.as_deref(), [args.stamps.as_path(), &args.input.trace])?;
    let mut stamps = read_times(&args.stamps)?;
    stamps.sort_by(f64::total_cmp);
    let (alignment, mut warnings) = match args.anchor[..] {
        [a, b] => {
            let trace = args.input.source(terminal)?.0.header();
            [a, b].iter().try_for_each(|anchor| check_anchor(*anchor, &trace))?;
            let alignment = Alignment::by_anchors(a, b)?;
            let warnings = alignment.warnings([a, b], &stamps);
            warnings.iter().for_each(|warning| warn_with(warning, "look at --anchor STAMP=TIME", terminal));
            (alignment, warnings)
        }
        [] => {
            let set = args.find.frames(&args.input, &args.input.trace, terminal)?.set;
            let starts: Vec<f64> = set.found.starts.iter().map(|start| start.time_s).collect();
            warn_of_frames(&set, terminal);
            (Alignment::by_fit(&stamps, &starts, ROUNDING_PERIODS / set.rate_hz)?, set.found.warnings)
        }
        _ => return Err(wrong("--anchor is given twice, or not at all for a fit to the frames found")),
    };
    if alignment.ambiguous {
        let warning = Warning::new(
            Code::AmbiguousAlignment,
            "another pairing fits about as well, or this one may fit by chance, as frame times are even or stamps few",
        );
        warn_with(&warning, "give two anchors", terminal);
        warnings.push(warning);
    }
    if let Some(out) = &args.out {
        write_file(out, |file| {
            writeln!(file, "stamp_s,time_s")?;
            stamps.iter().try_for_each(|stamp| writeln!(file, "{stamp},{}", alignment.time_s(*stamp)))
        })?;
    }
    if args.json {
        let aligned: Vec<f64> = stamps.iter().map(|stamp| alignment.time_s(*stamp)).collect();
        return print_json(
            &json!({ "alignment": alignment, "times_s": aligned, "warnings": warnings }),
            true,
        );
    }
    let line = format!(
        "time = {} s + {} x stamp ({} pairs, {:.3e} s left)",
        alignment.offset_s, alignment.scale, alignment.pairs, alignment.residual_s
    );
    report(&line, args.piped, terminal)
}
