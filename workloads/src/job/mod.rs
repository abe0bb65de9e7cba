//! Jobs: work for the rasterizer beyond one rendering of a scene.
//!
//! A [`Job`] draws frames like a scene, but in its own passes on a [`Gpu`], which counts and times them. [`crate::catalog`] makes jobs by name from their options ([`OptionSource`]).

mod options;

pub use options::OptionSource;
pub(crate) use options::{Flag, Flags, must_hold};

use glam::Vec3;
use pipeline::{Gpu, PassError};
use serde::Serialize;
use warnings::Warning;

use crate::fingerprint::{Fingerprint, FingerprintError};
use crate::scene::{Frame, FrameError, Overrides, Scene, Settings};

/// A result of a job.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fact {
    /// Name, with unit.
    pub name: &'static str,
    /// Value.
    pub value: f64,
}

/// Result of one frame of a job.
#[derive(Clone, Debug, Default)]
pub struct Drawn {
    /// Linear RGB radiance of each pixel, row by row from the top left.
    pub image: Vec<Vec3>,
    /// Whether time is a dimension of the rendering.
    pub moving: bool,
    /// Whether the lens is a dimension of the rendering.
    pub lens: bool,
    /// Results.
    pub facts: Vec<Fact>,
    /// Warnings about limitations of the methods.
    pub warnings: Vec<Warning>,
}

/// Implementation of a job: prepares the input of a frame, and draws from that alone.
///
/// [`draw`](Self::draw) does not receive the frame number. So everything that differs between frames is in
/// the input, and frames with equal inputs are drawn once. Derive `Serialize` for the input, so that new
/// fields are compared, too.
pub trait Draws: Sync + Send {
    /// Data that changes from frame to frame.
    type Input: Serialize;

    /// Size of the image, frames and frame rate.
    fn settings(&self) -> &Settings;

    /// Warnings about the job's sources, such as a scene file.
    fn warnings(&self) -> &[Warning] {
        &[]
    }

    /// Content of the images, for captions; empty if it is obvious.
    fn shows(&self) -> &'static str {
        ""
    }

    /// Prepares the input of frame `number`.
    ///
    /// # Errors
    /// [`JobError`] if the frame cannot be made.
    fn input(&self, number: u32) -> Result<Self::Input, JobError>;

    /// Draws a frame on `gpu`. Every frame may repeat warnings.
    ///
    /// # Errors
    /// [`JobError`] if the frame cannot be drawn.
    fn draw(&self, input: &Self::Input, gpu: &mut Gpu<'_>) -> Result<Drawn, JobError>;
}

/// A job whose frames are those of a scene.
pub trait DrawsScene: Sync + Send {
    /// The scene.
    fn scene(&self) -> &Scene;

    /// Size of the image, frames and frame rate.
    fn settings(&self) -> &Settings {
        self.scene().settings()
    }

    /// Draws a frame, as [`Draws::draw`].
    ///
    /// # Errors
    /// As [`Draws::draw`].
    fn draw_frame(&self, frame: &Frame, gpu: &mut Gpu<'_>) -> Result<Drawn, JobError>;
}

impl<D: DrawsScene> Draws for D {
    type Input = Frame;

    fn settings(&self) -> &Settings {
        DrawsScene::settings(self)
    }

    fn warnings(&self) -> &[Warning] {
        self.scene().warnings()
    }

    fn input(&self, number: u32) -> Result<Frame, JobError> {
        Ok(self.scene().frame(number)?)
    }

    fn draw(&self, frame: &Frame, gpu: &mut Gpu<'_>) -> Result<Drawn, JobError> {
        self.draw_frame(frame, gpu)
    }
}

/// A job: work for the rasterizer beyond one rendering of a scene. Every type that implements [`Draws`] is a
/// job.
pub trait Job: Sync + Send {
    /// Size of the image, frames and frame rate.
    fn settings(&self) -> &Settings;

    /// Fingerprint of the input of frame `number`. Frames with equal fingerprints have equal results.
    ///
    /// # Errors
    /// [`JobError`] if the frame cannot be made.
    fn fingerprint(&self, number: u32) -> Result<Fingerprint, JobError>;

    /// Warnings about the job's sources, such as a scene file.
    fn warnings(&self) -> &[Warning];

    /// Content of the images, for captions; empty if it is obvious.
    fn shows(&self) -> &'static str;

    /// Draws frame `number` on `gpu`.
    ///
    /// # Errors
    /// [`JobError`] if the frame cannot be made or drawn.
    fn frame(&self, number: u32, gpu: &mut Gpu<'_>) -> Result<Drawn, JobError>;
}

impl<D: Draws> Job for D {
    fn settings(&self) -> &Settings {
        Draws::settings(self)
    }

    fn warnings(&self) -> &[Warning] {
        Draws::warnings(self)
    }

    fn shows(&self) -> &'static str {
        Draws::shows(self)
    }

    fn fingerprint(&self, number: u32) -> Result<Fingerprint, JobError> {
        Ok(Fingerprint::of(&self.input(number)?)?)
    }

    fn frame(&self, number: u32, gpu: &mut Gpu<'_>) -> Result<Drawn, JobError> {
        self.draw(&self.input(number)?, gpu)
    }
}

/// Message about an image without pixels, or with too many.
pub const IMAGE_SIZE: &str = "image width or height is zero or too large";

/// Reason why a frame could not be drawn.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs, reason = "the variants are the sources, documented there")]
pub enum JobError {
    #[error(transparent)]
    Pass(#[from] PassError),
    #[error(transparent)]
    Frame(#[from] FrameError),
    #[error(transparent)]
    Fingerprint(#[from] FingerprintError),
    /// Invalid or incompatible settings.
    #[error("{0}")]
    Setting(String),
}

impl JobError {
    /// Wraps an error of a setting.
    pub(crate) fn setting(error: impl std::fmt::Display) -> Self {
        Self::Setting(error.to_string())
    }
}

/// Parameters of a job besides its own options.
#[derive(Clone, Copy, Debug)]
pub struct Request<'a> {
    /// Changes to the settings.
    pub overrides: &'a Overrides,
    /// Seed of all random numbers.
    pub seed: u64,
}

/// Hardware for tests of jobs.
#[cfg(test)]
pub(crate) mod testing {
    use pipeline::depth::DepthSpec;
    use pipeline::{CacheSpec, Features, MemorySpec, PipelineSpec, Shading};

    /// Small caches, with all features on.
    pub(crate) fn hardware() -> PipelineSpec {
        let lines = CacheSpec::lru(256, 4);
        let compression = Default::default();
        PipelineSpec {
            tile_px: 8,
            coarse_tile_px: 16,
            batch_triangles: 1000,
            vertex_reuse: 16,
            shading: Shading::default(),
            shading_cache: CacheSpec::lru(1024, 4),
            memory: MemorySpec {
                depth: lines,
                colour: lines,
                texture: lines,
                l2: lines,
                llc: None,
                edram: None,
                compression,
            },
            features: Features::ALL,
            depth: DepthSpec::default(),
            compute: None,
        }
    }
}
