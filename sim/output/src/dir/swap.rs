//! Moving new results into place and older ones out of it.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use super::manifest::{Entry, MANIFEST, Manifest, Owner};
use super::work::Work;
use super::{OutputError, SUMMARY};

/// Old and new results of a folder.
///
/// All steps are renames within one file system. One that fails undoes those before it. A process that is killed between them leaves
/// the list of the new files in `.quintile`; the next one [recovers](Self::recover) by doing the rest.
pub(super) struct Swap<'a> {
    root: &'a Path,
    work: &'a Work,
    old: Manifest,
    new: Manifest,
}

impl<'a> Swap<'a> {
    /// Of the folder `root`, which holds `old`, for the new files `written`.
    pub fn new(root: &'a Path, work: &'a Work, old: Manifest, written: BTreeMap<String, Entry>) -> Self {
        let by: BTreeSet<&str> = written.values().map(|entry| entry.by.as_str()).collect();
        let mut new = old.clone();
        new.files.retain(|_, entry| !by.contains(entry.by.as_str()));
        new.files.extend(written);
        Self { root, work, old, new }
    }

    /// Finishes what a killed process had begun; without whole results in `work`, clears it.
    pub fn recover(root: &'a Path, work: &'a Work, force: bool) -> Result<(), OutputError> {
        if work.manifest().exists() {
            let (old, new) = (Manifest::of_folder(root, force)?, Manifest::read(&work.manifest())?);
            Self { root, work, old, new }.replace(force)?;
        }
        work.clear();
        Ok(())
    }

    /// Replaces the old results by the new ones and returns the list of what is then in the folder.
    pub fn run(self, force: bool) -> Result<Manifest, OutputError> {
        let list = self.work.manifest();
        let failed = |source: io::Error| OutputError::Write { path: list.clone(), source: source.into() };
        let mut text = serde_json::to_string_pretty(&self.new).map_err(|error| failed(error.into()))?;
        text.push('\n');
        // Under its own name it says that everything is there.
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
                // The first failure is the one to report.
                steps[..done].iter().rev().for_each(|(from, to)| drop(rename(to, from)));
                let path = if to.starts_with(self.work.path()) { from } else { to };
                let (path, kept) = (path.clone(), self.work.new_files());
                return Err(OutputError::Publish { path, kept, source });
            }
        }
        // Folders that only held older results; others are not empty and stay.
        for folder in steps.iter().filter_map(|(from, _)| from.parent()).filter(|folder| *folder != self.root)
        {
            let _ = fs::remove_dir(folder);
        }
        Ok(())
    }

    /// Renames that take older results out of the way: `summary.json` first, so that a folder that holds both does not look whole.
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

    /// Renames that put new results into place: `summary.json` last, and then the list.
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

/// How late a file appears: those whose presence says that others are there come later.
fn rank(name: &str) -> u8 {
    if name == SUMMARY { 2 } else { u8::from(name.ends_with(".json")) }
}

fn rename(from: &Path, to: &Path) -> io::Result<()> {
    to.parent().map_or(Ok(()), fs::create_dir_all)?;
    fs::rename(from, to)
}
