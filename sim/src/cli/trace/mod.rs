//! `quintile trace`: analysis of any power trace, recorded or synthetic. `quintile trace convert` and
//! `quintile trace sample`: a trace in another format, and as another recorder would have written it.

mod energy;
mod frames;
mod input;
mod plot;

use std::path::{Path, PathBuf};

use clap::{Args, Subcommand, ValueEnum};
use energy::EnergyArgs;
use frames::{AlignArgs, FramesArgs};
use input::Pipes;
use output::plot::Picture;
use output::table::{counted, grouped, si};
use output::terminal::Terminal;
use plot::{ParetoArgs, PlotArgs};
use serde_json::json;
use traces::device::{Device, DeviceSpec, MAX_PACKET_SAMPLES, Peaks, RATES_HZ};
use traces::io::{self, TraceFormat, TraceHeader, TraceReader, WriteError, csv, endings};
use traces::search::SearchError;
use warnings::{Code, Warning};

use self::input::{InputArgs, trace_format};
use crate::cli::parse::{
    current, gain, length_of_time, positive_current, positive_voltage, rate, resistance, share_below_one,
    size_of_current, size_of_voltage, voltage,
};
use crate::cli::{Failure, may_hold_trace, print, print_json};

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
    /// Read a trace and write it in another format
    Convert(ConvertArgs),
    /// Record a trace anew with a coarser device: rate, range, bits, errors, noise
    Sample(Box<TraceSampleArgs>),
    /// Draw a trace or its frames
    Plot(Box<PlotArgs>),
    /// Pareto-optimal settings of a table, by time and energy
    Pareto(ParetoArgs),
}

pub(super) fn run(args: &TraceArgs, terminal: &Terminal) -> Result<(), Failure> {
    let mut args = args.clone();
    let pipes = Pipes::laid(&mut args)?;
    let done = run_on_files(&args, pipes.has_output(), terminal);
    pipes.finish(done)
}

/// Prints what was done, on standard error where standard output has the result.
fn report(line: &str, piped: bool, terminal: &Terminal) -> Result<(), Failure> {
    if !piped {
        return print(line);
    }
    terminal.detail(line);
    Ok(())
}

/// Prints a warning with what to change in the arguments.
fn warn_with(warning: &Warning, remedy: &str, terminal: &Terminal) {
    terminal.warn_of(warning.code, &format!("{}; {remedy}", warning.message));
}

/// Runs on files in place of `-`; `piped` is whether the result goes to standard output.
fn run_on_files(args: &TraceArgs, piped: bool, terminal: &Terminal) -> Result<(), Failure> {
    match &args.command {
        TraceCommand::Frames(args) => frames::run(args, piped, terminal),
        TraceCommand::Energy(args) => energy::run(args, terminal),
        TraceCommand::Align(args) => frames::align(args, piped, terminal),
        TraceCommand::Convert(args) => convert(args, piped, terminal),
        TraceCommand::Sample(args) => sample(args, piped, terminal),
        TraceCommand::Plot(args) => plot::run(args, piped, terminal),
        TraceCommand::Pareto(args) => plot::pareto(args, piped, terminal),
    }
}

impl From<SearchError> for Failure {
    fn from(error: SearchError) -> Self {
        match error {
            SearchError::Read(error) => error.into(),
            SearchError::Mark(error) => error.into(),
            SearchError::Unmarked => {
                wrong(format!("{error}: give --mark SECONDS, --mark-file FILE or --auto"))
            }
            SearchError::NoRise => wrong(format!("--auto {error}: mark one with --mark")),
            SearchError::NoRepetition { .. } => wrong(format!("--auto {error}; mark a frame with --mark")),
            SearchError::ProposalInPieces => wrong(format!("--auto: {error}; mark a frame with --mark")),
            SearchError::NotInPieces => wrong(format!("--stream: {error}; leave it out")),
        }
    }
}

impl From<WriteError> for Failure {
    fn from(error: WriteError) -> Self {
        match error {
            WriteError::Read(error) => error.into(),
            WriteError::Source(error) => wrong(error.to_string()),
            error => Self { message: error.to_string(), code: 1 },
        }
    }
}

/// Wrong arguments.
fn wrong(message: impl Into<String>) -> Failure {
    Failure { message: message.into(), code: 2 }
}

/// Formats of plots.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
#[allow(missing_docs, reason = "the names of the formats")]
pub enum PlotFormat {
    Svg,
    Png,
    Pdf,
}

impl PlotFormat {
    /// The ending of files of this format, and whether they are text.
    fn ending(self) -> (&'static str, bool) {
        match self {
            Self::Svg => ("svg", true),
            Self::Png => ("png", false),
            Self::Pdf => ("pdf", false),
        }
    }

    /// The format of a file, by its name.
    fn of(path: &Path) -> Result<Self, Failure> {
        match path.extension().and_then(|end| end.to_str()).map(str::to_ascii_lowercase).as_deref() {
            Some("svg") => Ok(Self::Svg),
            Some("png") => Ok(Self::Png),
            Some("pdf") => Ok(Self::Pdf),
            _ => Err(wrong(format!("{}: a plot has to end in .svg, .png or .pdf", path.display()))),
        }
    }
}

/// Writes a picture in a format.
pub(super) fn write_picture(picture: &Picture, path: &Path, format: PlotFormat) -> Result<(), Failure> {
    let bytes = match format {
        PlotFormat::Svg => picture.svg().map(String::into_bytes),
        PlotFormat::Png => picture.png(),
        PlotFormat::Pdf => Ok(picture.pdf()),
    }
    .map_err(|error| Failure { message: format!("{}: {error}", path.display()), code: 1 })?;
    Ok(io::atomic::write_file(path, |out| std::io::Write::write_all(out, &bytes))?)
}

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
}

/// Texts of more bytes are announced.
const LARGE_BYTES: u64 = 1 << 30;

fn convert(args: &ConvertArgs, piped: bool, terminal: &Terminal) -> Result<(), Failure> {
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
        piped,
        terminal,
    )
}

/// The format of a file to be written; other endings are refused before anything is read.
fn format_of(path: &Path) -> Result<&'static TraceFormat, Failure> {
    let refused = || wrong(format!("{}: its ending is not {}", path.display(), endings()));
    TraceFormat::of(path).ok_or_else(refused)
}

/// Refuses a file that [`save`] could not write, or that would overwrite an input, or a description that is
/// not that of an older `out`.
fn may_be_saved<'a>(
    flag: &str,
    out: &Path,
    format: &TraceFormat,
    inputs: impl IntoIterator<Item = &'a Path>,
) -> Result<(), Failure> {
    may_hold_trace(flag, Some(out), inputs)?;
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
fn save(trace: &dyn TraceReader, path: &Path, terminal: &Terminal) -> Result<(), Failure> {
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

/// Arguments of `trace sample`.
#[derive(Clone, Debug, Args)]
#[command(
    after_help = "Example:\n  quintile trace sample meter.parquet --device-rate 1kHz --bits 10 --specified-voltage 12V --out coarse.parquet\n\n\
    Without --device the recorder has the defaults above and a range that fits the trace. Options with a unit take a number in that \
    unit, or with any unit of its kind: 1kHz, 20us, 5mV, 250mA, 4mOhm."
)]
pub struct TraceSampleArgs {
    /// The trace.
    #[command(flatten)]
    pub input: InputArgs,
    /// The device in a JSON file, whose defaults are those below and +-30 A, +-20 V; the options below change it
    #[arg(long, value_name = "FILE.json")]
    pub device: Option<PathBuf>,
    /// Samples per second, 1 to 10 million (default: 50kHz, or the trace's if that is lower)
    #[arg(long, value_name = "HZ", allow_hyphen_values = true, value_parser = rate)]
    pub device_rate: Option<f64>,
    /// Bits of both converters, 1 to 24 (default: 14)
    #[arg(long, value_name = "N", allow_hyphen_values = true, value_parser = clap::value_parser!(u32).range(1..=24))]
    pub bits: Option<u32>,
    /// Highest current, the lowest is its negative (default: the smallest of 1mA, 3mA, 10mA, ... that holds
    /// the trace's peak)
    #[arg(long, value_name = "A", allow_hyphen_values = true, value_parser = positive_current)]
    pub current_range: Option<f64>,
    /// Highest voltage, the lowest is its negative (default: 1.5 times the rail's)
    #[arg(long, value_name = "V", allow_hyphen_values = true, value_parser = positive_voltage)]
    pub voltage_range: Option<f64>,
    /// Voltage of the rail without load (default: the trace's highest, or the specified one for a trace of
    /// power alone)
    #[arg(long, value_name = "V", allow_hyphen_values = true, value_parser = positive_voltage)]
    pub rail_voltage: Option<f64>,
    /// Resistance of the rail (default: 4mOhm, less where the range is above 25 A)
    #[arg(long, value_name = "OHM", allow_hyphen_values = true, value_parser = resistance)]
    pub rail_ohm: Option<f64>,
    /// Noise of the current, rms (default: a 6000th of the highest current)
    #[arg(long, value_name = "A", allow_hyphen_values = true, value_parser = size_of_current)]
    pub current_noise: Option<f64>,
    /// Noise of the voltage, rms (default: a 10000th of the highest voltage)
    #[arg(long, value_name = "V", allow_hyphen_values = true, value_parser = size_of_voltage)]
    pub voltage_noise: Option<f64>,
    /// Factor on the current: 1.01 for a gain 1 % too high (default: 1)
    #[arg(long, value_name = "FACTOR", allow_hyphen_values = true, value_parser = gain)]
    pub current_gain: Option<f64>,
    /// Offset of the current (default: 0A)
    #[arg(long, value_name = "A", allow_hyphen_values = true, value_parser = current)]
    pub current_offset: Option<f64>,
    /// Factor on the voltage (default: 1)
    #[arg(long, value_name = "FACTOR", allow_hyphen_values = true, value_parser = gain)]
    pub voltage_gain: Option<f64>,
    /// Offset of the voltage (default: 0V)
    #[arg(long, value_name = "V", allow_hyphen_values = true, value_parser = voltage)]
    pub voltage_offset: Option<f64>,
    /// Record this voltage, by specification, instead of measuring it (default: measured)
    #[arg(long, value_name = "V", allow_hyphen_values = true, value_parser = positive_voltage)]
    pub specified_voltage: Option<f64>,
    /// Time constant of a low-pass on the power, in seconds or with its unit (default: none)
    #[arg(long, value_name = "TIME", allow_hyphen_values = true, value_parser = length_of_time)]
    pub low_pass: Option<f64>,
    /// Samples in one packet; a packet is lost as a whole (default: 512)
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=i64::from(MAX_PACKET_SAMPLES)))]
    pub packet_samples: Option<u32>,
    /// Share of packets that are lost, 0 to below 1: gaps in the file (default: 0)
    #[arg(long, value_name = "SHARE", allow_hyphen_values = true, value_parser = share_below_one)]
    pub packet_loss: Option<f64>,
    /// Seed of noise and losses (default: 1)
    #[arg(long, value_name = "N", allow_negative_numbers = true, value_parser = crate::cli::parse::seed)]
    pub seed: Option<u64>,
    /// File to write, as for `trace convert`; `-` is standard output
    #[arg(long, value_name = "FILE")]
    pub out: PathBuf,
    /// Print as JSON
    #[arg(long)]
    pub json: bool,
    /// Format of standard output, where --out is `-` (default: csv)
    #[arg(long, value_name = "FORMAT", value_parser = trace_format())]
    pub format: Option<&'static TraceFormat>,
}

fn sample(args: &TraceSampleArgs, piped: bool, terminal: &Terminal) -> Result<(), Failure> {
    let format = format_of(&args.out)?;
    let inputs = args.device.as_deref().into_iter().chain([args.input.trace.as_path()]);
    may_be_saved("--out", &args.out, format, inputs)?;
    args.check_rate()?;
    let (trace, _) = args.input.source(terminal)?;
    let peaks = Peaks::of(&*trace)?;
    let device =
        Device::new(args.spec(&peaks, trace.header().rate_hz)?).map_err(|error| wrong(error.to_string()))?;
    let sampled = device.resample_in_pieces(&*trace)?;
    let (before_j, after_j) = (sampled.original_energy_j()?, sampled.energy_j);
    let warnings = [
        (sampled.clipping(), "widen it with --current-range or --voltage-range"),
        (device.spec().warning(&peaks), "narrow the range with --current-range"),
        (sampled.losses().map(|losses| Warning::new(Code::PacketsLost, losses)), "--repair fills them"),
        (sampled.energy_change(before_j), "look at --specified-voltage, --bits, ranges, gains and offsets"),
    ];
    let warnings = warnings.into_iter().filter_map(|(warning, remedy)| {
        let warning = warning?;
        warn_with(&warning, remedy, terminal);
        Some(warning)
    });
    let warnings: Vec<Warning> = warnings.collect();
    let (from_hz, to_hz) = (trace.header().rate_hz, device.spec().rate_hz);
    if to_hz > from_hz {
        terminal.note(&format!(
            "{to_hz} Hz is more than the {from_hz} Hz of the trace: the device sees steps between its samples"
        ));
    }
    save(&sampled, &args.out, terminal)?;
    let header = sampled.header();
    // A trace of no energy has no relative error.
    let error = (before_j != 0.0).then(|| after_j / before_j - 1.0);
    let TraceHeader { samples, lost_samples, .. } = header;
    if args.json {
        return print_json(
            &json!({ "samples": samples, "device": device.spec(), "energy_J": before_j, "sampled_energy_J": after_j,
                "relative_error": error, "lost_samples": lost_samples, "clipped_currents": sampled.clipped_currents,
                "clipped_voltages": sampled.clipped_voltages, "warnings": warnings }),
            true,
        );
    }
    let DeviceSpec { rate_hz, bits, current_range_a, .. } = device.spec();
    let relative = error.map_or(String::new(), |error| format!(" ({:+.3} %)", 100.0 * error));
    let lost = if lost_samples > 0 { format!(" and {} lost", grouped(lost_samples)) } else { String::new() };
    let line = format!(
        "{}: {}{lost} at {rate_hz} Hz, {bits} bits of {} to {}; {before_j:.6} J became {after_j:.6} J{relative}",
        args.out.display(),
        counted((samples - lost_samples) as usize, "sample"),
        si(current_range_a[0], "A"),
        si(current_range_a[1], "A"),
    );
    report(&line, piped, terminal)
}

impl TraceSampleArgs {
    /// The device: that of the file, or the default one with a range that fits and no more samples than the
    /// trace has; and what options change of it.
    fn spec(&self, peaks: &Peaks, trace_rate_hz: f64) -> Result<DeviceSpec, Failure> {
        let base = self.base(peaks, trace_rate_hz)?;
        let ranged = match self.current_range {
            Some(range_a) => base.clone().with_current_range(range_a),
            None => base.clone(),
        };
        let mut spec = match self.voltage_range {
            Some(range_v) => ranged.with_voltage_range(range_v),
            None => ranged,
        };
        self.change(&mut spec);
        if self.device.is_none() {
            return Ok(spec.named_by_rate_and_bits());
        }
        if spec != base {
            spec.name += " (changed by options)";
        }
        Ok(spec)
    }

    /// The device before options change it.
    fn base(&self, peaks: &Peaks, trace_rate_hz: f64) -> Result<DeviceSpec, Failure> {
        let Some(path) = &self.device else {
            // Power alone is drawn from a rail at the specified voltage.
            let specified_v = self.specified_voltage.filter(|_| !peaks.has_voltage);
            let rail_v = self.rail_voltage.or(specified_v).unwrap_or(peaks.voltage_v);
            let fitting = DeviceSpec::fitting(rail_v, peaks.power_w);
            return Ok(DeviceSpec { rate_hz: fitting.rate_hz.min(trace_rate_hz), ..fitting });
        };
        let hint =
            "--device takes a JSON file with the fields of a device, such as those that `--json` prints";
        let text = std::fs::read_to_string(path)
            .map_err(|error| wrong(format!("{}: cannot read it: {error}; check the path", path.display())))?;
        serde_json::from_str(&text).map_err(|error| wrong(format!("{}: {error}; {hint}", path.display())))
    }

    /// Puts the options that are given into `spec`; ranges are there already.
    fn change(&self, spec: &mut DeviceSpec) {
        let set = |field: &mut f64, given: Option<f64>| *field = given.unwrap_or(*field);
        set(&mut spec.rate_hz, self.device_rate);
        set(&mut spec.rail_v, self.rail_voltage);
        set(&mut spec.rail_ohm, self.rail_ohm);
        set(&mut spec.current_noise_a, self.current_noise);
        set(&mut spec.voltage_noise_v, self.voltage_noise);
        set(&mut spec.current_gain, self.current_gain);
        set(&mut spec.current_offset_a, self.current_offset);
        set(&mut spec.voltage_gain, self.voltage_gain);
        set(&mut spec.voltage_offset_v, self.voltage_offset);
        set(&mut spec.packet_loss, self.packet_loss);
        spec.bits = self.bits.unwrap_or(spec.bits);
        spec.specified_voltage_v = self.specified_voltage.or(spec.specified_voltage_v);
        spec.low_pass_s = self.low_pass.or(spec.low_pass_s);
        spec.packet_samples = self.packet_samples.unwrap_or(spec.packet_samples);
        spec.seed = self.seed.unwrap_or(spec.seed);
    }

    /// Refuses a rate that no modelled device has.
    fn check_rate(&self) -> Result<(), Failure> {
        match self.device_rate.filter(|rate| !RATES_HZ.contains(rate)) {
            Some(rate) => {
                Err(wrong(format!("--device-rate {rate}: a device takes 1 to 1e7 samples per second")))
            }
            None => Ok(()),
        }
    }
}
