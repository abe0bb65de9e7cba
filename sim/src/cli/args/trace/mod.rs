//! Arguments of `quintile trace`.

mod convert;
mod energy;
mod pareto;
mod parse;
mod plot;
mod sample;

pub use convert::{AlignArgs, ConvertArgs};
pub use energy::{Discard, EnergyArgs, IdleBy};
pub use pareto::{ParetoArgs, ParetoShow};
pub use plot::{PlotArgs, PlotKind};
pub use sample::SampleArgs;

use std::path::PathBuf;

use clap::{Args, Subcommand, ValueEnum};
use traces::frames::Method;

use parse::window;

use crate::cli::quantity::{positive_voltage, rate, time};

/// Arguments of `trace`.
#[derive(Clone, Debug, Args)]
#[command(
    after_help = "Example:\n  quintile trace frames meter.csv --mark 2.513 --out frames.csv\n  quintile trace plot meter.csv --from 2 --to 3 --out curve.svg"
)]
pub struct TraceArgs {
    /// The subcommand.
    #[command(subcommand)]
    pub command: TraceCommand,
}

/// Subcommands of `trace`.
#[derive(Clone, Debug, Subcommand)]
pub enum TraceCommand {
    /// Find every frame that begins like a marked one, and its energy from start to start
    Frames(Box<FramesArgs>),
    /// Energy between times, idle taken off, warm-up, outliers, repeated runs, passes within frames
    Energy(Box<EnergyArgs>),
    /// Put recorded time stamps onto the time of a trace
    Align(Box<AlignArgs>),
    /// Read a trace and write it as Parquet, JLS (Joulescope), CSV, TSV (with .gz if so named) or a Perfetto timeline
    Convert(ConvertArgs),
    /// Record a trace anew with a coarser device: rate, range, bits, errors, noise
    Sample(Box<SampleArgs>),
    /// Draw a trace or its frames
    Plot(Box<PlotArgs>),
    /// Pareto-optimal settings of a table, by time and energy
    Pareto(ParetoArgs),
}

/// Formats of traces that are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
#[allow(missing_docs, reason = "the names of the formats")]
pub enum TraceFormat {
    Csv,
    Tsv,
    #[value(name = "csv.gz")]
    CsvGz,
    #[value(name = "tsv.gz")]
    TsvGz,
    Parquet,
    Jls,
    PerfettoTrace,
}

impl TraceFormat {
    /// The ending of files of this format.
    pub fn name(self) -> &'static str {
        match self {
            Self::Csv => "csv",
            Self::Tsv => "tsv",
            Self::CsvGz => "csv.gz",
            Self::TsvGz => "tsv.gz",
            Self::Parquet => "parquet",
            Self::Jls => "jls",
            Self::PerfettoTrace => "perfetto-trace",
        }
    }
}

/// A trace and how to read it.
#[derive(Clone, Debug, Args)]
pub struct InputArgs {
    /// A trace: Parquet, JLS (Joulescope), CSV or TSV, the latter two also compressed with gzip; `-` reads standard input
    #[arg(value_name = "TRACE")]
    pub trace: PathBuf,
    /// A rail to read, by the name its columns carry; several are added up. All without it
    #[arg(long, value_name = "NAME")]
    pub rail: Vec<String>,
    /// The column of times, by name or number from 1
    #[arg(long, value_name = "COLUMN")]
    pub time_column: Option<String>,
    /// The column of voltages
    #[arg(long, value_name = "COLUMN")]
    pub voltage_column: Option<String>,
    /// The column of currents
    #[arg(long, value_name = "COLUMN")]
    pub current_column: Option<String>,
    /// A column of power instead of voltage and current
    #[arg(long, value_name = "COLUMN")]
    pub power_column: Option<String>,
    /// Voltage by specification instead of a measured one, in V
    #[arg(long, value_name = "V", allow_hyphen_values = true, value_parser = positive_voltage)]
    pub voltage: Option<f64>,
    /// Samples per second, where the file does not say: a number in Hz, or with its unit, such as 50kHz
    #[arg(long, value_name = "HZ", allow_hyphen_values = true, value_parser = rate)]
    pub rate: Option<f64>,
    /// Time of the first sample, where the file has no times: a number in seconds, or with its unit, such as 20ms
    #[arg(long, value_name = "TIME", allow_hyphen_values = true, value_parser = time)]
    pub start: Option<f64>,
    /// The first line holds numbers, not names
    #[arg(long)]
    pub no_header: bool,
    /// Repair the input: drop values that are not finite, sort times, fill gaps; the repairs are listed
    #[arg(long)]
    pub repair: bool,
}

/// Which frames.
#[derive(Clone, Debug, Args)]
pub struct FindArgs {
    /// The start of one frame, in seconds or with its unit; may be given several times
    #[arg(long, value_name = "TIME", allow_hyphen_values = true, value_parser = time)]
    pub mark: Vec<f64>,
    /// A file of starts: a number in each line, in seconds, or a table with a column start or time, its unit in its name (start_s, time_ms)
    #[arg(long, value_name = "FILE")]
    pub mark_file: Option<PathBuf>,
    /// Propose a start
    #[arg(long, conflicts_with_all = ["mark", "mark_file"])]
    pub auto: bool,
    /// Where the last frame ends, in seconds or with its unit; the end of the trace without it
    #[arg(long, value_name = "TIME", allow_hyphen_values = true, value_parser = time)]
    pub end: Option<f64>,
    /// What is compared: times before and after the mark, in milliseconds or with their units
    #[arg(long, value_name = "PRE,POST", value_parser = window, default_value = "1,4", allow_hyphen_values = true)]
    pub window: (f64, f64),
    /// How: `squares`, `normalized`, `tracking`, or `auto`
    #[arg(long, value_name = "METHOD", default_value_t)]
    pub method: Method,
    /// Read in pieces even if the trace would fit into memory (sum of squares)
    #[arg(long)]
    pub stream: bool,
    /// Pixels in a frame, for energy per pixel
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    pub pixels: Option<u64>,
}

/// Arguments of `trace frames`.
#[derive(Clone, Debug, Args)]
#[command(
    after_help = "Example:\n  quintile trace frames meter.parquet --mark 2.513 --pixels 921600 --out frames.csv"
)]
pub struct FramesArgs {
    /// The trace.
    #[command(flatten)]
    pub input: InputArgs,
    /// The frames.
    #[command(flatten)]
    pub find: FindArgs,
    /// File for the table of frames; `-` prints it and nothing else
    #[arg(long, value_name = "FRAMES.csv")]
    pub out: Option<PathBuf>,
    /// Also give inverse units, with what is wrong about averaging them
    #[arg(long)]
    pub inverse: bool,
    /// Worker threads [default: all cores]; results do not depend on it
    #[arg(long, value_name = "N", allow_negative_numbers = true, value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub threads: Option<u16>,
    /// Print everything as JSON and nothing else
    #[arg(long)]
    pub json: bool,
    /// Whether the result goes to standard output.
    #[arg(skip)]
    pub piped: bool,
}
