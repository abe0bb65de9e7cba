//! `quintile sweep report`.

use output::table::{Table, counted, si};
use output::terminal::Terminal;
use sweep::{RatedDesign, Report, ReportOptions};

use super::args::ReportArgs;
use super::{Printed, opened};
use crate::cli::Failure;
use crate::cli::outputs::{print, print_json};

pub(super) fn report(args: &ReportArgs, terminal: &Terminal) -> Result<(), Failure> {
    let folder = opened(&args.folder, terminal)?;
    let report = Report::of(&folder, ReportOptions { within: args.within })?;
    let page = report.write(&folder, &args.look.look())?;
    let name = folder.path().display().to_string();
    if args.folder.json {
        return print_json(&Printed { out: name, done: &report }, true);
    }
    let notes: String = report.notes().iter().map(|note| format!("{note}\n")).collect();
    let effects = match report.no_effects.len() {
        0 => String::new(),
        count => format!(
            "{} with too many values for effects of each: see the report\n",
            counted(count, "setting")
        ),
    };
    print(&format!(
        "{notes}{}\n{}\n{effects}report: {}",
        frontiers(&report),
        winners(&report),
        page.display()
    ))
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
