//! What a run draws: the frames of a scene or of a workload, and which of them differ.

use std::collections::HashMap;
use std::path::Path;

use rayon::prelude::*;
use warnings::Warning;
use workloads::catalog;
use workloads::job::{Job, JobError, OptionSource, Request};
use workloads::{Fingerprint, LoadError, Overrides, Scene};

use crate::RunError;

/// The frames of a run.
pub enum Work {
    /// One rendering of a scene each.
    Scene(Box<Scene>),
    /// Passes of a job.
    Job {
        /// Its name.
        name: String,
        /// What draws.
        job: Box<dyn Job>,
    },
}

impl Work {
    /// The job called `name`, or the scene of that name or path.
    ///
    /// # Errors
    /// [`LoadError`] when it cannot be loaded, or its settings make no sense.
    pub fn find(
        name: &Path,
        overrides: &Overrides,
        options: &OptionSource,
        seed: u64,
    ) -> Result<Self, LoadError> {
        // A workload has a name; a path of other bytes is none.
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

    /// What its images show, for captions; empty where that is plain.
    pub fn shows(&self) -> &'static str {
        match self {
            Self::Scene(_) => "",
            Self::Job { job, .. } => job.shows(),
        }
    }

    /// Size of the image, sampling, time and lens.
    pub fn settings(&self) -> &workloads::Settings {
        match self {
            Self::Scene(scene) => scene.settings(),
            Self::Job { job, .. } => job.settings(),
        }
    }

    /// The animation clip that plays; none without a scene file that has clips.
    pub fn clip(&self) -> Option<&str> {
        match self {
            Self::Scene(scene) => scene.clip(),
            Self::Job { .. } => None,
        }
    }

    /// The fingerprint of everything that frame `number` is drawn from and that changes from frame to frame.
    ///
    /// # Errors
    /// When the frame cannot be made.
    pub(super) fn fingerprint(&self, number: u32) -> Result<Fingerprint, RunError> {
        match self {
            Self::Scene(scene) => Ok(Fingerprint::of(&scene.frame(number)?).map_err(JobError::from)?),
            Self::Job { job, .. } => Ok(job.fingerprint(number)?),
        }
    }

    /// What was found strange when it was loaded.
    pub fn warnings(&self) -> &[Warning] {
        match self {
            Self::Scene(scene) => scene.warnings(),
            Self::Job { job, .. } => job.warnings(),
        }
    }

    /// The scene, for what cannot be done with jobs.
    ///
    /// # Errors
    /// Says that `what` needs a scene.
    pub fn scene(&self, what: &str) -> Result<&Scene, RunError> {
        match self {
            Self::Scene(scene) => Ok(scene),
            Self::Job { name, .. } => Err(RunError::Setting(format!(
                "{what} needs a scene, and `{name}` is a workload: leave it out"
            ))),
        }
    }
}

/// The frames of a run in groups of equal input.
///
/// Inputs are compared by the [`Fingerprint`] of everything that the renderer receives and that changes from frame to frame:
/// the camera at both ends of the shutter, every mesh, and whatever else a workload prepares. What does not change within a run
/// (settings, materials, lights, background, sample table, hardware) needs no comparison.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Distinct {
    /// The first frame of each group, in order.
    numbers: Vec<u32>,
    /// For each frame of the run the index of its group.
    groups: Vec<usize>,
    /// Number of the first frame of the run.
    start: u32,
}

impl Distinct {
    /// Prepares every frame of `work` and compares them.
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

    /// The first frame of each group, in order: those that have to be simulated.
    pub fn numbers(&self) -> &[u32] {
        &self.numbers
    }

    /// For each frame of the run the index of its group in [`Self::numbers`].
    pub fn groups(&self) -> &[usize] {
        &self.groups
    }

    /// Numbers of the frames in group `group`.
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
