//! What a sweep found: frontiers, winners, effects, and the confidence in all of that.
//!
//! ```text
//! results -> Row -> SweepDesign (runs that differ in their seed are one) -> frontier, ranks, winners, effects -> SweepReport -> files, page
//! ```

mod design;
mod effects;
mod order;
mod page;
mod winners;

use std::collections::BTreeMap;
use std::path::PathBuf;

use output::plot::PlotStyle;
use output::table::counted;
use rayon::prelude::*;
use serde::Serialize;

pub(crate) use design::label;
pub use design::{Cost, SweepDesign};
pub use effects::{Effect, Interaction, NoEffect, Share};
pub use order::RatedDesign;
pub use winners::{Measure, NearBest, Pair, Winner};

use self::design::{Row, designs, short_names};
use crate::execute::Outcome;
use crate::plan::{Point, idle};
use crate::{Folder, SweepError};

/// File of the page.
const PAGE: &str = "report.html";
/// File of the picture.
const PICTURE: &str = "frontier.svg";

/// What a report is made for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ReportOptions {
    /// How far from the best a design may be to be chosen for what else it costs, relative.
    pub within: f64,
}

impl Default for ReportOptions {
    fn default() -> Self {
        Self { within: 0.05 }
    }
}

/// Report of a sweep.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct SweepReport {
    /// Name of the sweep.
    pub sweep: String,
    /// How far from the best the designs in `near_best` may be.
    pub within: f64,
    /// Designs by workload, in the order of the plan, compared within the workload.
    pub workloads: BTreeMap<String, Vec<RatedDesign>>,
    /// Best design of each workload by each measure.
    pub winners: Vec<Winner>,
    /// Cheapest design near the best, by each measure.
    pub near_best: Vec<NearBest>,
    /// The best design against the next ones.
    pub pairs: Vec<Pair>,
    /// Main effects.
    pub effects: Vec<Effect>,
    /// Two-way interactions, the strongest first.
    pub interactions: Vec<Interaction>,
    /// Shares of variance.
    pub shares: Vec<Share>,
    /// Settings that vary and have no effects, or effects of groups of their values alone.
    pub no_effects: Vec<NoEffect>,
    /// Points that failed, were screened out or are undecided.
    pub failed: Vec<UnmeasuredPoint>,
    /// Points that are left out; the sum of the next four.
    pub left_out: usize,
    /// Points left out that failed.
    pub left_out_failed: usize,
    /// Points that a coarser timing level left out.
    pub left_out_screened: usize,
    /// Points that a coarser timing level cannot distinguish from those that ran.
    pub left_out_undecided: usize,
    /// Points that are not finished.
    pub left_out_unfinished: usize,
    /// Constraints and forbidden entries of the sweep file that leave out no point.
    pub idle: Vec<String>,
}

/// A point that failed, was screened out or is undecided.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct UnmeasuredPoint {
    /// Settings of the point.
    pub settings: String,
    /// Why.
    pub reason: String,
    /// Whether it did not run, as a coarser timing level left it out.
    pub screened_out: bool,
    /// Whether it did not run, as a coarser timing level cannot distinguish it from a point that did.
    pub undecided: bool,
}

/// Name of the effects over all workloads.
const ALL_WORKLOADS: &str = "all workloads";

impl SweepReport {
    /// Report of the sweep in `folder`.
    ///
    /// # Errors
    /// If the plan or a result cannot be read.
    pub fn of(folder: &Folder, options: ReportOptions) -> Result<Self, SweepError> {
        let plan = folder.plan()?;
        let names = short_names(&plan);
        // With screening, designs are compared at the last level.
        let same = if plan.screen.is_empty() { &["seed"][..] } else { &["seed", "timing"] };
        let points = plan.last_level();
        let failure = |point: &Point, outcome: Outcome| UnmeasuredPoint {
            settings: label(&point.settings, &names),
            screened_out: matches!(outcome, Outcome::ScreenedOut(_)),
            undecided: matches!(outcome, Outcome::Undecided(_)),
            reason: outcome.reason().unwrap_or_default(),
        };
        let read = |point| {
            let outcome = folder.result(point)?.map(|result| result.outcome);
            Ok(match outcome {
                Some(Outcome::Measured(measured)) => Some(Ok(Row::new(point, &measured, &names, same))),
                Some(outcome) => Some(Err(failure(point, outcome))),
                None => None,
            })
        };
        let read: Vec<_> = points.par_iter().map(read).collect::<Result<_, SweepError>>()?;
        let (mut rows, mut failed) = (Vec::new(), Vec::new());
        for point in read.into_iter().flatten() {
            match point {
                Ok(row) => rows.push(row),
                Err(failure) => failed.push(failure),
            }
        }
        let left_out = points.len() - rows.len();
        let count = |is: fn(&UnmeasuredPoint) -> bool| failed.iter().filter(|failure| is(failure)).count();
        let left_out_screened = count(|failure| failure.screened_out);
        let left_out_undecided = count(|failure| failure.undecided);
        let of_rows = Self::of_rows(rows, options);
        Ok(Self {
            sweep: plan.name,
            left_out,
            left_out_failed: failed.len() - left_out_screened - left_out_undecided,
            left_out_screened,
            left_out_undecided,
            left_out_unfinished: left_out - failed.len(),
            idle: plan.idle,
            failed,
            ..of_rows
        })
    }

    /// Writes the report into `folder`: its page, a picture, and tables. All are replaced together, and no
    /// file of the user. Returns the path of the page.
    ///
    /// # Errors
    /// [`SweepError::InTheWay`] if a file of the user has the name of one of them, and if they cannot be written.
    pub fn write(&self, folder: &Folder, plot_style: &PlotStyle) -> Result<PathBuf, SweepError> {
        let tables = self.tables();
        let names = tables.iter().map(|(name, _)| *name).chain([PICTURE, PAGE]);
        let mut dir = folder.open("sweep report", names)?;
        for (name, table) in &tables {
            dir.write_file(name, |out| Ok(table(out)?))?;
        }
        dir.write_file(PICTURE, |out| Ok(out.write_all(self.picture(plot_style).svg()?.as_bytes())?))?;
        dir.write_file(PAGE, |out| Ok(out.write_all(self.html(plot_style)?.as_bytes())?))?;
        dir.publish()?;
        Ok(folder.path().join(PAGE))
    }

    /// What a reader has to know before the numbers: which points are not in, by cause, which constraints do
    /// nothing, and designs whose energies are those of another GPU.
    pub fn notes(&self) -> Vec<String> {
        let causes = [
            (self.left_out_unfinished, "not finished (`quintile sweep run` runs them)"),
            (self.left_out_failed, "failed"),
            (self.left_out_screened, "screened out at a coarser timing level"),
            (self.left_out_undecided, "undecided at a coarser timing level against those that ran"),
        ];
        let causes: Vec<String> = causes
            .iter()
            .filter(|(count, _)| *count > 0)
            .map(|(count, cause)| format!("{count} {cause}"))
            .collect();
        let left_out = (self.left_out > 0)
            .then(|| format!("{} left out: {}", counted(self.left_out, "point"), causes.join(", ")));
        let all = || self.workloads.values().flatten();
        let mismatched = all().filter(|rated| rated.on_frontier && rated.design.is_mismatched()).count();
        let mismatched = (mismatched > 0).then(|| {
            let on = counted(all().filter(|rated| rated.on_frontier).count(), "design");
            format!("{mismatched} of {on} on the frontier with platform-mismatch (*): do not compare their energies with those of others")
        });
        left_out.into_iter().chain(self.idle.iter().map(|place| idle(place))).chain(mismatched).collect()
    }

    /// Report of measured points.
    fn of_rows(rows: Vec<Row<'_>>, options: ReportOptions) -> Self {
        let mut by_workload: BTreeMap<String, Vec<Row<'_>>> = BTreeMap::new();
        for row in rows {
            by_workload.entry(row.workload.clone()).or_default().push(row);
        }
        Self::of_designs(
            by_workload.iter().map(|(workload, rows)| (workload.clone(), designs(rows))).collect(),
            options,
        )
    }

    /// Report of designs by workload.
    fn of_designs(by_workload: BTreeMap<String, Vec<SweepDesign>>, options: ReportOptions) -> Self {
        let mut report = Self { within: options.within, ..Self::default() };
        if by_workload.len() > 1 {
            let all: Vec<&SweepDesign> = by_workload.values().flatten().collect();
            report.add_effects(ALL_WORKLOADS, &all, true);
        }
        for (workload, designs) in by_workload {
            report.add_effects(&workload, &designs.iter().collect::<Vec<_>>(), false);
            report.winners.extend(winners::winners(&workload, &designs));
            report.near_best.extend(winners::near_best(&workload, &designs, options.within));
            report.pairs.extend(winners::pairs(&workload, &designs));
            report.workloads.insert(workload, order::rated(designs));
        }
        report
    }

    /// Adds effects of the settings of designs, and with `conditions` those of the work.
    fn add_effects(&mut self, workload: &str, designs: &[&SweepDesign], conditions: bool) {
        let found = effects::Factorial::new(workload, designs, conditions);
        self.effects.extend(found.effects());
        self.interactions.extend(found.interactions());
        self.shares.extend(found.shares());
        self.no_effects.extend_from_slice(found.no_effects());
    }
}

/// Costs of designs with these times and energies, for tests: exact, with equal ends of the energy table.
#[cfg(test)]
pub(crate) fn exact(settings: &[(&str, &str)], time_s: f64, energy_j: f64) -> SweepDesign {
    let cost = |value| Cost { value, deviation: 0.0, error: 0.0, low: value, high: value };
    let settings: BTreeMap<String, String> =
        settings.iter().map(|(path, value)| ((*path).to_owned(), (*value).to_owned())).collect();
    let label = settings.iter().map(|(path, value)| format!("{path}={value}")).collect::<Vec<_>>().join(" ");
    SweepDesign {
        design: label,
        settings,
        conditions: BTreeMap::new(),
        runs: 1,
        time_s: cost(time_s),
        energy_j: cost(energy_j),
        area_mm2: None,
        warnings: Vec::new(),
    }
}
