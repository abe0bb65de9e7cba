//! `quintile trace pareto`.

use std::collections::BTreeMap;
use std::path::PathBuf;

use clap::{Args, ValueEnum};
use output::plot::{AxisSpec, Chart, ChartPanel, Mark, Paint, Picture, Series};
use output::table::{Table, si_digits};
use output::terminal::Terminal;
use serde_json::json;
use traces::io::atomic::write_file;
use traces::pareto::{ParetoError, Point, RatedPoint, SettingColumns, frontiers, write_csv};
use traces::table::{InputTable, TableReadError};

use super::input::shown;
use super::{PlotFormat, report, write_picture, wrong};
use crate::cli::Failure;
use crate::cli::args::LookArgs;
use crate::cli::outputs::{may_hold_results, print_json};
use crate::cli::parse::size_of_power;

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
    /// Whether the result goes to standard output.
    #[arg(skip)]
    pub piped: bool,
    /// Style of pictures.
    #[command(flatten)]
    pub look: LookArgs,
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

impl From<TableReadError> for Failure {
    fn from(error: TableReadError) -> Self {
        wrong(error.to_string())
    }
}

impl From<ParetoError> for Failure {
    fn from(error: ParetoError) -> Self {
        wrong(error.to_string())
    }
}

type Groups = BTreeMap<String, Vec<RatedPoint>>;

pub(super) fn run(args: &ParetoArgs, terminal: &Terminal) -> Result<(), Failure> {
    may_hold_results("--out", args.out.as_deref(), [args.table.as_path()])?;
    let table = InputTable::read(&args.table)?;
    let groups = frontiers(&table, &args.columns(), args.idle_w, args.seed)?;
    if let Some(out) = &args.out {
        if out.extension().is_some_and(|end| end.eq_ignore_ascii_case("csv")) {
            write_file(out, |file| write_csv(&groups, file))?;
        } else {
            let subject = format!("{} - idle power charged: {} W", shown(&args.table), args.idle_w);
            write_picture(&picture(&subject, args.show, &args.look, &groups), out, PlotFormat::of(out)?)?;
        }
    }
    if args.json {
        print_json(&json!({ "idle_W": args.idle_w, "groups": groups }), true)
    } else {
        report(&text(&groups), args.piped, terminal)
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
fn place(show: ParetoShow, p: &Point) -> (f64, f64, f64, f64) {
    match show {
        ParetoShow::Energy => (p.time_s, p.energy_j, p.time_deviation_s, p.energy_deviation_j),
        ParetoShow::Power => (p.time_s, p.power_w(), p.time_deviation_s, p.power_deviation_w()),
    }
}

/// All groups in one picture: points with their names and deviations, and each group's frontier as steps, as between two settings
/// there is none.
fn picture(subject: &str, show: ParetoShow, look: &LookArgs, groups: &Groups) -> Picture {
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
        series.push(Series::new("", Mark::Faint(lines)).painted(Paint::Ink));
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
            series.push(Series::new(name, Mark::Steps(steps)).painted(Paint::Like(2 + number % 6)));
        }
    }
    series.push(Series::new("dominated", Mark::Rings(of(false))).painted(Paint::Like(0)));
    series.push(Series::new("on the frontier", Mark::Dots(of(true))).painted(Paint::Like(0)));
    let (title, y) = match show {
        ParetoShow::Energy => ("Time and energy", ("energy", "J")),
        ParetoShow::Power => ("Time and mean power", ("power", "W")),
    };
    let axes = [("time", "s"), y].map(|(name, unit)| AxisSpec::even(name, unit));
    Chart::new(title, subject, vec![ChartPanel::over("", axes, series)]).picture(&look.look())
}
