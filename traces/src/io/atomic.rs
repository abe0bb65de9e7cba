//! Files that are written whole or not at all. An interrupt removes those that are unfinished: a signal
//! handler has no arguments, so it finds them in a list of the whole process.

use std::collections::BTreeMap;
use std::error::Error;
use std::ffi::{OsStr, OsString};
use std::fmt;
use std::fs::{self, File};
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};

use tempfile::Builder;

use super::WriteError;

/// Writes a file under a temporary name in the same folder and renames it once it is complete and on disk; on
/// any failure the temporary file is removed and what stood at `path` before is untouched. A link is
/// followed, so that it stays one.
///
/// # Errors
/// [`WriteError`] with the path; what `fill` returned is in [`WriteError::Content`]. Something other
/// than a file (a folder, a device) is left alone.
pub fn write_file<E>(
    path: &Path,
    fill: impl FnOnce(&mut BufWriter<File>) -> Result<(), E>,
) -> Result<(), WriteError>
where
    E: Into<Box<dyn Error + Send + Sync>>,
{
    let path = &destination(path)?;
    let io = |source| WriteError::Io { path: path.to_owned(), source };
    let (unfinished, file, name) = temporary(path)?;
    let mut writer = BufWriter::new(file);
    fill(&mut writer).map_err(|error| WriteError::Content { path: path.to_owned(), source: error.into() })?;
    writer.flush().map_err(io)?;
    writer.get_ref().sync_all().map_err(io)?;
    drop(writer);
    fs::rename(name, path).map_err(io)?;
    unfinished.finish();
    Ok(())
}

/// Checks whether a file can be written at `path`, by creating the temporary one and removing it: before long
/// work, not after it.
///
/// # Errors
/// As [`write_file`].
pub fn try_place(path: &Path) -> Result<(), WriteError> {
    temporary(&destination(path)?).map(drop)
}

/// A new file beside `path` that is removed unless it is finished, and its path: `.name.XXXXXX.part`. Six
/// random letters keep threads, processes and hosts apart.
fn temporary(path: &Path) -> Result<(Unfinished, File, PathBuf), WriteError> {
    let io = |source| WriteError::Io { path: path.to_owned(), source };
    let name = path.file_name().ok_or_else(|| WriteError::NoName { path: path.to_owned() })?;
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let prefix: OsString = [OsStr::new("."), name, OsStr::new(".")].into_iter().collect();
    // An interrupt waits until the file is in the list.
    let mut list = list();
    let made = Builder::new().prefix(&prefix).suffix(".part").make_in(folder, |path| File::create_new(path));
    let (file, name) = made.map_err(io)?.keep().map_err(|error| io(error.error))?;
    // The first error is the one to report; a leftover that cannot be removed changes nothing about it.
    let unfinished = list.add({
        let name = name.clone();
        move || drop(fs::remove_file(name))
    });
    Ok((unfinished, file, name))
}

/// As [`write_file`], for samples: errors of their source name that file alone.
pub(super) fn write_trace(
    path: &Path,
    fill: impl FnOnce(&mut BufWriter<File>) -> Result<(), WriteError>,
) -> Result<(), WriteError> {
    let mut unread = None;
    let written = write_file(path, |out| {
        fill(out).map_err(|error| match error {
            WriteError::Read(error) => {
                unread = Some(error);
                WriteError::Encode("the samples cannot be read".to_owned())
            }
            error => error,
        })
    });
    unread.map_or(written, |error| Err(WriteError::Read(error)))
}

/// The place of a file called `path`, links followed.
fn destination(path: &Path) -> Result<PathBuf, WriteError> {
    match fs::metadata(path) {
        Ok(there) if !there.is_file() => Err(WriteError::NoName { path: path.to_owned() }),
        Ok(_) => fs::canonicalize(path).map_err(|source| WriteError::Io { path: path.to_owned(), source }),
        Err(_) => Ok(path.to_owned()),
    }
}

type Remove = Box<dyn FnOnce() + Send>;

/// How to remove each, by its number.
#[derive(Default)]
pub struct List {
    last: u64,
    removers: BTreeMap<u64, Remove>,
}

impl List {
    fn add(&mut self, remove: impl FnOnce() + Send + 'static) -> Unfinished {
        self.last += 1;
        self.removers.insert(self.last, Box::new(remove));
        Unfinished { number: self.last }
    }
}

static LIST: Mutex<List> = Mutex::new(List { last: 0, removers: BTreeMap::new() });

/// Something that is removed when this is dropped, or when the process is interrupted, unless it was finished
/// before.
pub struct Unfinished {
    number: u64,
}

impl Unfinished {
    /// Something that `remove` removes. `remove` must not make or drop another [`Unfinished`].
    pub fn new(remove: impl FnOnce() + Send + 'static) -> Self {
        list().add(remove)
    }

    /// Ends the write: the file is finished and stays.
    pub fn finish(self) {
        list().removers.remove(&self.number);
    }
}

impl fmt::Debug for Unfinished {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.debug_struct("Unfinished").field("number", &self.number).finish()
    }
}

impl Drop for Unfinished {
    fn drop(&mut self) {
        let remove = list().removers.remove(&self.number);
        if let Some(remove) = remove {
            remove();
        }
    }
}

fn list() -> MutexGuard<'static, List> {
    LIST.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Does `work` while an interrupt waits: makes a file that belongs to something unfinished, or takes steps
/// that belong together. `work` must not make or drop an [`Unfinished`].
pub fn uninterrupted<T>(work: impl FnOnce() -> T) -> T {
    let _held = list();
    work()
}

/// Removes everything unfinished. While the result is held, nothing new is begun: hold it until the process
/// ends.
pub fn remove_all() -> MutexGuard<'static, List> {
    let mut list = list();
    std::mem::take(&mut list.removers).into_values().for_each(|remove| remove());
    list
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io;

    fn names(folder: &Path) -> Vec<String> {
        fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect()
    }

    #[test]
    fn a_failed_write_leaves_the_old_file_and_nothing_else() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.txt");
        write_file(&path, |w| w.write_all(b"old")).unwrap();
        let error = write_file(&path, |w| {
            w.write_all(b"half of the ne")?;
            Err(io::Error::other("no more ink"))
        })
        .unwrap_err();
        assert!(error.to_string().contains("a.txt: no more ink"), "{error}");
        assert_eq!(fs::read(&path).unwrap(), b"old");
        assert_eq!(names(folder.path()), ["a.txt"]);
    }

    #[test]
    fn threads_that_write_one_file_do_not_disturb_each_other() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.txt");
        let write = |letter: u8| {
            for _ in 0..20 {
                write_file(&path, |w| w.write_all(&[letter; 50_000])).unwrap();
                let found = fs::read(&path).unwrap();
                assert!(found.len() == 50_000 && found.iter().all(|byte| *byte == found[0]));
            }
        };
        std::thread::scope(|scope| (b'a'..b'e').for_each(|letter| drop(scope.spawn(move || write(letter)))));
        assert_eq!(names(folder.path()), ["a.txt"]);
    }

    #[cfg(unix)]
    #[test]
    fn others_may_read_what_is_written() {
        use std::os::unix::fs::PermissionsExt;
        let folder = tempfile::tempdir().unwrap();
        let [ours, plain] = ["a.txt", "b.txt"].map(|name| folder.path().join(name));
        write_file(&ours, |w| w.write_all(b"a")).unwrap();
        File::create(&plain).unwrap();
        let mode = |path: &Path| fs::metadata(path).unwrap().permissions().mode();
        assert_eq!(mode(&ours), mode(&plain));
    }

    #[cfg(unix)]
    #[test]
    fn links_and_devices_stay_what_they_are() {
        let folder = tempfile::tempdir().unwrap();
        let [file, link] = ["a.txt", "link.txt"].map(|name| folder.path().join(name));
        fs::write(&file, "old").unwrap();
        std::os::unix::fs::symlink(&file, &link).unwrap();
        write_file(&link, |w| w.write_all(b"new")).unwrap();
        assert_eq!(fs::read(&file).unwrap(), b"new");
        assert!(fs::symlink_metadata(&link).unwrap().is_symlink());
        for taken in [Path::new("/dev/null"), folder.path()] {
            let error = write_file(taken, |w| w.write_all(b"new")).unwrap_err().to_string();
            assert!(error.contains("name a file"), "{error}");
        }
        assert!(!fs::metadata("/dev/null").unwrap().is_file());
    }

    #[test]
    fn failures_name_the_path() {
        let folder = tempfile::tempdir().unwrap();
        let none = |_: &mut BufWriter<File>| Ok::<(), io::Error>(());
        let missing = folder.path().join("no/such/a.txt");
        assert!(
            write_file(&missing, none).unwrap_err().to_string().contains("no/such/a.txt: cannot be written")
        );
        // Where a folder takes no files.
        assert!(write_file(Path::new("/proc/self/a.txt"), none).is_err());
        assert!(write_file(Path::new("/"), none).unwrap_err().to_string().contains("/: is not a file"));
    }
}
