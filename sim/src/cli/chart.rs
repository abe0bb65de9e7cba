//! `quintile chart`.

use std::time::Instant;

use super::Failure;
use super::args::{ChartArg, ChartArgs};
use super::terminal::{print, print_json};
use crate::chart::ChartError;
use crate::chart::sampling::{self, Effort, SamplingChart};
use crate::output::progress::Progress;
use crate::output::table::Table;

impl From<ChartError> for Failure {
    fn from(error: ChartError) -> Self {
        Self { message: error.to_string(), code: 1 }
    }
}

pub(super) fn run(args: &ChartArgs) -> Result<(), Failure> {
    let started = Instant::now();
    let pool = super::threads(args.threads)?;
    let progress = Progress::new(args.json);
    match args.chart {
        ChartArg::Sampling => {
            let effort = if args.quick { Effort::QUICK } else { Effort::FULL };
            let chart = pool.install(|| sampling::chart(effort, &args.out, &progress))?;
            if args.json {
                return print_json(&chart, true);
            }
            print(&format!(
                "{}results: {}\ntook {:.1} s",
                text(&chart),
                args.out.display(),
                started.elapsed().as_secs_f64()
            ))
        }
    }
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
