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
use warnings::Code;

use super::report;
use super::wrong;
use crate::cli::Failure;
use crate::cli::outputs::may_hold_results;
use crate::cli::outputs::print_json;
use crate::cli::trace::input::{FindArgs, InputArgs, anchor};

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

/// Largest deviation of the clock of the stamps from that of the trace, as a share; clocks of computers deviate far less.
const MAX_CLOCK_DEVIATION: f64 = 0.02;

/// Warns of anchors that are likely wrong: stamps in another unit, or of another recording.
fn warn_of_anchors(anchors: [(f64, f64); 2], alignment: &Alignment, sorted: &[f64], terminal: &Terminal) {
    let warn = |what: String| {
        terminal.warn_of(Code::AnchorsOff, &format!("{what}; look at --anchor STAMP=TIME"));
    };
    if (alignment.scale - 1.0).abs() > MAX_CLOCK_DEVIATION {
        warn(format!("by the anchors, a second of the stamps lasts {} s of the trace", alignment.scale));
    }
    let (first, last) = (sorted[0], sorted[sorted.len() - 1]);
    for (stamp, _) in anchors {
        if !is_within([first, last], stamp) {
            warn(format!("stamp {stamp} s of an anchor is beyond those of the file, {first} s to {last} s"));
        }
    }
}

pub(super) fn run(args: &AlignArgs, terminal: &Terminal) -> Result<(), Failure> {
    may_hold_results(("--out", args.out.as_deref()), [args.stamps.as_path(), &args.input.trace])?;
    let mut stamps = read_times(&args.stamps)?;
    stamps.sort_by(f64::total_cmp);
    let alignment = match args.anchor[..] {
        [a, b] => {
            let trace = args.input.source(terminal)?.0.header();
            [a, b].iter().try_for_each(|anchor| check_anchor(*anchor, &trace))?;
            let alignment = Alignment::by_anchors(a, b)?;
            warn_of_anchors([a, b], &alignment, &stamps, terminal);
            alignment
        }
        [] => {
            let found = args.find.frames(&args.input, &args.input.trace, terminal)?.found;
            let starts: Vec<f64> = found.starts.iter().map(|start| start.time_s).collect();
            Alignment::by_fit(&stamps, &starts)?
        }
        _ => return Err(wrong("--anchor is given twice, or not at all for a fit to the frames found")),
    };
    if alignment.ambiguous {
        terminal.warn_of(
            Code::AmbiguousAlignment,
            "another pairing fits about as well, as frame times are even; give two anchors",
        );
    }
    if let Some(out) = &args.out {
        write_file(out, |file| {
            writeln!(file, "stamp_s,time_s")?;
            stamps.iter().try_for_each(|stamp| writeln!(file, "{stamp},{}", alignment.time_s(*stamp)))
        })?;
    }
    if args.json {
        let aligned: Vec<f64> = stamps.iter().map(|stamp| alignment.time_s(*stamp)).collect();
        return print_json(&json!({ "alignment": alignment, "times_s": aligned }), true);
    }
    let line = format!(
        "time = {} s + {} x stamp ({} pairs, {:.3e} s left)",
        alignment.offset_s, alignment.scale, alignment.pairs, alignment.residual_s
    );
    report(&line, args.piped, terminal)
}
