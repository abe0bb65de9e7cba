//! Claim: the files that a command may write, declared before its work.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use super::manifest::{MANIFEST, Manifest, Owner};
use super::{OutputError, manifest};

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
                .filter_map(|entry| Some(manifest::slashed(&folder.join(entry.file_name().to_str()?))))
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
