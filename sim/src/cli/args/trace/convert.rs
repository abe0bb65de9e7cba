//! Arguments of `quintile trace align` and `quintile trace convert`.

use std::path::PathBuf;

use clap::Args;

use super::parse::anchor;
use super::{FindArgs, InputArgs, TraceFormat};

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
