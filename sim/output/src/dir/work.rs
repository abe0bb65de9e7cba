//! Locked folder of unfinished results, the manifest of the results that Quintile may replace, and the
//! replacement of older results.

use std::collections::{BTreeMap, BTreeSet};
use std::fs::{self, File, OpenOptions, TryLockError};
use std::io::{self, Read, Write};
use std::path::{Component, Path, PathBuf};

use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use traces::io::atomic::Unfinished;

use super::{OutputError, SUMMARY};

/// File name of the manifest.
pub const MANIFEST: &str = "manifest.json";
/// Below the folder of results.
const WORK_FOLDER: &str = ".quintile";

/// Schema version of the manifest.
const SCHEMA: u32 = 1;

/// List of the results in a folder.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Manifest {
    schema: u32,
    /// Files by relative name, with `/` between folders.
    pub files: BTreeMap<String, Entry>,
}

/// Entry of a file.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Entry {
    /// Command that wrote the file, for example `run`.
    pub by: String,
    /// Size in bytes.
    pub bytes: u64,
    /// SHA-256 of the contents, hexadecimal.
    pub sha256: String,
}

/// Owner of a file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Owner {
    /// The file does not exist.
    Nobody,
    /// An unchanged result of the same command.
    Ours,
    /// A file of the user or of another command, with the reason.
    User(String),
    /// The path is a folder.
    Folder,
}

impl Default for Manifest {
    fn default() -> Self {
        Self { schema: SCHEMA, files: BTreeMap::new() }
    }
}

impl Manifest {
    /// Reads the manifest in the folder `root`; a missing one is empty. An unreadable one counts as a file of
    /// the user and is overwritten only with `force`.
    pub(super) fn of_folder(root: &Path, force: bool) -> Result<Self, OutputError> {
        let path = root.join(MANIFEST);
        match Self::read(&path) {
            Err(OutputError::InTheWay { .. }) if force && !path.is_dir() => Ok(Self::default()),
            read => read,
        }
    }

    pub(super) fn read(path: &Path) -> Result<Self, OutputError> {
        let in_the_way = |why: &str| OutputError::InTheWay {
            path: path.to_owned(),
            why: why.to_owned(),
            forcible: !path.is_dir(),
        };
        let text = match fs::read(path) {
            Ok(text) => text,
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(Self::default()),
            Err(_) if path.is_dir() => {
                return Err(in_the_way("it is a folder, and the list of results goes there"));
            }
            Err(source) => return Err(OutputError::Read { path: path.to_owned(), source }),
        };
        let known = serde_json::from_slice(&text).ok().filter(Self::is_known);
        known.ok_or_else(|| in_the_way("it is not a list of results that this version of Quintile wrote"))
    }

    /// Whether the manifest is valid: schema version of this program, and names within the folder, except
    /// itself and `.quintile`.
    fn is_known(&self) -> bool {
        let inside = |name: &String| {
            let path = Path::new(name);
            path.components().all(|part| matches!(part, Component::Normal(_)))
                && !path.starts_with(WORK_FOLDER)
                && name != MANIFEST
        };
        self.schema == SCHEMA && self.files.keys().all(inside)
    }

    /// Owner of the file `name` in `root`, from the view of command `by`.
    pub(super) fn owner(&self, root: &Path, name: &str, by: &str) -> Result<Owner, OutputError> {
        let path = root.join(name);
        let unreadable = |source| OutputError::Read { path: path.clone(), source };
        let metadata = match path.symlink_metadata() {
            Ok(metadata) => metadata,
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(Owner::Nobody),
            Err(source) => return Err(unreadable(source)),
        };
        let user = |why: String| Ok(Owner::User(why));
        match self.files.get(name) {
            _ if metadata.is_dir() => Ok(Owner::Folder),
            None => user(format!("Quintile did not write this file ({MANIFEST} does not list it)")),
            Some(entry) if entry.by != by => user(format!("`quintile {}` wrote this file", entry.by)),
            Some(entry) if metadata.is_file() && metadata.len() == entry.bytes => {
                let sha256 = sha256_of(&path).map_err(unreadable)?;
                if sha256 == entry.sha256 { Ok(Owner::Ours) } else { user(CHANGED.to_owned()) }
            }
            Some(_) => user(CHANGED.to_owned()),
        }
    }
}

const CHANGED: &str = "this file was changed after Quintile wrote it";

/// SHA-256 of the contents of a file, hexadecimal.
///
/// # Errors
/// If the file cannot be read.
pub fn sha256_of(path: &Path) -> io::Result<String> {
    let mut hash = Sha256::new();
    io::copy(&mut File::open(path)?, &mut Hashing(&mut hash))?;
    Ok(hex(hash))
}

/// SHA-256 of a text, hexadecimal.
pub fn sha256_of_text(text: &str) -> String {
    hex(Sha256::new_with_prefix(text))
}

struct Hashing<'a>(&'a mut Sha256);

impl Write for Hashing<'_> {
    fn write(&mut self, buffer: &[u8]) -> io::Result<usize> {
        self.0.update(buffer);
        Ok(buffer.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

pub(super) fn hex(hash: Sha256) -> String {
    hash.finalize().iter().map(|byte| format!("{byte:02x}")).collect()
}

/// A relative path with `/` between folders.
pub(super) fn slashed(path: &Path) -> String {
    let parts: Vec<_> = path.iter().map(|part| part.to_string_lossy()).collect();
    parts.join("/")
}

impl Owner {
    /// Checks that a file is an older result or may be overwritten.
    pub(super) fn must_be_ours(self, path: &Path, force: bool) -> Result<Self, OutputError> {
        let (why, forcible) = match &self {
            Self::Nobody | Self::Ours => return Ok(self),
            Self::Folder => ("it is a folder, and a result has to go there as a file".to_owned(), false),
            Self::User(why) => (why.clone(), true),
        };
        if force && forcible {
            return Ok(self);
        }
        Err(OutputError::InTheWay { path: path.to_owned(), why, forcible })
    }
}

/// Folder `.quintile` below a folder of results, with a lock that ends with the process.
#[derive(Debug)]
pub(super) struct Work {
    path: PathBuf,
    /// Removes the folder before the lock.
    _unfinished: Unfinished,
    _lock: File,
}

impl Work {
    /// Creates and locks the folder below `root`; creates `root` if missing.
    pub fn lock(root: &Path) -> Result<Self, OutputError> {
        let made = missing(root);
        let path = root.join(WORK_FOLDER);
        if path.is_symlink() {
            let why = "it is a link, and new results are made in a folder of that name".to_owned();
            return Err(OutputError::InTheWay { path, why, forcible: false });
        }
        let lock = locked(root, &path).inspect_err(|_| {
            // Removes only empty folders; a folder in use contains its lock.
            let _ = fs::remove_dir(&path);
            remove_empty(&made);
        })?;
        let unfinished = Unfinished::new({
            let path = path.clone();
            move || {
                abandon(&path);
                remove_empty(&made);
            }
        });
        Ok(Self { path, _unfinished: unfinished, _lock: lock })
    }

    /// Path of the folder.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Path of the new file `relative`.
    pub fn new_file(&self, relative: &str) -> PathBuf {
        self.new_files().join(relative)
    }

    /// Folder of new files.
    pub fn new_files(&self) -> PathBuf {
        self.path.join("new")
    }

    /// Folder of older files during a replacement.
    pub fn old_file(&self, relative: &str) -> PathBuf {
        self.path.join("old").join(relative)
    }

    /// Manifest of complete new files.
    pub fn manifest(&self) -> PathBuf {
        self.path.join(MANIFEST)
    }

    /// Removes unneeded files.
    pub fn clear(&self) {
        clear(&self.path);
    }

    /// Checks before the work that files can be moved into the existing `folders` of `root`.
    pub fn try_folders(&self, root: &Path, folders: BTreeSet<PathBuf>) -> Result<(), OutputError> {
        let probe = self.path.join("probe");
        for folder in folders.iter().map(|folder| root.join(folder)).filter(|folder| folder.is_dir()) {
            let moved = folder.join(".quintile-probe");
            let tried = File::create(&probe).and_then(|_| fs::rename(&probe, &moved));
            let tried = tried.and_then(|()| fs::remove_file(&moved));
            if let Err(source) = tried {
                // Only one of the two exists.
                [probe, moved].iter().for_each(|file| drop(fs::remove_file(file)));
                return Err(OutputError::Folder { path: folder, source });
            }
        }
        Ok(())
    }
}

/// Missing folders on the path of `folder`, the innermost first.
fn missing(folder: &Path) -> Vec<PathBuf> {
    let above = folder.ancestors().filter(|folder| !folder.as_os_str().is_empty());
    above.take_while(|folder| folder.symlink_metadata().is_err()).map(Path::to_owned).collect()
}

fn remove_empty(folders: &[PathBuf]) {
    folders.iter().for_each(|folder| drop(fs::remove_dir(folder)));
}

/// Creates and locks `work`.
fn locked(root: &Path, work: &Path) -> Result<File, OutputError> {
    let failed = |source| OutputError::Folder { path: root.to_owned(), source };
    // An ending process may remove the lock between opening and locking: try again.
    for _ in 0..100 {
        fs::create_dir_all(work).map_err(failed)?;
        let mut file = match open(&work.join("lock")) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => continue,
            opened => opened.map_err(failed)?,
        };
        match file.try_lock() {
            Ok(()) => {}
            // This file system has no locks.
            Err(TryLockError::Error(error)) if error.kind() == io::ErrorKind::Unsupported => {}
            Err(TryLockError::Error(error)) => return Err(failed(error)),
            Err(TryLockError::WouldBlock) => return Err(busy(root, &mut file)),
        }
        if is_still_there(&mut file, &work.join("lock")).map_err(failed)? {
            return Ok(file);
        }
    }
    Err(OutputError::Busy { path: root.to_owned(), process: String::new() })
}

fn open(path: &Path) -> io::Result<File> {
    OpenOptions::new().read(true).write(true).create(true).truncate(false).open(path)
}

fn busy(root: &Path, lock: &mut File) -> OutputError {
    let mut owner = String::new();
    let known = lock.read_to_string(&mut owner).is_ok()
        && owner.split(' ').next().is_some_and(|number| number.parse::<u32>().is_ok());
    let process = if known { format!(" (process {owner})") } else { String::new() };
    OutputError::Busy { path: root.to_owned(), process }
}

/// This process, such as `123 on node7`: on a cluster other hosts have processes of the same number. Where
/// the system does not name its host, the number alone.
fn owner() -> String {
    let number = std::process::id();
    match fs::read_to_string("/proc/sys/kernel/hostname") {
        Ok(host) => format!("{number} on {}", host.trim()),
        Err(_) => number.to_string(),
    }
}

/// Writes this process into the lock and reads it back by name. The former owner may have removed the file
/// between opening and locking; then another process may lock another file.
fn is_still_there(lock: &mut File, path: &Path) -> io::Result<bool> {
    let owner = owner();
    lock.set_len(0)?;
    lock.write_all(owner.as_bytes())?;
    Ok(fs::read_to_string(path).is_ok_and(|found| found == owner))
}

/// Removes all but complete results, and the lock last: another process may then use the folder.
fn abandon(work: &Path) {
    clear(work);
    // The next process that locks the folder removes the rest.
    let _ = fs::remove_file(work.join("lock"));
    let _ = fs::remove_dir(work);
}

/// Removes new and old files. Complete results, marked by the manifest, are kept for the next command.
fn clear(work: &Path) {
    if work.join(MANIFEST).exists() {
        return;
    }
    for folder in ["new", "old"] {
        let _ = fs::remove_dir_all(work.join(folder));
    }
    let _ = fs::remove_file(work.join("probe"));
}

/// Older and new results of a folder.
///
/// All steps are renames within one file system. If one fails, the earlier ones are undone. If the process is
/// killed between them, the manifest of the new files stays in `.quintile`, and the next process
/// [finishes](Self::recover) the renames.
pub(super) struct Swap<'a> {
    root: &'a Path,
    work: &'a Work,
    old: Manifest,
    new: Manifest,
}

impl<'a> Swap<'a> {
    /// Replacement of `old` with `written` in the folder `root`.
    pub fn new(root: &'a Path, work: &'a Work, old: Manifest, written: BTreeMap<String, Entry>) -> Self {
        let by: BTreeSet<&str> = written.values().map(|entry| entry.by.as_str()).collect();
        let mut new = old.clone();
        new.files.retain(|_, entry| !by.contains(entry.by.as_str()));
        new.files.extend(written);
        Self { root, work, old, new }
    }

    /// Finishes the replacement of a killed process. Without complete results in `work`, clears it.
    pub fn recover(root: &'a Path, work: &'a Work, force: bool) -> Result<(), OutputError> {
        if work.manifest().exists() {
            let (old, new) = (Manifest::of_folder(root, force)?, Manifest::read(&work.manifest())?);
            Self { root, work, old, new }.replace(force)?;
        }
        work.clear();
        Ok(())
    }

    /// Replaces the older results and returns the new manifest.
    pub fn run(self, force: bool) -> Result<Manifest, OutputError> {
        let list = self.work.manifest();
        let failed = |source: io::Error| OutputError::Write { path: list.clone(), source: source.into() };
        let mut text = serde_json::to_string_pretty(&self.new).map_err(|error| failed(error.into()))?;
        text.push('\n');
        // Under its final name the manifest marks the new files as complete.
        let unfinished = list.with_extension("unfinished");
        fs::write(&unfinished, text).and_then(|()| fs::rename(&unfinished, &list)).map_err(failed)?;
        self.replace(force)?;
        self.work.clear();
        Ok(self.new)
    }

    fn replace(&self, force: bool) -> Result<(), OutputError> {
        let mut steps = self.aside(force)?;
        steps.extend(self.moves());
        for (done, (from, to)) in steps.iter().enumerate() {
            if let Err(source) = rename(from, to) {
                // Report the first failure.
                steps[..done].iter().rev().for_each(|(from, to)| drop(rename(to, from)));
                let path = if to.starts_with(self.work.path()) { from } else { to };
                let (path, kept) = (path.clone(), self.work.new_files());
                return Err(OutputError::Publish { path, kept, source });
            }
        }
        // Remove folders that held only older results; others are not empty and stay.
        for folder in steps.iter().filter_map(|(from, _)| from.parent()).filter(|folder| *folder != self.root)
        {
            let _ = fs::remove_dir(folder);
        }
        Ok(())
    }

    /// Renames that move older results away: `summary.json` first, so that a mixed folder does not count as
    /// complete.
    fn aside(&self, force: bool) -> Result<Vec<(PathBuf, PathBuf)>, OutputError> {
        let mut names: Vec<&String> = Vec::new();
        for (name, entry) in &self.new.files {
            if !self.work.new_file(name).exists() {
                continue;
            }
            let owner = self.old.owner(self.root, name, &entry.by)?;
            if owner.must_be_ours(&self.root.join(name), force)? != Owner::Nobody {
                names.push(name);
            }
        }
        for (name, entry) in self.old.files.iter().filter(|(name, _)| !self.new.files.contains_key(*name)) {
            if self.old.owner(self.root, name, &entry.by)? == Owner::Ours {
                names.push(name);
            }
        }
        names.sort_by_key(|name| std::cmp::Reverse(rank(name)));
        let mut steps: Vec<_> =
            names.iter().map(|name| (self.root.join(name), self.work.old_file(name))).collect();
        let list = self.root.join(MANIFEST);
        steps.extend(list.symlink_metadata().is_ok().then(|| (list, self.work.old_file(MANIFEST))));
        Ok(steps)
    }

    /// Renames that put new results into place: `summary.json` next to last, then the manifest.
    fn moves(&self) -> Vec<(PathBuf, PathBuf)> {
        let mut names: Vec<&String> =
            self.new.files.keys().filter(|name| self.work.new_file(name).exists()).collect();
        names.sort_by_key(|name| rank(name));
        let mut steps: Vec<_> =
            names.iter().map(|name| (self.work.new_file(name), self.root.join(name))).collect();
        steps.push((self.work.manifest(), self.root.join(MANIFEST)));
        steps
    }
}

/// Order of renames: files that mark results as complete come last.
fn rank(name: &str) -> u8 {
    if name == SUMMARY { 2 } else { u8::from(name.ends_with(".json")) }
}

fn rename(from: &Path, to: &Path) -> io::Result<()> {
    to.parent().map_or(Ok(()), fs::create_dir_all)?;
    fs::rename(from, to)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hashes_are_those_of_sha256sum() {
        let file = tempfile::NamedTempFile::new().unwrap();
        fs::write(file.path(), "abc").unwrap();
        // FIPS 180-2, appendix B.1.
        let expected = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad";
        assert_eq!(sha256_of(file.path()).unwrap(), expected);
    }
}
