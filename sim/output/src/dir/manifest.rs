//! The list of results in a folder: what of it Quintile may replace.

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io;
use std::path::{Component, Path};

use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use super::OutputError;

/// The name of the list in a folder of results.
pub const MANIFEST: &str = "manifest.json";
/// Below the folder of results.
pub(super) const WORK_FOLDER: &str = ".quintile";

/// The version of the list's form.
const SCHEMA: u32 = 1;

/// The results in a folder.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Manifest {
    schema: u32,
    /// Each file by its name relative to the folder, with `/` between folders.
    pub files: BTreeMap<String, Entry>,
}

/// A file as it was written.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Entry {
    /// The command that wrote it, for example `run`.
    pub by: String,
    /// Its size.
    pub bytes: u64,
    /// The SHA-256 of its content, hexadecimal.
    pub sha256: String,
}

/// Whose the file at a name is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Owner {
    /// There is none.
    Nobody,
    /// The command that asks wrote it, and nobody changed it.
    Ours,
    /// Somebody else's; how that is known.
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
    /// The list in the folder `root`, an empty one where there is none. One that cannot be read is the user's: it is overwritten only
    /// with `force`.
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

    /// Whether this version wrote it: all names are of files in the folder, and none is the list itself or in `.quintile`.
    fn is_known(&self) -> bool {
        let inside = |name: &String| {
            let path = Path::new(name);
            path.components().all(|part| matches!(part, Component::Normal(_)))
                && !path.starts_with(WORK_FOLDER)
                && name != MANIFEST
        };
        self.schema == SCHEMA && self.files.keys().all(inside)
    }

    /// Whose the file `name` in `root` is, asked by the command `by`.
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

/// The SHA-256 of a file's content, hexadecimal.
///
/// # Errors
/// When the file cannot be read.
pub fn sha256_of(path: &Path) -> io::Result<String> {
    let mut hash = Sha256::new();
    io::copy(&mut File::open(path)?, &mut Hashing(&mut hash))?;
    Ok(hex(hash))
}

/// The same of a text.
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
