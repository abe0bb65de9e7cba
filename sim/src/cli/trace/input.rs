//! Reading a trace, its marks and its frames, by the arguments.
//!
//! `-` in place of a file: standard input and standard output, by way of files in a temporary folder, as a
//! trace is read several times and a file is written whole.

use std::fs::File;
use std::io::{self, ErrorKind, IsTerminal, Write};
use std::path::{Path, PathBuf};

use clap::Args;
use clap::builder::{PossibleValuesParser, TypedValueParser};
use output::terminal::Terminal;
use tempfile::TempDir;
use traces::Trace;
use traces::frames::{FinderMethod, Window};
use traces::io::{
    FORMATS, ReadOptions, Repair, Rows, TraceFile, TraceFormat, TraceReader, open, rail_of_sums, read,
    readable, unread_power_ratio,
};
use traces::search::{FrameSearch, FrameSet};
use traces::times::read_times;
use traces::trace::RATE_LIMITS_HZ;
use warnings::{Code, Warning};

use super::PlotFormat;
use super::wrong;
use crate::cli::Failure;
use crate::cli::parse::{milliseconds, positive_voltage, rate, time};
use crate::cli::trace::{TraceArgs, TraceCommand};

/// Parser of `--format`: the formats of traces by the endings of their files.
pub(super) fn trace_format() -> impl TypedValueParser<Value = &'static TraceFormat> {
    let named = |ending: String| FORMATS.iter().find(|format| format.ending == ending);
    PossibleValuesParser::new(FORMATS.each_ref().map(|format| format.ending))
        .try_map(move |ending| named(ending).ok_or("unknown format"))
}

/// A trace and how to read it.
#[derive(Clone, Debug, Args)]
pub struct InputArgs {
    /// A trace in any of the formats that are read; `-` reads standard input
    #[arg(value_name = "TRACE", help = format!("A trace: {}; `-` reads standard input", readable()))]
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
    /// The start of one frame, in seconds or with its unit; may be given several times. A trace with marks in
    /// its description needs none
    #[arg(long, value_name = "TIME", allow_hyphen_values = true, value_parser = time)]
    pub mark: Vec<f64>,
    /// A file of starts: a number in each line, in seconds, or a table with a column start or time, its unit
    /// in its name (start_s, time_ms)
    #[arg(long, value_name = "FILE")]
    pub mark_file: Option<PathBuf>,
    /// Propose the start of a frame near the middle of the trace, where no mark is known; look at the result
    #[arg(long, conflicts_with_all = ["mark", "mark_file"])]
    pub auto: bool,
    /// Where the last frame ends, in seconds or with its unit; without it the end mark of the trace, else its
    /// end
    #[arg(long, value_name = "TIME", allow_hyphen_values = true, value_parser = time)]
    pub end: Option<f64>,
    /// The window around a mark that is compared with the trace: times before and after it, in milliseconds
    /// or with their units. Without it 1,4, or less where power repeats sooner
    #[arg(long, value_name = "PRE,POST", value_parser = window, allow_hyphen_values = true)]
    pub window: Option<(f64, f64)>,
    /// How starts are found: `squares` (sum of squared differences to the marked window), `normalized` (the
    /// same, regardless of level and scale), `tracking` (the most likely sequence of starts), `consensus`
    /// (agreement of four starts tried as marks), `segments` (one segmentation of the whole trace), or `auto`
    /// (chosen by the length and the clarity of the trace)
    #[arg(long, value_name = "METHOD", default_value_t)]
    pub method: FinderMethod,
    /// Read in pieces even if the trace would fit into memory (`squares`, or `normalized` if that is the method)
    #[arg(long)]
    pub stream: bool,
    /// Pixels in a frame, for energy per pixel
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    pub pixels: Option<u64>,
}

/// Two values separated by `between`; `form` describes them in errors.
fn two(
    text: &str,
    between: &str,
    form: &str,
    value: fn(&str) -> Result<f64, String>,
) -> Result<(f64, f64), String> {
    let (a, b) = text.split_once(between).ok_or_else(|| format!("`{text}` is not of the form {form}"))?;
    let value =
        |part: &str| value(part).map_err(|error| format!("`{text}` is not of the form {form}: {error}"));
    Ok((value(a)?, value(b)?))
}

/// Times before and after a mark, s.
pub(super) fn window(text: &str) -> Result<(f64, f64), String> {
    two(text, ",", "PRE,POST in milliseconds or with units, for example 1,4 or 500us,4ms", milliseconds)
}

/// A segment of a trace, s.
pub(super) fn segment(text: &str) -> Result<(f64, f64), String> {
    let (a, b) =
        two(text, "..", "A..B in seconds or with units, for example 0.1..0.4 or 100ms..400ms", time)?;
    if a < b {
        Ok((a, b))
    } else {
        Err(format!("`{text}` ends before it begins; the earlier time comes first"))
    }
}

/// A stamp and its time in the trace, s.
pub(super) fn anchor(text: &str) -> Result<(f64, f64), String> {
    two(text, "=", "STAMP=TIME in seconds or with units, for example 0.5=2.513", time)
}

/// The name of a pass and when it begins after the start of its frame, s.
pub(super) fn pass(text: &str) -> Result<(String, f64), String> {
    let form = "NAME=MS, for example light=4.2 or light=4200us";
    let (name, begins) = text.split_once('=').ok_or_else(|| format!("`{text}` is not of the form {form}"))?;
    let begins_s =
        milliseconds(begins).map_err(|error| format!("`{text}` is not of the form {form}: {error}"))?;
    Ok((name.to_owned(), begins_s))
}

impl InputArgs {
    pub(super) fn options(&self) -> Result<ReadOptions, Failure> {
        let [low, high] = RATE_LIMITS_HZ;
        if let Some(rate_hz) = self.rate.filter(|rate| !(low..=high).contains(rate)) {
            return Err(wrong(format!("--rate {rate_hz}: a rate has to be from {low:e} to {high:e} Hz")));
        }
        if self.power_column.is_some() && !self.rail.is_empty() {
            return Err(wrong("--rail chooses by name what --power-column chooses by hand: leave one out"));
        }
        let twice = |(index, rail): &(usize, &String)| {
            self.rail[..*index].iter().any(|other| other.eq_ignore_ascii_case(rail))
        };
        if let Some((_, rail)) = self.rail.iter().enumerate().find(twice) {
            return Err(wrong(format!("--rail {rail} is given twice: rails are added up, each once")));
        }
        Ok(ReadOptions {
            rails: self.rail.clone(),
            time: self.time_column.clone(),
            voltage: self.voltage_column.clone(),
            current: self.current_column.clone(),
            power: self.power_column.clone(),
            fixed_voltage_v: self.voltage,
            rate_hz: self.rate,
            start_s: self.start,
            delimiter: None,
            header: self.no_header.then_some(false),
            repair: self.repair,
        })
    }

    /// The whole trace in memory. Repairs are reported.
    pub(super) fn load(&self, terminal: &Terminal) -> Result<(Trace, Vec<Repair>), Failure> {
        self.load_other(&self.trace, terminal)
    }

    /// Another trace, read in the same way.
    pub(super) fn load_other(
        &self,
        path: &Path,
        terminal: &Terminal,
    ) -> Result<(Trace, Vec<Repair>), Failure> {
        let loaded = read(path, &self.options()?)?;
        self.warn_of_columns(path, terminal)?;
        note_repairs(path, &loaded.repairs, terminal);
        Ok((loaded.trace, loaded.repairs))
    }

    /// The trace, of any length: read in pieces, or in memory where it has to be repaired. Repairs are reported.
    pub(super) fn source(&self, terminal: &Terminal) -> Result<(Box<dyn TraceReader>, Vec<Repair>), Failure> {
        let (trace, repairs) = open(&self.trace, &self.options()?)?;
        self.warn_of_columns(&self.trace, terminal)?;
        note_repairs(&self.trace, &repairs, terminal);
        Ok((trace, repairs))
    }

    /// Warns of a rail that is added to those that it is the sum of, and notes how columns are read.
    pub(super) fn warn_of_columns(&self, path: &Path, terminal: &Terminal) -> Result<(), Failure> {
        let rows = Rows::open(path, &self.options()?)?;
        if let Some(guess) = rows.guess() {
            terminal.note(&format!(
                "{}: columns without names: {guess}; --time-column 1 and the like choose others",
                shown(path)
            ));
        }
        let without_unit: Vec<&str> = rows.without_unit().collect();
        if !without_unit.is_empty() {
            let columns = without_unit.join(", ");
            terminal.note(&format!("{}: no unit at {columns}: read as s, V, A or W", shown(path)));
        }
        if !rows.unread().is_empty() {
            let columns = rows.unread().join(", ");
            terminal.note(&format!("{}: {columns} is not read: power is voltage times current", shown(path)));
        }
        if let Some(ratio) = unread_power_ratio(path, &self.options()?) {
            terminal.warn_of(
                Code::PowerDiffers,
                &format!(
                    "{}: {} is {ratio:.4} times voltage times current, which is read; --power-column reads it instead",
                    shown(path),
                    rows.unread().join(", ")
                ),
            );
        }
        if self.rail.is_empty() { self.warn_of_sums(&rows, terminal) } else { Ok(()) }
    }

    fn warn_of_sums(&self, rows: &Rows, terminal: &Terminal) -> Result<(), Failure> {
        if let Some(sum) = rail_of_sums(rows.path(), &self.options()?)? {
            let others: Vec<String> = sum.others.iter().map(|rail| format!("--rail {rail}")).collect();
            let alone = if sum.rail.is_empty() { String::new() } else { format!("--rail {}, or ", sum.rail) };
            terminal.warn_of(Code::RailCountedTwice, &format!("{sum}: give {alone}{}", others.join(" ")));
        } else if rows.rails().len() > 1 {
            let name = |rail: &String| {
                if rail.is_empty() { "the one without a name".to_owned() } else { rail.clone() }
            };
            let rails: Vec<String> = rows.rails().iter().map(name).collect();
            terminal.note(&format!(
                "{}: {} rails are added up: {}; --rail chooses",
                shown(rows.path()),
                rails.len(),
                rails.join(", ")
            ));
        }
        Ok(())
    }
}

fn note_repairs(path: &Path, repairs: &[Repair], terminal: &Terminal) {
    for repair in repairs {
        terminal.note(&format!("{}: repaired: {}", shown(path), repair.message));
    }
}

/// Prints the warnings of a search.
pub(super) fn warn_of_frames(set: &FrameSet, terminal: &Terminal) {
    warn_of(&set.found.warnings, terminal);
}

/// Prints warnings.
pub(super) fn warn_of(warnings: &[Warning], terminal: &Terminal) {
    warnings.iter().for_each(|warning| terminal.warn_of(warning.code, &warning.message));
}

/// Frames, with the repairs of the trace they were found in.
pub(super) struct Frames {
    pub set: FrameSet,
    pub repairs: Vec<Repair>,
}

impl FindArgs {
    /// Finds frames in memory, or in pieces where the trace is long.
    pub(super) fn frames(
        &self,
        input: &InputArgs,
        path: &Path,
        terminal: &Terminal,
    ) -> Result<Frames, Failure> {
        let search = self.search()?;
        if search.reads_in_pieces(path, &input.options()?)? {
            return in_pieces(&search, input, path, terminal);
        }
        let (trace, repairs) = input.load_other(path, terminal)?;
        Ok(Frames { set: search.of_trace(&trace)?, repairs })
    }

    /// As [`FindArgs::frames`], with the samples they were found in.
    pub(super) fn frames_and_samples(
        &self,
        input: &InputArgs,
        path: &Path,
        terminal: &Terminal,
    ) -> Result<(Frames, Box<dyn TraceReader>), Failure> {
        let search = self.search()?;
        if search.reads_in_pieces(path, &input.options()?)? {
            let recording = TraceFile::open(path, &input.options()?)?;
            return Ok((in_pieces(&search, input, path, terminal)?, Box::new(recording)));
        }
        let (trace, repairs) = input.load_other(path, terminal)?;
        Ok((Frames { set: search.of_trace(&trace)?, repairs }, Box::new(trace)))
    }

    /// Frames of a trace in memory, where nothing is read in pieces.
    pub(super) fn frames_of(&self, trace: &Trace) -> Result<FrameSet, Failure> {
        if self.stream {
            return Err(wrong("--stream: to draw frames, all samples are held; leave it out"));
        }
        Ok(self.search()?.of_trace(trace)?)
    }

    fn search(&self) -> Result<FrameSearch, Failure> {
        let mut starts_s = self.mark.clone();
        if let Some(path) = &self.mark_file {
            starts_s.extend(read_times(path)?);
        }
        Ok(FrameSearch {
            starts_s,
            propose: self.auto,
            window: self.window.map(|(pre_s, post_s)| Window { pre_s, post_s }),
            end_s: self.end,
            method: self.method,
            in_pieces: self.stream,
        })
    }
}

fn in_pieces(
    search: &FrameSearch,
    input: &InputArgs,
    path: &Path,
    terminal: &Terminal,
) -> Result<Frames, Failure> {
    let set = search.of_file(path, &input.options()?)?;
    input.warn_of_columns(path, terminal)?;
    Ok(Frames { set, repairs: Vec::new() })
}

/// Name of an input from a pipe in messages and plots.
const INPUT: &str = "standard input";
/// The format of tables.
const CSV: (&str, bool) = ("csv", true);
/// The files that stand in for standard input and standard output.
pub(super) struct Pipes {
    folder: Option<TempDir>,
    output: Option<PathBuf>,
}

/// An input as messages and plots call it.
pub(super) fn shown(path: &Path) -> String {
    match path.file_name().is_some_and(|name| name == INPUT) {
        true => INPUT.to_owned(),
        false => path.display().to_string(),
    }
}

fn is_dash(path: &Path) -> bool {
    path.as_os_str() == "-"
}

impl Pipes {
    /// Puts files in place of every `-` among `args`, and reads standard input where it is one of them.
    pub fn laid(args: &mut TraceArgs) -> Result<Self, Failure> {
        let mut pipes = Self { folder: None, output: None };
        match &mut args.command {
            TraceCommand::Frames(args) => {
                pipes.input(&mut args.input.trace)?;
                pipes.optional_output(&mut args.out, args.json)?;
            }
            TraceCommand::Energy(args) => pipes.input(&mut args.input.trace)?,
            TraceCommand::Align(args) => {
                pipes.input(&mut args.input.trace)?;
                pipes.optional_output(&mut args.out, args.json)?;
            }
            TraceCommand::Convert(args) => {
                pipes.input(&mut args.input.trace)?;
                args.out = args.last.take().or(args.named.take()).unwrap_or_default();
                let format = args.format.map(|format| (format.ending, format.is_text));
                pipes.output(&mut args.out, format, CSV, args.json)?;
            }
            TraceCommand::Sample(args) => {
                pipes.input(&mut args.input.trace)?;
                let format = args.format.map(|format| (format.ending, format.is_text));
                pipes.output(&mut args.out, format, CSV, args.json)?;
            }
            TraceCommand::Plot(args) => {
                pipes.input(&mut args.input.trace)?;
                let format = args.format.map(PlotFormat::ending);
                pipes.output(&mut args.out, format, PlotFormat::Svg.ending(), args.json)?;
            }
            TraceCommand::Pareto(args) => {
                pipes.input(&mut args.table)?;
                pipes.optional_output(&mut args.out, args.json)?;
            }
        }
        Ok(pipes)
    }

    /// Whether the result goes to standard output.
    pub fn has_output(&self) -> bool {
        self.output.is_some()
    }

    /// Copies the result to standard output, or says why there is none.
    pub fn finish(self, done: Result<(), Failure>) -> Result<(), Failure> {
        let Some(folder) = &self.folder else { return done };
        // The folder is nothing that a user knows.
        let place = format!("{}{}", folder.path().display(), std::path::MAIN_SEPARATOR);
        done.map_err(|failure| Failure { message: failure.message.replace(&place, ""), ..failure })?;
        self.output.as_deref().map_or(Ok(()), copy_out)
    }

    fn input(&mut self, path: &mut PathBuf) -> Result<(), Failure> {
        if !is_dash(path) {
            return Ok(());
        }
        let file = self.file(INPUT)?;
        let copied = File::create(&file).and_then(|mut file| io::copy(&mut io::stdin().lock(), &mut file));
        copied.map_err(|error| Failure { message: format!("{INPUT}: cannot read it: {error}"), code: 1 })?;
        *path = file;
        Ok(())
    }

    fn optional_output(&mut self, out: &mut Option<PathBuf>, json: bool) -> Result<(), Failure> {
        out.as_mut().map_or(Ok(()), |out| self.output(out, None, CSV, json))
    }

    /// Puts a file in place of `out` if that is standard output. A format is its ending, and whether it is text.
    fn output(
        &mut self,
        out: &mut PathBuf,
        format: Option<(&str, bool)>,
        default: (&str, bool),
        json: bool,
    ) -> Result<(), Failure> {
        if !is_dash(out) {
            return match format {
                Some((format, _)) => Err(wrong(format!(
                    "--format {format} goes with `-`, standard output; the name of a file says its format: {} has to end in .{format}",
                    out.display()
                ))),
                None => Ok(()),
            };
        }
        if json {
            return Err(wrong(
                "-: standard output takes the result or --json, not both; name a file, or leave --json out",
            ));
        }
        let (format, is_text) = format.unwrap_or(default);
        if !is_text && io::stdout().is_terminal() {
            return Err(wrong(format!(
                "-: {format} is binary, and standard output is a terminal; name a file, or send it into one with >"
            )));
        }
        let file = self.file(&format!("standard output.{format}"))?;
        self.output = Some(file.clone());
        *out = file;
        Ok(())
    }

    fn file(&mut self, name: &str) -> Result<PathBuf, Failure> {
        let made = match self.folder.take() {
            Some(folder) => Ok(folder),
            None => tempfile::tempdir(),
        };
        let folder = made.map_err(|error| Failure {
            message: format!("{}: no temporary folder can be made: {error}", std::env::temp_dir().display()),
            code: 1,
        })?;
        let file = folder.path().join(name);
        self.folder = Some(folder);
        Ok(file)
    }
}

/// Copies a file to standard output; a reader that closed the pipe has what it wanted.
fn copy_out(path: &Path) -> Result<(), Failure> {
    let mut out = io::stdout().lock();
    let copied =
        File::open(path).and_then(|mut file| io::copy(&mut file, &mut out)).and_then(|_| out.flush());
    match copied {
        Err(error) if error.kind() != ErrorKind::BrokenPipe => {
            Err(Failure { message: format!("standard output: cannot write to it: {error}"), code: 1 })
        }
        _ => Ok(()),
    }
}
