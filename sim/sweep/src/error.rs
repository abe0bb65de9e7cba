//! Errors of a sweep.

use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use activity::spec::SpecError;
use output::OutputError;
use run::RunError;
use traces::io::WriteError;

use crate::place::placed;

/// Why a sweep cannot be planned, run or merged.
#[derive(Debug, thiserror::Error)]
pub enum SweepError {
    /// The sweep file cannot be read or parsed.
    #[error(transparent)]
    Spec(#[from] SpecError),
    /// A part of the sweep file is invalid.
    #[error("{file}: {place}: {message}")]
    Value {
        /// The sweep file.
        file: String,
        /// The part.
        place: String,
        /// What is wrong, and what to do.
        message: String,
    },
    /// No point can run with a setting: it is unknown, or its value is invalid.
    #[error("{file}: {message}")]
    Setting {
        /// The sweep file.
        file: String,
        /// What is wrong, and what to do.
        message: String,
    },
    /// A shard is wrong, or its variables are.
    #[error("{0}")]
    Shard(String),
    /// The folder holds another sweep.
    #[error("{folder} holds the sweep `{holds}`, and this is `{name}`: give another --out, or remove that folder", folder = .folder.display())]
    OtherSweep {
        /// The folder.
        folder: PathBuf,
        /// Sweep in it.
        holds: String,
        /// Sweep to be run.
        name: String,
    },
    /// The folder has no plan, or a damaged one.
    #[error("{path}: {message}", path = .path.display())]
    Plan {
        /// The file.
        path: PathBuf,
        /// What is wrong, and what to do.
        message: String,
    },
    /// A folder or file cannot be used.
    #[error("{path}: {source}; {remedy}", path = .path.display(), remedy = remedy(.source))]
    Folder {
        /// The folder or file.
        path: PathBuf,
        /// Error of the operating system.
        source: std::io::Error,
    },
    /// A result cannot be written.
    #[error("{0}{remedy}", remedy = kept(.0))]
    Write(#[from] WriteError),
    /// A file of the user has the name of a result.
    #[error("{path}: {why}; move or rename it, then call this again", path = .path.display())]
    InTheWay {
        /// The file.
        path: PathBuf,
        /// Why it is not an earlier result.
        why: String,
    },
    /// Another process writes results into the folder.
    #[error("{folder}: another quintile{process} writes results there; wait until it is done", folder = .folder.display())]
    Busy {
        /// The folder.
        folder: PathBuf,
        /// ` (process 123 on node7)`, or empty if it is unknown.
        process: String,
    },
    /// Results are complete, but cannot be moved into place.
    #[error(transparent)]
    Publish(OutputError),
    /// Points are not finished.
    #[error(
        "{folder}: {missing} of {points} points are not finished: call `quintile sweep run` again, or give --partial{damaged}",
        folder = .folder.display()
    )]
    Unfinished {
        /// The folder.
        folder: PathBuf,
        /// Points without a result.
        missing: usize,
        /// All points.
        points: usize,
        /// What is wrong with a damaged file; empty if none is.
        damaged: String,
    },
    /// Jobs cannot be submitted.
    #[error("{0}")]
    Slurm(String),
    /// An input file cannot be read.
    #[error(transparent)]
    Input(RunError),
}

impl SweepError {
    /// Whether the request is at fault, or an input that it names (exit code 2), rather than what came while it ran (exit code 1).
    pub fn is_usage(&self) -> bool {
        match self {
            Self::Folder { source, .. } => source.kind() == ErrorKind::NotADirectory,
            Self::Spec(_)
            | Self::Input(_)
            | Self::Value { .. }
            | Self::Setting { .. }
            | Self::Shard(_)
            | Self::OtherSweep { .. }
            | Self::InTheWay { .. }
            | Self::Busy { .. }
            | Self::Plan { .. } => true,
            Self::Write(_) | Self::Publish(_) | Self::Unfinished { .. } | Self::Slurm(_) => false,
        }
    }

    /// A wrong part of the sweep in the `text` of `file`, made of the place and what is wrong there.
    pub(crate) fn at(text: &str, file: &str) -> impl Fn((String, String)) -> Self {
        move |(place, message)| Self::Value { file: placed(text, file, &place), place, message }
    }

    /// Error of the operating system at `path`.
    pub(crate) fn folder(path: &Path) -> impl FnOnce(std::io::Error) -> Self {
        |source| Self::Folder { path: path.to_owned(), source }
    }
}

impl From<OutputError> for SweepError {
    fn from(error: OutputError) -> Self {
        match error {
            OutputError::InTheWay { path, why, .. } => Self::InTheWay { path, why },
            OutputError::Busy { path: folder, process } => Self::Busy { folder, process },
            OutputError::Folder { path, source } | OutputError::Read { path, source } => {
                Self::Folder { path, source }
            }
            OutputError::Write { path, source } => WriteError::Content { path, source }.into(),
            error @ (OutputError::Publish { .. } | OutputError::Unclaimed { .. }) => Self::Publish(error),
        }
    }
}

/// Whether no call can write there.
fn is_closed(error: &std::io::Error) -> bool {
    matches!(error.kind(), ErrorKind::ReadOnlyFilesystem | ErrorKind::PermissionDenied)
}

/// What to do about a folder or file that cannot be used.
fn remedy(error: &std::io::Error) -> &'static str {
    match error.kind() {
        ErrorKind::StorageFull => "make room on the disk",
        _ if is_closed(error) => "give a folder that you may read and write",
        _ => "check that it is a folder that you may read and write",
    }
}

/// End of a message about a result that cannot be written: going on helps unless the folder is closed.
fn kept(error: &WriteError) -> &'static str {
    match error {
        WriteError::Io { source, .. } if is_closed(source) => "",
        _ => "; what is finished is kept: call it again to continue",
    }
}
