//! Recording of the input files of a run.
//!
//! Scenes, machines and tables are read through [`open`], [`read`] and [`read_to_string`], so [`record`]
//! lists every file that was read, including files named by other files.

use std::cell::RefCell;
use std::collections::BTreeSet;
use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};

thread_local! {
    /// Files opened on this thread while [`record`] is active.
    static OPENED: RefCell<Option<BTreeSet<PathBuf>>> = const { RefCell::new(None) };
}

/// Run `work` and list the files it tried to open on this thread, sorted by path.
pub fn record<T>(work: impl FnOnce() -> T) -> (T, Vec<PathBuf>) {
    let outer = OPENED.replace(Some(BTreeSet::new()));
    let done = work();
    let opened = OPENED.replace(outer).unwrap_or_default();
    opened.iter().for_each(|path| note(path));
    (done, opened.into_iter().collect())
}

/// Add `path` to the recorded files.
pub fn note(path: &Path) {
    OPENED.with_borrow_mut(|opened| {
        if let Some(opened) = opened {
            opened.insert(path.to_owned());
        }
    });
}

/// Record `path` and open it, as [`File::open`] does.
///
/// # Errors
/// Errors of [`File::open`].
pub fn open(path: &Path) -> io::Result<File> {
    note(path);
    File::open(path)
}

/// Record `path` and read it, as [`std::fs::read`] does.
///
/// # Errors
/// Errors of [`std::fs::read`].
pub fn read(path: &Path) -> io::Result<Vec<u8>> {
    note(path);
    std::fs::read(path)
}

/// Record `path` and read it, as [`std::fs::read_to_string`] does.
///
/// # Errors
/// Errors of [`std::fs::read_to_string`], such as text that is not UTF-8.
pub fn read_to_string(path: &Path) -> io::Result<String> {
    note(path);
    std::fs::read_to_string(path)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_file_is_listed_once_even_if_missing() {
        let [a, b, c] = ["/nowhere/a", "/nowhere/b", "/nowhere/c"].map(Path::new);
        let (inner, outer) = record(|| {
            let _ = (read(b), open(a), read(b));
            record(|| read_to_string(c)).1
        });
        assert_eq!((inner, outer), (vec![c.to_owned()], vec![a.to_owned(), b.to_owned(), c.to_owned()]));
        assert_eq!(record(|| ()).1, [""; 0].map(PathBuf::from));
    }
}
