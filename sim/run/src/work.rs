//! What a run draws: the frames of a scene, or those of a job.

use std::path::Path;

use warnings::Warning;
use workloads::catalog;
use workloads::job::{Job, JobError, OptionSource, Request};
use workloads::{Fingerprint, LoadError, Overrides, Scene};

use super::RunError;

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
