//! What can be typed after `quintile trace`.

use std::path::PathBuf;

use clap::{Args, Subcommand, ValueEnum};
use traces::frames::Method;

/// Arguments of `trace`.
#[derive(Debug, Args)]
#[command(
    after_help = "Example:\n  quintile trace frames meter.csv --mark 2.513 --out frames.csv\n  quintile trace plot meter.csv --from 2 --to 3 --out curve.svg"
)]
pub struct TraceArgs {
    /// What to do with it.
    #[command(subcommand)]
    pub command: TraceCommand,
}

/// What to do with a trace.
#[derive(Debug, Subcommand)]
pub enum TraceCommand {
    /// Find every frame that begins like a marked one, and its energy from start to start
    Frames(Box<FramesArgs>),
    /// Energy between times, idle taken off, warm-up, outliers, repeated runs, passes within frames
    Energy(Box<EnergyArgs>),
    /// Put recorded time stamps onto the time of a trace
    Align(Box<AlignArgs>),
    /// Read a trace and write it as Parquet, CSV, TSV (with .gz if so named) or a Perfetto timeline
    Convert(ConvertArgs),
    /// Record a trace anew with a coarser device: rate, range, bits, errors, noise
    Sample(Box<SampleArgs>),
    /// Draw a trace or its frames
    Plot(Box<PlotArgs>),
    /// Which settings of a table no other beats in time and energy
    Pareto(ParetoArgs),
}

/// A trace and how to read it.
#[derive(Debug, Args)]
pub struct InputArgs {
    /// A trace: Parquet, CSV or TSV, the latter two also compressed with gzip
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
    /// Voltage by specification instead of a measured one
    #[arg(long, value_name = "V", allow_negative_numbers = true)]
    pub voltage: Option<f64>,
    /// Samples per second, where the file does not say
    #[arg(long, value_name = "HZ", allow_negative_numbers = true)]
    pub rate: Option<f64>,
    /// Time of the first sample, where the file does not say
    #[arg(long, value_name = "SECONDS", allow_negative_numbers = true)]
    pub start: Option<f64>,
    /// The first line holds numbers, not names
    #[arg(long)]
    pub no_header: bool,
    /// Mend what is not finite, unsorted or missing, and say what was mended
    #[arg(long)]
    pub repair: bool,
}

/// Which frames.
#[derive(Debug, Args)]
pub struct FindArgs {
    /// The start of one frame; may be given several times
    #[arg(long, value_name = "SECONDS", allow_negative_numbers = true)]
    pub mark: Vec<f64>,
    /// A file of starts: a number in each line, or a table with a column start_s
    #[arg(long, value_name = "FILE")]
    pub mark_file: Option<PathBuf>,
    /// Propose a start
    #[arg(long, conflicts_with_all = ["mark", "mark_file"])]
    pub auto: bool,
    /// Where the last frame ends; the end of the trace without it
    #[arg(long, value_name = "SECONDS", allow_negative_numbers = true)]
    pub end: Option<f64>,
    /// What is compared, in milliseconds before and after the mark
    #[arg(long, value_name = "PRE,POST", value_parser = window, default_value = "1,4")]
    pub window: (f64, f64),
    /// How: `squares`, `tracking`, or `auto`
    #[arg(long, value_name = "METHOD", default_value_t)]
    pub method: Method,
    /// Read in pieces even if the trace would fit into memory (sum of squares)
    #[arg(long)]
    pub stream: bool,
    /// Pixels in a frame, for energy per pixel
    #[arg(long, value_name = "N")]
    pub pixels: Option<u64>,
}

/// Arguments of `trace frames`.
#[derive(Debug, Args)]
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
    /// File for the table of frames
    #[arg(long, value_name = "FRAMES.csv")]
    pub out: Option<PathBuf>,
    /// Also give inverse units, with what is wrong about averaging them
    #[arg(long)]
    pub inverse: bool,
    /// Worker threads; all cores without it. The results do not depend on it
    #[arg(long, value_name = "N", allow_negative_numbers = true, value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub threads: Option<u16>,
    /// Print everything as JSON and nothing else
    #[arg(long)]
    pub json: bool,
}

/// Arguments of `trace energy`.
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  quintile trace energy meter.csv --from 1.5 --to 2.5\n  quintile trace energy meter.csv --mark 2.513 --idle 0..0.4 --pass shadow=0 --pass light=4.2 --discard auto --drop-outliers"
)]
pub struct EnergyArgs {
    /// The trace.
    #[command(flatten)]
    pub input: InputArgs,
    /// The frames.
    #[command(flatten)]
    pub find: FindArgs,
    /// Begin of the stretch
    #[arg(long, value_name = "SECONDS", allow_negative_numbers = true)]
    pub from: Option<f64>,
    /// End of the stretch
    #[arg(long, value_name = "SECONDS", allow_negative_numbers = true)]
    pub to: Option<f64>,
    /// A stretch without rendering: its mean power is taken off
    #[arg(long, value_name = "A..B", value_parser = stretch, conflicts_with_all = ["idle_w", "idle_trace"])]
    pub idle: Option<(f64, f64)>,
    /// Idle power to take off
    #[arg(long, value_name = "W", conflicts_with = "idle_trace", allow_negative_numbers = true)]
    pub idle_w: Option<f64>,
    /// A recording without rendering to take off
    #[arg(long, value_name = "TRACE")]
    pub idle_trace: Option<PathBuf>,
    /// How the recording is taken off
    #[arg(long, value_enum, default_value_t)]
    pub idle_by: IdleBy,
    /// A pass within every frame, from so many milliseconds after its start to the next pass
    #[arg(long, value_name = "NAME=MS", value_parser = pass)]
    pub pass: Vec<(String, f64)>,
    /// Leave out the first frames: a number, or `auto` to find the warm-up
    #[arg(long, value_name = "N", default_value = "0", value_parser = discard)]
    pub discard: Discard,
    /// Leave out frames that differ from those around them
    #[arg(long)]
    pub drop_outliers: bool,
    /// Another run of the same thing, with the same marks; may be given several times
    #[arg(long, value_name = "TRACE")]
    pub run: Vec<PathBuf>,
    /// Power above which the old method takes a frame's work to go on; a tenth above idle without it
    #[arg(long, value_name = "W", allow_negative_numbers = true)]
    pub busy_above: Option<f64>,
    /// Print everything as JSON and nothing else
    #[arg(long)]
    pub json: bool,
}

/// How a recording of idling is taken off.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum IdleBy {
    /// Its mean power, at all times
    #[default]
    Mean,
    /// Instant by instant
    Instant,
}

/// Frames to leave out at the beginning.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Discard {
    /// So many.
    Count(usize),
    /// Those before the mean settles.
    Auto,
}

/// Arguments of `trace align`.
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  quintile trace align meter.csv stamps.csv --anchor 0.0=2.513 --anchor 33.1=35.613\n  quintile trace align meter.csv stamps.csv --mark 2.513"
)]
pub struct AlignArgs {
    /// The trace.
    #[command(flatten)]
    pub input: InputArgs,
    /// Recorded stamps in seconds: a number in each line, or a table with a column start_s or time_s
    #[arg(value_name = "STAMPS")]
    pub stamps: PathBuf,
    /// A stamp and its time in the trace, twice; without them the best fit to the frames found
    #[arg(long, value_name = "STAMP=TIME", value_parser = anchor)]
    pub anchor: Vec<(f64, f64)>,
    /// The frames.
    #[command(flatten)]
    pub find: FindArgs,
    /// File for the stamps with their times
    #[arg(long, value_name = "FILE")]
    pub out: Option<PathBuf>,
    /// Print as JSON and nothing else
    #[arg(long)]
    pub json: bool,
}

/// Arguments of `trace convert`.
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  quintile trace convert meter.csv.gz meter.parquet --repair")]
pub struct ConvertArgs {
    /// The trace.
    #[command(flatten)]
    pub input: InputArgs,
    /// File to write: .parquet, .csv, .tsv, .csv.gz, .tsv.gz or .perfetto-trace
    #[arg(value_name = "OUT")]
    pub out: PathBuf,
    /// Print what was read, mended and written as JSON
    #[arg(long)]
    pub json: bool,
}

/// Arguments of `trace sample`.
#[derive(Debug, Args)]
#[command(
    after_help = "Example:\n  quintile trace sample meter.parquet --device-rate 1000 --bits 10 --specified-voltage 12 --out coarse.parquet"
)]
pub struct SampleArgs {
    /// The trace.
    #[command(flatten)]
    pub input: InputArgs,
    /// The device in a JSON or RON-like JSON file; the flags below change it
    #[arg(long, value_name = "FILE.json")]
    pub device: Option<PathBuf>,
    /// Samples per second, 1 to 10 million
    #[arg(long, value_name = "HZ", allow_negative_numbers = true)]
    pub device_rate: Option<f64>,
    /// Bits of both converters
    #[arg(long, value_name = "N")]
    pub bits: Option<u32>,
    /// Highest current, the lowest is its negative
    #[arg(long, value_name = "A", allow_negative_numbers = true)]
    pub current_range: Option<f64>,
    /// Highest voltage, the lowest is its negative
    #[arg(long, value_name = "V", allow_negative_numbers = true)]
    pub voltage_range: Option<f64>,
    /// Voltage of the rail without load
    #[arg(long, value_name = "V", allow_negative_numbers = true)]
    pub rail_voltage: Option<f64>,
    /// Resistance of the rail
    #[arg(long, value_name = "OHM", allow_negative_numbers = true)]
    pub rail_ohm: Option<f64>,
    /// Noise of the current, A rms
    #[arg(long, value_name = "A", allow_negative_numbers = true)]
    pub current_noise: Option<f64>,
    /// Noise of the voltage, V rms
    #[arg(long, value_name = "V", allow_negative_numbers = true)]
    pub voltage_noise: Option<f64>,
    /// Factor on the current: 1.01 for a gain 1 % too high
    #[arg(long, value_name = "FACTOR", allow_negative_numbers = true)]
    pub current_gain: Option<f64>,
    /// Offset of the current
    #[arg(long, value_name = "A", allow_negative_numbers = true)]
    pub current_offset: Option<f64>,
    /// Factor on the voltage
    #[arg(long, value_name = "FACTOR", allow_negative_numbers = true)]
    pub voltage_gain: Option<f64>,
    /// Offset of the voltage
    #[arg(long, value_name = "V", allow_negative_numbers = true)]
    pub voltage_offset: Option<f64>,
    /// Take the voltage to be this, by specification, instead of measuring it
    #[arg(long, value_name = "V", allow_negative_numbers = true)]
    pub specified_voltage: Option<f64>,
    /// Time constant of the low-pass in seconds
    #[arg(long, value_name = "SECONDS", allow_negative_numbers = true)]
    pub low_pass: Option<f64>,
    /// Samples that travel together, and are lost together
    #[arg(long, value_name = "N")]
    pub packet_samples: Option<u32>,
    /// Share of packets that are lost, 0 to below 1: gaps in the file
    #[arg(long, value_name = "SHARE", allow_negative_numbers = true)]
    pub packet_loss: Option<f64>,
    /// Seed of noise and losses
    #[arg(long, value_name = "N")]
    pub seed: Option<u64>,
    /// File to write, as for `trace convert`
    #[arg(long, value_name = "FILE")]
    pub out: PathBuf,
    /// Print as JSON
    #[arg(long)]
    pub json: bool,
}

/// Arguments of `trace plot`.
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  quintile trace plot meter.parquet --from 2 --to 2.5 --out curve.svg\n  quintile trace plot meter.parquet --kind energy --mark 2.513 --out energy.png"
)]
pub struct PlotArgs {
    /// The trace.
    #[command(flatten)]
    pub input: InputArgs,
    /// The frames, for kinds that show them.
    #[command(flatten)]
    pub find: FindArgs,
    /// What to draw
    #[arg(long, value_enum, default_value_t)]
    pub kind: PlotKind,
    /// Begin of what is shown
    #[arg(long, value_name = "SECONDS", allow_negative_numbers = true)]
    pub from: Option<f64>,
    /// End of what is shown
    #[arg(long, value_name = "SECONDS", allow_negative_numbers = true)]
    pub to: Option<f64>,
    /// Time over which the curve's mean is drawn, in milliseconds; the whole range over 50 without it
    #[arg(long, value_name = "MS", allow_negative_numbers = true)]
    pub low_pass: Option<f64>,
    /// Which frame, for `frame`; the middle one without it
    #[arg(long, value_name = "N")]
    pub frame: Option<usize>,
    /// Another run of the same thing, for `repeats`
    #[arg(long, value_name = "TRACE")]
    pub run: Vec<PathBuf>,
    /// File: .svg or .png
    #[arg(long, value_name = "FILE")]
    pub out: PathBuf,
    /// Print what was drawn as JSON
    #[arg(long)]
    pub json: bool,
}

/// What to draw.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum PlotKind {
    /// Power over time: lowest and highest of each column, and a mean
    #[default]
    Curve,
    /// One frame
    Frame,
    /// Frames on top of one another
    Overlay,
    /// Energy of each frame
    Energy,
    /// How often which energy occurs
    Histogram,
    /// Mean energy over the number of frames left out at the beginning
    Discard,
    /// Mean and standard deviation of each frame over repeated runs
    Repeats,
}

/// Arguments of `trace pareto`.
#[derive(Debug, Args)]
#[command(
    after_help = "Example:\n  quintile trace pareto results.csv --time time_ms --energy energy_mJ --label algorithm --group scene --group msaa --idle-w 14 --out pareto.svg"
)]
pub struct ParetoArgs {
    /// A table with a row for each setting: CSV, TSV or Parquet
    #[arg(value_name = "TABLE")]
    pub table: PathBuf,
    /// The column of times; its unit is taken from its name (s without one)
    #[arg(long, value_name = "COLUMN", default_value = "time_ms")]
    pub time: String,
    /// The column of energies; its unit is taken from its name (J without one)
    #[arg(long, value_name = "COLUMN", default_value = "energy_mJ")]
    pub energy: String,
    /// The column of standard deviations of the times
    #[arg(long, value_name = "COLUMN")]
    pub time_sd: Option<String>,
    /// The column of standard deviations of the energies
    #[arg(long, value_name = "COLUMN")]
    pub energy_sd: Option<String>,
    /// The column of names; the number of the row without it
    #[arg(long, value_name = "COLUMN")]
    pub label: Option<String>,
    /// A column whose values make groups, each with a frontier; may be given several times
    #[arg(long, value_name = "COLUMN")]
    pub group: Vec<String>,
    /// Idle power that the faster of two is charged for the time it saves
    #[arg(long, value_name = "W", default_value_t = 0.0, allow_negative_numbers = true)]
    pub idle_w: f64,
    /// Seed of the draws for probabilities
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub seed: u64,
    /// File for a plot (.svg, .png) or a table (.csv)
    #[arg(long, value_name = "FILE")]
    pub out: Option<PathBuf>,
    /// Print as JSON and nothing else
    #[arg(long)]
    pub json: bool,
}

fn two(text: &str, between: &str, form: &str) -> Result<(f64, f64), String> {
    let wrong = || format!("`{text}` is not of the form {form}");
    let (a, b) = text.split_once(between).ok_or_else(wrong)?;
    let number = |part: &str| part.trim().parse::<f64>().ok().filter(|v| v.is_finite()).ok_or_else(wrong);
    Ok((number(a)?, number(b)?))
}

fn window(text: &str) -> Result<(f64, f64), String> {
    two(text, ",", "PRE,POST in milliseconds, for example 1,4")
}

fn stretch(text: &str) -> Result<(f64, f64), String> {
    let (a, b) = two(text, "..", "A..B in seconds, for example 0.1..0.4")?;
    if a < b { Ok((a, b)) } else { Err(format!("`{text}` ends before it begins")) }
}

fn anchor(text: &str) -> Result<(f64, f64), String> {
    two(text, "=", "STAMP=TIME in seconds, for example 0.5=2.513")
}

fn pass(text: &str) -> Result<(String, f64), String> {
    let (name, ms) = text.split_once('=').ok_or_else(|| format!("`{text}` is not of the form NAME=MS"))?;
    let ms = ms.trim().parse().ok().filter(|ms: &f64| ms.is_finite() && *ms >= 0.0);
    Ok((name.to_owned(), ms.ok_or_else(|| format!("`{text}`: what follows = is no time in milliseconds"))?))
}

fn discard(text: &str) -> Result<Discard, String> {
    match text {
        "auto" => Ok(Discard::Auto),
        _ => text
            .parse()
            .map(Discard::Count)
            .map_err(|_| format!("`{text}` is neither a number of frames nor auto")),
    }
}
