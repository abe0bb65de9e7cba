//! `quintile trace convert`.

use std::path::{Path, PathBuf};

use clap::Args;
use output::table::{counted, grouped};
use output::terminal::Terminal;
use serde_json::json;
use traces::io::{self, TraceFormat, TraceHeader, TraceReader, csv, endings};

use super::report;
use super::wrong;
use crate::cli::Failure;
use crate::cli::outputs::may_hold_results;
use crate::cli::outputs::print_json;
use crate::cli::trace::input::{InputArgs, trace_format};

/// Arguments of `trace convert`.
#[derive(Clone, Debug, Args)]
#[command(after_help = "Example:\n  quintile trace convert meter.csv.gz meter.parquet --repair")]
pub struct ConvertArgs {
    /// The trace.
    #[command(flatten)]
    pub input: InputArgs,
    /// File to write, in the format of its ending; `-` is standard output
    #[arg(value_name = "OUT", required_unless_present = "named", help = format!("File to write: {}; `-` is standard output", endings()))]
    pub last: Option<PathBuf>,
    /// The same as OUT
    #[arg(long = "out", id = "named", value_name = "FILE", conflicts_with = "last")]
    pub named: Option<PathBuf>,
    /// The file to write, however it was given.
    #[arg(skip)]
    pub out: PathBuf,
    /// Print what was read, repaired and written as JSON
    #[arg(long)]
    pub json: bool,
    /// Format of standard output, where OUT is `-` (default: csv)
    #[arg(long, value_name = "FORMAT", value_parser = trace_format())]
    pub format: Option<&'static TraceFormat>,
    /// Whether the result goes to standard output.
    #[arg(skip)]
    pub piped: bool,
}

/// Texts of more bytes are announced.
const LARGE_BYTES: u64 = 1 << 30;

pub(super) fn run(args: &ConvertArgs, terminal: &Terminal) -> Result<(), Failure> {
    let format = format_of(&args.out)?;
    may_be_saved("OUT", &args.out, format, [args.input.trace.as_path()])?;
    let (trace, repairs) = args.input.source(terminal)?;
    save(&*trace, &args.out, terminal)?;
    let TraceHeader { samples, rate_hz, .. } = trace.header();
    if args.json {
        let out = args.out.display().to_string();
        return print_json(
            &json!({ "out": out, "samples": samples, "rate_hz": rate_hz, "repairs": repairs }),
            true,
        );
    }
    report(
        &format!("{}: {} at {rate_hz} Hz", args.out.display(), counted(samples as usize, "sample")),
        args.piped,
        terminal,
    )
}

/// The format of a file to be written; other endings are refused before anything is read.
pub(super) fn format_of(path: &Path) -> Result<&'static TraceFormat, Failure> {
    let refused = || wrong(format!("{}: its ending is not {}", path.display(), endings()));
    TraceFormat::of(path).ok_or_else(refused)
}

/// Refuses a file that [`save`] could not write, or that would overwrite an input, or a description that is not that of an
/// older `out`.
pub(super) fn may_be_saved<'a>(
    flag: &str,
    out: &Path,
    format: &TraceFormat,
    inputs: impl IntoIterator<Item = &'a Path>,
) -> Result<(), Failure> {
    may_hold_results((flag, Some(out)), inputs)?;
    let beside = format.description_path(out).filter(|beside| beside.exists() && !out.exists());
    beside.map_or(Ok(()), |beside| {
        Err(wrong(format!(
            "{flag}: {} is there already, where the description of {} goes; name another file, or move it",
            beside.display(),
            out.display()
        )))
    })
}

/// Writes a trace, in pieces, in the format of its ending.
pub(super) fn save(trace: &dyn TraceReader, path: &Path, terminal: &Terminal) -> Result<(), Failure> {
    let (format, samples) = (format_of(path)?, trace.header().samples);
    let bytes = samples * csv::ROW_BYTES;
    if format.is_text && bytes > LARGE_BYTES {
        let gigabytes = bytes as f64 * 1e-9;
        terminal.note(&format!("{}: about {gigabytes:.1} GB as text; Parquet takes a tenth", path.display()));
    }
    if let Some(most) = format.max_samples.filter(|&most| samples > most) {
        let [most, samples] = [most, samples].map(grouped);
        terminal.note(&format!(
            "{}: at most {most} of {samples} samples kept, extremes among them",
            path.display()
        ));
    }
    Ok(io::save(trace, path)?)
}
