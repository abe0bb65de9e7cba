//! `quintile trace plot` and `quintile trace pareto`: pictures of a trace and its frames, and of the settings
//! of a table.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use output::plot::{AxisSpec, Chart, ChartPanel, Paint, Picture, PlotMark, Scale, Series};
use output::table::{Table, counted, si, si_digits};
use output::terminal::Terminal;
use serde_json::json;
use traces::Trace;
use traces::energy::{FrameEnergy, Histogram, Repeats, mean_over_discarded, whole};
use traces::io::atomic::write_file;
use traces::io::{ReadError, ReadOptions};
use traces::pareto::{ParetoPoint, RatedPoint, SettingColumns, frontiers, write_csv};
use traces::pyramid::{Column, PowerPyramid, moving_means_w, pyramid_path};
use traces::table::InputTable;
use traces::trace::check_span;

use super::input::shown as name_of;
use super::{PlotFormat, report, write_picture, wrong};
use crate::cli::args::PlotStyleArgs;
use crate::cli::parse::{milliseconds, size_of_power, time};
use crate::cli::trace::input::{FindArgs, InputArgs};
use crate::cli::{Failure, may_hold_results, print_json};

/// Arguments of `trace plot`.
#[derive(Clone, Debug, Args)]
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
    /// Kind of plot
    #[arg(long, value_enum, default_value_t)]
    pub kind: PlotKind,
    /// Where the shown part of the curve begins, in seconds or with its unit
    #[arg(long, value_name = "TIME", allow_hyphen_values = true, value_parser = time)]
    pub from: Option<f64>,
    /// Where the shown part of the curve ends, in seconds or with its unit
    #[arg(long, value_name = "TIME", allow_hyphen_values = true, value_parser = time)]
    pub to: Option<f64>,
    /// Time over which the curve's mean is drawn, in milliseconds or with its unit; a fiftieth of the range
    /// without it
    #[arg(long, value_name = "MS", allow_hyphen_values = true, value_parser = milliseconds)]
    pub low_pass: Option<f64>,
    /// Keep the overview of a curve beside the trace as TRACE.pyramid: later plots of a long trace are then
    /// drawn at once
    #[arg(long)]
    pub keep_pyramid: bool,
    /// Which frame, for `frame`; the middle one without it
    #[arg(long, value_name = "N")]
    pub frame: Option<usize>,
    /// Another run of the same thing, for `repeats`
    #[arg(long, value_name = "TRACE")]
    pub run: Vec<PathBuf>,
    /// File: .svg, .png or .pdf; `-` is standard output
    #[arg(long, value_name = "FILE")]
    pub out: PathBuf,
    /// Print what was drawn as JSON
    #[arg(long)]
    pub json: bool,
    /// Format of standard output, where --out is `-` (default: svg)
    #[arg(long, value_enum, value_name = "FORMAT")]
    pub format: Option<PlotFormat>,
    /// Style of pictures.
    #[command(flatten)]
    pub plot_style: PlotStyleArgs,
}

/// Kind of plot.
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
    /// Distribution of the energies of frames
    Histogram,
    /// Mean energy over the number of frames left out at the beginning
    Discard,
    /// Mean and standard deviation of each frame over repeated runs
    Repeats,
}

/// Columns of the curve.
const COLUMNS: usize = 1050;
/// Bars of the histogram, at most.
const BARS: usize = 60;
/// Frames drawn on top of one another, at most.
const OVERLAID: usize = 400;

pub(super) fn run(args: &PlotArgs, piped: bool, terminal: &Terminal) -> Result<(), Failure> {
    let kind = PlotFormat::of(&args.out)?;
    may_hold_results("--out", Some(&args.out), [args.input.trace.as_path()])?;
    let (picture, shown) = match args.kind {
        PlotKind::Curve => curve(args, terminal)?,
        _ => framed(args, terminal)?,
    };
    write_picture(&picture, &args.out, kind)?;
    if args.json {
        return print_json(&json!({ "out": args.out.display().to_string(), "shown": shown }), true);
    }
    report(&format!("{}: {shown}", args.out.display()), piped, terminal)
}

fn span(args: &PlotArgs, start_s: f64, end_s: f64) -> Result<[f64; 2], Failure> {
    let (from_s, to_s) = (args.from.unwrap_or(start_s), args.to.unwrap_or(end_s));
    check_span([start_s, end_s], [from_s, to_s])
        .map_err(|error| wrong(format!("--from and --to: {error}")))?;
    Ok([from_s.max(start_s), to_s.min(end_s)])
}

type Make = fn(&Path, &ReadOptions) -> Result<PowerPyramid, ReadError>;

/// The shown time and its columns: from the pyramid beside the file, or from the samples where these are few.
fn columns(args: &PlotArgs, terminal: &Terminal) -> Result<([f64; 2], Vec<Column>), Failure> {
    if args.input.repair {
        // Repairs are listed, so they are made anew each time.
        let trace = args.input.load(terminal)?.0;
        let shown = span(args, trace.start_s(), trace.end_s())?;
        let columns = PowerPyramid::of_trace(&trace).columns_of_trace(&trace, shown, COLUMNS);
        return Ok((shown, columns.unwrap_or_default()));
    }
    let (path, options) = (args.input.trace.as_path(), args.input.options()?);
    args.input.warn_of_columns(path, terminal)?;
    let (pyramid, make): (_, Make) = match args.keep_pyramid {
        true => (PowerPyramid::of_file(path, &options)?, PowerPyramid::anew),
        false => (PowerPyramid::look(path, &options)?, PowerPyramid::build),
    };
    let note = || terminal.note(&format!("{}: damaged; made anew", pyramid_path(path).display()));
    if pyramid.was_damaged() {
        note();
    }
    let shown = span(args, pyramid.start_s(), pyramid.end_s())?;
    if let Some(columns) = pyramid.columns_of_file(path, &options, shown, COLUMNS)? {
        return Ok((shown, columns));
    }
    note();
    let columns = make(path, &options)?.columns_of_file(path, &options, shown, COLUMNS)?;
    Ok((shown, columns.unwrap_or_default()))
}

/// Lowest, highest and mean power of each column.
fn curve(args: &PlotArgs, terminal: &Terminal) -> Result<(Picture, String), Failure> {
    let ([from_s, to_s], columns) = columns(args, terminal)?;
    let middle = |column: &Column| 0.5 * (column.from_s + column.to_s);
    let band = columns.iter().map(|c| (middle(c), f64::from(c.low_w), f64::from(c.high_w))).collect();
    let width_s = args.low_pass.unwrap_or((to_s - from_s) / 50.0);
    let mean =
        moving_means_w(&columns, width_s).into_iter().zip(&columns).map(|(w, c)| (middle(c), w)).collect();
    let shown = format!("{from_s} s to {to_s} s in {} columns", columns.len());
    let series = vec![
        series("lowest to highest", PlotMark::Band(band)),
        series(&format!("mean over {}", si(width_s, "s")), PlotMark::Line(mean)),
    ];
    let subject = name_of(&args.input.trace);
    Ok((drawn(args, &subject, ("Power", ("time", "s"), POWER, series)), shown))
}

/// The kinds that need frames.
fn framed(args: &PlotArgs, terminal: &Terminal) -> Result<(Picture, String), Failure> {
    if args.from.is_some() || args.to.is_some() {
        return Err(wrong("--from and --to choose a part of --kind curve; leave them out"));
    }
    let (count, plot) = match args.kind {
        PlotKind::Frame | PlotKind::Overlay => samples(args, terminal)?,
        _ => energies(args, terminal)?,
    };
    let shown = counted(count, "frame");
    let subject = format!("{} - {shown}", name_of(&args.input.trace));
    Ok((drawn(args, &subject, plot), shown))
}

/// The picture of a plot; power starts at zero in all kinds.
fn drawn(args: &PlotArgs, subject: &str, (title, x, y, series): Drawn) -> Picture {
    let scale = if y == POWER { Scale::FromZero } else { Scale::Even };
    let axes = [AxisSpec::even(x.0, x.1), AxisSpec { scale, ..AxisSpec::even(y.0, y.1) }];
    Chart::new(title, subject, vec![ChartPanel::over("", axes, series)])
        .picture(&args.plot_style.plot_style())
}

/// The kinds that show samples of frames, which are held.
fn samples(args: &PlotArgs, terminal: &Terminal) -> Result<(usize, Drawn), Failure> {
    let (trace, _) = args.input.load(terminal)?;
    let frames = args.find.frames_of(&trace)?.energies;
    let drawn = match args.kind {
        PlotKind::Frame => one_frame(args, &trace, &frames)?,
        _ => overlay(&trace, &frames),
    };
    Ok((frames.len(), drawn))
}

/// The energy of each frame of one recording, J, in pieces where it is long.
fn energies_of(args: &PlotArgs, path: &Path, terminal: &Terminal) -> Result<Vec<f64>, Failure> {
    let frames = args.find.frames(&args.input, path, terminal)?.set;
    // A last frame that is cut has no energy that belongs into a distribution.
    let all = &frames.energies;
    let shown = if args.kind == PlotKind::Histogram { whole(all, frames.ends_with_trace) } else { all };
    Ok(shown.iter().map(|frame| frame.energy_j).collect())
}

/// The kinds that show energies of frames.
fn energies(args: &PlotArgs, terminal: &Terminal) -> Result<(usize, Drawn), Failure> {
    let energies = energies_of(args, &args.input.trace, terminal)?;
    let drawn = match args.kind {
        PlotKind::Histogram => histogram(&energies),
        PlotKind::Discard => {
            let means = mean_over_discarded(&energies);
            let kept = means[..means.len().saturating_sub(means.len() / 10).max(1)].iter();
            let line = kept.enumerate().map(|(index, j)| (index as f64, *j)).collect();
            (
                "Mean energy over discarded frames",
                ("frames discarded", ""),
                ("energy", "J"),
                vec![series("mean of the rest", PlotMark::Line(line))],
            )
        }
        PlotKind::Repeats => repeats(args, &energies, terminal)?,
        _ => {
            let out = traces::energy::outliers(&energies);
            let of = |odd: bool| {
                let chosen = energies.iter().enumerate().filter(|(index, _)| out[*index] == odd);
                PlotMark::Dots(chosen.map(|(index, j)| (index as f64, *j, String::new())).collect())
            };
            let series = vec![series("frame", of(false)), series("outlier", of(true))];
            ("Energy per frame", ("frame", ""), ("energy", "J"), series)
        }
    };
    Ok((energies.len(), drawn))
}

type Drawn = (&'static str, (&'static str, &'static str), (&'static str, &'static str), Vec<Series>);

/// The vertical axis of power.
const POWER: (&str, &str) = ("power", "W");

fn series(name: &str, mark: PlotMark) -> Series {
    Series::new(name, mark)
}

/// How much of what is before and after one frame is shown beside it, as a share of the frame.
const BESIDE: f64 = 0.08;

/// Power within a frame, over the time since its start.
fn within(trace: &Trace, frame: &FrameEnergy) -> Vec<(f64, f64)> {
    between(trace, [frame.start_s, frame.end_s], frame.start_s)
}

/// Power between two times, over the time since a third.
fn between(trace: &Trace, [from_s, to_s]: [f64; 2], since_s: f64) -> Vec<(f64, f64)> {
    trace.powers_between(from_s, to_s).map(|(time_s, power_w)| (time_s - since_s, power_w)).collect()
}

fn one_frame(args: &PlotArgs, trace: &Trace, frames: &[FrameEnergy]) -> Result<Drawn, Failure> {
    let number = args.frame.unwrap_or(frames.len() / 2);
    let frame = frames.get(number).ok_or_else(|| {
        wrong(format!(
            "--frame {number}: the trace has {}, from 0 on; give a lower number",
            counted(frames.len(), "frame")
        ))
    })?;
    let name = format!("frame {number}, {}", si(frame.energy_j, "J"));
    let margin_s = BESIDE * (frame.end_s - frame.start_s);
    let beside = [[frame.start_s - margin_s, frame.start_s], [frame.end_s, frame.end_s + margin_s]];
    let beside = beside.map(|span_s| between(trace, span_s, frame.start_s));
    Ok((
        "Power of one frame",
        ("time since its start", "s"),
        POWER,
        vec![
            series("before and after it", PlotMark::Faint(beside.into())).painted(Paint::Grey),
            series(&name, PlotMark::Line(within(trace, frame))).painted(Paint::Like(0)),
            series("start and end", PlotMark::Uprights(vec![0.0, frame.end_s - frame.start_s]))
                .painted(Paint::Ink),
        ],
    ))
}

fn overlay(trace: &Trace, frames: &[FrameEnergy]) -> Drawn {
    let step = frames.len().div_ceil(OVERLAID).max(1);
    let lines: Vec<_> = frames.iter().step_by(step).map(|frame| within(trace, frame)).collect();
    let name = counted(lines.len(), "frame");
    (
        "Frames on top of one another",
        ("time since the start", "s"),
        POWER,
        vec![series(&name, PlotMark::Faint(lines))],
    )
}

fn histogram(energies: &[f64]) -> Drawn {
    let histogram = Histogram::of(energies, BARS);
    let bars = histogram.bins().map(|(from, to, count)| (from, to, f64::from(count))).collect();
    (
        "Distribution of frame energies",
        ("energy", "J"),
        ("frames", ""),
        vec![series("frames", PlotMark::Bars(bars))],
    )
}

/// Mean and deviation of the n-th frame over all runs.
fn repeats(args: &PlotArgs, first: &[f64], terminal: &Terminal) -> Result<Drawn, Failure> {
    let mut runs = vec![first.to_vec()];
    for path in &args.run {
        runs.push(energies_of(args, path, terminal)?);
    }
    let none = || wrong("no run has a frame");
    let repeats = Repeats::of(&runs).ok_or_else(none)?;
    repeats.warning().iter().for_each(|warning| terminal.warn_of(warning.code, &warning.message));
    let spreads = repeats.energies_j;
    let at = |index: usize| index as f64;
    let band = spreads
        .iter()
        .enumerate()
        .map(|(i, s)| (at(i), s.mean - s.deviation, s.mean + s.deviation))
        .collect();
    let mean = spreads.iter().enumerate().map(|(i, s)| (at(i), s.mean)).collect();
    let name = format!("one deviation over {}", counted(runs.len(), "run"));
    Ok((
        "Energy of each frame over repeated runs",
        ("frame", ""),
        ("energy", "J"),
        vec![series(&name, PlotMark::Band(band)), series("mean", PlotMark::Line(mean))],
    ))
}

/// Arguments of `trace pareto`.
#[derive(Clone, Debug, Args)]
#[command(
    after_help = "Example:\n  quintile trace pareto results.csv --time time_ms --energy energy_mJ --label algorithm --group scene --group msaa --idle-w 14 --out pareto.svg"
)]
pub struct ParetoArgs {
    /// A table with a row for each setting: CSV, TSV or Parquet; `-` reads standard input
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
    /// Idle power that the faster of two is charged for the time it saves, in W
    #[arg(long, value_name = "W", default_value = "0", allow_hyphen_values = true, value_parser = size_of_power)]
    pub idle_w: f64,
    /// Seed of the draws for probabilities
    #[arg(long, value_name = "N", default_value_t = 1, allow_negative_numbers = true, value_parser = crate::cli::parse::seed)]
    pub seed: u64,
    /// Quantity of the plot over time: energy, or mean power as Paper IV does
    #[arg(long, value_enum, default_value_t)]
    pub show: ParetoShow,
    /// File for a plot (.svg, .png, .pdf) or a table (.csv); `-` prints the table as CSV and nothing else
    #[arg(long, value_name = "FILE")]
    pub out: Option<PathBuf>,
    /// Print as JSON and nothing else
    #[arg(long)]
    pub json: bool,
    /// Style of pictures.
    #[command(flatten)]
    pub plot_style: PlotStyleArgs,
}

/// Quantity that a plot of frontiers shows over time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum ParetoShow {
    /// Energy
    #[default]
    Energy,
    /// Energy by time (Paper IV, Figures 7 to 9)
    Power,
}

type Groups = BTreeMap<String, Vec<RatedPoint>>;

pub(super) fn pareto(args: &ParetoArgs, piped: bool, terminal: &Terminal) -> Result<(), Failure> {
    may_hold_results("--out", args.out.as_deref(), [args.table.as_path()])?;
    let table = InputTable::read(&args.table)?;
    let groups = frontiers(&table, &args.columns(), args.idle_w, args.seed)?;
    if let Some(out) = &args.out {
        if out.extension().is_some_and(|end| end.eq_ignore_ascii_case("csv")) {
            write_file(out, |file| write_csv(&groups, file))?;
        } else {
            let subject = format!("{} - idle power charged: {} W", name_of(&args.table), args.idle_w);
            write_picture(
                &picture(&subject, args.show, &args.plot_style, &groups),
                out,
                PlotFormat::of(out)?,
            )?;
        }
    }
    if args.json {
        print_json(&json!({ "idle_W": args.idle_w, "groups": groups }), true)
    } else {
        report(&text(&groups), piped, terminal)
    }
}

impl ParetoArgs {
    fn columns(&self) -> SettingColumns {
        SettingColumns {
            time: self.time.clone(),
            energy: self.energy.clone(),
            time_deviation: self.time_sd.clone(),
            energy_deviation: self.energy_sd.clone(),
            label: self.label.clone(),
            groups: self.group.clone(),
        }
    }
}

fn text(groups: &Groups) -> String {
    let mut table = Table::new(["group", "setting", "time", "energy", "power", "frontier", "probability"]);
    for (group, settings) in groups {
        for s in settings {
            table.row([
                group.clone(),
                s.point.label.clone(),
                si_digits(s.point.time_s, "s", 4),
                si_digits(s.point.energy_j, "J", 4),
                si_digits(s.point.power_w(), "W", 4),
                if s.on_frontier { "yes" } else { "" }.to_owned(),
                format!("{:.3}", s.probability),
            ]);
        }
    }
    let trade = groups.values().filter(|s| s.iter().filter(|s| s.on_frontier).count() > 1).count();
    format!("{table}{trade} of {} groups have a trade-off", groups.len())
}

/// Where a setting stands in the plot, and its deviations.
fn place(show: ParetoShow, p: &ParetoPoint) -> (f64, f64, f64, f64) {
    match show {
        ParetoShow::Energy => (p.time_s, p.energy_j, p.time_deviation_s, p.energy_deviation_j),
        ParetoShow::Power => (p.time_s, p.power_w(), p.time_deviation_s, p.power_deviation_w()),
    }
}

/// All groups in one picture: points with their names and deviations, and each group's frontier as steps, as
/// between two settings there is none.
fn picture(subject: &str, show: ParetoShow, plot_style: &PlotStyleArgs, groups: &Groups) -> Picture {
    let place = |s: &RatedPoint| place(show, &s.point);
    let all = || groups.values().flatten();
    let of = |on: bool| {
        let chosen = all().filter(move |s| s.on_frontier == on);
        chosen.map(|s| (place(s).0, place(s).1, s.point.label.clone())).collect()
    };
    let mut series = Vec::new();
    let crosses: Vec<_> = all().map(place).filter(|(_, _, dx, dy)| *dx > 0.0 || *dy > 0.0).collect();
    for (x, y, dx, dy) in &crosses {
        let lines = vec![vec![(x - dx, *y), (x + dx, *y)], vec![(*x, y - dy), (*x, y + dy)]];
        series.push(Series::new("", PlotMark::Faint(lines)).painted(Paint::Ink));
    }
    if let Some(first) = series.first_mut() {
        first.name = "one standard deviation".to_owned();
    }
    for (number, (group, settings)) in groups.iter().enumerate() {
        let on = settings.iter().filter(|s| s.on_frontier);
        let mut steps: Vec<(f64, f64)> = on.map(|s| (place(s).0, place(s).1)).collect();
        steps.sort_by(|a, b| a.0.total_cmp(&b.0));
        if steps.len() > 1 {
            let name = if group.is_empty() { "frontier".to_owned() } else { group.clone() };
            series.push(Series::new(name, PlotMark::Steps(steps)).painted(Paint::Like(2 + number % 6)));
        }
    }
    series.push(Series::new("dominated", PlotMark::Rings(of(false))).painted(Paint::Like(0)));
    series.push(Series::new("on the frontier", PlotMark::Dots(of(true))).painted(Paint::Like(0)));
    let (title, y) = match show {
        ParetoShow::Energy => ("Time and energy", ("energy", "J")),
        ParetoShow::Power => ("Time and mean power", ("power", "W")),
    };
    let axes = [("time", "s"), y].map(|(name, unit)| AxisSpec::even(name, unit));
    Chart::new(title, subject, vec![ChartPanel::over("", axes, series)]).picture(&plot_style.plot_style())
}
