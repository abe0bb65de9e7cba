//! The work of a run: the frames of a scene or of a workload, and which of them differ.

use std::collections::HashMap;
use std::path::Path;

use rayon::prelude::*;
use warnings::Warning;
use workloads::catalog;
use workloads::job::{Job, JobError, OptionSource, Request};
use workloads::{Fingerprint, LoadError, Overrides, Scene};

use crate::RunError;

/// Source of the frames of a run.
pub enum Work {
    /// Each frame is one rendering of a scene.
    Scene(Box<Scene>),
    /// Each frame is the passes of a workload.
    Job {
        /// Its name.
        name: String,
        /// The workload.
        job: Box<dyn Job>,
    },
}

impl Work {
    /// Finds the workload called `name`, or the scene of that name or path.
    ///
    /// # Errors
    /// [`LoadError`] if it cannot be loaded or its settings are invalid.
    pub fn find(
        name: &Path,
        overrides: &Overrides,
        options: &OptionSource,
        seed: u64,
    ) -> Result<Self, LoadError> {
        // Names of workloads are Unicode; a path that is not cannot name one.
        let text = name.to_str().unwrap_or_default();
        if let Some(job) = catalog::find(text, options, &Request { overrides, seed }) {
            return Ok(Self::Job { name: text.to_owned(), job: job? });
        }
        let scene = workloads::load(name).map_err(catalog::or_job)?;
        if *options != OptionSource::default() {
            let jobs: Vec<&str> = catalog::names().map(|(name, _)| name).collect();
            let message =
                format!("`{}` is a scene; only workloads have options: {}", name.display(), jobs.join(", "));
            return Err(LoadError::Setting { setting: "set", message });
        }
        Ok(Self::Scene(Box::new(scene.with_overrides(overrides)?)))
    }

    /// Its name.
    pub fn name(&self) -> &str {
        match self {
            Self::Scene(scene) => scene.name(),
            Self::Job { name, .. } => name,
        }
    }

    /// Description of the images for captions; empty for scenes.
    pub fn shows(&self) -> &'static str {
        match self {
            Self::Scene(_) => "",
            Self::Job { job, .. } => job.shows(),
        }
    }

    /// Settings of image, sampling, time and lens.
    pub fn settings(&self) -> &workloads::Settings {
        match self {
            Self::Scene(scene) => scene.settings(),
            Self::Job { job, .. } => job.settings(),
        }
    }

    /// Animation clip in use; `None` if the scene has no clips.
    pub fn clip(&self) -> Option<&str> {
        match self {
            Self::Scene(scene) => scene.clip(),
            Self::Job { .. } => None,
        }
    }

    /// Fingerprint of those inputs of frame `number` that change from frame to frame.
    ///
    /// # Errors
    /// If the frame cannot be made.
    pub(super) fn fingerprint(&self, number: u32) -> Result<Fingerprint, RunError> {
        match self {
            Self::Scene(scene) => Ok(Fingerprint::of(&scene.frame(number)?).map_err(JobError::from)?),
            Self::Job { job, .. } => Ok(job.fingerprint(number)?),
        }
    }

    /// Warnings from loading.
    pub fn warnings(&self) -> &[Warning] {
        match self {
            Self::Scene(scene) => scene.warnings(),
            Self::Job { job, .. } => job.warnings(),
        }
    }

    /// The scene, for features that workloads do not support.
    ///
    /// # Errors
    /// If this is a workload; the message names `what`.
    pub fn scene(&self, what: &str) -> Result<&Scene, RunError> {
        match self {
            Self::Scene(scene) => Ok(scene),
            Self::Job { name, .. } => Err(RunError::Setting(format!(
                "{what} needs a scene, and `{name}` is a workload: leave it out"
            ))),
        }
    }
}

/// Groups of frames with equal input. Each group is simulated once.
///
/// Inputs are compared by the [`Fingerprint`] of everything that the renderer receives and that changes from
/// frame to frame: the camera at both ends of the shutter, every mesh, and all that a workload prepares.
/// Settings, materials, lights, background, sample table and hardware are constant in a run and are not
/// compared.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Distinct {
    /// First frame of each group, in order.
    numbers: Vec<u32>,
    /// Index of the group of each frame of the run.
    groups: Vec<usize>,
    /// Number of the first frame of the run.
    start: u32,
}

impl Distinct {
    /// Prepares and compares all frames of `work`.
    ///
    /// # Errors
    /// When a frame cannot be made.
    pub fn new(work: &Work) -> Result<Self, RunError> {
        let range = work.settings().frames.clone();
        if range.len() == 1 {
            return Ok(Self::of(range.start, &[()]));
        }
        let start = range.start;
        let prints = range.into_par_iter().map(|number| work.fingerprint(number));
        Ok(Self::of(start, &prints.collect::<Result<Vec<Fingerprint>, _>>()?))
    }

    fn of<K: Eq + std::hash::Hash>(start: u32, inputs: &[K]) -> Self {
        let (mut numbers, mut known) = (Vec::new(), HashMap::new());
        let groups = (start..)
            .zip(inputs)
            .map(|(number, input)| {
                *known.entry(input).or_insert_with(|| {
                    numbers.push(number);
                    numbers.len() - 1
                })
            })
            .collect();
        Self { numbers, groups, start }
    }

    /// Number of the first frame of each group, in order: the frames to simulate.
    pub fn numbers(&self) -> &[u32] {
        &self.numbers
    }

    /// Index of the group of each frame of the run, in [`Self::numbers`].
    pub fn groups(&self) -> &[usize] {
        &self.groups
    }

    /// Numbers of the frames in `group`.
    pub fn members(&self, group: usize) -> impl Iterator<Item = u32> {
        (self.start..).zip(&self.groups).filter(move |(_, of)| **of == group).map(|(number, _)| number)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_frames_share_a_group_wherever_they_are() {
        let found = Distinct::of(7, &["a", "b", "a", "a", "c", "b"]);
        assert_eq!((found.numbers(), found.groups()), (&[7, 8, 11][..], &[0, 1, 0, 0, 2, 1][..]));
        assert_eq!(found.members(0).collect::<Vec<_>>(), [7, 9, 10]);
        assert_eq!(found.members(2).collect::<Vec<_>>(), [11]);
    }
}
