//! The files that something is made from.
//!
//! Scenes, machines and tables are read through [`open`], [`read`] and [`read_to_string`], so that [`record`] knows every file,
//! also those that a file names.

use std::cell::RefCell;
use std::collections::BTreeSet;
use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};

thread_local! {
    /// Files opened on this thread, where somebody wants to know.
    static OPENED: RefCell<Option<BTreeSet<PathBuf>>> = const { RefCell::new(None) };
}

/// Does `work` and lists the files that it tried to open on this thread, in the order of their names.
pub fn record<T>(work: impl FnOnce() -> T) -> (T, Vec<PathBuf>) {
    let outer = OPENED.replace(Some(BTreeSet::new()));
    let done = work();
    let opened = OPENED.replace(outer).unwrap_or_default();
    opened.iter().for_each(|path| note(path));
    (done, opened.into_iter().collect())
}

/// Counts `path` among the files that something tried to open.
pub fn note(path: &Path) {
    OPENED.with_borrow_mut(|opened| {
        if let Some(opened) = opened {
            opened.insert(path.to_owned());
        }
    });
}

/// As [`File::open`].
///
/// # Errors
/// Those of the system.
pub fn open(path: &Path) -> io::Result<File> {
    note(path);
    File::open(path)
}

/// As [`std::fs::read`].
///
/// # Errors
/// Those of the system.
pub fn read(path: &Path) -> io::Result<Vec<u8>> {
    note(path);
    std::fs::read(path)
}

/// As [`std::fs::read_to_string`].
///
/// # Errors
/// Those of the system, or that the file is not UTF-8.
pub fn read_to_string(path: &Path) -> io::Result<String> {
    note(path);
    std::fs::read_to_string(path)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_opened_is_listed_once_also_if_it_is_missing() {
        let [a, b, c] = ["/nowhere/a", "/nowhere/b", "/nowhere/c"].map(Path::new);
        let (inner, outer) = record(|| {
            let _ = (read(b), open(a), read(b));
            record(|| read_to_string(c)).1
        });
        assert_eq!((inner, outer), (vec![c.to_owned()], vec![a.to_owned(), b.to_owned(), c.to_owned()]));
        assert_eq!(record(|| ()).1, [""; 0].map(PathBuf::from));
    }
}
