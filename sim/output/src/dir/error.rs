//! Why results could not be written.

use std::io;
use std::path::PathBuf;

use super::BoxError;

/// Why results could not be written.
#[derive(Debug, thiserror::Error)]
pub enum OutputError {
    /// The folder could not be made or written to.
    #[error(
        "{}: cannot use it as the folder for results: {source}; name another with --out or check its permissions",
        path.display()
    )]
    Folder {
        /// The folder as it was named.
        path: PathBuf,
        /// What the system reported.
        source: io::Error,
    },
    /// Another process writes into the folder.
    #[error(
        "{}: another quintile{process} is writing results there; wait until it is done, or name another folder with --out",
        path.display()
    )]
    Busy {
        /// The folder as it was named.
        path: PathBuf,
        /// ` (process 123)`, or nothing where the number is not known.
        process: String,
    },
    /// A file that Quintile did not write, where a result has to go.
    #[error(
        "{}: {why}; name another folder with --out, {}", path.display(),
        if *forcible { "or overwrite it with --force" } else { "or move it away" }
    )]
    InTheWay {
        /// The file, below the folder as it was named.
        path: PathBuf,
        /// Why it is not taken for an older result.
        why: String,
        /// Whether `--force` overwrites it.
        forcible: bool,
    },
    /// A file could not be written.
    #[error(
        "{}: cannot write it: {source}; make room or check the permissions, or name another folder with --out",
        path.display()
    )]
    Write {
        /// The file, below the folder as it was named.
        path: PathBuf,
        /// What the writer reported.
        source: BoxError,
    },
    /// A file of an earlier run could not be read.
    #[error("{}: cannot read it: {source}; check its permissions, or name another folder with --out", path.display())]
    Read {
        /// The file, below the folder as it was named.
        path: PathBuf,
        /// What the system reported.
        source: io::Error,
    },
    /// Results are whole, but could not be moved into place.
    #[error(
        "{}: cannot move a new result there: {source}; the earlier results are as they were, the new ones wait in {}: make \
         room or check the permissions, and run a command with this folder again", path.display(), kept.display()
    )]
    Publish {
        /// The file, below the folder as it was named.
        path: PathBuf,
        /// Where the new results are.
        kept: PathBuf,
        /// What the system reported.
        source: io::Error,
    },
    /// A file that the command did not list beforehand.
    #[error("{path}: not among the files that this command may write: an internal error, please report it")]
    Unclaimed {
        /// The name as it was given.
        path: String,
    },
}

impl OutputError {
    /// Whether the mistake is the caller's (exit code 2) rather than a failure (exit code 1).
    pub fn is_usage(&self) -> bool {
        matches!(self, Self::Busy { .. } | Self::InTheWay { .. })
    }
}
