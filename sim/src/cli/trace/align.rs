//! `quintile trace align`.

use std::io::Write;

use serde_json::json;
use traces::align::{AlignError, Alignment};
use traces::io::Heading;
use traces::io::atomic::write_file;

use super::args::AlignArgs;
use super::input::wrong;
use super::times::times;
use crate::cli::Failure;
use crate::cli::outputs::may_hold_results;
use crate::cli::terminal::{complain, print, print_json};

impl From<AlignError> for Failure {
    fn from(error: AlignError) -> Self {
        Self { message: error.to_string(), code: 2 }
    }
}

/// Refuses an anchor at a time that the trace does not have.
fn is_within((stamp_s, time_s): (f64, f64), trace: &Heading) -> Result<(), Failure> {
    let (start_s, end_s) = (trace.start_s, trace.end_s());
    let rounding_s = 1e-12 * start_s.abs().max(end_s.abs());
    if (start_s - rounding_s..=end_s + rounding_s).contains(&time_s) {
        return Ok(());
    }
    Err(wrong(format!(
        "--anchor {stamp_s}={time_s}: {time_s} s is not within the trace, {start_s} s to {end_s} s; write STAMP=TIME"
    )))
}

pub(super) fn run(args: &AlignArgs) -> Result<(), Failure> {
    may_hold_results(("--out", args.out.as_deref()), [args.stamps.as_path(), &args.input.trace])?;
    let mut stamps = times(&args.stamps)?;
    stamps.sort_by(f64::total_cmp);
    let alignment = match args.anchor[..] {
        [a, b] => {
            let trace = args.input.source()?.0.heading();
            [a, b].iter().try_for_each(|anchor| is_within(*anchor, &trace))?;
            Alignment::by_anchors(a, b)?
        }
        [] => {
            let found = args.find.frames(&args.input, &args.input.trace)?.found;
            let starts: Vec<f64> = found.starts.iter().map(|start| start.time_s).collect();
            Alignment::by_fit(&stamps, &starts)?
        }
        _ => return Err(wrong("--anchor is given twice, or not at all for a fit to the frames found")),
    };
    if alignment.ambiguous {
        complain(
            "warning ambiguous-alignment: another pairing fits about as well, as frame times are even; give two anchors",
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
    print(&format!(
        "time = {} s + {} x stamp ({} pairs, {:.3e} s left)",
        alignment.offset_s, alignment.scale, alignment.pairs, alignment.residual_s
    ))
}
