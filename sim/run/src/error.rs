//! Errors of a run.

use crate::changes::ChangeError;
use crate::gpu::{GpuError, GpuSpec};
use output::OutputError;
use output::image::ImageError;
use output::plot::PlotError;
use pipeline::PassError;
use timing::TimingError;
use workloads::job::JobError;

/// Error of a run.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs, reason = "the variants are the sources, documented there")]
pub enum RunError {
    #[error(transparent)]
    Scene(#[from] workloads::LoadError),
    #[error(transparent)]
    Frame(#[from] workloads::FrameError),
    #[error(transparent)]
    Job(#[from] JobError),
    /// Groups of lanes do not run on the GPU.
    #[error("GPU `{gpu}`: {source}")]
    Groups { gpu: String, source: JobError },
    #[error(transparent)]
    Gpu(#[from] GpuError),
    #[error(transparent)]
    Change(#[from] ChangeError),
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
    #[error("a recorded frame: {0}")]
    Stream(#[from] activity::StreamError),
    #[error(transparent)]
    Write(#[from] traces::io::WriteError),
    /// A setting is invalid, or two settings conflict.
    #[error("{0}")]
    Setting(String),
}

impl RunError {
    /// Invalid setting, with the message of `why`.
    pub fn setting(why: impl std::fmt::Display) -> Self {
        Self::Setting(why.to_string())
    }

    /// Error of a frame on `gpu`, with its name where it is the GPU that cannot run groups.
    pub(crate) fn on(gpu: &GpuSpec) -> impl FnOnce(JobError) -> Self {
        |source| match source {
            JobError::Pass(PassError::Compute { .. }) => Self::Groups { gpu: gpu.name.clone(), source },
            other => Self::Job(other),
        }
    }

    /// Whether the request is at fault (exit code 2): a wrong value, or an input that is missing or damaged. Other failures come
    /// while it runs (exit code 1).
    pub fn is_usage(&self) -> bool {
        match self {
            Self::Output(error) => error.is_usage(),
            Self::Pacing(error) => matches!(error, power_model::PacingError::Rate(_)),
            Self::Timing(error) => matches!(error, TimingError::TooLong),
            Self::Job(error) => matches!(error, JobError::Setting(_) | JobError::Pass(_)),
            Self::Frame(_)
            | Self::Timeline { .. }
            | Self::Plot(_)
            | Self::Image(_)
            | Self::Frames(_)
            | Self::Write(_) => false,
            _ => true,
        }
    }
}

#[cfg(test)]
mod tests {
    use pipeline::ComputeError;

    use super::*;

    #[test]
    fn a_missing_compute_unit_names_the_gpu() {
        let gpu = GpuSpec::load("mobile").unwrap();
        let pass = || "culling".to_owned();
        let missing = PassError::Compute { pass: pass(), error: ComputeError::Missing };
        let error = RunError::on(&gpu)(missing.into());
        assert!(
            error.is_usage() && error.to_string().starts_with("GPU `mobile`: pass `culling`:"),
            "{error}"
        );
        let large = PassError::Memory { pass: pass(), bytes: 0 };
        assert!(RunError::on(&gpu)(large.into()).to_string().starts_with("pass `culling`"));
    }
}
