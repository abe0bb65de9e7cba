//! Reasons why a pass cannot be drawn.

use std::fmt;

use crate::compute::ComputeError;
use crate::memory::{AddressSpace, CacheError};
use crate::surface::{Format, MAX_TARGETS};

/// Reason why a pass cannot be drawn.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum PassError {
    /// A cache is invalid.
    #[error(transparent)]
    Cache(#[from] CacheError),
    /// A surface cannot be used as it is.
    #[error("pass `{pass}`, surface `{surface}`: {problem}")]
    Surface {
        /// The pass.
        pass: String,
        /// The surface.
        surface: String,
        /// What is wrong.
        problem: SurfaceProblem,
    },
    /// A draw tests or stores depths or stencil values that the pass does not have.
    #[error(
        "pass `{pass}`: draw {draw} has a depth or stencil test, but the pass has no depths; give it a depth target, or the draw \
         `DepthState::NONE`"
    )]
    NoDepths {
        /// The pass.
        pass: String,
        /// The draw.
        draw: usize,
    },
    /// A query that may end early stores something.
    #[error(
        "pass `{pass}`: draw {draw} asks whether any sample passes, so the rest of it may not be drawn, but it stores depths or colours, \
         or has a stencil test; give it a state without them, or let it count all samples"
    )]
    QueryStores {
        /// The pass.
        pass: String,
        /// The draw.
        draw: usize,
    },
    /// Groups cannot run.
    #[error("pass `{pass}`: {error}")]
    Compute {
        /// The pass.
        pass: String,
        /// What is wrong.
        error: ComputeError,
    },
    /// A buffer is of another frame.
    #[error(
        "pass `{pass}`: the frame has no such buffer number {number}; use one that `Gpu::buffer` returned in this frame"
    )]
    Buffer {
        /// The pass.
        pass: String,
        /// Number of the buffer.
        number: u32,
    },
    /// The surfaces of a frame are too large.
    #[error(
        "pass `{pass}`: the surfaces of the frame take {bytes} bytes, more than the {} that can be addressed; draw fewer pixels, \
         samples or passes",
        AddressSpace::END
    )]
    Memory {
        /// The pass that does not fit.
        pass: String,
        /// Bytes of all surfaces with those of the pass.
        bytes: u64,
    },
}

/// Why a pass cannot use a surface.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum SurfaceProblem {
    /// It is of another GPU.
    #[error("the frame has no such surface; use one that `Gpu::create_surface` returned in this frame")]
    Unknown,
    /// It is read and written.
    #[error(
        "it is read and written in the same pass: {reader} reads it, and {writer} writes it; draw to another surface"
    )]
    Feedback {
        /// What reads it first.
        reader: PassPart,
        /// What writes it first.
        writer: PassPart,
    },
    /// Nothing was stored in it.
    #[error("it is read, but no earlier pass of the frame stored anything in it; store it, or clear it")]
    Unwritten,
    /// The sizes differ.
    #[error("it has {0} pixels, but the pass has {1}; make both the same size")]
    Size(String, String),
    /// The samples differ.
    #[error("it has {0} samples per pixel, but the pass has {1}; make both the same")]
    Samples(u32, u32),
    /// It has several levels and several samples.
    #[error("it has {0} levels and {1} samples per pixel; resolve the samples into a surface with levels")]
    Levels(u32, u32),
    /// It is a target twice.
    #[error("it is a target of the pass twice; remove one of them")]
    Twice,
    /// The pass has too many targets.
    #[error("it is one colour target too many; a pass has up to {MAX_TARGETS}")]
    TooMany,
    /// Its format does not fit the target.
    #[error("its format {0:?} is not one of {1}")]
    Format(Format, &'static str),
    /// Colours in it cannot be combined.
    #[error(
        "draw {draw} blends, but values of format {format:?} cannot be combined; replace them, or use another format"
    )]
    Blend {
        /// The draw.
        draw: usize,
        /// The format.
        format: Format,
    },
    /// It has no stencil values.
    #[error("draw {draw} has a stencil test, but format {format:?} has no stencil values; use D24S8")]
    Stencil {
        /// The draw.
        draw: usize,
        /// The format.
        format: Format,
    },
}

/// A part of a pass, in messages.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PassPart {
    /// The draw of this number.
    Draw(usize),
    /// All of it: a resolve, or a target that no draw changes.
    Whole,
}

impl fmt::Display for PassPart {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Draw(number) => write!(f, "draw {number}"),
            Self::Whole => f.write_str("the pass as a whole"),
        }
    }
}
