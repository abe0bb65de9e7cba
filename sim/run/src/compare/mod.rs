//! Comparison of two results: runs, tables of frames, images, or folders of images.

mod images;
mod numbers;
mod runs;

use std::path::Path;

use serde::Serialize;

pub use images::{FolderComparison, ImageComparison, Named};
pub use numbers::{Change, TableComparison};
pub use runs::shown;
pub use runs::{RunComparison, Setting};

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
        /// What is wrong, and what to do.
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
        /// What went wrong.
        message: String,
    },
}

impl CompareError {
    /// Whether this is a usage error (exit code 2) rather than a broken file (exit code 1).
    pub fn is_usage(&self) -> bool {
        matches!(self, Self::Usage(_))
    }

    fn broken(path: &Path, message: impl Into<String>) -> Self {
        Self::Broken { path: path.display().to_string(), message: message.into() }
    }

    fn unreadable(path: &Path) -> impl FnOnce(std::io::Error) -> Self {
        let path = path.display().to_string();
        |source| Self::Read { path, source }
    }
}

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
        Kind::Frames => numbers::compare_tables(a, b).map(Comparison::Frames),
        Kind::Image => images::compare(a, b, out).map(Comparison::Images),
        Kind::Folder => images::compare_folders(a, b).map(Comparison::Folders),
    }
}
