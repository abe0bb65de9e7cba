//! One page of all studies: speed against accuracy, every picture, every table.

use minijinja::{Environment, context};
use serde::Serialize;

use super::tradeoff::{PICTURE, Tradeoff};
use output::plot::Look;
use output::report::ReportError;
use output::{Claim, OutDir, OutputError};

const TEMPLATE: &str = include_str!("../../assets/charts.html");
/// The end of the name makes every value escaped for HTML.
const TEMPLATE_NAME: &str = "charts.html";

/// A study on the page.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Section {
    /// Its name on the command line.
    pub name: String,
    /// Its subject, in one line.
    pub about: String,
    /// Its tables, as printed.
    pub text: String,
    /// Its pictures: paths relative to the page, without ending; each is there as `.svg` and `.png`.
    pub pictures: Vec<String>,
    /// Its other files, relative to the page.
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
    pub sections: Vec<Section>,
    /// Names of those that are still to come.
    pub missing: Vec<String>,
    /// Their methods between speed and accuracy.
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

impl Section {
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
    pub fn write(&self, dir: &OutDir, look: &Look) -> Result<(), IndexError> {
        self.tradeoff.write(dir, look)?;
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
    use super::super::tradeoff::{Metric, TradeoffPoint};
    use super::*;

    #[test]
    fn names_are_escaped_and_speed_against_accuracy_is_there() {
        let folder = tempfile::tempdir().unwrap();
        let section = Section { name: "<b>".into(), text: "1 < 2".into(), took_s: 1.0, ..Section::default() };
        let section = section.with_files(["p.csv", "p.png", "p.svg"].map(str::to_owned).into());
        assert_eq!(
            (&section.pictures[..], &section.files[..]),
            (&["p".to_owned()][..], &["p.csv".to_owned()][..])
        );
        let missing = vec!["timing".into()];
        let point = TradeoffPoint::new("frames", ["packet", ""], [Metric::rmse(0.25), Metric::host_s(2.0)]);
        let tradeoff = Tradeoff { points: vec![point.of("timing")] };
        let index = Index { command: "quintile".into(), sections: vec![section], missing, tradeoff };
        OutDir::with(folder.path(), claim(), |dir| index.write(dir, &Look::default())).unwrap().unwrap();
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
