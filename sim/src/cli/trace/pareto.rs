//! `quintile trace pareto`.

use std::collections::BTreeMap;
use std::io::Write;

use serde_json::json;
use traces::io::atomic::write_file;
use traces::pareto::{Point, Standing, frontier};
use traces::table::{Table as Columns, TableReadError};

use super::failure::wrong;
use super::pipes::shown;
use super::plot::{Ending, write};
use super::report;
use super::units::{Quantity, scale_with};
use crate::cli::Failure;
use crate::cli::args::trace::{ParetoArgs, ParetoShow};
use crate::cli::outputs::may_hold_results;
use crate::cli::terminal::print_json;
use output::plot::{AxisSpec, Chart, ChartPanel, Mark, Paint, Picture, Series};
use output::table::{Table, si_digits};
use output::terminal::Terminal;

impl From<TableReadError> for Failure {
    fn from(error: TableReadError) -> Self {
        let code = if matches!(error, TableReadError::File { .. }) { 1 } else { 2 };
        Self { message: error.to_string(), code }
    }
}

type Groups = BTreeMap<String, Vec<Standing>>;

pub(super) fn run(args: &ParetoArgs, terminal: &Terminal) -> Result<(), Failure> {
    may_hold_results(("--out", args.out.as_deref()), [args.table.as_path()])?;
    let table = Columns::read(&args.table)?;
    let groups = groups(args, &table)?;
    if let Some(out) = &args.out {
        if out.extension().is_some_and(|end| end.eq_ignore_ascii_case("csv")) {
            write_file(out, |file| write_table(&groups, file))?;
        } else {
            write(&picture(args, &groups), out, Ending::of(out)?)?;
        }
    }
    if args.json {
        print_json(&json!({ "idle_W": args.idle_w, "groups": groups }), true)
    } else {
        report(&text(&groups), args.piped, terminal)
    }
}

fn groups(args: &ParetoArgs, table: &Columns) -> Result<Groups, Failure> {
    let numbers = |column: &str, scale: f64| -> Result<Vec<f64>, Failure> {
        let values = table.numbers(column)?;
        Ok(values.into_iter().map(|value| value * scale).collect())
    };
    let unit = |column: &str, of: Quantity| scale_with(column, table.unit(column), of).map_err(wrong);
    // A deviation whose name tells no unit has that of what it belongs to.
    let deviations = |column: &Option<String>, (of, quantity): (&str, Quantity)| match column {
        Some(column) => numbers(column, unit(column, quantity)?.or(unit(of, quantity)?).unwrap_or(1.0)),
        None => Ok(vec![0.0; table.rows()]),
    };
    let texts = |column: &String| table.texts(column);
    let (time, energy) = ((args.time.as_str(), Quantity::Time), (args.energy.as_str(), Quantity::Energy));
    let [times, energies] =
        [time, energy].map(|(column, of)| numbers(column, unit(column, of)?.unwrap_or(1.0)));
    let (times, energies) = (times?, energies?);
    let (time_sd, energy_sd) = (deviations(&args.time_sd, time)?, deviations(&args.energy_sd, energy)?);
    let labels = args.label.as_ref().map(texts).transpose()?;
    let keys = args.group.iter().map(texts).collect::<Result<Vec<_>, _>>()?;
    let mut groups: BTreeMap<String, Vec<Point>> = BTreeMap::new();
    check(args, &times, &time_sd, &energy_sd)?;
    for row in 0..table.rows() {
        let named = args.group.iter().zip(&keys).map(|(column, values)| format!("{column}={}", values[row]));
        let key = named.collect::<Vec<_>>().join(", ");
        groups.entry(key).or_default().push(Point {
            label: labels.as_ref().map_or_else(|| (row + 1).to_string(), |labels| labels[row].clone()),
            time_s: times[row],
            energy_j: energies[row],
            time_deviation_s: time_sd[row],
            energy_deviation_j: energy_sd[row],
        });
    }
    Ok(groups.into_iter().map(|(key, points)| (key, frontier(&points, args.idle_w, args.seed))).collect())
}

/// Refuses what is no setting.
fn check(args: &ParetoArgs, times: &[f64], time_sd: &[f64], energy_sd: &[f64]) -> Result<(), Failure> {
    let refuse = |row: usize, what: &str| {
        wrong(format!("{}: row {}: {what}: mend or drop the row", args.table.display(), row + 1))
    };
    if times.is_empty() {
        let message = format!("{}: has no row: give one for each setting", args.table.display());
        return Err(Failure { message, code: 1 });
    }
    if let Some(row) = times.iter().position(|time_s| *time_s <= 0.0) {
        return Err(refuse(row, &format!("{} is not above 0", args.time)));
    }
    match time_sd.iter().chain(energy_sd).position(|deviation| *deviation < 0.0) {
        Some(at) => Err(refuse(at % times.len(), "a standard deviation is below 0")),
        None => Ok(()),
    }
}

fn text(groups: &Groups) -> String {
    let mut table = Table::new(["group", "setting", "time", "energy", "power", "frontier", "probability"]);
    for (group, standings) in groups {
        for s in standings {
            table.row([
                group.clone(),
                s.point.label.clone(),
                si_digits(s.point.time_s, "s", 4),
                si_digits(s.point.energy_j, "J", 4),
                si_digits(s.point.energy_j / s.point.time_s, "W", 4),
                if s.on_frontier { "yes" } else { "" }.to_owned(),
                format!("{:.3}", s.probability),
            ]);
        }
    }
    let trade = groups.values().filter(|s| s.iter().filter(|s| s.on_frontier).count() > 1).count();
    format!("{table}{trade} of {} groups have a trade-off", groups.len())
}

fn write_table(groups: &Groups, out: &mut impl Write) -> std::io::Result<()> {
    let mut rows = csv::Writer::from_writer(out);
    rows.write_record([
        "group",
        "label",
        "time_s",
        "energy_J",
        "compensated_J",
        "on_frontier",
        "probability",
    ])?;
    for (group, standings) in groups {
        for s in standings {
            rows.write_record([
                group.clone(),
                s.point.label.clone(),
                s.point.time_s.to_string(),
                s.point.energy_j.to_string(),
                s.compensated_j.to_string(),
                u8::from(s.on_frontier).to_string(),
                s.probability.to_string(),
            ])?;
        }
    }
    rows.flush()
}

/// Where a setting stands in the plot, and its deviations.
fn place(show: ParetoShow, p: &Point) -> (f64, f64, f64, f64) {
    match show {
        ParetoShow::Energy => (p.time_s, p.energy_j, p.time_deviation_s, p.energy_deviation_j),
        ParetoShow::Power => {
            let power_w = p.energy_j / p.time_s;
            let shares = libm::hypot(p.time_deviation_s / p.time_s, p.energy_deviation_j / p.energy_j);
            (p.time_s, power_w, p.time_deviation_s, (power_w * shares).abs())
        }
    }
}

/// All groups in one picture: points with their names and deviations, and each group's frontier as steps, as between two settings
/// there is none.
fn picture(args: &ParetoArgs, groups: &Groups) -> Picture {
    let place = |s: &Standing| place(args.show, &s.point);
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
    for (number, (group, standings)) in groups.iter().enumerate() {
        let on = standings.iter().filter(|s| s.on_frontier);
        let mut steps: Vec<(f64, f64)> = on.map(|s| (place(s).0, place(s).1)).collect();
        steps.sort_by(|a, b| a.0.total_cmp(&b.0));
        if steps.len() > 1 {
            let name = if group.is_empty() { "frontier".to_owned() } else { group.clone() };
            series.push(Series::new(name, Mark::Steps(steps)).painted(Paint::Like(2 + number % 6)));
        }
    }
    series.push(Series::new("dominated", Mark::Rings(of(false))).painted(Paint::Like(0)));
    series.push(Series::new("on the frontier", Mark::Dots(of(true))).painted(Paint::Like(0)));
    let subject = format!("{} - idle power charged: {} W", shown(&args.table), args.idle_w);
    let (title, y) = match args.show {
        ParetoShow::Energy => ("Time and energy", ("energy", "J")),
        ParetoShow::Power => ("Time and mean power", ("power", "W")),
    };
    let axes = [("time", "s"), y].map(|(name, unit)| AxisSpec::even(name, unit));
    Chart::new(title, &subject, vec![ChartPanel::over("", axes, series)]).picture(&args.look.look())
}
