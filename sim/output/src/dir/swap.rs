//! Replacement of older results with new ones.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use super::manifest::{Entry, MANIFEST, Manifest, Owner};
use super::work::Work;
use super::{OutputError, SUMMARY};

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
