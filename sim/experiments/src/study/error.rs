//! Each way a study can fail.

use output::OutputError;
use run::{GpuError, RunError};

/// Why a study could not be made.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs, reason = "the variants are the sources, documented there")]
pub enum StudyError {
    #[error(transparent)]
    Scene(#[from] workloads::LoadError),
    #[error(transparent)]
    Frame(#[from] workloads::FrameError),
    #[error(transparent)]
    Samples(#[from] pipeline::sampling::TableError),
    #[error(transparent)]
    Gpu(#[from] GpuError),
    #[error(transparent)]
    Soup(#[from] workloads::stress::StressError),
    #[error(transparent)]
    Curve(#[from] traces::CurveError),
    #[error(transparent)]
    Recording(#[from] traces::synth::SynthError),
    #[error(transparent)]
    Mark(#[from] traces::frames::MarkError),
    #[error("starting the thread that is timed: {0}")]
    Thread(#[from] rayon::ThreadPoolBuildError),
    #[error("the pipeline does not take the scene: {0}")]
    Pipeline(String),
    #[error(transparent)]
    Job(#[from] workloads::job::JobError),
    #[error(transparent)]
    Run(#[from] RunError),
    #[error(transparent)]
    Output(#[from] OutputError),
}

impl StudyError {
    /// The pipeline refused what it was given.
    pub(crate) fn pipeline(why: impl std::fmt::Display) -> Self {
        Self::Pipeline(why.to_string())
    }
}
