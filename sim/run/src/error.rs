//! Errors of a run.

use crate::gpu::GpuError;
use output::OutputError;
use output::image::ImageError;
use output::plot::PlotError;
use timing::TimingError;

/// Error of a run.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs, reason = "the variants are the sources, documented there")]
pub enum RunError {
    #[error(transparent)]
    Scene(#[from] workloads::LoadError),
    #[error(transparent)]
    Frame(#[from] workloads::FrameError),
    #[error(transparent)]
    Job(#[from] workloads::job::JobError),
    #[error(transparent)]
    Gpu(#[from] GpuError),
    #[error(transparent)]
    Platform(#[from] power_model::PlatformError),
    #[error(transparent)]
    Table(#[from] power_model::TableError),
    #[error("energy table and platform: {0}")]
    Model(#[from] power_model::ModelError),
    #[error("frame {frame}: internal error of the timing model: {source}. Please report it")]
    Timeline { frame: u32, source: power_model::TimelineError },
    #[error("timing: {0}")]
    Timing(#[from] TimingError),
    #[error("pacing: {0}")]
    Pacing(#[from] power_model::PacingError),
    #[error(transparent)]
    Samples(#[from] pipeline::sampling::TableError),
    #[error(transparent)]
    Device(#[from] traces::device::DeviceError),
    #[error("sampling the power curve: {0}")]
    Sample(#[from] traces::device::SampleError),
    #[error("finding frames: {0}")]
    Marks(#[from] traces::frames::MarkError),
    #[error(transparent)]
    Output(#[from] OutputError),
    #[error("drawing a plot: {0}")]
    Plot(#[from] PlotError),
    #[error("encoding an image: {0}")]
    Image(#[from] ImageError),
    #[error("frames.csv: {0}")]
    Frames(#[from] traces::energy::TableError),
    #[error("{path}: cannot read it: {source}; check the path")]
    Input { path: String, source: std::io::Error },
    #[error(transparent)]
    Spec(#[from] activity::spec::SpecError),
    /// A file is cut off or damaged.
    #[error("{path}: {message}")]
    Damaged { path: String, message: String },
    /// A setting is invalid, or two settings conflict.
    #[error("{0}")]
    Setting(String),
}

impl RunError {
    /// Invalid setting, with the message of `why`.
    pub fn setting(why: impl std::fmt::Display) -> Self {
        Self::Setting(why.to_string())
    }

    /// Whether this is a usage error (exit code 2) rather than a failure (exit code 1).
    pub fn is_usage(&self) -> bool {
        match self {
            Self::Scene(error) => error.is_usage(),
            Self::Gpu(GpuError::Spec(activity::spec::SpecError::Read { .. })) => false,
            Self::Output(error) => error.is_usage(),
            Self::Platform(error) => !is_unreadable(error),
            Self::Table(error) => !is_unreadable(error),
            Self::Spec(activity::spec::SpecError::Read { .. }) => false,
            Self::Pacing(power_model::PacingError::Rate(_)) | Self::Timing(TimingError::TooLong) => true,
            Self::Spec(_)
            | Self::Gpu(_)
            | Self::Marks(_)
            | Self::Sample(_)
            | Self::Samples(_)
            | Self::Device(_)
            | Self::Model(_)
            | Self::Job(workloads::job::JobError::Setting(_) | workloads::job::JobError::Pass(_))
            | Self::Setting(_) => true,
            _ => false,
        }
    }
}

/// Whether the chain of causes contains an input or output error: the file could not be read.
fn is_unreadable(error: &(dyn std::error::Error + 'static)) -> bool {
    let mut cause = Some(error);
    while let Some(error) = cause {
        if error.downcast_ref::<std::io::Error>().is_some() {
            return true;
        }
        cause = error.source();
    }
    false
}
