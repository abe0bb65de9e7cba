//! `quintile chart`, `quintile stress` and `quintile reproduce`: studies, opened, made, written and printed.

use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::time::Instant;

use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use clap::error::{ContextKind, ContextValue};
use clap::{Arg, Args, Command};
use experiments::reproduce::{self, Paper, ReproduceOptions};
use experiments::stress::{StressChart, StressEffort, family_named};
use experiments::study::tradeoff::{self, Index, StudySection};
use experiments::study::{Done, Study, StudyEntry, StudyError, StudyRequest};
use experiments::{ALL, CHARTS, all};
use output::plot::PlotStyle;
use output::terminal::{Progress, Terminal};
use output::{Destination, OutDir, OutputError};
use run::RunError;
use serde_json::{Map, Value};

use super::{Failure, print, print_json};
use crate::cli::args::{PlotStyleArgs, ThreadArgs};
use crate::cli::parse::named;

/// Arguments of `stress`.
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  quintile stress slivers --out slivers\n\n\
    Results are in DIR: plots/, stress.csv and summary.json. Ends with 1 if any method loses a sample.")]
pub struct StressArgs {
    /// One family; all without it
    pub family: Option<String>,
    /// Folder for the results; created if missing
    #[arg(long, value_name = "DIR", default_value = "out/stress")]
    pub out: PathBuf,
    /// Overwrite files in DIR that Quintile did not write
    #[arg(long)]
    pub force: bool,
    /// Smaller images, fewer triangles
    #[arg(long)]
    pub quick: bool,
    /// Worker threads.
    #[command(flatten)]
    pub threads: ThreadArgs,
    /// Print summary.json to standard output and nothing else
    #[arg(long)]
    pub json: bool,
    /// Style of pictures.
    #[command(flatten)]
    pub plot_style: PlotStyleArgs,
}

/// Arguments of `chart`.
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  quintile chart sampling --quick --out charts\n\n\
    Results are in DIR: pictures as SVG and PNG, NAME.csv, NAME.json and NAME.md.")]
pub struct ChartArgs {
    /// Which chart
    #[arg(value_parser = ChartParser, value_name = "NAME")]
    pub chart: ChartArg,
    /// Another scene for `sampled`, `tile-tests` or `timing`, by name or file; may be given several times
    #[arg(long, value_name = "SCENE")]
    pub scene: Vec<String>,
    /// Seed of the GPUs of `stated-errors`, instead of its own
    #[arg(long, value_name = "N", value_parser = crate::cli::parse::seed)]
    pub seed: Option<u64>,
    /// Smaller images, fewer samples and a coarser reference: seconds for one chart instead of minutes,
    /// minutes for `all`
    #[arg(long)]
    pub quick: bool,
    /// Folder for the results; created if missing
    #[arg(long, value_name = "DIR", default_value = "out/charts")]
    pub out: PathBuf,
    /// Overwrite files in DIR that Quintile did not write
    #[arg(long)]
    pub force: bool,
    /// Worker threads.
    #[command(flatten)]
    pub threads: ThreadArgs,
    /// Print the numbers as JSON and nothing else
    #[arg(long)]
    pub json: bool,
    /// Style of pictures.
    #[command(flatten)]
    pub plot_style: PlotStyleArgs,
}

/// A chart, or all of them.
#[derive(Clone, Copy, Debug)]
pub enum ChartArg {
    /// Every chart and the failure catalogue.
    All,
    /// One chart.
    One(&'static StudyEntry),
}

/// Charts that had another name in 0.1.0: that name, and the name today. Errors suggest it.
const RENAMED: [(&str, &str); 3] =
    [("collision", "ccd"), ("shadows", "soft-shadows"), ("views", "multiview")];

/// Parser of the name of a chart.
#[derive(Clone, Debug)]
struct ChartParser;

impl ChartParser {
    /// The names, each with its line of help.
    fn names() -> impl Iterator<Item = PossibleValue> {
        let names = CHARTS.iter().map(|chart| (chart.name, chart.about));
        std::iter::once(ALL).chain(names).map(|(name, help)| PossibleValue::new(name).help(help))
    }
}

impl TypedValueParser for ChartParser {
    type Value = ChartArg;

    fn parse_ref(
        &self,
        command: &Command,
        argument: Option<&Arg>,
        value: &OsStr,
    ) -> Result<ChartArg, clap::Error> {
        let parsed = PossibleValuesParser::new(Self::names()).parse_ref(command, argument, value);
        let name = parsed.map_err(|mut error| {
            if let Some((_, today)) = RENAMED.iter().find(|(former, _)| value == *former) {
                error.insert(ContextKind::SuggestedValue, ContextValue::String((*today).to_owned()));
            }
            error
        })?;
        let chart = CHARTS.iter().find(|chart| chart.name == name);
        Ok(chart.map_or(ChartArg::All, ChartArg::One))
    }

    fn possible_values(&self) -> Option<Box<dyn Iterator<Item = PossibleValue> + '_>> {
        Some(Box::new(Self::names()))
    }
}

impl From<StudyError> for Failure {
    fn from(error: StudyError) -> Self {
        match error {
            StudyError::Output(error) => error.into(),
            StudyError::Run(error) => error.into(),
            error => Self { message: error.to_string(), code: 1 },
        }
    }
}

impl From<OutputError> for Failure {
    fn from(error: OutputError) -> Self {
        RunError::from(error).into()
    }
}

pub(super) fn run(args: &ChartArgs, terminal: &Terminal) -> Result<(), Failure> {
    let takes_scenes = !matches!(args.chart, ChartArg::One(chart) if !chart.takes_scenes);
    if !args.scene.is_empty() && !takes_scenes {
        let message = not_taken("--scene", |chart| chart.takes_scenes);
        return Err(Failure { message, code: 2 });
    }
    if args.seed.is_some() && matches!(args.chart, ChartArg::One(chart) if !chart.takes_seed) {
        return Err(Failure { message: not_taken("--seed", |chart| chart.takes_seed), code: 2 });
    }
    // What can be known to be wrong is reported before minutes of work.
    let out = Destination { folder: args.out.clone(), force: args.force };
    let mut dir = match args.chart {
        ChartArg::All => out.open(all().map(StudyEntry::claim).chain([tradeoff::claim()])),
        ChartArg::One(chart) => out.open([chart.claim()]),
    }?;
    for scene in &args.scene {
        workloads::load(scene).map_err(RunError::from)?;
    }
    let pool = args.threads.pool()?;
    let (plot_style, progress) = (args.plot_style.plot_style(), Progress::on(terminal, args.json));
    let make = |study: &StudyEntry, dir: &OutDir| {
        let ChartArgs { quick, ref scene, seed, .. } = *args;
        let request =
            StudyRequest { quick, scenes: scene, seed, dir, plot_style: &plot_style, progress: &progress };
        Ok(study.run(&request)?)
    };
    match args.chart {
        ChartArg::All => pool.install(|| run_all(args, &mut dir, &plot_style, make)),
        ChartArg::One(chart) => {
            let done = pool.install(|| make(chart, &dir))?;
            dir.publish()?;
            show(&done, args.json, &args.out)
        }
    }
}

/// Message about an option that goes with some charts alone.
fn not_taken(option: &str, takes: fn(&StudyEntry) -> bool) -> String {
    let takers = CHARTS.iter().filter(|chart| takes(chart)).map(|chart| format!("`{}`", chart.name));
    let mut takers: Vec<String> = std::iter::once("`chart all`".to_owned()).chain(takers).collect();
    let last = takers.pop().unwrap_or_default();
    format!("{option} goes with {} and {last}; leave it out", takers.join(", "))
}

/// Prints a study that is written.
fn show(done: &Done, json: bool, out: &Path) -> Result<(), Failure> {
    match json {
        true => print(&done.json)?,
        false => print(&format!("{}results: {}", done.text, out.display()))?,
    }
    done.fault.clone().map_or(Ok(()), |message| Err(Failure { message, code: 1 }))
}

/// Makes every study and the page; a broken promise of one does not keep the others.
fn run_all(
    args: &ChartArgs,
    dir: &mut OutDir,
    plot_style: &PlotStyle,
    make: impl Fn(&StudyEntry, &OutDir) -> Result<Done, Failure>,
) -> Result<(), Failure> {
    let (mut json, mut faults) = (Map::new(), Vec::new());
    let mut page = Index { command: command(args), ..Index::default() };
    for (at, study) in all().enumerate() {
        page.missing = all().skip(at + 1).map(|study| study.name.to_owned()).collect();
        if !args.json {
            print(&format!("{}:", study.name))?;
        }
        let started = Instant::now();
        let Done { text, json: found, tradeoff, fault } = make(study, dir)?;
        if !args.json {
            print(&text)?;
        }
        json.insert(study.name.to_owned(), serde_json::from_str(&found).unwrap_or(Value::Null));
        faults.extend(fault.map(|fault| format!("{}: {fault}", study.name)));
        let files = dir.publish()?;
        let (name, about) = (study.name.to_owned(), study.about.to_owned());
        let took_s = started.elapsed().as_secs_f64();
        page.sections
            .push(StudySection { name, about, text, took_s, ..StudySection::default() }.with_files(files));
        page.tradeoff.points.extend(tradeoff);
        // After each, so that what there is can be looked at while the next one runs.
        page.write(dir, plot_style).map_err(|error| Failure { message: error.to_string(), code: 1 })?;
        dir.publish()?;
    }
    match args.json {
        true => print_json(&Value::Object(json), true)?,
        false => print(&format!("results: {}", args.out.join("index.html").display()))?,
    }
    if faults.is_empty() { Ok(()) } else { Err(Failure { message: faults.join("; "), code: 1 }) }
}

/// The command as one would type it again.
fn command(args: &ChartArgs) -> String {
    let mut words = vec!["quintile chart all".to_owned()];
    words.extend(args.scene.iter().map(|scene| format!("--scene {scene}")));
    words.extend(args.seed.map(|seed| format!("--seed {seed}")));
    words.extend(args.quick.then(|| "--quick".to_owned()));
    words.push(format!("--out {}", args.out.display()));
    words.join(" ")
}

/// `quintile stress`: the failure catalogue, or one family of it.
pub(super) fn stress(args: &StressArgs, terminal: &Terminal) -> Result<(), Failure> {
    // The folder first: that it cannot be written is better known before the work than after it.
    let out = Destination { folder: args.out.clone(), force: args.force };
    let mut dir = out.open([StressChart::claim()])?;
    let pool = args.threads.pool()?;
    let progress = Progress::on(terminal, args.json);
    let only = args.family.as_deref().map(family_named).transpose()?;
    let effort = StressEffort { only, quick: args.quick };
    let report = pool.install(|| StressChart::measure(effort, &[], &progress))?;
    let done = Done::new(&report, &dir, &args.plot_style.plot_style())?;
    dir.publish()?;
    show(&done, args.json, &args.out)
}

/// Arguments of `reproduce`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  quintile reproduce III --quick --out claims\n  \
    quintile reproduce VI --row VI-13 --row VI-14\n  \
    quintile reproduce VI --row VI-1 --collision-data ccd\n\n\
    Each row of the paper is computed from scratch, by simulating, recording and analysing, and compared with what the paper \
    says, at every value of the settings that the paper leaves open. It holds at all of them, differs at all of them, depends \
    on them, or is not yet there because a part is missing. Rows of kind E have to hold exactly, N are numbers to be near, O \
    orders or signs that have to come out, F have figures. The settings are in sim/experiments/papers; every row names the SHA-256 \
    of its file, what was run, and what it does not exercise.\n\n\
    Results are in DIR: plots/ as SVG and PNG, reproduce_III.md and, last, reproduce_III.json with a list `rows`. Ends with 0 \
    if every row of kind E holds and every row ran something, otherwise with 1; one that is not yet there does not hold.")]
pub struct ReproduceArgs {
    /// Which paper
    #[arg(value_name = "PAPER", ignore_case = true, value_parser = named(Paper::ALL.map(|paper| (paper, paper.number(), paper.title()))))]
    pub paper: Paper,
    /// Fewer values, frames and repetitions: some minutes. Verdicts then say at how many of the settings they
    /// were reached
    #[arg(long)]
    pub quick: bool,
    /// Only this row, for example VI-13; may be given more than once
    #[arg(long, value_name = "ID")]
    pub row: Vec<String>,
    /// Settings in place of the committed ones; a copy of sim/experiments/papers/paper6.ron with other values
    #[arg(long, value_name = "FILE")]
    pub settings: Option<PathBuf>,
    /// Folder with public cases of collision detection for row VI-1 (*.mts.gz, queries/); without it none is
    /// run, and other rows refuse it
    #[arg(long, value_name = "DIR")]
    pub collision_data: Option<PathBuf>,
    /// Folder for the results; created if missing
    #[arg(long, value_name = "DIR", default_value = "out/reproduce")]
    pub out: PathBuf,
    /// Overwrite files in DIR that Quintile did not write, and a result of the paper with more rows or in full
    #[arg(long)]
    pub force: bool,
    /// Worker threads.
    #[command(flatten)]
    pub threads: ThreadArgs,
    /// Print only the JSON to standard output
    #[arg(long)]
    pub json: bool,
}

pub(super) fn reproduce(args: &ReproduceArgs, terminal: &Terminal) -> Result<(), Failure> {
    let started = Instant::now();
    let pool = args.threads.pool()?;
    let progress = Progress::on(terminal, args.json);
    let out = Destination { folder: args.out.clone(), force: args.force };
    let options = ReproduceOptions {
        quick: args.quick,
        rows: args.row.clone(),
        settings: args.settings.clone(),
        collision_data: args.collision_data.clone(),
    };
    let report = pool.install(|| reproduce::reproduce(args.paper, &options, &out, &progress))?;
    if args.json {
        print_json(&report, true)?;
    } else {
        let took_s = started.elapsed().as_secs_f64();
        print(&format!("{}results: {}\ntook {took_s:.1} s", report.text(), args.out.display()))?;
    }
    let failing = report.failing();
    if failing.is_empty() {
        return Ok(());
    }
    let message = format!(
        "rows of kind E that do not hold, or that ran nothing: {}; the table says why",
        failing.join(", ")
    );
    Err(Failure { message, code: 1 })
}
