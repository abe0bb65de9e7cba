//! `quintile sweep report`.

use std::io::Write;

use output::table::{Table, counted, si};
use output::terminal::Terminal;
use sweep::{RatedDesign, Report, ReportOptions};
use traces::io::atomic::write_file;

use super::args::ReportArgs;
use super::{Printed, opened};
use crate::cli::Failure;
use crate::cli::outputs::{print, print_json};
use crate::cli::trace::{PlotFormat, write_picture};

pub(super) fn report(args: &ReportArgs, terminal: &Terminal) -> Result<(), Failure> {
    let folder = opened(&args.folder, terminal)?;
    let report = Report::of(&folder, ReportOptions { within: args.within })?;
    let file = |name: &str| folder.path().join(name);
    report.tables().into_iter().try_for_each(|(name, table)| write_file(&file(name), |out| table(out)))?;
    let look = args.look.look();
    write_picture(&report.picture(&look), &file("frontier.svg"), PlotFormat::Svg)?;
    let page = report.html(&look).map_err(|error| Failure { message: error.to_string(), code: 1 })?;
    write_file(&file("report.html"), |out| out.write_all(page.as_bytes()))?;
    let name = folder.path().display().to_string();
    if args.folder.json {
        return print_json(&Printed { out: name, done: &report }, true);
    }
    let html = file("report.html").display().to_string();
    let notes: String = report.notes().iter().map(|note| format!("{note}\n")).collect();
    let effects = match report.no_effects.len() {
        0 => String::new(),
        count => format!(
            "{} with too many values for effects of each: see the report\n",
            counted(count, "setting")
        ),
    };
    print(&format!("{notes}{}\n{}\n{effects}report: {html}", frontiers(&report), winners(&report)))
}

/// Designs on the frontier, the fastest first.
fn frontiers(report: &Report) -> Table {
    let mut table = Table::new([
        "workload",
        "busy time",
        "busy energy",
        "area",
        "ranks by time",
        "design on the frontier",
    ]);
    for (workload, designs) in &report.workloads {
        let mut optimal: Vec<&RatedDesign> = designs.iter().filter(|design| design.on_frontier).collect();
        optimal.sort_by(|a, b| a.design.time_s.value.total_cmp(&b.design.time_s.value));
        for rated in optimal {
            let design = &rated.design;
            let [time, energy] = [(design.time_s.value, "s"), (design.energy_j.value, "J")]
                .map(|(value, unit)| si(value, unit));
            let area = design.area_mm2.map_or("-".to_owned(), |area| format!("{area:.1} mm2"));
            let [best, worst] = rated.time_ranks;
            let ranks = if best == worst { best.to_string() } else { format!("{best} to {worst}") };
            table.row([
                workload.clone(),
                time,
                energy,
                area,
                ranks,
                marked(&design.design, design.is_mismatched()),
            ]);
        }
    }
    table
}

/// Best designs, and how many others they cannot be distinguished from.
fn winners(report: &Report) -> Table {
    let mut table = Table::new(["workload", "best by", "cost", "undecided", "design"]);
    for winner in &report.winners {
        let undecided = format!("{} of {}", winner.undecided, winner.designs.saturating_sub(1));
        let cost = si(winner.value, winner.measure.unit());
        let measure = winner.measure.name().to_owned();
        table.row([
            winner.workload.clone(),
            measure,
            cost,
            undecided,
            marked(&winner.design, winner.platform_mismatch),
        ]);
    }
    table
}

/// The name of a design, marked if its energies are those of another GPU.
fn marked(design: &str, is_mismatched: bool) -> String {
    format!("{design}{}", if is_mismatched { " *" } else { "" })
}
