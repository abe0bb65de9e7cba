//! Speed against accuracy, the same few numbers for every method of every study, and the page of all studies.

use minijinja::{Environment, context};
use output::plot::{AxisSpec, Chart, ChartPanel, Paint, Picture, PlotMark, PlotStyle, Scale, Series};
use output::report::ReportError;
use output::table::digits;
use output::{Claim, OutDir, OutputError};
use serde::Serialize;

use super::groups;
use super::table::{Sheet, TableBuilder, plain};

/// A measured quantity of which less is better, beside that of the reference.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Metric {
    /// Name of the metric, for example `RMSE`.
    pub name: &'static str,
    /// Unit of the metric; empty for a number without one.
    pub unit: &'static str,
    /// Value of the metric.
    pub value: f64,
    /// Value of the reference, where it is known.
    pub reference: Option<f64>,
}

impl Metric {
    /// A quantity whose reference is not known.
    pub const fn new(name: &'static str, unit: &'static str, value: f64) -> Self {
        Self { name, unit, value, reference: None }
    }

    /// Root mean squared error of an image in linear light.
    pub const fn rmse(value: f64) -> Self {
        Self::new("RMSE", "", value)
    }

    /// Seconds of the host.
    pub const fn host_s(value: f64) -> Self {
        Self::new("host time", "s", value)
    }

    /// The same beside that of the reference.
    #[must_use]
    pub const fn beside(self, reference: f64) -> Self {
        Self { reference: Some(reference), ..self }
    }

    /// Name and unit, as an axis has them.
    fn label(&self) -> String {
        if self.unit.is_empty() { self.name.to_owned() } else { format!("{} ({})", self.name, self.unit) }
    }

    /// Value and unit.
    pub fn shown(&self) -> String {
        format!("{} {}", digits(self.value), self.unit).trim_end().to_owned()
    }
}

/// A level of a method: how wrong it is and what it costs.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct TradeoffPoint {
    /// The study that measured it.
    pub study: &'static str,
    /// The quantity that is computed, for example `time of a frame`.
    pub subject: String,
    /// The method, for example `packet`.
    pub method: String,
    /// Level of the method, for example `16 samples a pixel`; empty where it has one alone.
    pub level: String,
    /// Error.
    pub error: Metric,
    /// Cost of the method.
    pub cost: Metric,
}

impl TradeoffPoint {
    /// A method at a level, its error and its cost.
    pub fn new(subject: impl Into<String>, [method, level]: [&str; 2], [error, cost]: [Metric; 2]) -> Self {
        let (subject, method, level) = (subject.into(), method.to_owned(), level.to_owned());
        Self { study: "", subject, method, level, error, cost }
    }

    /// The same point, measured by a study.
    #[must_use]
    pub(super) fn of(self, study: &'static str) -> Self {
        Self { study, ..self }
    }

    /// Whether both are of the same quantities.
    fn is_comparable(&self, other: &Self) -> bool {
        let names = |point: &Self| [point.error.name, point.error.unit, point.cost.name, point.cost.unit];
        names(self) == names(other)
    }

    /// Whether both find the same, measured in the same quantities: one of them may be better.
    fn competes_with(&self, other: &Self) -> bool {
        (self.study, &self.subject) == (other.study, &other.subject) && self.is_comparable(other)
    }

    /// Whether it is nowhere worse than the other and somewhere better.
    fn dominates(&self, other: &Self) -> bool {
        let [a, b] = [self, other].map(|point| (point.cost.value, point.error.value));
        a.0 <= b.0 && a.1 <= b.1 && a != b
    }
}

/// For each (cost, gain) whether it is Pareto-optimal: no other costs no more and gains no less, one of the
/// two strictly.
pub fn front(points: &[(f64, f64)]) -> Vec<bool> {
    let costs: Vec<(f64, f64)> = points.iter().map(|(cost, gain)| (*cost, -gain)).collect();
    traces::pareto::nondominated(&costs)
}

/// The points of many studies.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Tradeoff {
    /// Study by study.
    pub points: Vec<TradeoffPoint>,
}

/// The path of the picture, without ending.
pub const PICTURE: &str = "tradeoff";

impl Tradeoff {
    /// Adds the files of the trade-off to a claim.
    pub fn add_to(claim: Claim) -> Claim {
        claim.plots([PICTURE]).files(["tradeoff.csv", "tradeoff.md", "tradeoff.json"])
    }

    /// Whether no point of the same subject dominates this one.
    pub fn is_optimal(&self, point: &TradeoffPoint) -> bool {
        !self.points.iter().any(|other| other.competes_with(point) && other.dominates(point))
    }

    /// All numbers.
    pub fn sheet(&self) -> Sheet {
        TableBuilder::of(&self.points)
            .column("study", "study", |point| point.study, plain)
            .column("subject", "what is found", |point| point.subject.as_str(), plain)
            .column("method", "method", |point| point.method.as_str(), plain)
            .column("level", "level", |point| point.level.as_str(), plain)
            .column("error_metric", "error", |point| point.error.name, plain)
            .data("error_unit", |point| point.error.unit)
            .data("error", |point| point.error.value)
            .shown("", |point| point.error.shown(), plain)
            .data("reference_error", |point| point.error.reference)
            .column("cost_metric", "cost", |point| point.cost.name, plain)
            .data("cost_unit", |point| point.cost.unit)
            .data("cost", |point| point.cost.value)
            .shown("", |point| point.cost.shown(), plain)
            .data("reference_cost", |point| point.cost.reference)
            .column(
                "pareto",
                "optimal",
                |point| self.is_optimal(point),
                |yes| if yes { "yes" } else { "" }.to_owned(),
            )
            .sheet()
    }

    /// Writes picture and numbers.
    ///
    /// # Errors
    /// Errors of the folder.
    pub fn write(&self, dir: &OutDir, plot_style: &PlotStyle) -> Result<(), OutputError> {
        let sheet = self.sheet();
        self.picture(plot_style).write(dir, PICTURE)?;
        dir.write_file("tradeoff.csv", |out| sheet.write_csv(out))?;
        let book = sheet.markdown().unwrap_or_default();
        dir.write_file("tradeoff.md", |out| Ok(out.write_all(book.as_bytes())?))?;
        dir.write_json("tradeoff.json", &sheet)
    }

    /// A panel for each pair of quantities, a series for each method.
    pub fn picture(&self, plot_style: &PlotStyle) -> Picture {
        let subject = "each point a level of a method; lower and further left is better; lines: Pareto fronts, one for \
                       each thing that is found";
        Chart::new("Speed against accuracy of every method", subject, self.panels()).picture(plot_style)
    }

    fn panels(&self) -> Vec<ChartPanel> {
        groups(self.points.iter(), TradeoffPoint::is_comparable)
            .iter()
            .map(|points| self.panel(points))
            .collect()
    }

    fn panel(&self, points: &[&TradeoffPoint]) -> ChartPanel {
        let fronts = groups(points.iter().copied(), TradeoffPoint::competes_with);
        let fronts: Vec<Vec<(f64, f64)>> = fronts.iter().map(|points| self.front(points)).collect();
        let lines = fronts.into_iter().filter(|front| front.len() > 1);
        let lines = lines.map(|front| Series::new("", PlotMark::Steps(front)).painted(Paint::Grey));
        let methods = groups(points.iter().copied(), |a, b| a.method == b.method);
        let dots = methods.iter().enumerate().map(|(place, points)| {
            let place_of = |point: &&TradeoffPoint| (point.cost.value, point.error.value, String::new());
            let dots = PlotMark::Dots(points.iter().map(place_of).collect());
            Series::new(points[0].method.as_str(), dots).painted(Paint::Like(place))
        });
        let [error, cost] = [&points[0].error, &points[0].cost];
        let axis = |metric: &Metric, scale, zero: &str| AxisSpec {
            name: metric.label(),
            scale,
            zero: zero.to_owned(),
            ..AxisSpec::default()
        };
        // Without a value above zero there is nothing that a logarithm could show.
        let exact = points.iter().all(|point| point.error.value == 0.0);
        let scale = if exact { Scale::Listed(vec!["exact".to_owned()]) } else { Scale::Decades };
        let axes = [axis(cost, Scale::Decades, ""), axis(error, scale, "exact")];
        let mut subjects: Vec<&str> = points.iter().map(|point| point.study).collect();
        subjects.dedup();
        ChartPanel::over(&subjects.join(", "), axes, lines.chain(dots).collect())
    }

    /// The Pareto front of points that compete, from the cheapest on.
    fn front(&self, points: &[&TradeoffPoint]) -> Vec<(f64, f64)> {
        let optimal = points.iter().filter(|point| self.is_optimal(point));
        let mut front: Vec<(f64, f64)> = optimal.map(|point| (point.cost.value, point.error.value)).collect();
        front.sort_by(|a, b| a.0.total_cmp(&b.0));
        front.dedup();
        front
    }
}

const TEMPLATE: &str = include_str!("../../assets/charts.html");
/// The end of the name makes every value escaped for HTML.
const TEMPLATE_NAME: &str = "charts.html";

/// A study on the page.
#[derive(Clone, Debug, Default, Serialize)]
pub struct StudySection {
    /// Name of the study on the command line.
    pub name: String,
    /// Subject of the study, in one line.
    pub about: String,
    /// Tables, as printed.
    pub text: String,
    /// Pictures: paths relative to the page, without ending; each is there as `.svg` and `.png`.
    pub pictures: Vec<String>,
    /// Other files, relative to the page.
    pub files: Vec<String>,
    /// Seconds of the clock on the wall that it took.
    pub took_s: f64,
}

/// The page.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Index {
    /// The command that makes it.
    pub command: String,
    /// The studies, in the order in which they were made.
    pub sections: Vec<StudySection>,
    /// Names of those that are still to come.
    pub missing: Vec<String>,
    /// Methods of all studies between speed and accuracy.
    #[serde(skip)]
    pub tradeoff: Tradeoff,
}

/// A line of the table of speed against accuracy.
#[derive(Serialize)]
struct Line<'a> {
    study: &'a str,
    subject: &'a str,
    method: &'a str,
    level: &'a str,
    /// Name and value of each.
    error: [String; 2],
    cost: [String; 2],
    optimal: bool,
}

impl StudySection {
    /// Adds the files of the study, by their names relative to the page.
    #[must_use]
    pub fn with_files(mut self, files: Vec<String>) -> Self {
        for file in files {
            match file.strip_suffix(".svg") {
                Some(picture) => self.pictures.push(picture.to_owned()),
                None if file.ends_with(".png") => {}
                None => self.files.push(file),
            }
        }
        self
    }
}

/// The files of the page.
pub fn claim() -> Claim {
    Tradeoff::add_to(Claim::new("chart all").files(["index.html"]))
}

impl Index {
    /// Writes `index.html` and the files of speed against accuracy.
    ///
    /// # Errors
    /// When the page cannot be filled or written.
    pub fn write(&self, dir: &OutDir, plot_style: &PlotStyle) -> Result<(), IndexError> {
        self.tradeoff.write(dir, plot_style)?;
        let mut environment = Environment::new();
        environment.set_trim_blocks(true);
        environment.set_lstrip_blocks(true);
        environment.add_template(TEMPLATE_NAME, TEMPLATE).map_err(ReportError::from)?;
        let page = environment.get_template(TEMPLATE_NAME).map_err(ReportError::from)?;
        let html = page.render(context! { index => self, picture => PICTURE, lines => self.lines() });
        let html = html.map_err(ReportError::from)?;
        dir.write_file("index.html", |out| Ok(out.write_all(html.as_bytes())?))?;
        Ok(())
    }

    fn lines(&self) -> Vec<Line<'_>> {
        let points = self.tradeoff.points.iter();
        let line = points.map(|point| Line {
            study: point.study,
            subject: &point.subject,
            method: &point.method,
            level: &point.level,
            error: [point.error.name.to_owned(), point.error.shown()],
            cost: [point.cost.name.to_owned(), point.cost.shown()],
            optimal: self.tradeoff.is_optimal(point),
        });
        line.collect()
    }
}

/// Why there is no page.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs, reason = "each is what its source says")]
pub enum IndexError {
    #[error(transparent)]
    Page(#[from] ReportError),
    #[error(transparent)]
    Output(#[from] OutputError),
}

#[cfg(test)]
mod tests {
    use super::*;

    fn point(subject: &str, method: &str, error: f64, host_s: f64) -> TradeoffPoint {
        TradeoffPoint::new(subject, [method, ""], [Metric::rmse(error), Metric::host_s(host_s)])
    }

    #[test]
    fn the_front_is_what_nothing_dominates() {
        let points = [(1.0, 0.1), (2.0, 0.5), (2.0, 0.4), (3.0, 0.5), (4.0, 0.9), (4.0, 0.9)];
        assert_eq!(front(&points), [true, true, false, false, true, true]);
        assert!(front(&[]).is_empty());
    }

    #[test]
    fn only_points_of_one_subject_and_the_same_quantities_compete() {
        let exact = TradeoffPoint { error: Metric::new("wrong", "%", 0.0), ..point("a", "other", 0.0, 0.1) };
        let points = vec![
            point("a", "fast", 0.4, 1.0),
            point("a", "slow", 0.5, 2.0),
            point("b", "slow", 0.5, 2.0),
            point("a", "slow", 0.1, 4.0),
            exact,
        ];
        let all = Tradeoff { points };
        let optimal: Vec<bool> = all.points.iter().map(|point| all.is_optimal(point)).collect();
        assert_eq!(optimal, [true, false, true, true, true]);
        let panels = all.panels();
        let names = |panel: &ChartPanel| {
            panel.series.iter().map(|series| series.name.clone()).filter(|name| !name.is_empty()).collect()
        };
        let names: Vec<Vec<String>> = panels.iter().map(names).collect();
        assert_eq!(names, [vec!["fast", "slow"], vec!["other"]]);
        let svg = all.picture(&PlotStyle::default()).svg().unwrap();
        assert!(svg.contains("RMSE") && svg.contains("host time (s)") && svg.contains("wrong (%)"));
    }

    #[test]
    fn names_are_escaped_and_speed_against_accuracy_is_there() {
        let folder = tempfile::tempdir().unwrap();
        let section =
            StudySection { name: "<b>".into(), text: "1 < 2".into(), took_s: 1.0, ..StudySection::default() };
        let section = section.with_files(["p.csv", "p.png", "p.svg"].map(str::to_owned).into());
        assert_eq!(
            (&section.pictures[..], &section.files[..]),
            (&["p".to_owned()][..], &["p.csv".to_owned()][..])
        );
        let missing = vec!["timing".into()];
        let point = TradeoffPoint::new("frames", ["packet", ""], [Metric::rmse(0.25), Metric::host_s(2.0)]);
        let tradeoff = Tradeoff { points: vec![point.of("timing")] };
        let index = Index { command: "quintile".into(), sections: vec![section], missing, tradeoff };
        OutDir::with(folder.path(), claim(), |dir| index.write(dir, &PlotStyle::default())).unwrap().unwrap();
        let read = |name: &str| std::fs::read_to_string(folder.path().join(name)).unwrap();
        let page = read("index.html");
        assert!(page.contains("Not finished") && page.contains("timing"));
        assert!(page.contains("&lt;b&gt;") && page.contains("1 &lt; 2") && page.contains("p.svg"));
        assert!(page.contains("packet") && page.contains("0.2500") && page.contains("tradeoff.svg"));
        let line = "timing,frames,packet,,RMSE,,0.25,,host time,s,2.0,,true";
        assert!(read("tradeoff.csv").ends_with(&format!("{line}\n")), "{}", read("tradeoff.csv"));
        assert!(read("tradeoff.json").contains("\"error_metric\": \"RMSE\""));
    }
}
