//! Interchange: CSV with the header `time_s,voltage_V,current_A`, no comment lines, and a JSON file beside it.

mod write;

use super::{ReadError, ReadOptions, Rows};
use crate::trace::Trace;
use std::path::{Path, PathBuf};
pub use write::{save, save_as, write, write_sidecar, write_with};

/// Where the description of a CSV file lies: the same name ending in `.json`.
pub fn sidecar_path(path: &Path) -> PathBuf {
    path.with_extension("json")
}

/// Where [`save_as`] puts the description of a file: that of one packed with gzip lies where it would unpacked.
pub fn description_path(path: &Path, gzip: bool) -> PathBuf {
    if gzip { sidecar_path(&path.with_extension("")) } else { sidecar_path(path) }
}

/// What stands between the fields of a text's first line: a tab or a semicolon if it has any, else a comma.
pub(crate) fn delimiter(text: &[u8]) -> u8 {
    let line = text.split(|&byte| byte == b'\n').next().unwrap_or_default();
    [b'\t', b';'].into_iter().find(|byte| line.contains(byte)).unwrap_or(b',')
}

/// Reads a CSV file, and its description if there is a [`sidecar_path`].
///
/// Columns are found by name without regard to case, in any order among others; `time_s` may be missing if the
/// description states the rate. Without a description the rate is that of the time stamps.
///
/// # Errors
/// [`ReadError`] names the file, the row and how to mend it.
pub fn read(path: &Path) -> Result<Trace, ReadError> {
    Ok(crate::io::read::load(Rows::csv(path, &ReadOptions::default(), false)?)?.trace)
}
