//! `quintile chart`.

use std::time::Instant;

use clap::ValueEnum;
use serde::Serialize;

use super::Failure;
use super::args::{ChartArg, ChartArgs};
use super::terminal::{json_text, print};
use experiments::chart::ChartError;
use experiments::chart::sampling::{self, Effort, SamplingChart};
use experiments::chart::standing::{Standing, Standings};
use experiments::chart::{
    caustics, collision, frames, glossy, growth, index, occlusion, points, sampled, shadows, tile_tests,
    timing, views,
};
use output::progress::Progress;
use output::table::Table;
use output::terminal::Terminal;
use output::{Claim, Destination, OutDir, OutputError};
use run::RunError;

mod all;

impl From<ChartError> for Failure {
    fn from(error: ChartError) -> Self {
        match error {
            ChartError::Output(error) => error.into(),
            error => Self { message: error.to_string(), code: 1 },
        }
    }
}

impl From<OutputError> for Failure {
    fn from(error: OutputError) -> Self {
        RunError::from(error).into()
    }
}

/// The files that a chart may write, for each command that makes them.
fn claims(chart: ChartArg) -> Vec<Claim> {
    let claim = match chart {
        ChartArg::All => {
            let charts = ChartArg::value_variants().iter().filter(|&&chart| chart != ChartArg::All);
            let charts = charts.flat_map(|&chart| claims(chart));
            return charts.chain([experiments::stress::claim(), index::claim()]).collect();
        }
        ChartArg::Caustics => caustics::claim(),
        ChartArg::Collision => collision::claim(),
        ChartArg::Frames => frames::claim(),
        ChartArg::Glossy => glossy::claim(),
        ChartArg::Growth => growth::claim(),
        ChartArg::Occlusion => occlusion::claim(),
        ChartArg::Points => points::claim(),
        ChartArg::Sampled => sampled::claim(),
        ChartArg::Sampling => sampling::claim(),
        ChartArg::Shadows => shadows::claim(),
        ChartArg::TileTests => tile_tests::claim(),
        ChartArg::Timing => timing::claim(),
        ChartArg::Views => views::claim(),
    };
    vec![claim]
}

pub(super) fn run(args: &ChartArgs, terminal: &Terminal) -> Result<(), Failure> {
    let takes_scenes =
        matches!(args.chart, ChartArg::All | ChartArg::Sampled | ChartArg::TileTests | ChartArg::Timing);
    if !args.scene.is_empty() && !takes_scenes {
        let message =
            "--scene goes with `chart all`, `sampled`, `tile-tests` and `timing`; leave it out".to_owned();
        return Err(Failure { message, code: 2 });
    }
    // What can be known to be wrong is reported before minutes of work.
    let out = Destination { folder: args.out.clone(), force: args.force };
    let mut dir = out.open(claims(args.chart))?;
    for scene in &args.scene {
        workloads::load(scene).map_err(RunError::from)?;
    }
    let pool = super::threads(args.threads)?;
    let progress = Progress::on(terminal, args.json);
    if args.chart == ChartArg::All {
        return pool.install(|| all::run(args, &mut dir, &progress));
    }
    let done = pool.install(|| make(args.chart, args, &dir, &progress))?;
    dir.publish()?;
    match args.json {
        true => print(&done.json)?,
        false => print(&format!("{}results: {}", done.text, args.out.display()))?,
    }
    done.fault.map_or(Ok(()), |message| Err(Failure { message, code: 1 }))
}

/// A chart that is measured, drawn and written.
struct Done {
    /// Its table and what else is to be said of it, in whole lines.
    text: String,
    json: String,
    standings: Vec<Standing>,
    /// A promise that it found broken.
    fault: Option<String>,
}

impl Done {
    fn new(chart: &(impl Serialize + Standings), text: String) -> Result<Self, Failure> {
        Ok(Self { text, json: json_text(chart, true)?, standings: chart.standings(), fault: None })
    }
}

fn make(chart: ChartArg, args: &ChartArgs, dir: &OutDir, progress: &Progress) -> Result<Done, Failure> {
    match chart {
        ChartArg::All => Err(Failure { message: "`all` is no chart of its own".to_owned(), code: 1 }),
        ChartArg::Caustics => chart_caustics(args, dir, progress),
        ChartArg::Collision => chart_collision(args, dir, progress),
        ChartArg::Frames => chart_frames(args, dir, progress),
        ChartArg::Glossy => chart_glossy(args, dir, progress),
        ChartArg::Growth => chart_growth(args, dir, progress),
        ChartArg::Occlusion => chart_occlusion(args, dir, progress),
        ChartArg::Points => chart_points(args, dir, progress),
        ChartArg::Sampled => chart_sampled(args, dir, progress),
        ChartArg::Sampling => chart_sampling(args, dir, progress),
        ChartArg::Shadows => chart_shadows(args, dir, progress),
        ChartArg::TileTests => chart_tile_tests(args, dir, progress),
        ChartArg::Timing => chart_timing(args, dir, progress),
        ChartArg::Views => chart_views(args, dir, progress),
    }
}

fn chart_collision(args: &ChartArgs, dir: &OutDir, progress: &Progress) -> Result<Done, Failure> {
    let effort = if args.quick { collision::Effort::QUICK } else { collision::Effort::FULL };
    let chart = collision::chart(effort, dir, &args.look.look(), progress)?;
    let missed = chart.missed();
    let fault = format!("{missed} pairs that collide were not kept: a bound does not hold; please report it");
    Ok(Done { fault: (missed > 0).then_some(fault), ..Done::new(&chart, chart.text())? })
}

fn chart_caustics(args: &ChartArgs, dir: &OutDir, progress: &Progress) -> Result<Done, Failure> {
    let effort = if args.quick { caustics::Effort::QUICK } else { caustics::Effort::FULL };
    let chart = caustics::chart(effort, dir, &args.look.look(), progress)?;
    let (text, fault) = (chart.text(), chart.fault());
    Ok(Done { text, json: json_text(&chart, true)?, standings: Vec::new(), fault })
}

fn chart_occlusion(args: &ChartArgs, dir: &OutDir, progress: &Progress) -> Result<Done, Failure> {
    let effort = if args.quick { occlusion::Effort::QUICK } else { occlusion::Effort::FULL };
    let chart = occlusion::chart(effort, dir, &args.look.look(), progress)?;
    let (text, fault) = (chart.text(), chart.fault());
    Ok(Done { text, json: json_text(&chart, true)?, standings: Vec::new(), fault })
}

fn chart_frames(args: &ChartArgs, dir: &OutDir, progress: &Progress) -> Result<Done, Failure> {
    let started = Instant::now();
    let effort = if args.quick { frames::Effort::QUICK } else { frames::Effort::FULL };
    let chart = frames::chart(effort, dir, &args.look.look(), progress)?;
    let (table, below, took_s) = (chart.text(), frames::FAILS_BELOW, started.elapsed().as_secs_f64());
    let text = format!(
        "{table}*: mean F1 below {below}; in brackets how many scenes are below\ntook {took_s:.1} s\n"
    );
    Done::new(&chart, text)
}

fn chart_glossy(args: &ChartArgs, dir: &OutDir, progress: &Progress) -> Result<Done, Failure> {
    let effort = if args.quick { glossy::Effort::QUICK } else { glossy::Effort::FULL };
    let chart = glossy::chart(effort, dir, &args.look.look(), progress)?;
    Done::new(&chart, chart.text())
}

fn chart_growth(args: &ChartArgs, dir: &OutDir, progress: &Progress) -> Result<Done, Failure> {
    let effort = if args.quick { growth::Effort::QUICK } else { growth::Effort::FULL };
    let chart = growth::chart(effort, dir, &args.look.look(), progress)?;
    Done::new(&chart, chart.text())
}

fn chart_points(args: &ChartArgs, dir: &OutDir, progress: &Progress) -> Result<Done, Failure> {
    let effort = if args.quick { points::Effort::QUICK } else { points::Effort::FULL };
    let chart = points::chart(effort, dir, &args.look.look(), progress)?;
    Done::new(&chart, chart.text())
}

fn chart_sampling(args: &ChartArgs, dir: &OutDir, progress: &Progress) -> Result<Done, Failure> {
    let started = Instant::now();
    let effort = if args.quick { Effort::QUICK } else { Effort::FULL };
    let chart = sampling::chart(effort, dir, &args.look.look(), progress)?;
    let took_s = started.elapsed().as_secs_f64();
    Done::new(&chart, format!("{}took {took_s:.1} s\n", text(&chart)))
}

fn chart_sampled(args: &ChartArgs, dir: &OutDir, progress: &Progress) -> Result<Done, Failure> {
    let effort = if args.quick { sampled::Effort::QUICK } else { sampled::Effort::FULL };
    let chart = sampled::sampled(&args.scene, effort, progress)?;
    chart.write(dir, &args.look.look())?;
    Done::new(&chart, format!("{}\n{}", chart.text(), chart.cost_text()))
}

fn chart_shadows(args: &ChartArgs, dir: &OutDir, progress: &Progress) -> Result<Done, Failure> {
    let effort = if args.quick { shadows::Effort::QUICK } else { shadows::Effort::FULL };
    let chart = shadows::chart(effort, dir, &args.look.look(), progress)?;
    let fault = (!chart.is_equal()).then(|| "one pass and accumulation differ; please report it".to_owned());
    Ok(Done { fault, ..Done::new(&chart, chart.text())? })
}

fn chart_tile_tests(args: &ChartArgs, dir: &OutDir, progress: &Progress) -> Result<Done, Failure> {
    let chart = tile_tests::tile_tests(&args.scene, args.quick, progress)?;
    chart.write(dir, &args.look.look())?;
    let lost = chart.samples_lost();
    let fault = format!("{lost} samples were lost: a test is not conservative; please report it");
    Ok(Done { fault: (lost > 0).then_some(fault), ..Done::new(&chart, chart.text())? })
}

fn chart_timing(args: &ChartArgs, dir: &OutDir, progress: &Progress) -> Result<Done, Failure> {
    let started = Instant::now();
    let chart = timing::timing(&args.scene, args.quick, progress)?;
    chart.write(dir, &args.look.look())?;
    let speed = &chart.reference;
    let text = format!(
        "{}the reference: {:.1} million unit-cycles, {:.2} million cycles a second\ntook {:.1} s\n",
        chart.text(),
        speed.unit_cycles_per_s / 1e6,
        speed.cycles_per_s / 1e6,
        started.elapsed().as_secs_f64()
    );
    Done::new(&chart, text)
}

fn chart_views(args: &ChartArgs, dir: &OutDir, progress: &Progress) -> Result<Done, Failure> {
    let effort = if args.quick { views::Effort::QUICK } else { views::Effort::FULL };
    let chart = views::chart(effort, dir, &args.look.look(), progress)?;
    Done::new(&chart, chart.text())
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
