//! `quintile trace frames` and `quintile trace align`: frames in a trace, and recorded time stamps put onto its time.

use std::io::Write;
use std::path::{Path, PathBuf};

use clap::Args;
use output::table::{Table, counted, si, si_digits};
use output::terminal::Terminal;
use serde::Serialize;
use serde_json::{Value, json};
use traces::align::Alignment;
use traces::energy::{FrameSummary, FrameTable, InverseUnits, whole};
use traces::frames::{Rule, Threshold};
use traces::io::atomic::write_file;
use traces::io::{TraceFormat, TraceHeader};
use traces::search::FrameSet;
use traces::times::read_times;
use traces::trace::is_within;
use warnings::{Code, Warning};

use super::input::{FindArgs, Frames, InputArgs, anchor, warn_of_frames};
use super::{report, warn_with, wrong};
use crate::cli::args::ThreadArgs;
use crate::cli::{Failure, may_hold_results, print_json};

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
    /// Worker threads.
    #[command(flatten)]
    pub threads: ThreadArgs,
    /// Print everything as JSON and nothing else
    #[arg(long)]
    pub json: bool,
}

/// Frames shown on the terminal.
const SHOWN: usize = 12;

pub(super) fn run(args: &FramesArgs, piped: bool, terminal: &Terminal) -> Result<(), Failure> {
    let inputs = args.find.mark_file.as_deref().into_iter().chain([args.input.trace.as_path()]);
    may_hold_results("--out", args.out.as_deref(), inputs)?;
    args.out.as_deref().map_or(Ok(()), is_table)?;
    let (frames, table, summary, pixels) = args.threads.pool()?.install(|| {
        let mut frames = args.find.frames(&args.input, &args.input.trace, terminal)?;
        let pixels = args.find.pixels.or(frames.set.metadata.pixels);
        let table = FrameTable::new(std::mem::take(&mut frames.set.energies), pixels);
        let write = |out| write_file(out, |file| table.write_csv(file));
        let (written, summary) = rayon::join(
            || args.out.as_deref().map_or(Ok(()), write),
            || FrameSummary::of(whole(table.frames(), frames.set.ends_with_trace)),
        );
        written?;
        Ok::<_, Failure>((frames, table, summary, pixels))
    })?;
    if args.json {
        return print_json(&json_report(&frames, &table, summary, pixels, args.inverse), true);
    }
    warn_of_frames(&frames.set, terminal);
    report(&text(&frames.set, &table, summary, pixels), piped, terminal)?;
    if args.inverse {
        report(&inverse_text(&table, pixels, terminal), piped, terminal)?;
    }
    args.out.as_ref().map_or(Ok(()), |out| report(&format!("frames: {}", out.display()), piped, terminal))
}

/// Refuses a name that promises another kind of file.
fn is_table(out: &Path) -> Result<(), Failure> {
    let ending = out.extension().map(|ending| ending.to_string_lossy().to_ascii_lowercase());
    let of_trace = TraceFormat::of(out).map(|format| format.ending).filter(|ending| *ending != "csv");
    let of_others = ending.as_deref().filter(|ending| ["json", "gz", "svg", "png", "pdf"].contains(ending));
    of_trace.or(of_others).map_or(Ok(()), |other| {
        Err(wrong(format!(
            "--out {}: frames are written as CSV, which is no .{other}; name a file that ends in .csv",
            out.display()
        )))
    })
}

#[derive(Serialize)]
struct Row {
    start_s: f64,
    end_s: f64,
    #[serde(rename = "energy_J")]
    energy_j: f64,
    #[serde(rename = "power_W")]
    power_w: f64,
    confidence: f64,
    flags: String,
    outlier: u8,
}

fn json_report(
    frames: &Frames,
    table: &FrameTable,
    summary: Option<FrameSummary>,
    pixels: Option<u64>,
    inverse: bool,
) -> Value {
    let rows: Vec<Row> = table
        .frames()
        .iter()
        .zip(table.outliers())
        .map(|(frame, outlier)| Row {
            start_s: frame.start_s,
            end_s: frame.end_s,
            energy_j: frame.energy_j,
            power_w: frame.power_w(),
            confidence: frame.confidence,
            flags: frame.flags.to_string(),
            outlier: u8::from(*outlier),
        })
        .collect();
    let Frames { set, repairs } = frames;
    let window = set.found.window;
    let mut report = json!({
        "samples": set.samples, "rate_hz": set.rate_hz, "start_s": set.start_s, "total_J": set.total_j,
        "method": set.found.method, "threshold": set.found.threshold,
        "window_s": [window.pre_s, window.post_s], "end_s": set.found.end_s,
        "warnings": set.found.warnings, "repairs": repairs, "proposal": set.proposal,
        "pixels": pixels, "summary": summary, "frames": rows,
    });
    if inverse {
        report["inverse"] = inverse_units(table, pixels);
    }
    report
}

fn text(frames: &FrameSet, table: &FrameTable, summary: Option<FrameSummary>, pixels: Option<u64>) -> String {
    let mut lines = String::new();
    if let Some(p) = &frames.proposal {
        lines += &format!(
            "proposed mark: {} s, of {}; {} like it, evenly apart over {:.0} % of the trace\n",
            p.mark_s,
            counted(p.tried, "rise"),
            counted(p.similar_starts, "start"),
            100.0 * p.regularity
        );
    }
    lines += &format!(
        "{} at {}, {} by {}; {}\n",
        counted(frames.samples as usize, "sample"),
        si(frames.rate_hz, "Hz"),
        counted(table.frames().len(), "frame"),
        frames.found.method,
        reason(&frames.found.threshold)
    );
    let mut shown = Table::new(["frame", "start", "time", "energy", "power", "confidence", "flags"]);
    for (index, (frame, outlier)) in table.frames().iter().zip(table.outliers()).enumerate().take(SHOWN) {
        let flags = if *outlier { format!("{} outlier", frame.flags) } else { frame.flags.to_string() };
        shown.row([
            index.to_string(),
            format!("{:.6} s", frame.start_s),
            format!("{:.3} ms", frame.duration_s() * 1e3),
            format!("{:.4} mJ", frame.energy_j * 1e3),
            si_digits(frame.power_w(), "W", 4),
            format!("{:.2}", frame.confidence),
            flags,
        ]);
    }
    lines += &shown.to_string();
    if table.frames().len() > SHOWN {
        lines += &format!("... {} more\n", table.frames().len() - SHOWN);
    }
    if let Some(s) = summary {
        lines += &format!(
            "mean: {:.4} mJ/frame (deviation {:.4}), {:.3} ms, {}",
            s.energy_j.mean * 1e3,
            s.energy_j.deviation * 1e3,
            s.duration_s.mean * 1e3,
            si_digits(s.overall_power_w, "W", 4)
        );
        if let Some(pixels) = pixels.filter(|&pixels| pixels > 0) {
            lines += &format!(", {:.3} nJ/pixel", s.energy_j.mean / pixels as f64 * 1e9);
        }
        let outliers = table.outliers().iter().filter(|out| **out).count();
        let cut = if s.frames < table.frames().len() { "; without the last, which is cut" } else { "" };
        lines += &format!("; {}{cut}\n", counted(outliers, "outlier"));
    }
    lines
}

/// Why just these are starts.
fn reason(threshold: &Threshold) -> String {
    match threshold.rule {
        Rule::Sequence => "no threshold: the sequence with the most evidence as a whole".to_owned(),
        Rule::NoneMatch => "no threshold: nothing else resembles the marked frame".to_owned(),
        Rule::NoCandidates => "no threshold: nothing to compare with the marked frame".to_owned(),
        Rule::AllMatch => format!("threshold {:.4e} W^2, above all minima", threshold.value_w2),
        Rule::Otsu | Rule::OtsuRegular | Rule::OtsuDistinct => {
            format!("threshold {:.4e} W^2, separation {:.2}", threshold.value_w2, threshold.separation)
        }
    }
}

/// Inverse units as JSON, with the average that would be wrong (Paper II).
fn inverse_units(table: &FrameTable, pixels: Option<u64>) -> Value {
    let units = InverseUnits::of(table.frames(), pixels);
    json!({
        "frames_per_J": units.frames_per_j, "pixels_per_J": units.pixels_per_j,
        "wrong_mean_of_frames_per_J": units.wrong_mean_of_frames_per_j,
        "warning": "inverse units cannot be averaged: the mean of frames per joule is not the inverse of the mean energy",
    })
}

fn inverse_text(table: &FrameTable, pixels: Option<u64>, terminal: &Terminal) -> String {
    let units = InverseUnits::of(table.frames(), pixels);
    terminal.warn_of(
        Code::InverseUnits,
        "inverse units cannot be averaged; these are inverses of the mean energy (Paper II)",
    );
    let number = |value: f64| if value.is_finite() { value } else { f64::NAN };
    let per_pixel = units.pixels_per_j.filter(|value| value.is_finite());
    let per_pixel = per_pixel.map_or(String::new(), |p| format!(", {:.3} Mpixels/J", p * 1e-6));
    format!(
        "inverse: {:.4} frames/J{per_pixel} (the mean of the inverses would be {:.4}, which is wrong)",
        number(units.frames_per_j),
        number(units.wrong_mean_of_frames_per_j)
    )
}

/// Arguments of `trace align`.
#[derive(Clone, Debug, Args)]
#[command(
    after_help = "Examples:\n  quintile trace align meter.csv stamps.csv --anchor 0.0=2.513 --anchor 33.1=35.613\n  quintile trace align meter.csv stamps.csv --mark 2.513"
)]
pub struct AlignArgs {
    /// The trace.
    #[command(flatten)]
    pub input: InputArgs,
    /// Recorded stamps: a number in each line, in seconds, or a table with a column start, time, mark or
    /// stamp, its unit in its name (time_s, stamp_ms)
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
}

/// Root mean square of rounding to whole samples, in sample periods, as 1 / sqrt 12: starts are at best known
/// to half a sample.
const ROUNDING_PERIODS: f64 = 0.289;

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

pub(super) fn align(args: &AlignArgs, piped: bool, terminal: &Terminal) -> Result<(), Failure> {
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
    report(&line, piped, terminal)
}
