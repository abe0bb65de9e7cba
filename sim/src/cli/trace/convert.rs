//! `quintile trace convert`.

use std::path::{Path, PathBuf};

use clap::Args;
use output::perfetto::{self, CounterTrack, MAX_POINTS, Thinner, Timeline};
use output::terminal::Terminal;
use serde_json::json;
use traces::io::{self, FORMATS, TraceChunk, TraceHeader, TraceReader, TraceWriter, WriteError, atomic, csv};

use super::report;
use super::wrong;
use crate::cli::Failure;
use crate::cli::outputs::may_hold_results;
use crate::cli::outputs::print_json;
use crate::cli::trace::input::{InputArgs, TraceFormat};

/// Arguments of `trace convert`.
#[derive(Clone, Debug, Args)]
#[command(after_help = "Example:\n  quintile trace convert meter.csv.gz meter.parquet --repair")]
pub struct ConvertArgs {
    /// The trace.
    #[command(flatten)]
    pub input: InputArgs,
    /// File to write: .parquet, .jls (Joulescope), .csv, .tsv, .csv.gz, .tsv.gz or .perfetto-trace; `-` is standard output
    #[arg(value_name = "OUT", required_unless_present = "named")]
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
    #[arg(long, value_enum, value_name = "FORMAT")]
    pub format: Option<TraceFormat>,
    /// Whether the result goes to standard output.
    #[arg(skip)]
    pub piped: bool,
}

/// About the bytes of a row of CSV. Files of more than [`LARGE_BYTES`] are announced.
const ROW_BYTES: u64 = 50;
const LARGE_BYTES: u64 = 1 << 30;
/// The ending of files for the viewer of Perfetto.
const PERFETTO: &str = ".perfetto-trace";

pub(super) fn run(args: &ConvertArgs, terminal: &Terminal) -> Result<(), Failure> {
    check(&args.out)?;
    may_be_saved("OUT", &args.out, [args.input.trace.as_path()])?;
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
    report(&format!("{}: {samples} samples at {rate_hz} Hz", args.out.display()), args.piped, terminal)
}

fn name(path: &Path) -> String {
    path.file_name().map_or(String::new(), |name| name.to_string_lossy().to_ascii_lowercase())
}

/// Refuses a file of unknown kind before anything is read.
pub(super) fn check(path: &Path) -> Result<(), Failure> {
    let known = [&FORMATS[..], &[PERFETTO]].concat();
    if known.iter().any(|end| name(path).ends_with(end)) {
        return Ok(());
    }
    Err(wrong(format!("{}: its ending is none of {}", path.display(), known.join(", "))))
}

/// Refuses a file that [`save`] could not write, or that would overwrite an input, or a description that is not that of an
/// older `out`.
pub(super) fn may_be_saved<'a>(
    flag: &str,
    out: &Path,
    inputs: impl IntoIterator<Item = &'a Path>,
) -> Result<(), Failure> {
    may_hold_results((flag, Some(out)), inputs)?;
    let beside = description_path(out).filter(|beside| beside.exists() && !out.exists());
    beside.map_or(Ok(()), |beside| {
        Err(wrong(format!(
            "{flag}: {} is there already, where the description of {} goes; name another file, or move it",
            beside.display(),
            out.display()
        )))
    })
}

/// The description beside a text.
fn description_path(out: &Path) -> Option<PathBuf> {
    let name = name(out);
    let plain = name.trim_end_matches(".gz");
    let text = plain.ends_with(".csv") || plain.ends_with(".tsv");
    text.then(|| csv::description_path(out))
}

/// Writes a trace, in pieces, in the format of its ending.
pub(super) fn save(trace: &dyn TraceReader, path: &Path, terminal: &Terminal) -> Result<(), Failure> {
    if name(path).ends_with(PERFETTO) {
        return perfetto(trace, path, terminal);
    }
    let bytes = trace.header().samples * ROW_BYTES;
    if description_path(path).is_some() && bytes > LARGE_BYTES {
        terminal.note(&format!(
            "{}: about {:.1} GB as text; Parquet takes a tenth",
            path.display(),
            bytes as f64 * 1e-9
        ));
    }
    Ok(io::save(trace, path)?)
}

/// Writes a counter track of the power, thinned out to as many points as the viewer holds.
fn perfetto(trace: &dyn TraceReader, path: &Path, terminal: &Terminal) -> Result<(), Failure> {
    let header = trace.header();
    let mut extremes = PowerExtremes(Thinner::new(header.samples, MAX_POINTS));
    trace.read_into(&mut extremes)?;
    let start_ns = header.time_ns(0);
    let place = |(index, watts): (u64, f64)| ((header.time_ns(index) - start_ns).unsigned_abs(), watts);
    let points: Vec<(u64, f64)> = extremes.0.kept().into_iter().map(place).collect();
    let (kept, samples) = (points.len() as u64, header.samples);
    if kept < samples {
        terminal.note(&format!("{}: {kept} of {samples} samples kept, extremes among them", path.display()));
    }
    let counters = vec![CounterTrack { name: "power", unit: "W", points }];
    let timeline = Timeline { process: "trace", counters, ..Timeline::default() };
    Ok(atomic::write_file(path, |out| perfetto::write(&timeline, out))?)
}

/// Keeps the extremes of the power of a trace.
struct PowerExtremes(Thinner);

impl TraceWriter for PowerExtremes {
    fn write(&mut self, chunk: &TraceChunk<'_>) -> Result<(), WriteError> {
        chunk.powers_w().for_each(|watts| self.0.push(watts));
        Ok(())
    }
}
