//! Error of writing results.

use std::io;
use std::path::PathBuf;

use super::BoxError;

/// Error of writing results.
#[derive(Debug, thiserror::Error)]
pub enum OutputError {
    /// The folder cannot be created or written.
    #[error(
        "{}: cannot use it as the folder for results: {source}; name another with --out or check its permissions",
        path.display()
    )]
    Folder {
        /// Folder as given.
        path: PathBuf,
        /// Error of the system.
        source: io::Error,
    },
    /// Another process writes into the folder.
    #[error(
        "{}: another quintile{process} is writing results there; wait until it is done, or name another folder with --out",
        path.display()
    )]
    Busy {
        /// Folder as given.
        path: PathBuf,
        /// ` (process 123)`, or empty if the number is unknown.
        process: String,
    },
    /// A file that Quintile did not write has the name of a result.
    #[error(
        "{}: {why}; name another folder with --out, {}", path.display(),
        if *forcible { "or overwrite it with --force" } else { "or move it away" }
    )]
    InTheWay {
        /// File, with the folder as given.
        path: PathBuf,
        /// Reason why it is not an older result.
        why: String,
        /// Whether `--force` overwrites it.
        forcible: bool,
    },
    /// A file cannot be written.
    #[error(
        "{}: cannot write it: {source}; make room or check the permissions, or name another folder with --out",
        path.display()
    )]
    Write {
        /// File, with the folder as given.
        path: PathBuf,
        /// Error of the writer.
        source: BoxError,
    },
    /// A file of an earlier run cannot be read.
    #[error("{}: cannot read it: {source}; check its permissions, or name another folder with --out", path.display())]
    Read {
        /// File, with the folder as given.
        path: PathBuf,
        /// Error of the system.
        source: io::Error,
    },
    /// Results are complete, but cannot be moved into place.
    #[error(
        "{}: cannot move a new result there: {source}; the earlier results are as they were, the new ones wait in {}: make \
         room or check the permissions, and run a command with this folder again", path.display(), kept.display()
    )]
    Publish {
        /// File, with the folder as given.
        path: PathBuf,
        /// Location of the new results.
        kept: PathBuf,
        /// Error of the system.
        source: io::Error,
    },
    /// A file that the command did not claim.
    #[error("{path}: not among the files that this command may write: an internal error, please report it")]
    Unclaimed {
        /// Name of the file.
        path: String,
    },
}

impl OutputError {
    /// Whether this is a usage error (exit code 2) rather than a failure (exit code 1).
    pub fn is_usage(&self) -> bool {
        matches!(self, Self::Busy { .. } | Self::InTheWay { .. })
    }
}
