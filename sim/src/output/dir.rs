//! The folder of results. Files appear whole or not at all; `summary.json`, the marker of a whole run, comes last.

use std::error::Error;
use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::{Component, Path, PathBuf};

/// Anything that a writer of a file can fail with.
pub type BoxError = Box<dyn Error + Send + Sync>;

/// The file whose presence says that a run is whole.
pub const SUMMARY: &str = "summary.json";

/// Why results could not be written.
#[derive(Debug, thiserror::Error)]
pub enum OutputError {
    /// The folder could not be made or written to.
    #[error(
        "{path}: cannot use it as the folder for results: {source}; name another with --out or mend its permissions"
    )]
    Folder {
        /// The folder as it was named.
        path: String,
        /// What the system said.
        source: io::Error,
    },
    /// A file could not be written.
    #[error(
        "{path}: cannot write it: {source}; make room or check the permissions, or name another folder with --out"
    )]
    Write {
        /// The file, below the folder as it was named.
        path: String,
        /// What the writer said.
        source: BoxError,
    },
    /// A stale file of an earlier run could not be removed.
    #[error(
        "{path}: cannot remove this file of an earlier run: {source}; remove it by hand or name another folder with --out"
    )]
    Stale {
        /// The file, below the folder as it was named.
        path: String,
        /// What the system said.
        source: io::Error,
    },
    /// A name that leads out of the folder.
    #[error("{path}: not a plain relative path below the folder for results")]
    Path {
        /// The path as it was given.
        path: String,
    },
}

/// Whether a name is `.something.PID.tmp` of a process that does not run. Where the system does not tell, no file is taken
/// to be abandoned.
fn is_abandoned(name: &str) -> bool {
    let Some((_, pid)) =
        name.strip_suffix(".tmp").filter(|_| name.starts_with('.')).and_then(|n| n.rsplit_once('.'))
    else {
        return false;
    };
    let processes = Path::new("/proc");
    pid.parse::<u32>().is_ok() && processes.join("self").exists() && !processes.join(pid).exists()
}

/// The folder that a run writes into.
#[derive(Debug)]
pub struct OutDir {
    root: PathBuf,
}

impl OutDir {
    /// Makes the folder (and those above it), makes sure that it can be written to, and removes the `summary.json` of
    /// an earlier run, so that a run that dies on the way does not look whole.
    ///
    /// # Errors
    /// [`OutputError::Folder`] when the folder cannot be made or written, [`OutputError::Stale`] when the old summary
    /// cannot be removed.
    pub fn create(path: &Path) -> Result<Self, OutputError> {
        let folder = |source| OutputError::Folder { path: path.display().to_string(), source };
        fs::create_dir_all(path).map_err(folder)?;
        // Learn now, and not after minutes of simulation, that nothing can be written here.
        let probe = Temporary { path: path.join(format!(".probe.{}.tmp", std::process::id())) };
        File::create(&probe.path).map_err(folder)?;
        drop(probe);
        let dir = Self { root: path.to_owned() };
        dir.remove(&path.join(SUMMARY))?;
        dir.remove_abandoned()?;
        Ok(dir)
    }

    /// Removes temporary files of runs that were killed: those whose process is gone.
    fn remove_abandoned(&self) -> Result<(), OutputError> {
        for folder in ["", "images", "plots", "heat"] {
            let Ok(entries) = fs::read_dir(self.root.join(folder)) else { continue };
            for path in entries.flatten().map(|entry| entry.path()).filter(|path| path.is_file()) {
                if path.file_name().and_then(|name| name.to_str()).is_some_and(is_abandoned) {
                    self.remove(&path)?;
                }
            }
        }
        Ok(())
    }

    /// The folder as it was named.
    pub fn path(&self) -> &Path {
        &self.root
    }

    /// The files in the folder and in `plots/`, by their names relative to the folder, in order.
    ///
    /// # Errors
    /// [`OutputError::Folder`] when it cannot be read.
    pub fn files(&self) -> Result<Vec<String>, OutputError> {
        let folder = |source| OutputError::Folder { path: self.root.display().to_string(), source };
        let mut names = Vec::new();
        for below in ["", "plots/"] {
            let path = self.root.join(below);
            if !path.is_dir() {
                continue;
            }
            for entry in fs::read_dir(path).map_err(folder)? {
                let entry = entry.map_err(folder)?;
                if entry.path().is_file() {
                    names.extend(entry.file_name().to_str().map(|name| format!("{below}{name}")));
                }
            }
        }
        names.sort();
        Ok(names)
    }

    /// Removes files directly in `folder` (relative, may be absent; empty for the root) whose name begins with `prefix` and ends with one
    /// of `extensions` (without the dot): what an earlier, longer run left there.
    ///
    /// # Errors
    /// [`OutputError::Stale`] with the file that could not be removed.
    pub fn remove_stale(&self, folder: &str, prefix: &str, extensions: &[&str]) -> Result<(), OutputError> {
        let folder = if folder.is_empty() { self.root.clone() } else { self.resolve(folder)? };
        let Ok(entries) = fs::read_dir(folder) else { return Ok(()) };
        for path in entries.flatten().map(|entry| entry.path()).filter(|path| path.is_file()) {
            let named =
                path.file_name().and_then(|name| name.to_str()).is_some_and(|n| n.starts_with(prefix));
            let extension = path.extension().and_then(|extension| extension.to_str()).unwrap_or_default();
            if named && extensions.contains(&extension) {
                self.remove(&path)?;
            }
        }
        Ok(())
    }

    /// Writes the file `relative` (folders in between are made) through `write`, under a temporary name that becomes
    /// the real one only at the end. Returns the path of the file.
    ///
    /// # Errors
    /// [`OutputError::Write`] with the file and the cause; nothing is left behind then, and an older file stays.
    pub fn write_atomic(
        &self,
        relative: &str,
        write: impl FnOnce(&mut (dyn Write + Send)) -> Result<(), BoxError>,
    ) -> Result<PathBuf, OutputError> {
        self.place(relative, |temporary| {
            let mut out = BufWriter::new(File::create(temporary)?);
            write(&mut out)?;
            out.flush()?;
            Ok(())
        })
    }

    /// Writes `value` as a JSON file for people to read, a line end after it.
    ///
    /// # Errors
    /// As [`Self::write_atomic`].
    pub fn write_json(&self, relative: &str, value: &impl serde::Serialize) -> Result<PathBuf, OutputError> {
        // Text first: what is written has to be sendable, what is described need not.
        let text = serde_json::to_string_pretty(value);
        self.write_atomic(relative, |out| Ok(writeln!(out, "{}", text?)?))
    }

    /// Like [`Self::write_atomic`] for writers that want a path: `write` makes the file at the path it is given.
    ///
    /// # Errors
    /// As [`Self::write_atomic`].
    pub fn place(
        &self,
        relative: &str,
        write: impl FnOnce(&Path) -> Result<(), BoxError>,
    ) -> Result<PathBuf, OutputError> {
        let target = self.resolve(relative)?;
        let failed = |source: BoxError| OutputError::Write { path: target.display().to_string(), source };
        let temporary = Temporary::beside(&target);
        if let Some(folder) = target.parent() {
            fs::create_dir_all(folder).map_err(|error| failed(error.into()))?;
        }
        write(&temporary.path).map_err(failed)?;
        fs::rename(&temporary.path, &target).map_err(|error| failed(error.into()))?;
        Ok(target)
    }

    /// Writes `summary.json` and gives up the folder: nothing can be written after it.
    ///
    /// # Errors
    /// As [`Self::write_atomic`].
    pub fn complete(
        self,
        write: impl FnOnce(&mut (dyn Write + Send)) -> Result<(), BoxError>,
    ) -> Result<PathBuf, OutputError> {
        self.write_atomic(SUMMARY, write)
    }

    fn resolve(&self, relative: &str) -> Result<PathBuf, OutputError> {
        let path = Path::new(relative);
        let plain = path.components().all(|part| matches!(part, Component::Normal(_)));
        if relative.is_empty() || !plain {
            return Err(OutputError::Path { path: relative.to_owned() });
        }
        Ok(self.root.join(path))
    }

    fn remove(&self, path: &Path) -> Result<(), OutputError> {
        match fs::remove_file(path) {
            Err(source) if source.kind() != io::ErrorKind::NotFound => {
                Err(OutputError::Stale { path: path.display().to_string(), source })
            }
            _ => Ok(()),
        }
    }
}

/// A file that is gone when this goes out of scope, unless it was renamed before.
struct Temporary {
    path: PathBuf,
}

impl Temporary {
    fn beside(target: &Path) -> Self {
        let name = target.file_name().unwrap_or_default().to_string_lossy();
        Self { path: target.with_file_name(format!(".{name}.{}.tmp", std::process::id())) }
    }
}

impl Drop for Temporary {
    fn drop(&mut self) {
        // Not found after a rename; any other failure has nobody to tell.
        let _ = fs::remove_file(&self.path);
    }
}
