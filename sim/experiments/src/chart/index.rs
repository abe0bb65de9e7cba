//! One page of all charts: speed against accuracy, every picture, every table.

use minijinja::{Environment, context};
use serde::Serialize;

use super::standing::Standing;
use output::report::ReportError;
use output::{Claim, OutDir, OutputError};

const TEMPLATE: &str = include_str!("../../assets/charts.html");
/// The end of the name makes every value escaped for HTML.
const TEMPLATE_NAME: &str = "charts.html";

/// A chart on the page.
#[derive(Clone, Debug, Serialize)]
pub struct Entry {
    /// Its name on the command line.
    pub name: String,
    /// What it shows.
    pub about: String,
    /// Its table, as printed.
    pub text: String,
    /// Its pictures: paths relative to the page, without ending; each is there as `.svg` and `.png`.
    pub pictures: Vec<String>,
    /// Its other files, relative to the page.
    pub files: Vec<String>,
    /// Seconds of the clock on the wall that it took.
    pub took_s: f64,
    /// Its levels between speed and accuracy.
    pub standings: Vec<Standing>,
}

/// The page.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Index {
    /// The command that makes it.
    pub command: String,
    /// The charts, in the order in which they were made.
    pub entries: Vec<Entry>,
    /// Names of the charts that are still to come.
    pub missing: Vec<String>,
}

impl Entry {
    /// Adds the files of the chart, by their names relative to the page.
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
    Claim::new("chart all").files(["index.html"])
}

impl Index {
    /// Writes `index.html`.
    ///
    /// # Errors
    /// When the page cannot be filled or written.
    pub fn write(&self, dir: &OutDir) -> Result<(), IndexError> {
        let mut environment = Environment::new();
        environment.set_trim_blocks(true);
        environment.set_lstrip_blocks(true);
        environment.add_template(TEMPLATE_NAME, TEMPLATE).map_err(ReportError::from)?;
        let page = environment.get_template(TEMPLATE_NAME).map_err(ReportError::from)?;
        let html = page.render(context! { index => self }).map_err(ReportError::from)?;
        dir.write_file("index.html", |out| Ok(out.write_all(html.as_bytes())?))?;
        Ok(())
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

    #[test]
    fn names_are_escaped() {
        let folder = tempfile::tempdir().unwrap();
        let entry = Entry {
            name: "<b>".into(),
            about: String::new(),
            text: "1 < 2".into(),
            pictures: Vec::new(),
            files: Vec::new(),
            took_s: 1.0,
            standings: Vec::new(),
        };
        let entry = entry.with_files(["p.csv", "p.png", "p.svg"].map(str::to_owned).into());
        assert_eq!(
            (&entry.pictures[..], &entry.files[..]),
            (&["p".to_owned()][..], &["p.csv".to_owned()][..])
        );
        let missing = vec!["timing".into()];
        let index = Index { command: "quintile".into(), entries: vec![entry], missing };
        OutDir::with(folder.path(), claim(), |dir| index.write(dir)).unwrap().unwrap();
        let page = std::fs::read_to_string(folder.path().join("index.html")).unwrap();
        assert!(page.contains("Not finished") && page.contains("timing"));
        assert!(page.contains("&lt;b&gt;") && page.contains("1 &lt; 2") && page.contains("p.svg"));
    }
}
