//! `quintile run`.

use std::time::Instant;

use power_model::Bound;
use serde::Serialize;
use workloads::Overrides;
use workloads::job::OptionSource;

use super::Failure;
use super::args::{BoundArg, PacingArg, RunArgs};
use super::terminal::{print, print_json};
use crate::output::MeanSd;
use crate::output::progress::Progress;
use crate::output::table::{Table, digits, si, si_mean_sd};
use crate::run::{Detection, Outcome, PacingChoice, RunOptions, Summary, Wish};

pub(super) fn run(args: &RunArgs) -> Result<(), Failure> {
    let started = Instant::now();
    let progress = Progress::new(args.json);
    let pool = super::threads(args.threads)?;
    let outcome = pool.install(|| crate::run::run(options(args), &args.out, &progress))?;
    if args.json {
        let printed = Printed { out: args.out.display().to_string(), summary: &outcome.summary };
        return print_json(&printed, true);
    }
    print(&format!("{}took {:.1} s", text(args, &outcome), started.elapsed().as_secs_f64()))
}

fn options(args: &RunArgs) -> RunOptions {
    RunOptions {
        scene: args.scene.clone(),
        options: OptionSource { file: args.options.clone(), set: args.set.clone() },
        overrides: Overrides {
            size: args.size,
            samples: args.samples,
            frame_rate_hz: args.rate,
            shutter: args.shutter,
            frames: args.frames.clone(),
            lens_radius: args.lens,
            focus: args.focus,
            clip: args.clip.clone(),
            table: args.table.clone(),
        },
        gpu: args.gpu.clone(),
        platform: args.platform.clone(),
        energy: args.energy.clone(),
        bound: match args.bound {
            BoundArg::Low => Bound::Low,
            BoundArg::Nominal => Bound::Nominal,
            BoundArg::High => Bound::High,
        },
        timing: args.timing.level(),
        sampling: args.timing.sampling(),
        wish: Wish { accuracy: args.accuracy, budget_s: args.budget },
        verify: args.verify,
        pacing: match args.pacing {
            PacingArg::Vsync => PacingChoice::Vsync,
            PacingArg::Free => PacingChoice::Free,
        },
        trace_rate_hz: args.trace_rate,
        packet_samples: args.packet_samples,
        packet_loss: args.packet_loss,
        seed: args.seed,
        exr: args.exr,
        heat: args.heat.clone(),
    }
}

/// The summary with the folder it was written to.
#[derive(Serialize)]
struct Printed<'a> {
    out: String,
    #[serde(flatten)]
    summary: &'a Summary,
}

/// What a run says on a terminal.
fn text(args: &RunArgs, outcome: &Outcome) -> String {
    let (summary, settings) = (&outcome.summary, &outcome.summary.settings);
    let mut lines = vec![
        format!(
            "{} on {}, {}x{}, {} samples per pixel, {} frames, {} triangles",
            summary.scene,
            summary.gpu,
            settings.width,
            settings.height,
            settings.samples,
            settings.frames,
            settings.triangles
        ),
        format!("modelled: {}", summary.modelled.line()),
        judged(summary),
        figures(outcome).to_string(),
        found(&summary.detection),
    ];
    if let Some(efficiency) = summary.sample_test_efficiency {
        lines.push(format!("sample test efficiency {:.1} %", efficiency * 100.0));
    }
    lines.extend(summary.facts.iter().map(|(name, value)| format!("{name}: {}", digits(*value))));
    lines.extend(summary.warnings.iter().map(|warning| format!("warning: {warning}")));
    lines.push(format!("results: {}", args.out.display()));
    lines.push(format!("report:  {}\n", args.out.join("report.html").display()));
    lines.join("\n")
}

/// What was chosen, predicted and verified; a line each.
fn judged(summary: &Summary) -> String {
    let lines = summary.judgement().into_iter().map(|(name, value)| format!("{name}: {value}\n"));
    lines.collect()
}

fn found(detection: &Detection) -> String {
    format!(
        "{} of {} frame starts found in the trace ({} false), worst timing error {}",
        detection.matched_frames,
        detection.true_frames,
        detection.found_frames - detection.matched_frames,
        detection.worst_timing_error_s.map_or("-".to_owned(), |error| si(error, "s")),
    )
}

/// Measured beside true, a row for each quantity.
fn figures(outcome: &Outcome) -> Table {
    let mut table = Table::new(["", "measured in the trace", "simulator's truth"]);
    for row in outcome.summary.headline() {
        let cell = |number: Option<MeanSd>| number.map_or("-".to_owned(), |n| si_mean_sd(n, &row.unit));
        table.row([row.label.clone(), cell(row.measured), cell(row.truth)]);
    }
    table
}
