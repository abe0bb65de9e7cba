//! `quintile run`.

use std::path::{Path, PathBuf};
use std::time::Instant;

use activity::Event;
use activity::spec::suggestion;
use clap::builder::TypedValueParser;
use clap::parser::ValueSource;
use clap::{ArgMatches, Args, ValueEnum};
use output::table::{Table, count_or_digits, counted, si, si_mean_sd};
use output::terminal::{Progress, Terminal, Verbosity};
use output::{Destination, MeanSd};
use power_model::Bound;
use run::{
    Choice, DryRun, FinishedRun, HeatQuantity, HeatRequest, PacingChoice, Plan, Prepared, Requested,
    RunError, RunOptions, Sampling, Summary, again, open, prepare, refuse_beside_images,
};
use serde::Serialize;
use timing::Level;
use workloads::job::OptionSource;

use super::{Failure, json_text, lists, print};
use crate::cli::args::{PlotStyleArgs, SceneArgs, ThreadArgs};
use crate::cli::parse::{duration, named, percent, rate, setting, share_below_one};

/// Arguments of `run`.
#[derive(Debug, Args)]
#[command(
    after_help = "Example:\n  quintile run Fox.glb --clip Run --frames 0..60 --lens 2 --samples 16 --out fox\n  \
    quintile run Fox.glb --frames 0..300 --accuracy 2% --verify --out fox\n  \
    quintile run ccd --set resolution=64 --set bins=8 --out ccd\n\n\
    The chapter of a workload in the book lists its options and defaults; an unknown name after `--set` lists the known ones, or the nearest. Workloads \
    refuse flags without effect.\n\n\
    Results are in DIR: images/, report.html, summary.json, frames.csv, trace.parquet, trace.csv, plots/ and \
    timeline.perfetto-trace (open it at ui.perfetto.dev). They appear together when all are whole; results of an earlier run \
    are replaced then, and other files in DIR are left alone."
)]
pub struct RunArgs {
    /// A built-in scene or a workload (see `quintile list`), or a .ron, .gltf, .glb, .obj, .ply, .off or .stl file
    #[arg(default_value = "default", value_name = "SCENE|WORKLOAD|FILE")]
    pub scene: PathBuf,
    /// Repeat the run that wrote this summary.json, to the same bytes;
    /// only --out, --force, --threads, --dry-run, --json and the options of messages can be added. Refused if
    /// the program version or an input differs, unless with --force
    #[arg(long, value_name = "SUMMARY", conflicts_with_all = SETTINGS)]
    pub again: Option<PathBuf>,
    /// Options of a workload in a .ron file
    #[arg(long, value_name = "FILE.ron")]
    pub options: Option<PathBuf>,
    /// An option of a workload (bins=8, or workload.bins=8), a value in the file of GPU, platform, energy
    /// table or scene (gpu.pipeline.tile_px=8), or, where a scene is run, an option of the run as sweep files
    /// name it (timing=bound); may be given several times, and overrides others. With several values, as
    /// tile_px=4,8, each has a run in a folder of its own below DIR, and a table compares them
    #[arg(long, value_name = "NAME=VALUE[,VALUE...]", value_parser = setting)]
    pub set: Vec<(String, String)>,
    /// Folder for the results; created if missing
    #[arg(long, value_name = "DIR", default_value = "out")]
    pub out: PathBuf,
    /// Overwrite files in DIR that Quintile did not write; with --again, repeat although the program or an
    /// input differs
    #[arg(long)]
    pub force: bool,
    /// Changes to the scene
    #[command(flatten)]
    pub view: SceneArgs,
    /// A built-in GPU or a .ron file; its file names the platform and the energy table that belong to it (see
    /// `quintile list`)
    #[arg(long, value_name = "NAME|FILE", default_value = "reference")]
    pub gpu: PathBuf,
    /// A built-in platform or a .ron file [default: the GPU's own]
    #[arg(long, value_name = "NAME|FILE")]
    pub platform: Option<PathBuf>,
    /// A built-in energy table or a .ron file [default: the GPU's own]
    #[arg(long, value_name = "NAME|FILE")]
    pub energy: Option<PathBuf>,
    /// Which values of the energy table to use
    #[arg(long, value_name = "BOUND", default_value = "nominal", value_parser = bound())]
    pub bound: Bound,
    /// Timing level; `quintile chart timing` shows its accuracy
    #[arg(long, value_enum, default_value_t)]
    pub timing: TimingChoice,
    /// Let a probe choose level, frames and dimensions so that the error of cycles and energy is at most
    /// this, for example 2%
    #[arg(long, value_name = "P%", value_parser = percent, conflicts_with = "timing", allow_hyphen_values = true)]
    pub accuracy: Option<f64>,
    /// Let a probe choose the most accurate options with which frames take no longer than this, for example 30s,
    /// 500ms or 2min; the probe and the files written come on top
    #[arg(long, value_name = "T", value_parser = duration, conflicts_with = "timing", allow_hyphen_values = true)]
    pub budget: Option<f64>,
    /// Simulate every frame at the reference as well, and report the actual error
    #[arg(long)]
    pub verify: bool,
    /// When the next frame starts
    #[arg(long, value_name = "PACING", default_value = "vsync", value_parser = pacing())]
    pub pacing: PacingChoice,
    /// Samples per second of the recorder, 1 to 10 million: a number in Hz, or with its unit, such as 50kHz
    /// or 1MHz [default: 50kHz, or up to 1MHz where the shortest frame is busy for less than two samples or
    /// lasts for fewer than fifty]
    #[arg(long, value_name = "HZ", allow_hyphen_values = true, value_parser = rate)]
    pub trace_rate: Option<f64>,
    /// Samples in one packet of the recorder; a packet is lost as a whole
    #[arg(long, value_name = "N", default_value_t = 512, value_parser = clap::value_parser!(u32).range(1..=i64::from(traces::device::MAX_PACKET_SAMPLES)))]
    pub packet_samples: u32,
    /// Share of packets that are lost, 0 to below 1: gaps in trace.parquet
    #[arg(long, value_name = "SHARE", default_value_t = 0.0, allow_hyphen_values = true, value_parser = share_below_one)]
    pub packet_loss: f64,
    /// Seed of samples, noise and packet losses
    #[arg(long, value_name = "N", default_value_t = 1, allow_negative_numbers = true, value_parser = crate::cli::parse::seed)]
    pub seed: u64,
    /// Also write every frame as EXR (linear light)
    #[arg(long)]
    pub exr: bool,
    /// Write heat maps of a counter, or of the energy of all counters (joules), as PNG, EXR and CSV in heat/;
    /// with @PASS those of the passes of that name alone; may be given several times
    #[arg(long, value_name = "(COUNTER|joules)[@PASS]", value_parser = heat)]
    pub heat: Vec<HeatRequest>,
    /// Worker threads.
    #[command(flatten)]
    pub threads: ThreadArgs,
    /// Print what the run would do, with the expected time, and stop before anything is simulated or written
    #[arg(long)]
    pub dry_run: bool,
    /// Print only summary.json to standard output; a list of them where --set has lists
    #[arg(long)]
    pub json: bool,
    /// Style of pictures.
    #[command(flatten)]
    pub plot_style: PlotStyleArgs,
}

/// Value of `--timing`: a timing level for every frame, or sampled simulation.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum TimingChoice {
    /// Every unit from cycle to cycle: the reference, slow
    Stepped,
    /// A recurrence over packets
    #[default]
    Packet,
    /// The busiest unit of each batch, fill and drain
    Bound,
    /// One frame in fifty at `packet`, the others predicted from a preview, with intervals
    Sampled,
    /// Images alone, drawn about three times as fast: no counts, cycles and joules
    None,
}

impl TimingChoice {
    /// Timing level of the simulated frames, if they are timed.
    pub const fn level(self) -> Option<Level> {
        match self {
            Self::Stepped => Some(Level::Stepped),
            Self::Packet | Self::Sampled => Some(Level::Packet),
            Self::Bound => Some(Level::Bound),
            Self::None => None,
        }
    }

    /// Which frames are simulated.
    pub const fn sampling(self) -> Sampling {
        match self {
            Self::Sampled => Sampling::Some,
            _ => Sampling::Every,
        }
    }
}

/// Arguments that `--again` takes from the summary.
const SETTINGS: [&str; 31] = [
    "scene",
    "options",
    "set",
    "frames",
    "samples",
    "table",
    "size",
    "rate",
    "lens",
    "focus",
    "shutter",
    "clip",
    "camera",
    "gpu",
    "platform",
    "energy",
    "bound",
    "timing",
    "accuracy",
    "budget",
    "verify",
    "pacing",
    "trace_rate",
    "packet_samples",
    "packet_loss",
    "seed",
    "exr",
    "heat",
    "width",
    "title",
    "font_size",
];

/// Parser of `--bound`: the name of a column of the energy table.
pub(super) fn bound() -> impl TypedValueParser<Value = Bound> {
    named([
        (Bound::Low, "low", "The lowest that sources support"),
        (Bound::Nominal, "nominal", "The most likely"),
        (Bound::High, "high", "The highest that sources support"),
    ])
}

/// Parser of `--pacing`.
pub(super) fn pacing() -> impl TypedValueParser<Value = PacingChoice> {
    named([
        (PacingChoice::Vsync, PacingChoice::Vsync.name(), "On the next tick of the display"),
        (PacingChoice::Free, PacingChoice::Free.name(), "As soon as the previous frame is done"),
    ])
}

/// Refuses options without effect on images alone that are given with their default values; others are
/// refused with the plan.
pub(super) fn check_given(matches: &ArgMatches) -> Result<(), RunError> {
    if matches.get_one::<TimingChoice>("timing") != Some(&TimingChoice::None) {
        return Ok(());
    }
    let given = ["bound", "pacing", "packet_samples", "packet_loss"]
        .into_iter()
        .filter(|id| matches.value_source(id) == Some(ValueSource::CommandLine));
    refuse_beside_images(&given.map(|id| format!("--{}", id.replace('_', "-"))).collect::<Vec<_>>())
}

/// Parser of `--heat`: energy, or a counter that has a position in the image; of all passes or those of a name.
fn heat(text: &str) -> Result<HeatRequest, String> {
    if let Ok(known) = HeatRequest::try_from(text.to_owned()) {
        return Ok(known);
    }
    let (text, _) = HeatRequest::split(text);
    if Event::from_name(text).is_some() {
        return Err(format!(
            "`{text}` is counted before it is known where in the image; samples_tested is not"
        ));
    }
    let known: Vec<&str> = HeatQuantity::all().map(HeatQuantity::name).collect();
    Err(format!("unknown counter `{text}`; {}", suggestion(text, &known)))
}

/// The git revision of this program.
pub(super) const REVISION: Option<&str> = option_env!("QUINTILE_REVISION");

pub(super) fn run(args: &RunArgs, terminal: &Terminal) -> Result<(), Failure> {
    if let Some(summary) = &args.again {
        let (options, recorded) = again(summary, args.force, REVISION)?;
        let mut json = Vec::new();
        one(args, terminal, (options, recorded), (&args.out, &mut json))?;
        return json.first().map_or(Ok(()), |text| print(text));
    }
    one_gpu(&args.gpu)?;
    let listed = lists::runs(&options(args), &args.set, &args.out)?;
    let is_alone = listed.iter().all(|run| run.varied.is_empty());
    if !is_alone {
        // Wrong values and folders are refused before the first of several runs.
        listed.iter().try_for_each(|run| {
            let plan = Plan::resolve(run.options.clone())?;
            open(&plan, &Destination { folder: run.out.clone(), force: args.force }).map(drop)
        })?;
    }
    let (mut done, mut json) = (Vec::new(), Vec::new());
    for run in listed {
        let summary = one(args, terminal, (run.options.clone(), None), (&run.out, &mut json))?;
        done.extend(summary.map(|summary| (run, summary)));
    }
    match (args.json, is_alone) {
        (true, true) => json.first().map_or(Ok(()), |text| print(text)),
        (true, false) => print(&format!("[\n{}\n]", json.join(",\n"))),
        (false, false) if !done.is_empty() => print(&lists::table(&done).to_string()),
        (false, _) => Ok(()),
    }
}

/// Refuses several GPUs in one value.
pub(super) fn one_gpu(gpu: &Path) -> Result<(), Failure> {
    match gpu.to_string_lossy() {
        several if several.contains(',') && !gpu.exists() => {
            let message = format!(
                "--gpu {several}: it takes one GPU; give several to --set gpu={several} of `quintile run SCENE`, or as an axis of \
                 `quintile sweep`"
            );
            Err(Failure { message, code: 2 })
        }
        _ => Ok(()),
    }
}

/// Runs with `options` into `out`, and prints its results, or adds them to `json`; returns the summary,
/// unless it is a dry run.
fn one(
    args: &RunArgs,
    terminal: &Terminal,
    (options, recorded): (RunOptions, Option<Choice>),
    (out, json): (&Path, &mut Vec<String>),
) -> Result<Option<Summary>, Failure> {
    let started = Instant::now();
    let progress = Progress::on(terminal, args.json);
    let destination = Destination { folder: out.to_owned(), force: args.force };
    let pool = args.threads.pool()?;
    let plan = Plan::resolve(options)?;
    let dir = open(&plan, &destination)?;
    let is_timed = plan.options.timing.is_some();
    let prepared = pool.install(|| prepare(plan, recorded, REVISION, &progress))?;
    if !is_timed && !args.dry_run {
        let summary = pool.install(|| prepared.draw(dir, &progress))?;
        if args.json {
            json.push(json_text(&Printed { out: out.display().to_string(), summary: &summary }, true)?);
        } else {
            summary.warnings.iter().for_each(|warning| terminal.warn(warning));
            print(&with_results(summary.lines(), out, started))?;
        }
        return Ok(None);
    }
    if args.dry_run {
        let dry_run = pool.install(|| DryRun::new(&prepared))?;
        match args.json {
            true => json.push(json_text(&dry_run, true)?),
            false => print_dry_run(out, &dry_run, terminal)?,
        }
        return Ok(None);
    }
    if !args.json && terminal.verbosity() > Verbosity::Quiet {
        pool.install(|| note_expected(&prepared, &progress))?;
    }
    let outcome = pool.install(|| prepared.run(dir, &progress))?;
    if args.json {
        json.push(json_text(&Printed { out: out.display().to_string(), summary: &outcome.summary }, true)?);
    } else {
        outcome.summary.warnings.iter().for_each(|warning| terminal.warn(warning));
        print(&with_results(text(&outcome), out, started))?;
    }
    Ok(Some(outcome.summary))
}

/// Prints the expected time of a run.
fn note_expected(prepared: &Prepared, progress: &Progress) -> Result<(), RunError> {
    if prepared.is_worth_estimating() {
        progress.note(&format!("expected time: {}", prepared.expected()?.line()));
    }
    Ok(())
}

/// Prints a description of the run and the folder of results.
fn print_dry_run(out: &Path, dry_run: &DryRun, terminal: &Terminal) -> Result<(), Failure> {
    dry_run.warnings.iter().for_each(|warning| terminal.warn(warning));
    let results = ("results", format!("would be written into {}; nothing was", out.display()));
    let rows = dry_run.rows().into_iter().chain([results]);
    print(&rows.map(|(name, value)| format!("{name:<9} {value}")).collect::<Vec<_>>().join("\n"))
}

/// Options without those of `--set`.
fn options(args: &RunArgs) -> RunOptions {
    RunOptions {
        scene: args.scene.clone(),
        options: OptionSource { file: args.options.clone(), set: Vec::new() },
        changes: Vec::new(),
        overrides: args.view.overrides(),
        gpu: args.gpu.clone(),
        platform: args.platform.clone(),
        energy: args.energy.clone(),
        bound: args.bound,
        timing: args.timing.level(),
        sampling: args.timing.sampling(),
        requested: Requested { accuracy: args.accuracy, budget_s: args.budget },
        verify: args.verify,
        pacing: args.pacing,
        trace_rate_hz: args.trace_rate,
        packet_samples: args.packet_samples,
        packet_loss: args.packet_loss,
        seed: args.seed,
        exr: args.exr,
        heat: args.heat.clone(),
        plot_style: args.plot_style.plot_style(),
    }
}

/// Summary with the folder it was written to.
#[derive(Serialize)]
struct Printed<'a, S> {
    out: String,
    #[serde(flatten)]
    summary: &'a S,
}

/// Lines with the places of the results and the time they took.
fn with_results(lines: Vec<String>, out: &Path, started: Instant) -> String {
    let places = [
        format!("results: {}", out.display()),
        format!("report:  {}", out.join("report.html").display()),
        format!("took {:.1} s", started.elapsed().as_secs_f64()),
    ];
    lines.into_iter().chain(places).collect::<Vec<_>>().join("\n")
}

/// Text of a finished run for the terminal.
fn text(outcome: &FinishedRun) -> Vec<String> {
    let (summary, settings) = (&outcome.summary, &outcome.summary.settings);
    let mut lines = vec![
        format!(
            "{} on {}, {}x{}, {} per pixel, {}, {}",
            summary.scene,
            summary.gpu,
            settings.width,
            settings.height,
            counted(settings.samples as usize, "sample"),
            counted(settings.frames as usize, "frame"),
            counted(settings.triangles, "triangle")
        ),
        format!("modelled: {}", summary.modelled.line()),
        accuracy_lines(summary),
        figures(outcome).to_string(),
        found(summary),
    ];
    lines.extend(summary.recorder.raised_line());
    if let Some(efficiency) = summary.sample_test_efficiency {
        lines.push(format!("sample test efficiency {:.1} %", efficiency * 100.0));
    }
    lines.extend(summary.facts.iter().map(|(name, value)| format!("{name}: {}", count_or_digits(*value))));
    lines
}

/// One line each for the choice, the predicted intervals and the actual errors.
fn accuracy_lines(summary: &Summary) -> String {
    let lines = summary.accuracy_rows().into_iter().map(|(name, value)| format!("{name}: {value}\n"));
    lines.collect()
}

fn found(summary: &Summary) -> String {
    let detection = &summary.detection;
    if summary.measured.is_none() {
        return "no frame but the marked one was found in the trace: nothing is measured by frame".to_owned();
    }
    if detection.true_frames == 1 && detection.found_frames == 1 {
        return "1 frame, whose start is marked in the trace".to_owned();
    }
    format!(
        "{} of {} frame starts found in the trace ({} false), worst timing error {}",
        detection.matched_frames,
        detection.true_frames,
        detection.found_frames - detection.matched_frames,
        detection.worst_timing_error_s.map_or("-".to_owned(), |error| si(error, "s")),
    )
}

/// Table of measured and true values, one row per quantity.
fn figures(outcome: &FinishedRun) -> Table {
    let mut table = Table::new(["", "measured in the trace", "simulator's truth"]);
    for row in outcome.summary.headline() {
        let cell = |number: Option<MeanSd>| number.map_or("-".to_owned(), |n| si_mean_sd(n, &row.unit));
        table.row([row.label.clone(), cell(row.measured), cell(row.truth)]);
    }
    table
}

#[cfg(test)]
mod tests {
    use clap::{Args as _, Command};

    use super::*;

    #[test]
    fn again_takes_every_setting_from_the_summary() {
        let command = RunArgs::augment_args(Command::new("run"));
        let beside = ["again", "out", "force", "dry_run", "threads", "json"];
        for argument in command.get_arguments().map(|argument| argument.get_id().as_str()) {
            assert!(SETTINGS.contains(&argument) != beside.contains(&argument), "{argument}");
        }
    }
}
