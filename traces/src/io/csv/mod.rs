//! Interchange: CSV with the header `time_s,voltage_V,current_A`, no comment lines, and a JSON file beside it.

mod write;

use std::path::{Path, PathBuf};
pub use write::{save, save_as, write, write_sidecar, write_with};

/// Where the description of a CSV file may lie as well: the same name ending in `.json`.
pub fn sidecar_path(path: &Path) -> PathBuf {
    path.with_extension("json")
}

/// Where [`save_as`] puts the description of a file: its whole name and `.json`, which no other file shares.
pub fn description_path(path: &Path) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push(".json");
    name.into()
}

/// Where a description may be, in the order in which they are tried: [`description_path`], then [`sidecar_path`], also without `.gz`.
pub(crate) fn description_paths(path: &Path) -> impl Iterator<Item = PathBuf> {
    let inner = path.with_extension("");
    let unpacked = inner.extension().is_some().then(|| sidecar_path(&inner));
    [description_path(path), sidecar_path(path)].into_iter().chain(unpacked)
}

/// What stands between the fields of a text's first line: a tab or a semicolon if it has any, else a comma.
pub(crate) fn delimiter(text: &[u8]) -> u8 {
    let line = text.split(|&byte| byte == b'\n').next().unwrap_or_default();
    [b'\t', b';'].into_iter().find(|byte| line.contains(byte)).unwrap_or(b',')
}
