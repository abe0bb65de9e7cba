//! Manifest: list of the results in a folder, which Quintile may replace. Claim: the files that a command may write, declared
//! before its work.

use std::collections::{BTreeMap, BTreeSet};
use std::fs::{self, File};
use std::io;
use std::path::{Component, Path, PathBuf};

use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use super::OutputError;

/// File name of the manifest.
pub const MANIFEST: &str = "manifest.json";
/// Below the folder of results.
pub(super) const WORK_FOLDER: &str = ".quintile";

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
    /// It is a folder.
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

impl io::Write for Hashing<'_> {
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
