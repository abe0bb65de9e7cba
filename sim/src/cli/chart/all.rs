//! `quintile chart all`.

use std::time::Instant;

use clap::ValueEnum;
use serde_json::{Map, Value};

use super::{Done, make};
use crate::cli::Failure;
use crate::cli::args::{ChartArg, ChartArgs};
use crate::cli::terminal::{json_text, print, print_json};
use experiments::chart::CHARTS;
use experiments::chart::index::{Entry, Index};
use output::OutDir;
use output::progress::Progress;

/// The failure catalogue, which has a command of its own.
const STRESS: &str = "stress";

/// Makes every chart and the page; a broken promise of one does not keep the others.
pub(super) fn run(args: &ChartArgs, dir: &mut OutDir, progress: &Progress) -> Result<(), Failure> {
    let (mut json, mut faults) = (Map::new(), Vec::new());
    let charts: Vec<_> = charts();
    let mut index = Index { command: command(args), ..Index::default() };
    for (at, (name, chart)) in charts.iter().enumerate() {
        index.missing = charts[at + 1..].iter().map(|(name, _)| name.clone()).collect();
        if !args.json {
            print(&format!("{name}:"))?;
        }
        let started = Instant::now();
        let done = match chart {
            Some(chart) => make(*chart, args, dir, progress)?,
            None => stress(args, dir, progress)?,
        };
        if !args.json {
            print(&done.text)?;
        }
        json.insert(name.clone(), serde_json::from_str(&done.json).unwrap_or(Value::Null));
        faults.extend(done.fault.iter().map(|fault| format!("{name}: {fault}")));
        let files = dir.publish()?;
        index.entries.push(entry(name.clone(), done, started.elapsed().as_secs_f64()).with_files(files));
        // After each, so that what there is can be looked at while the next one runs.
        index.write(dir).map_err(|error| Failure { message: error.to_string(), code: 1 })?;
        dir.publish()?;
    }
    match args.json {
        true => print_json(&Value::Object(json), true)?,
        false => print(&format!("results: {}", args.out.join("index.html").display()))?,
    }
    if faults.is_empty() { Ok(()) } else { Err(Failure { message: faults.join("; "), code: 1 }) }
}

/// Every chart by name, and the catalogue.
fn charts() -> Vec<(String, Option<ChartArg>)> {
    let charts = ChartArg::value_variants().iter().filter(|&&chart| chart != ChartArg::All);
    let named =
        charts.filter_map(|&chart| Some((chart.to_possible_value()?.get_name().to_owned(), Some(chart))));
    named.chain([(STRESS.to_owned(), None)]).collect()
}

fn entry(name: String, done: Done, took_s: f64) -> Entry {
    let about = CHARTS.iter().find(|(chart, _)| *chart == name).map_or(
        "each tile test on families of triangles from harmless to hopeless: samples lost, efficiency, cost",
        |(_, about)| about,
    );
    Entry {
        about: about.to_owned(),
        text: done.text,
        pictures: Vec::new(),
        files: Vec::new(),
        took_s,
        standings: done.standings,
        name,
    }
}

/// The failure catalogue as a chart among the others.
fn stress(args: &ChartArgs, dir: &OutDir, progress: &Progress) -> Result<Done, Failure> {
    let report = experiments::stress::stress(None, args.quick, progress)?;
    let (text, fault) = (report.text(), report.fault().map(str::to_owned));
    let json = json_text(&report.summary(), false)?;
    report.write(dir, &args.look.look())?;
    Ok(Done { text, json, standings: Vec::new(), fault })
}

/// The command as one would type it again.
fn command(args: &ChartArgs) -> String {
    let mut words = vec!["quintile chart all".to_owned()];
    words.extend(args.scene.iter().map(|scene| format!("--scene {scene}")));
    words.extend(args.quick.then(|| "--quick".to_owned()));
    words.push(format!("--out {}", args.out.display()));
    words.join(" ")
}
