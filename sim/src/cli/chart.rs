//! `quintile chart`.

use std::time::Instant;

use super::Failure;
use super::args::{ChartArg, ChartArgs};
use super::terminal::{print, print_json};
use crate::chart::ChartError;
use crate::chart::sampling::{self, Effort, SamplingChart};
use crate::chart::tile_tests::tile_tests;
use crate::chart::timing::timing;
use crate::chart::{frames, growth, sampled};
use crate::output::OutDir;
use crate::output::progress::Progress;
use crate::output::table::Table;
use crate::run::RunError;

impl From<ChartError> for Failure {
    fn from(error: ChartError) -> Self {
        Self { message: error.to_string(), code: 1 }
    }
}

pub(super) fn run(args: &ChartArgs) -> Result<(), Failure> {
    let pool = super::threads(args.threads)?;
    let progress = Progress::new(args.json);
    if !args.scene.is_empty()
        && !matches!(args.chart, ChartArg::Sampled | ChartArg::TileTests | ChartArg::Timing)
    {
        let message =
            "--scene goes with `chart sampled`, `chart tile-tests` and `chart timing`; leave it out"
                .to_owned();
        return Err(Failure { message, code: 2 });
    }
    match args.chart {
        ChartArg::Frames => pool.install(|| chart_frames(args, &progress)),
        ChartArg::Growth => pool.install(|| chart_growth(args, &progress)),
        ChartArg::Sampled => pool.install(|| chart_sampled(args, &progress)),
        ChartArg::Sampling => pool.install(|| chart_sampling(args, &progress)),
        ChartArg::TileTests => pool.install(|| chart_tile_tests(args, &progress)),
        ChartArg::Timing => pool.install(|| chart_timing(args, &progress)),
    }
}

fn chart_frames(args: &ChartArgs, progress: &Progress) -> Result<(), Failure> {
    let started = Instant::now();
    let effort = if args.quick { frames::Effort::QUICK } else { frames::Effort::FULL };
    let chart = frames::chart(effort, &args.out, progress)?;
    if args.json {
        return print_json(&chart, true);
    }
    let took_s = started.elapsed().as_secs_f64();
    let (table, below, out) = (chart.text(), frames::FAILS_BELOW, args.out.display());
    print(&format!(
        "{table}*: mean F1 below {below}; in brackets how many scenes are below\nresults: {out}\ntook {took_s:.1} s"
    ))
}

fn chart_growth(args: &ChartArgs, progress: &Progress) -> Result<(), Failure> {
    let effort = if args.quick { growth::Effort::QUICK } else { growth::Effort::FULL };
    let chart = growth::chart(effort, &args.out, progress)?;
    if args.json { print_json(&chart, true) } else { print(&chart.text()) }
}

fn chart_sampling(args: &ChartArgs, progress: &Progress) -> Result<(), Failure> {
    let started = Instant::now();
    let effort = if args.quick { Effort::QUICK } else { Effort::FULL };
    let chart = sampling::chart(effort, &args.out, progress)?;
    if args.json {
        return print_json(&chart, true);
    }
    let took_s = started.elapsed().as_secs_f64();
    print(&format!("{}results: {}\ntook {took_s:.1} s", text(&chart), args.out.display()))
}

fn chart_sampled(args: &ChartArgs, progress: &Progress) -> Result<(), Failure> {
    let effort = if args.quick { sampled::Effort::QUICK } else { sampled::Effort::FULL };
    let chart = sampled::sampled(&args.scene, effort, progress)?;
    let dir = OutDir::create(&args.out).map_err(RunError::from)?;
    chart.write(&dir).map_err(RunError::from)?;
    if args.json {
        return print_json(&chart, true);
    }
    print(&format!("{}\n{}results: {}", chart.text(), chart.cost_text(), args.out.display()))
}

fn chart_tile_tests(args: &ChartArgs, progress: &Progress) -> Result<(), Failure> {
    let chart = tile_tests(&args.scene, args.quick, progress)?;
    if args.json {
        print_json(&chart, true)?
    } else {
        print(&chart.text())?
    }
    let dir = OutDir::create(&args.out).map_err(RunError::from)?;
    chart.write(dir).map_err(RunError::from)?;
    let lost = chart.samples_lost();
    let message = format!("{lost} samples were lost: a test is not conservative; please report it");
    if lost == 0 { Ok(()) } else { Err(Failure { message, code: 1 }) }
}

fn chart_timing(args: &ChartArgs, progress: &Progress) -> Result<(), Failure> {
    let started = Instant::now();
    let chart = timing(&args.scene, args.quick, progress)?;
    let dir = OutDir::create(&args.out).map_err(RunError::from)?;
    chart.write(&dir).map_err(RunError::from)?;
    if args.json {
        return print_json(&chart, true);
    }
    let speed = &chart.reference;
    print(&format!(
        "{}the reference: {:.1} million unit-cycles, {:.2} million cycles a second\nresults: {}\ntook {:.1} s",
        chart.text(),
        speed.unit_cycles_per_s / 1e6,
        speed.cycles_per_s / 1e6,
        args.out.display(),
        started.elapsed().as_secs_f64()
    ))
}

/// Exponents and errors, a row for each scene and table.
fn text(chart: &SamplingChart) -> Table {
    let most = format!("RMSE at {} samples", chart.effort.most_samples);
    let mut table = Table::new(["scene", "table", "exponent", "RMSE at 1 sample", &most, "seconds then"]);
    for row in chart.rows.iter().chain(&chart.failures.many_edges) {
        let (first, last) = (row.points.first(), row.points.last());
        let rmse =
            |point: Option<&sampling::Point>| point.map_or("-".to_owned(), |p| format!("{:.5}", p.rmse));
        table.row([
            row.scene.to_owned(),
            row.table.to_owned(),
            row.exponent.map_or("-".to_owned(), |p| format!("{p:.2}")),
            rmse(first),
            rmse(last),
            last.map_or("-".to_owned(), |p| format!("{:.2}", p.host_s)),
        ]);
    }
    table
}
