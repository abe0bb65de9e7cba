//! Folder of results: files are written aside and moved into place when all are complete.
//!
//! ```text
//! Destination --open--> OutDir --write--> .quintile/new --publish--> the folder, manifest.json
//! ```
//!
//! New files are in `.quintile/new` below the folder, so that they are on the same file system. This holds
//! for mount points, links and the current directory, too. Earlier results stay unchanged until new ones are
//! published. Files that no [manifest](Manifest) lists, or that changed since, belong to the user: they are
//! neither removed nor overwritten.

mod work;

use std::collections::{BTreeMap, BTreeSet};
use std::error::Error;
use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::{Component, Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use sha2::{Digest, Sha256};
use traces::io::atomic;
use work::{Swap, Work, slashed};

pub use work::{Entry, MANIFEST, Manifest, sha256_of, sha256_of_text};

/// Error of a file's writer.
pub type BoxError = Box<dyn Error + Send + Sync>;

/// Last file of a run. If it exists, the run is complete.
pub const SUMMARY: &str = "summary.json";

/// Destination of results, as given by the caller.
#[derive(Clone, Debug)]
pub struct Destination {
    /// The folder; created if missing.
    pub folder: PathBuf,
    /// Whether files that Quintile did not write may be overwritten.
    pub force: bool,
}

impl Destination {
    /// Destination in which only results of Quintile are overwritten.
    pub fn new(folder: impl Into<PathBuf>) -> Self {
        Self { folder: folder.into(), force: false }
    }

    /// Creates and locks the folder for the files of `claims`.
    ///
    /// # Errors
    /// [`OutputError::Folder`] if the folder cannot be created or written, [`OutputError::Busy`] if another
    /// process writes into it, [`OutputError::InTheWay`] for a file of the user with the name of a result.
    pub fn open(&self, claims: impl IntoIterator<Item = Claim>) -> Result<OutDir, OutputError> {
        OutDir::open(self, claims.into_iter().collect())
    }
}

/// A locked folder of results. Dropping it without [`Self::publish`] removes the new files.
#[derive(Debug)]
pub struct OutDir {
    destination: Destination,
    claims: Vec<Claim>,
    /// Results in the folder when it was opened or last published.
    listed: Manifest,
    /// Files written since then.
    written: Mutex<BTreeMap<String, Entry>>,
    work: Work,
}

impl OutDir {
    fn open(destination: &Destination, claims: Vec<Claim>) -> Result<Self, OutputError> {
        let (root, force) = (destination.folder.as_path(), destination.force);
        let work = Work::lock(root)?;
        Swap::recover(root, &work, force)?;
        let listed = Manifest::of_folder(root, force)?;
        for claim in &claims {
            claim.check(root, &listed, force)?;
        }
        work.try_folders(root, claims.iter().flat_map(Claim::folders).collect())?;
        let (destination, written) = (destination.clone(), Mutex::default());
        Ok(Self { destination, claims, listed, written, work })
    }

    /// Folder as given.
    pub fn path(&self) -> &Path {
        &self.destination.folder
    }

    /// Writes the file `relative` through `write` and creates its folders. It appears in the folder of
    /// results when [published](Self::publish).
    ///
    /// # Errors
    /// [`OutputError::Write`] with the file and the cause, [`OutputError::Unclaimed`] for a file that no
    /// claim lists.
    pub fn write_file(
        &self,
        relative: &str,
        write: impl FnOnce(&mut (dyn Write + Send)) -> Result<(), BoxError>,
    ) -> Result<(), OutputError> {
        let by = self.producer(relative)?;
        let staged = self.work.new_file(relative);
        let failed = |source| OutputError::Write { path: self.path().join(relative), source };
        // The signal handler removes the folder; it must not run between these two.
        let created = atomic::uninterrupted(|| {
            staged.parent().map_or(Ok(()), fs::create_dir_all)?;
            File::create(&staged)
        });
        let mut out = Counted::new(created.map_err(|error| failed(error.into()))?);
        write(&mut out).map_err(failed)?;
        let entry = out.entry(by).map_err(|error| failed(error.into()))?;
        let mut written = self.written.lock().unwrap_or_else(PoisonError::into_inner);
        written.insert(relative.to_owned(), entry);
        Ok(())
    }

    /// Writes `value` as an indented JSON file with a final line end.
    ///
    /// # Errors
    /// As [`Self::write_file`].
    pub fn write_json(&self, relative: &str, value: &impl serde::Serialize) -> Result<(), OutputError> {
        self.write_file(relative, |out| {
            serde_json::to_writer_pretty(&mut *out, value)?;
            Ok(writeln!(out)?)
        })
    }

    /// Moves the new files into place and removes older results of the same commands. Returns the sorted
    /// names of the new files.
    ///
    /// # Errors
    /// [`OutputError::InTheWay`] and [`OutputError::Publish`]. The folder is then unchanged, and the new
    /// results stay in `.quintile/new`. The next command with this folder moves them into place.
    pub fn publish(&mut self) -> Result<Vec<String>, OutputError> {
        let written = std::mem::take(self.written.get_mut().unwrap_or_else(PoisonError::into_inner));
        let names = written.keys().cloned().collect();
        let swap = Swap::new(self.path(), &self.work, self.listed.clone(), written);
        // Signals wait while old and new results are mixed.
        self.listed = atomic::uninterrupted(|| swap.run(self.destination.force))?;
        Ok(names)
    }

    /// Command that claims `relative`.
    fn producer(&self, relative: &str) -> Result<&str, OutputError> {
        let plain = Path::new(relative).components().all(|part| matches!(part, Component::Normal(_)));
        let claim = self.claims.iter().find(|claim| plain && claim.covers(relative));
        claim.map(Claim::by).ok_or_else(|| OutputError::Unclaimed { path: relative.to_owned() })
    }
}

impl OutDir {
    /// Opens `folder`, lets `make` write into it, and publishes.
    ///
    /// # Errors
    /// If the folder cannot be opened or the results cannot be moved into it.
    pub fn with<T>(folder: &Path, claim: Claim, make: impl FnOnce(&Self) -> T) -> Result<T, OutputError> {
        let mut dir = Destination::new(folder).open([claim])?;
        let made = make(&dir);
        dir.publish()?;
        Ok(made)
    }
}

/// Writer of a file that counts and hashes its bytes.
struct Counted {
    out: BufWriter<File>,
    hash: Sha256,
    bytes: u64,
}

impl Counted {
    fn new(file: File) -> Self {
        Self { out: BufWriter::new(file), hash: Sha256::new(), bytes: 0 }
    }

    fn entry(mut self, by: &str) -> io::Result<Entry> {
        self.out.flush()?;
        Ok(Entry { by: by.to_owned(), bytes: self.bytes, sha256: work::hex(self.hash) })
    }
}

impl Write for Counted {
    fn write(&mut self, buffer: &[u8]) -> io::Result<usize> {
        let count = self.out.write(buffer)?;
        self.hash.update(&buffer[..count]);
        self.bytes += count as u64;
        Ok(count)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.out.flush()
    }
}

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
        /// ` (process 123 on node7)`, or empty if it is unknown.
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
    /// Whether this is a usage error (exit code 2), such as a file in place of the folder or a name that no
    /// folder can have, rather than a failure (exit code 1).
    pub fn is_usage(&self) -> bool {
        match self {
            Self::Folder { source, .. } => {
                use io::ErrorKind::{AlreadyExists, InvalidFilename, NotADirectory};
                matches!(source.kind(), NotADirectory | AlreadyExists | InvalidFilename)
            }
            _ => matches!(self, Self::Busy { .. } | Self::InTheWay { .. }),
        }
    }
}

/// Files that a command may write into a folder, by relative names. A name may contain one `*`.
#[derive(Clone, Debug)]
pub struct Claim {
    by: String,
    names: BTreeSet<String>,
}

impl Claim {
    /// Empty claim of the command `by`, for example `chart timing`.
    pub fn new(by: impl Into<String>) -> Self {
        Self { by: by.into(), names: BTreeSet::new() }
    }

    /// Adds these files.
    #[must_use]
    pub fn files<S: Into<String>>(mut self, names: impl IntoIterator<Item = S>) -> Self {
        self.names.extend(names.into_iter().map(Into::into));
        self
    }

    /// Adds these plots, each as `STEM.svg` and `STEM.png`.
    #[must_use]
    pub fn plots<S: AsRef<str>>(self, stems: impl IntoIterator<Item = S>) -> Self {
        let both = |stem: S| ["svg", "png"].map(|end| format!("{}.{end}", stem.as_ref()));
        self.files(stems.into_iter().flat_map(both))
    }

    /// The command.
    pub fn by(&self) -> &str {
        &self.by
    }

    /// Whether the command may write `name`.
    pub(super) fn covers(&self, name: &str) -> bool {
        self.names.contains(name) || self.patterns().any(|pattern| matches(pattern, name))
    }

    fn patterns(&self) -> impl Iterator<Item = &str> {
        self.names.iter().map(String::as_str).filter(|name| name.contains('*'))
    }

    /// Folders of the files, relative; the empty path is the folder of results itself.
    pub(super) fn folders(&self) -> BTreeSet<PathBuf> {
        self.names.iter().filter_map(|name| Path::new(name).parent()).map(Path::to_owned).collect()
    }

    /// Checks that files in `root` that would be overwritten are older results of this command.
    pub(super) fn check(&self, root: &Path, listed: &Manifest, force: bool) -> Result<(), OutputError> {
        for folder in self.folders() {
            let at = root.join(&folder);
            if at.symlink_metadata().is_ok() && !at.is_dir() {
                let why = "it is not a folder, and results have to go into a folder of this name".to_owned();
                return Err(OutputError::InTheWay { path: at, why, forcible: false });
            }
            let entries = fs::read_dir(&at).into_iter().flatten().flatten();
            let mut names: Vec<String> = entries
                .filter_map(|entry| Some(slashed(&folder.join(entry.file_name().to_str()?))))
                .filter(|name| name != MANIFEST && self.covers(name))
                .collect();
            names.sort();
            for name in &names {
                listed.owner(root, name, &self.by)?.must_be_ours(&root.join(name), force)?;
            }
        }
        Ok(())
    }
}

/// Whether `name` matches `pattern`; `*` matches any text.
fn matches(pattern: &str, name: &str) -> bool {
    pattern.split_once('*').is_some_and(|(start, end)| {
        name.len() >= start.len() + end.len() && name.starts_with(start) && name.ends_with(end)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_claim_covers_its_names_plots_and_patterns() {
        let claim = Claim::new("x").files(["a.csv", "plots/VI_fig*.svg"]).plots(["plots/b"]);
        for name in ["a.csv", "plots/b.svg", "plots/b.png", "plots/VI_fig8.svg"] {
            assert!(claim.covers(name), "{name}");
        }
        for name in ["b.csv", "plots/b.pdf", "VI_fig8.svg", "plots/VI_fig8.png", "plots/VI_fi.svg"] {
            assert!(!claim.covers(name), "{name}");
        }
        assert_eq!(claim.folders().len(), 2);
    }
}
