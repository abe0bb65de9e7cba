//! `quintile run`.

use std::time::Instant;

use power_model::Bound;
use serde::Serialize;
use workloads::Overrides;

use super::Failure;
use super::args::{BoundArg, PacingArg, RunArgs};
use crate::output::MeanSd;
use crate::output::progress::Progress;
use crate::output::table::{Table, si, si_mean_sd};
use crate::run::{Outcome, PacingChoice, RunError, RunOptions, Summary};

impl From<RunError> for Failure {
    fn from(error: RunError) -> Self {
        Self { message: error.to_string(), code: if error.is_usage() { 2 } else { 1 } }
    }
}

pub(super) fn run(args: &RunArgs) -> Result<(), Failure> {
    let started = Instant::now();
    let progress = Progress::new(args.json);
    let threads = usize::from(args.threads.unwrap_or(0));
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
    let pool =
        pool.map_err(|error| Failure { message: format!("starting worker threads: {error}"), code: 1 })?;
    let outcome = pool.install(|| crate::run::run(options(args), &args.out, &progress))?;
    if args.json {
        return print_json(args, &outcome);
    }
    print_text(args, &outcome);
    println!("took {:.1} s", started.elapsed().as_secs_f64());
    Ok(())
}

fn options(args: &RunArgs) -> RunOptions {
    RunOptions {
        scene: args.scene.clone(),
        overrides: Overrides {
            size: args.size,
            samples: args.samples,
            frame_rate_hz: args.rate,
            shutter: args.shutter,
            frames: args.frames.clone(),
            lens_radius: args.lens,
            focus: args.focus,
            clip: args.clip.clone(),
        },
        gpu: args.gpu.clone(),
        platform: args.platform.clone(),
        energy: args.energy.clone(),
        bound: match args.bound {
            BoundArg::Low => Bound::Low,
            BoundArg::Nominal => Bound::Nominal,
            BoundArg::High => Bound::High,
        },
        pacing: match args.pacing {
            PacingArg::Vsync => PacingChoice::Vsync,
            PacingArg::Free => PacingChoice::Free,
        },
        trace_rate_hz: args.trace_rate,
        seed: args.seed,
        exr: args.exr,
    }
}

/// The summary with the folder it was written to.
#[derive(Serialize)]
struct Printed<'a> {
    out: String,
    #[serde(flatten)]
    summary: &'a Summary,
}

fn print_json(args: &RunArgs, outcome: &Outcome) -> Result<(), Failure> {
    let failed = |error: serde_json::Error| Failure { message: format!("printing JSON: {error}"), code: 1 };
    let printed = Printed { out: args.out.display().to_string(), summary: &outcome.summary };
    println!("{}", serde_json::to_string_pretty(&printed).map_err(failed)?);
    Ok(())
}

fn print_text(args: &RunArgs, outcome: &Outcome) {
    let summary = &outcome.summary;
    let settings = &summary.settings;
    println!(
        "{} on {}, {}x{}, {} samples per pixel, {} frames, {} triangles",
        summary.scene,
        summary.gpu,
        settings.width,
        settings.height,
        settings.samples,
        settings.frames,
        settings.triangles
    );
    println!("modelled: {}", summary.modelled.line());
    println!();
    print!("{}", figures(outcome));
    println!();
    let detection = &summary.detection;
    println!(
        "{} of {} frame starts found in the trace ({} false), worst timing error {}",
        detection.matched_frames,
        detection.true_frames,
        detection.found_frames - detection.matched_frames,
        detection.worst_timing_error_s.map_or("-".to_owned(), |error| si(error, "s")),
    );
    if let Some(efficiency) = summary.sample_test_efficiency {
        println!("sample test efficiency {:.1} %", efficiency * 100.0);
    }
    for warning in &summary.warnings {
        println!("warning: {warning}");
    }
    println!("results: {}", args.out.display());
    println!("report:  {}", args.out.join("report.html").display());
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
