//! Small input files, and where the real ones are.

use std::fs;
use std::path::{Path, PathBuf};

use tempfile::TempDir;

/// Temporary folder of input files.
#[derive(Debug)]
pub struct Inputs {
    folder: TempDir,
}

impl Default for Inputs {
    fn default() -> Self {
        Self::new()
    }
}

impl Inputs {
    /// An empty folder.
    ///
    /// # Panics
    /// If it cannot be made.
    pub fn new() -> Self {
        Self { folder: TempDir::new().expect("a temporary folder can be made") }
    }

    /// Writes a file and returns its path.
    ///
    /// # Panics
    /// If it cannot be written.
    pub fn put(&self, name: &str, bytes: impl AsRef<[u8]>) -> String {
        let path = self.path(name);
        fs::write(&path, bytes).unwrap_or_else(|error| panic!("{path}: {error}"));
        path
    }

    /// Path of `name` in the folder, existing or not.
    pub fn path(&self, name: &str) -> String {
        self.folder.path().join(name).display().to_string()
    }
}

/// The root of the repository.
pub fn root() -> PathBuf {
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    here.parent().unwrap_or(here).to_path_buf()
}

/// The file `name` among the real scenes. A test that calls this is ignored unless `cfg(real_scenes)`.
pub fn real_scene(name: &str) -> String {
    let folder = std::env::var_os("QUINTILE_SCENES").expect("the folder of real scenes");
    Path::new(&folder).join(name).display().to_string()
}
