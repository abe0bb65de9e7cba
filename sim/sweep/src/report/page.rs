//! The report as one page that opens from disk and needs no network.

use minijinja::{Environment, context};
use output::plot::{Look, PlotError};
use output::table::si;
use serde::Serialize;

use super::Report;

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

impl Report {
    /// The page.
    ///
    /// # Errors
    /// [`PageError`] if the template cannot be filled, or the picture cannot be drawn.
    pub(super) fn html(&self, look: &Look) -> Result<String, PageError> {
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
            frontier => self.picture(look).svg()?,
            data => &self.workloads,
        })?)
    }
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
            Report::of_designs([("w".to_owned(), vec![design])].into(), ReportOptions::default());
        let html = report.html(&Look::default()).unwrap();
        assert!(
            html.contains("gpu.a=2 *")
                && html.contains("1 of 1 design on the frontier with platform-mismatch")
        );
        assert!(!html.contains("left out"));
        (report.left_out, report.left_out_failed, report.left_out_unfinished) = (3, 1, 2);
        report.idle = vec!["constraints[1]".to_owned()];
        let html = report.html(&Look::default()).unwrap();
        let says = "3 points left out: 2 not finished (`quintile sweep run` runs them), 1 failed";
        let (top, _) = html.split_once("<h2>").unwrap();
        assert!(top.contains(says) && top.contains("constraints[1] leaves out no point"), "{top}");
    }

    #[test]
    fn a_page_holds_its_designs_and_escapes_their_names() {
        let designs = vec![exact(&[("gpu.a", "1</script>")], 1.0, 2.0), exact(&[("gpu.a", "2")], 2.0, 1.0)];
        let report = Report::of_designs([("a < b".to_owned(), designs)].into(), ReportOptions::default());
        let html = report.html(&Look::default()).unwrap();
        assert!(html.contains("2 designs in 1 workload;") && html.contains("a &lt; b"), "{html}");
        assert!(!html.contains("1</script>") && html.contains("<svg"));
        assert!(
            !html.contains("http://")
                || html.matches("http://").count() == html.matches("http://www.w3.org/").count()
        );
    }
}
