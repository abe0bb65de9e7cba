//! The report as one page that opens from disk and needs no network, with its pictures; and its tables as CSV.

use std::io::{self, Write};

use minijinja::{Environment, context};
use output::plot::{AxisSpec, Chart, ChartPanel, Paint, Picture, PlotError, PlotMark, PlotStyle, Series};
use output::table::si;
use serde::Serialize;
use traces::pareto::nondominated;

use super::{RatedDesign, SweepReport};

/// Template of the page.
const TEMPLATE: &str = include_str!("../../assets/report.html");
/// The ending `.html` makes the engine escape every value.
const NAME: &str = "report.html";

/// Most interactions in the page; all are in the table beside it.
const MAX_INTERACTIONS: usize = 60;

/// Why the page cannot be made.
#[derive(Debug, thiserror::Error)]
pub(super) enum PageError {
    /// The template cannot be filled.
    #[error("cannot fill the report: {0}")]
    Template(#[from] minijinja::Error),
    /// The picture cannot be drawn.
    #[error(transparent)]
    Plot(#[from] PlotError),
}

/// A winner, as shown.
#[derive(Serialize)]
struct WinnerView<'a> {
    workload: &'a str,
    measure: &'static str,
    design: &'a str,
    cost: String,
    undecided: usize,
    others: usize,
    platform_mismatch: bool,
}

impl SweepReport {
    /// The page.
    ///
    /// # Errors
    /// [`PageError`] if the template cannot be filled, or the picture cannot be drawn.
    pub(super) fn html(&self, plot_style: &PlotStyle) -> Result<String, PageError> {
        let mut environment = Environment::new();
        environment.set_trim_blocks(true);
        environment.set_lstrip_blocks(true);
        environment.add_filter("ratio", |value: Option<f64>| {
            value.map_or("–".to_owned(), |value| format!("{value:.3}"))
        });
        environment.add_template(NAME, TEMPLATE)?;
        let winners: Vec<WinnerView<'_>> = self
            .winners
            .iter()
            .map(|winner| WinnerView {
                workload: &winner.workload,
                measure: winner.measure.name(),
                design: &winner.design,
                cost: si(winner.value, winner.measure.unit()),
                undecided: winner.undecided,
                others: winner.designs.saturating_sub(1),
                platform_mismatch: winner.platform_mismatch,
            })
            .collect();
        let interactions = &self.interactions[..self.interactions.len().min(MAX_INTERACTIONS)];
        let count: usize = self.workloads.values().map(Vec::len).sum();
        Ok(environment.get_template(NAME)?.render(context! {
            notes => self.notes(),
            report => self,
            count,
            winners,
            interactions,
            within => format!("{:.0} %", 100.0 * self.within),
            frontier => self.picture(plot_style).svg()?,
            data => &self.workloads,
        })?)
    }
}

/// A quantity of a design: name, unit, and its value.
type Quantity = (&'static str, &'static str, fn(&RatedDesign) -> Option<f64>);

const TIME: Quantity = ("busy time", "s", |rated| Some(rated.design.time_s.value));
const ENERGY: Quantity = ("busy energy", "J", |rated| Some(rated.design.energy_j.value));
const AREA: Quantity = ("area", "mm2", |rated| rated.design.area_mm2);

/// Most designs on the frontier that are named.
const MAX_NAMES: usize = 12;

impl SweepReport {
    /// Designs over each two of time, energy and area. The frontier is over all three; steps are that of the
    /// two that are shown.
    pub(super) fn picture(&self, plot_style: &PlotStyle) -> Picture {
        let pairs = [(TIME, ENERGY), (AREA, TIME), (AREA, ENERGY)];
        let panels = pairs.into_iter().filter_map(|(x, y)| self.panel(x, y)).collect();
        Chart::new("Designs", &self.sweep, panels).picture(plot_style)
    }

    fn panel(&self, x: Quantity, y: Quantity) -> Option<ChartPanel> {
        let at = |rated: &RatedDesign| Some((x.2(rated)?, y.2(rated)?));
        let mut series = Vec::new();
        for (number, (workload, designs)) in self.workloads.iter().enumerate() {
            let steps = steps(&designs.iter().filter_map(at).collect::<Vec<_>>());
            if steps.len() > 1 {
                series.push(
                    Series::new(workload.clone(), PlotMark::Steps(steps))
                        .painted(Paint::Like(2 + number % 6)),
                );
            }
        }
        let all = || self.workloads.values().flatten();
        // Many names would hide the points.
        let named = all().filter(|rated| rated.on_frontier).count() <= MAX_NAMES;
        let of = |on: bool| -> Vec<(f64, f64, String)> {
            let name =
                |rated: &RatedDesign| if on && named { rated.design.design.clone() } else { String::new() };
            let chosen = all().filter(|rated| rated.on_frontier == on);
            chosen.filter_map(|rated| at(rated).map(|(x, y)| (x, y, name(rated)))).collect()
        };
        let (others, frontier) = (of(false), of(true));
        if frontier.is_empty() {
            return None;
        }
        series.push(Series::new("dominated", PlotMark::Rings(others)).painted(Paint::Like(0)));
        series.push(Series::new("on the frontier", PlotMark::Dots(frontier)).painted(Paint::Like(0)));
        let axes = [x, y].map(|(name, unit, _)| AxisSpec::even(name, unit));
        Some(ChartPanel::over("", axes, series))
    }
}

/// Points that no other dominates in both coordinates, from left to right.
fn steps(points: &[(f64, f64)]) -> Vec<(f64, f64)> {
    let on = nondominated(points);
    let mut steps: Vec<_> =
        points.iter().copied().zip(on).filter_map(|(point, on)| on.then_some(point)).collect();
    steps.sort_by(|a, b| a.0.total_cmp(&b.0));
    steps.dedup();
    steps
}

/// Writes a table.
type Table<'a> = Box<dyn Fn(&mut dyn Write) -> io::Result<()> + 'a>;

impl SweepReport {
    /// Tables by the names of their files.
    pub(super) fn tables(&self) -> Vec<(&'static str, Table<'_>)> {
        vec![
            ("designs.csv", Box::new(|out| self.write_designs(out))),
            ("winners.csv", Box::new(|out| write_rows(&self.winners, out))),
            ("near_best.csv", Box::new(|out| write_rows(&self.near_best, out))),
            ("pairs.csv", Box::new(|out| write_rows(&self.pairs, out))),
            ("effects.csv", Box::new(|out| write_rows(&self.effects, out))),
            ("interactions.csv", Box::new(|out| write_rows(&self.interactions, out))),
            ("shares.csv", Box::new(|out| write_rows(&self.shares, out))),
        ]
    }

    /// Writes a row for each design: costs with their errors, ranks, frontier.
    ///
    /// # Errors
    /// The errors of `out`.
    fn write_designs(&self, out: impl Write) -> io::Result<()> {
        let mut csv = csv::Writer::from_writer(out);
        csv.write_record([
            "workload",
            "design",
            "runs",
            "time_s",
            "time_sd_s",
            "time_error",
            "energy_J",
            "energy_low_J",
            "energy_high_J",
            "energy_sd_J",
            "energy_error",
            "area_mm2",
            "on_frontier",
            "probability",
            "time_rank_best",
            "time_rank_worst",
            "energy_rank_best",
            "energy_rank_worst",
            "warnings",
        ])?;
        let optional = |value: Option<f64>| value.map_or(String::new(), |value| value.to_string());
        for (workload, designs) in &self.workloads {
            for rated in designs {
                let (time, energy) = (&rated.design.time_s, &rated.design.energy_j);
                csv.write_record([
                    workload.clone(),
                    rated.design.design.clone(),
                    rated.design.runs.to_string(),
                    time.value.to_string(),
                    time.deviation.to_string(),
                    time.error.to_string(),
                    energy.value.to_string(),
                    energy.low.to_string(),
                    energy.high.to_string(),
                    energy.deviation.to_string(),
                    energy.error.to_string(),
                    optional(rated.design.area_mm2),
                    u8::from(rated.on_frontier).to_string(),
                    optional(rated.probability),
                    rated.time_ranks[0].to_string(),
                    rated.time_ranks[1].to_string(),
                    rated.energy_ranks[0].to_string(),
                    rated.energy_ranks[1].to_string(),
                    rated.design.warnings.join(","),
                ])?;
            }
        }
        csv.flush()
    }
}

/// Writes a table whose columns are the fields of its rows.
///
/// # Errors
/// The errors of `out`.
fn write_rows<T: Serialize + Default>(rows: &[T], mut out: impl Write) -> io::Result<()> {
    if rows.is_empty() {
        // The names come with a row.
        let mut csv = csv::Writer::from_writer(Vec::new());
        csv.serialize(T::default())?;
        let text = csv.into_inner().map_err(csv::IntoInnerError::into_error)?;
        return text.split_inclusive(|&byte| byte == b'\n').take(1).try_for_each(|line| out.write_all(line));
    }
    let mut csv = csv::Writer::from_writer(out);
    rows.iter().try_for_each(|row| csv.serialize(row))?;
    csv.flush()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::{ReportOptions, exact};

    #[test]
    fn a_page_begins_with_what_is_missing_and_marks_designs_on_other_platforms() {
        let mut design = exact(&[("gpu.a", "2")], 2.0, 1.0);
        design.warnings = vec!["platform-mismatch".to_owned()];
        let mut report =
            SweepReport::of_designs([("w".to_owned(), vec![design])].into(), ReportOptions::default());
        let html = report.html(&PlotStyle::default()).unwrap();
        assert!(
            html.contains("gpu.a=2 *")
                && html.contains("1 of 1 design on the frontier with platform-mismatch")
        );
        assert!(!html.contains("left out"));
        (report.left_out, report.left_out_failed, report.left_out_unfinished) = (3, 1, 2);
        report.idle = vec!["constraints[1]".to_owned()];
        let html = report.html(&PlotStyle::default()).unwrap();
        let says = "3 points left out: 2 not finished (`quintile sweep run` runs them), 1 failed";
        let (top, _) = html.split_once("<h2>").unwrap();
        assert!(top.contains(says) && top.contains("constraints[1] leaves out no point"), "{top}");
    }

    #[test]
    fn a_page_holds_its_designs_and_escapes_their_names() {
        let designs = vec![exact(&[("gpu.a", "1</script>")], 1.0, 2.0), exact(&[("gpu.a", "2")], 2.0, 1.0)];
        let report =
            SweepReport::of_designs([("a < b".to_owned(), designs)].into(), ReportOptions::default());
        let html = report.html(&PlotStyle::default()).unwrap();
        assert!(html.contains("2 designs in 1 workload;") && html.contains("a &lt; b"), "{html}");
        assert!(!html.contains("1</script>") && html.contains("<svg"));
        assert!(
            !html.contains("http://")
                || html.matches("http://").count() == html.matches("http://www.w3.org/").count()
        );
    }

    #[test]
    fn steps_fall_from_left_to_right() {
        let points = vec![(2.0, 1.0), (1.0, 3.0), (1.0, 2.0), (3.0, 1.0), (1.5, 2.5), (2.0, 1.0)];
        assert_eq!(steps(&points), [(1.0, 2.0), (2.0, 1.0)]);
    }

    #[test]
    fn empty_tables_have_the_header_of_full_ones() {
        let texts = |report: &SweepReport| -> Vec<String> {
            let text = |table: Table<'_>| {
                let mut bytes = Vec::new();
                table(&mut bytes).unwrap();
                String::from_utf8(bytes).unwrap()
            };
            report.tables().into_iter().map(|(_, table)| text(table)).collect()
        };
        let design = |a: &str, b: &str| exact(&[("gpu.a", a), ("gpu.b", b)], 1.0 + a.len() as f64, 1.0);
        let designs = vec![design("1", "1"), design("1", "2"), design("22", "1"), design("22", "2")];
        let full = SweepReport::of_designs([("w".to_owned(), designs)].into(), ReportOptions::default());
        let (full, empty) = (texts(&full), texts(&SweepReport::default()));
        for (full, empty) in full.iter().zip(&empty) {
            assert!(full.lines().count() > 1, "{full}");
            assert_eq!(format!("{}\n", full.lines().next().unwrap()), *empty);
        }
    }
}
