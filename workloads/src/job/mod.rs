//! Jobs: work for the rasterizer that is more than one rendering of a scene.
//!
//! A [`Job`] draws frames as a scene does, in passes of its own, and hands every packet of work to whoever asked, so that it
//! can be timed and turned into watts. [`crate::catalog`] makes one by name from its options ([`OptionSource`]).

mod flags;
mod options;
mod passes;
#[cfg(test)]
pub(crate) mod testing;
mod words;

use activity::{Counts, LineAccess, Packet};
use glam::Vec3;
use pipeline::PipelineSpec;
use pipeline::memory::CacheError;
use serde::Serialize;
use warnings::Warning;

use crate::fingerprint::{Fingerprint, FingerprintError};
use crate::scene::{FrameError, Overrides, Settings};

pub(crate) use flags::{Flag, Flags};
pub use options::OptionSource;
pub(crate) use options::must_hold;
pub use passes::{FrontEnd, Passes, TileWork, Touch};

/// Where the packets of a frame go, with the lines each asks the L2 for, in the order of the modelled hardware.
pub type Emit<'a> = &'a mut dyn FnMut(&Packet, &[LineAccess]);

/// Packets go out as those of passes from `first` on.
pub(crate) fn shifted<'e>(
    first: u16,
    emit: &'e mut (dyn FnMut(&Packet, &[LineAccess]) + 'e),
) -> impl FnMut(&Packet, &[LineAccess]) + 'e {
    move |packet, lines| emit(&Packet { pass: packet.pass.saturating_add(first), ..*packet }, lines)
}

/// A number that a job found out.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fact {
    /// Its name, with its unit.
    pub name: &'static str,
    /// Its value.
    pub value: f64,
}

/// What a job drew in one frame.
#[derive(Clone, Debug, Default)]
pub struct Drawn {
    /// Linear RGB radiance of each pixel, row by row from the top left.
    pub image: Vec<Vec3>,
    /// How often each event happened, in all passes.
    pub counts: Counts,
    /// Triangles drawn, in all passes.
    pub triangles: usize,
    /// Whether time is a dimension of what was drawn.
    pub moving: bool,
    /// Whether the lens is.
    pub lens: bool,
    /// What was found out.
    pub facts: Vec<Fact>,
    /// Regimes in which its methods are known to be bad.
    pub warnings: Vec<Warning>,
}

/// How a job draws: it prepares the input of a frame, and draws from that alone.
///
/// [`draw`](Self::draw) does not know the number of the frame, so whatever differs between frames is in the input, and frames
/// with equal inputs can be drawn once. Derive `Serialize` for the input: a field that is added later is compared, too.
pub trait Draws: Sync + Send {
    /// Everything that changes from frame to frame.
    type Input: Serialize;

    /// Size of the image, frames and frame rate.
    fn settings(&self) -> &Settings;

    /// Warnings about what it was made from, such as a scene file.
    fn warnings(&self) -> &[Warning] {
        &[]
    }

    /// What its images show, for captions; empty where that is plain.
    fn shows(&self) -> &'static str {
        ""
    }

    /// The input of frame `number`.
    ///
    /// # Errors
    /// When the frame cannot be made.
    fn input(&self, number: u32) -> Result<Self::Input, JobError>;

    /// Draws a frame on the hardware `spec`. Warnings may come again in every frame.
    ///
    /// # Errors
    /// When the hardware cannot be built or the frame cannot be drawn.
    fn draw(&self, input: &Self::Input, spec: &PipelineSpec, emit: Emit<'_>) -> Result<Drawn, JobError>;
}

/// Work for the rasterizer that is more than one rendering of a scene: every type that [`Draws`].
pub trait Job: Sync + Send {
    /// Size of the image, frames and frame rate.
    fn settings(&self) -> &Settings;

    /// The fingerprint of the input of frame `number`. Frames with the same fingerprint are drawn alike.
    ///
    /// # Errors
    /// When the frame cannot be made.
    fn fingerprint(&self, number: u32) -> Result<Fingerprint, JobError>;

    /// Warnings about what it was made from, such as a scene file.
    fn warnings(&self) -> &[Warning];

    /// What its images show, for captions; empty where that is plain.
    fn shows(&self) -> &'static str;

    /// Draws frame `number` on the hardware `spec`.
    ///
    /// # Errors
    /// When the hardware cannot be built or the frame cannot be made.
    fn frame(&self, number: u32, spec: &PipelineSpec, emit: Emit<'_>) -> Result<Drawn, JobError>;
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

    fn frame(&self, number: u32, spec: &PipelineSpec, emit: Emit<'_>) -> Result<Drawn, JobError> {
        self.draw(&self.input(number)?, spec, emit)
    }
}

/// Why a frame of a job could not be drawn.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs, reason = "the variants are the sources, documented there")]
pub enum JobError {
    #[error(transparent)]
    Cache(#[from] CacheError),
    #[error(transparent)]
    Frame(#[from] FrameError),
    #[error(transparent)]
    Fingerprint(#[from] FingerprintError),
    /// Two settings that cannot be together, or one that cannot be.
    #[error("{0}")]
    Setting(String),
}

/// What a job is made from besides its own options.
#[derive(Clone, Copy, Debug)]
pub struct Request<'a> {
    /// Changes to its settings.
    pub overrides: &'a Overrides,
    /// Seed of everything random in it.
    pub seed: u64,
}
