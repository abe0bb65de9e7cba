//! `quintile run`.

use std::time::Instant;

use serde::Serialize;
use workloads::job::OptionSource;

use super::Failure;
use super::args::RunArgs;
use super::terminal::{print, print_json};
use output::progress::Progress;
use output::table::{Table, count_or_digits, counted, si, si_mean_sd};
use output::terminal::{Terminal, Verbosity};
use output::{Destination, MeanSd};
use run::{DryRun, Outcome, Plan, Prepared, Requested, RunError, RunOptions, Summary, again, open, prepare};

/// The git revision of this program.
const REVISION: Option<&str> = option_env!("QUINTILE_REVISION");

pub(super) fn run(args: &RunArgs, terminal: &Terminal) -> Result<(), Failure> {
    let started = Instant::now();
    let progress = Progress::on(terminal, args.json);
    let out = Destination { folder: args.out.clone(), force: args.force };
    let pool = super::threads(args.threads)?;
    let (options, recorded) = match &args.again {
        Some(summary) => again(summary, args.force, REVISION)?,
        None => (options(args), None),
    };
    let plan = Plan::resolve(options)?;
    let dir = open(&plan, &out)?;
    let prepared = pool.install(|| prepare(plan, recorded, REVISION, &progress))?;
    if args.dry_run {
        return dry_run(args, &pool.install(|| DryRun::new(&prepared))?, terminal);
    }
    if !args.json && terminal.verbosity() > Verbosity::Quiet {
        pool.install(|| note_expected(&prepared, &progress))?;
    }
    let outcome = pool.install(|| prepared.run(dir, &progress))?;
    if args.json {
        let printed = Printed { out: args.out.display().to_string(), summary: &outcome.summary };
        return print_json(&printed, true);
    }
    outcome.summary.warnings.iter().for_each(|warning| terminal.warn(warning));
    print(&format!("{}took {:.1} s", text(args, &outcome), started.elapsed().as_secs_f64()))
}

/// Prints the expected time of a run.
fn note_expected(prepared: &Prepared, progress: &Progress) -> Result<(), RunError> {
    if prepared.is_worth_estimating() {
        progress.note(&format!("expected time: {}", prepared.expected()?.line()));
    }
    Ok(())
}

/// Prints a description of the run and the folder of results.
fn dry_run(args: &RunArgs, dry_run: &DryRun, terminal: &Terminal) -> Result<(), Failure> {
    if args.json {
        return print_json(dry_run, true);
    }
    dry_run.warnings.iter().for_each(|warning| terminal.warn(warning));
    let results = ("results", format!("would be written into {}; nothing was", args.out.display()));
    let rows = dry_run.rows().into_iter().chain([results]);
    print(&rows.map(|(name, value)| format!("{name:<9} {value}")).collect::<Vec<_>>().join("\n"))
}

fn options(args: &RunArgs) -> RunOptions {
    RunOptions {
        scene: args.scene.clone(),
        options: OptionSource { file: args.options.clone(), set: args.set.clone() },
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
        plot_style: args.look.look(),
    }
}

/// Summary with the folder it was written to.
#[derive(Serialize)]
struct Printed<'a> {
    out: String,
    #[serde(flatten)]
    summary: &'a Summary,
}

/// Text of a finished run for the terminal.
fn text(args: &RunArgs, outcome: &Outcome) -> String {
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
    lines.push(format!("results: {}", args.out.display()));
    lines.push(format!("report:  {}\n", args.out.join("report.html").display()));
    lines.join("\n")
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
    format!(
        "{} of {} frame starts found in the trace ({} false), worst timing error {}",
        detection.matched_frames,
        detection.true_frames,
        detection.found_frames - detection.matched_frames,
        detection.worst_timing_error_s.map_or("-".to_owned(), |error| si(error, "s")),
    )
}

/// Table of measured and true values, one row per quantity.
fn figures(outcome: &Outcome) -> Table {
    let mut table = Table::new(["", "measured in the trace", "simulator's truth"]);
    for row in outcome.summary.headline() {
        let cell = |number: Option<MeanSd>| number.map_or("-".to_owned(), |n| si_mean_sd(n, &row.unit));
        table.row([row.label.clone(), cell(row.measured), cell(row.truth)]);
    }
    table
}
