//! Comparison of two results: runs, tables of frames, images, or folders of images.

mod images;
mod runs;

use std::collections::BTreeMap;
use std::path::Path;

use serde::Serialize;
use traces::energy::Spread;

pub use images::{FolderComparison, ImageComparison, Named};
pub use runs::{RunComparison, Setting, shown};

/// Error of a comparison.
#[derive(Debug, thiserror::Error)]
pub enum CompareError {
    /// A file is missing or cannot be read.
    #[error("{path}: cannot read it: {source}; check the path")]
    Read {
        /// The file.
        path: String,
        /// Error of the system.
        source: std::io::Error,
    },
    /// The contents of a file are not of its format.
    #[error("{path}: {message}")]
    Broken {
        /// The file.
        path: String,
        /// The fault and the remedy.
        message: String,
    },
    /// The two cannot be compared, or an option does not apply.
    #[error("{0}")]
    Usage(String),
    /// The difference image cannot be made or written.
    #[error("{path}: cannot write it: {message}")]
    Write {
        /// The file.
        path: String,
        /// The cause.
        message: String,
    },
}

impl CompareError {
    /// Whether the request is at fault, or a file that it names (exit code 2), rather than the writing of the result (exit code 1).
    pub fn is_usage(&self) -> bool {
        !matches!(self, Self::Write { .. })
    }

    fn broken(path: &Path, message: impl Into<String>) -> Self {
        Self::Broken { path: path.display().to_string(), message: message.into() }
    }

    fn unreadable(path: &Path) -> impl FnOnce(std::io::Error) -> Self {
        let path = path.display().to_string();
        |source| Self::Read { path, source }
    }
}

/// Largest relative difference of sums of the same numbers in another order.
const ROUNDING: f64 = 1e-13;

/// Result of a comparison.
#[derive(Clone, Debug, Serialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum Comparison {
    /// Two runs.
    Runs(RunComparison),
    /// Two tables of frames.
    Frames(TableComparison),
    /// Two images.
    Images(ImageComparison),
    /// Images of the same name in two folders.
    Folders(FolderComparison),
}

/// Kind of result at a path.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Run,
    Frames,
    Image,
    Folder,
}

impl Kind {
    fn of(path: &Path) -> Result<Self, CompareError> {
        let metadata = std::fs::metadata(path).map_err(CompareError::unreadable(path))?;
        if metadata.is_dir() {
            return Ok(if path.join(runs::SUMMARY).is_file() { Self::Run } else { Self::Folder });
        }
        let ending = path.extension().and_then(|ending| ending.to_str()).unwrap_or_default();
        match ending.to_ascii_lowercase().as_str() {
            "json" => Ok(Self::Run),
            "csv" => Ok(Self::Frames),
            "png" | "exr" | "jpg" | "jpeg" => Ok(Self::Image),
            _ => Err(CompareError::Usage(format!(
                "{}: it is neither a run (a folder with summary.json), a frames.csv nor an image (.png, .exr): give one of these",
                path.display()
            ))),
        }
    }

    fn description(self) -> &'static str {
        match self {
            Self::Run => "a run",
            Self::Frames => "a table of frames",
            Self::Image => "an image",
            Self::Folder => "a folder of images",
        }
    }
}

/// Compares the results at `a` and `b`. A difference image is written to `out`.
///
/// # Errors
/// [`CompareError`]. A difference is not an error.
pub fn compare(a: &Path, b: &Path, out: Option<&Path>) -> Result<Comparison, CompareError> {
    let kinds = [Kind::of(a)?, Kind::of(b)?];
    if kinds[0] != kinds[1] {
        let [one, other] = kinds.map(Kind::description);
        return Err(CompareError::Usage(format!(
            "{} is {one} and {} {other}: give two of a kind",
            a.display(),
            b.display()
        )));
    }
    if out.is_some() && kinds[0] != Kind::Image {
        let message = format!(
            "--out is for the difference of two images, and these are not: leave it out ({})",
            kinds[0].description()
        );
        return Err(CompareError::Usage(message));
    }
    match kinds[0] {
        Kind::Run => runs::compare(a, b).map(Comparison::Runs),
        Kind::Frames => compare_tables(a, b).map(Comparison::Frames),
        Kind::Image => images::compare(a, b, out).map(Comparison::Images),
        Kind::Folder => images::compare_folders(a, b).map(Comparison::Folders),
    }
}

/// Value of a quantity in A and in B.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Change {
    /// Group of the quantity.
    pub group: String,
    /// Its name.
    pub name: String,
    /// Its unit; empty for counts and shares.
    pub unit: String,
    /// Value in A, if present.
    pub a: Option<f64>,
    /// Value in B, if present.
    pub b: Option<f64>,
    /// B minus A.
    pub difference: Option<f64>,
    /// B over A; `None` if A is zero.
    pub ratio: Option<f64>,
}

impl Change {
    /// The change from `a` to `b`.
    pub fn new(group: &str, name: &str, unit: &str, [a, b]: [Option<f64>; 2]) -> Self {
        let both = a.zip(b);
        Self {
            group: group.to_owned(),
            name: name.to_owned(),
            unit: unit.to_owned(),
            a,
            b,
            difference: both.map(|(a, b)| b - a),
            ratio: both.filter(|(a, _)| *a != 0.0).map(|(a, b)| b / a),
        }
    }

    /// Whether both values are equal but for the rounding of sums, or both are missing.
    pub fn is_equal(&self) -> bool {
        let close = |(a, b): (f64, f64)| (a - b).abs() <= ROUNDING * a.abs().max(b.abs());
        self.a == self.b || self.a.zip(self.b).is_some_and(close)
    }
}

/// Comparison of two tables of frames.
#[derive(Clone, Debug, Serialize)]
pub struct TableComparison {
    /// The files.
    pub files: [String; 2],
    /// Number of frames, and mean and standard deviation of each column.
    pub values: Vec<Change>,
}

/// Columns of `frames.csv` that are compared, with their units.
const COLUMNS: [(&str, &str); 6] = [
    ("duration_s", "s"),
    ("energy_J", "J"),
    ("power_W", "W"),
    ("energy_per_pixel_J", "J"),
    ("confidence", ""),
    ("true_energy_J", "J"),
];

/// Compares two tables written by `quintile run` or `quintile trace frames`.
fn compare_tables(a: &Path, b: &Path) -> Result<TableComparison, CompareError> {
    let [one, other] = [read(a)?, read(b)?];
    let frames = [&one, &other].map(|table| table.values().map(Vec::len).max().map(|count| count as f64));
    let mut values = vec![Change::new("frames", "frames", "", frames)];
    for (column, unit) in COLUMNS {
        let numbers = [&one, &other].map(|table| table.get(column).filter(|column| !column.is_empty()));
        if numbers.iter().all(Option::is_none) {
            continue;
        }
        let spreads = numbers.map(|numbers| numbers.and_then(|numbers| Spread::of(numbers)));
        let means = spreads.map(|spread| spread.map(|spread| spread.mean));
        values.push(Change::new("mean over frames", column, unit, means));
        let deviations = spreads.map(|spread| spread.map(|spread| spread.deviation));
        values.push(Change::new("standard deviation", column, unit, deviations));
    }
    Ok(TableComparison { files: [a, b].map(|path| path.display().to_string()), values })
}

/// Reads the known columns; empty cells are skipped.
fn read(path: &Path) -> Result<BTreeMap<&'static str, Vec<f64>>, CompareError> {
    let broken = |message: String| CompareError::broken(path, message);
    let file = std::fs::File::open(path).map_err(CompareError::unreadable(path))?;
    let mut reader = csv::Reader::from_reader(file);
    let header = reader.headers().map_err(|error| broken(format!("not a CSV file: {error}")))?.clone();
    let place = |name: &str| header.iter().position(|column| column == name);
    let places: Vec<(&'static str, usize)> =
        COLUMNS.iter().filter_map(|(name, _)| Some((*name, place(name)?))).collect();
    if !places.iter().any(|(name, _)| *name == "energy_J") {
        return Err(broken(
            "it has no column `energy_J`: give a frames.csv of `quintile run` or `quintile trace frames`"
                .to_owned(),
        ));
    }
    let mut table: BTreeMap<&'static str, Vec<f64>> =
        places.iter().map(|(name, _)| (*name, Vec::new())).collect();
    for (line, record) in (2..).zip(reader.records()) {
        let record = record.map_err(|error| broken(format!("line {line}: {error}")))?;
        for (name, place) in &places {
            let cell = record.get(*place).unwrap_or_default().trim();
            if cell.is_empty() {
                continue;
            }
            let number = cell.parse::<f64>().ok().filter(|number| number.is_finite());
            let number = number.ok_or_else(|| {
                broken(format!("line {line}: {name} is `{cell}`, which is not a finite number"))
            })?;
            table.entry(name).or_default().push(number);
        }
    }
    Ok(table)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_change_has_a_sign_and_a_ratio() {
        let change = Change::new("g", "n", "J", [Some(2.0), Some(1.5)]);
        assert_eq!((change.difference, change.ratio), (Some(-0.5), Some(0.75)));
        assert_eq!(Change::new("g", "n", "J", [Some(0.0), Some(1.0)]).ratio, None);
        assert!(Change::new("g", "n", "J", [Some(0.1 + 0.2), Some(0.3)]).is_equal());
        assert!(!Change::new("g", "n", "J", [Some(1.0), Some(1.0 + 1e-9)]).is_equal());
        let missing = Change::new("g", "n", "J", [None, Some(1.0)]);
        assert!(!missing.is_equal() && missing.difference.is_none());
    }

    #[test]
    fn tables_are_compared_by_their_means() {
        let folder = tempfile::tempdir().unwrap();
        let put = |name: &str, text: &str| {
            std::fs::write(folder.path().join(name), text).unwrap();
            folder.path().join(name)
        };
        let a = put("a.csv", "frame,duration_s,energy_J,true_energy_J\n0,0.1,2,\n1,0.1,4,\n");
        let b = put("b.csv", "frame,duration_s,energy_J,true_energy_J\n0,0.1,6,\n");
        let compared = compare_tables(&a, &b).unwrap();
        let energy = compared.values.iter().find(|change| change.name == "energy_J").unwrap();
        assert_eq!((energy.a, energy.b, energy.ratio), (Some(3.0), Some(6.0), Some(2.0)));
        assert_eq!(compared.values[0].difference, Some(-1.0));
        assert!(compared.values.iter().all(|change| change.name != "true_energy_J"));
        for (text, says) in
            [("a,b\n1,2\n", "no column `energy_J`"), ("energy_J\nnan\n", "line 2: energy_J is `nan`")]
        {
            let error = compare_tables(&a, &put("c.csv", text)).unwrap_err();
            assert!(error.is_usage() && error.to_string().contains(says), "{error}");
        }
    }
}
