//! Surfaces of a frame as targets and as bindings of draws, with load and store operations, and why a pass is
//! refused.

use std::fmt;
use std::sync::Arc;

use glam::Vec4;

use crate::buffer::BufferBinding;
use crate::compute::ComputeError;
use crate::memory::{AddressSpace, CacheError, MemoryRange};
use crate::state::Clear;
use crate::surface::{Format, Layout, MAX_TARGETS, SurfaceSpec, Texels};
use crate::texture::Texture;

/// A surface of a frame, at one level of its chain.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct SurfaceId {
    /// Number of the finest level in the frame.
    first: u32,
    level: u32,
}

impl SurfaceId {
    /// The surface at another level, 0 for the finest.
    #[must_use]
    pub fn level(self, level: u32) -> Self {
        Self { level, ..self }
    }
}

/// Contents of a target before the first draw of a pass.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Load<V> {
    /// This value. Memory is not read.
    Clear(V),
    /// What an earlier pass stored.
    Load,
    /// Undefined: zeros here. Memory is not read.
    Discard,
}

/// What becomes of a target after the last draw of a pass.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Store {
    /// Later passes may read it, and it is in memory when the frame ends.
    #[default]
    Store,
    /// The target is dropped, and not written to memory.
    Discard,
}

/// A target of a pass, with values of type `V`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Attachment<V> {
    /// The surface.
    pub surface: SurfaceId,
    /// Contents before the first draw.
    pub load: Load<V>,
    /// What becomes of the contents.
    pub store: Store,
}

impl<V> Attachment<V> {
    /// A target that starts with `value`, and is stored.
    pub fn cleared(surface: SurfaceId, value: V) -> Self {
        Self { surface, load: Load::Clear(value), store: Store::Store }
    }

    /// A target that goes on with what an earlier pass stored, and is stored.
    pub fn loaded(surface: SurfaceId) -> Self {
        Self { surface, load: Load::Load, store: Store::Store }
    }

    /// The target without being stored.
    #[must_use]
    pub fn dropped(self) -> Self {
        Self { store: Store::Discard, ..self }
    }
}

/// Targets of a pass: up to [`crate::surface::MAX_TARGETS`] for colours, and one for depths and stencil values.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Attachments {
    /// Colours.
    pub colours: Vec<Attachment<Vec4>>,
    /// Depths; without them draws have [`crate::DepthState::NONE`] and no stencil test.
    pub depth: Option<Attachment<Clear>>,
}

impl Attachments {
    /// All surfaces with whether they are loaded and stored.
    pub(super) fn all(&self) -> impl Iterator<Item = (SurfaceId, bool, Store)> {
        let colours = self.colours.iter().map(|to| (to.surface, to.load == Load::Load, to.store));
        colours.chain(self.depth.iter().map(|to| (to.surface, to.load == Load::Load, to.store)))
    }
}

/// What a shader may read in a slot of a draw.
#[derive(Clone, Copy, Debug)]
pub enum Binding<'a> {
    /// A texture.
    Texture(&'a Texture),
    /// A level of a surface that an earlier pass of the frame stored.
    Surface(SurfaceId),
    /// All levels of a surface, each of which an earlier pass of the frame stored.
    Levels(SurfaceId),
    /// A buffer, for [`crate::Lane::load`]. Draws read it alone.
    Buffer(BufferBinding),
}

/// A level of a surface with its place and its contents.
#[derive(Clone, Debug)]
pub(super) struct SurfaceState {
    name: String,
    spec: SurfaceSpec<'static>,
    pub region: MemoryRange,
    pub layout: Layout,
    /// `None` while nothing is stored in it.
    pub texels: Option<Arc<Texels>>,
}

impl SurfaceState {
    pub fn spec(&self) -> SurfaceSpec<'_> {
        SurfaceSpec { name: &self.name, ..self.spec }
    }
}

/// The surfaces of a frame.
#[derive(Clone, Debug, Default)]
pub(super) struct Surfaces(Vec<SurfaceState>);

impl Surfaces {
    pub fn create(&mut self, spec: &SurfaceSpec<'_>, tile_px: u32, space: &mut AddressSpace) -> SurfaceId {
        let first = self.0.len() as u32;
        for (level, viewport) in (0..).map_while(|level| Some((level, spec.size_of(level)?))) {
            let (name, spec) = (level_name(spec.name, level), SurfaceSpec { name: "", viewport, ..*spec });
            let region = space.take(Layout::new(&spec, tile_px, 0).1);
            let layout = Layout::new(&spec, tile_px, region.address()).0;
            self.0.push(SurfaceState { name, spec, region, layout, texels: None });
        }
        SurfaceId { first, level: 0 }
    }

    pub fn get(&self, id: SurfaceId) -> Option<&SurfaceState> {
        self.0.get(self.index(id)?)
    }

    pub fn get_mut(&mut self, id: SurfaceId) -> Option<&mut SurfaceState> {
        let index = self.index(id)?;
        self.0.get_mut(index)
    }

    fn index(&self, id: SurfaceId) -> Option<usize> {
        (id.level < self.levels(id)).then_some(id.first as usize + id.level as usize)
    }

    /// Levels of a surface, 0 for one of another frame.
    pub fn levels(&self, id: SurfaceId) -> u32 {
        self.0.get(id.first as usize).map_or(0, |state| state.spec.levels)
    }

    /// What a binding reads: levels of a surface.
    pub fn read_by(&self, binding: &Binding<'_>) -> Vec<SurfaceId> {
        match *binding {
            Binding::Texture(_) | Binding::Buffer(_) => Vec::new(),
            Binding::Surface(id) => vec![id],
            Binding::Levels(id) => (0..self.levels(id).max(1)).map(|level| id.level(level)).collect(),
        }
    }

    /// The error that `problem` is with a surface in a pass.
    pub fn refused(&self, pass: &str, id: SurfaceId, problem: SurfaceProblem) -> PassError {
        let number = || level_name(&format!("number {}", id.first), id.level);
        let missing =
            || self.0.get(id.first as usize).map_or_else(number, |state| level_name(&state.name, id.level));
        let surface = self.get(id).map_or_else(missing, |state| state.name.clone());
        PassError::Surface { pass: pass.to_owned(), surface, problem }
    }
}

/// Name of a level in messages.
fn level_name(surface: &str, level: u32) -> String {
    if level == 0 { surface.to_owned() } else { format!("{surface}, level {level}") }
}

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
    /// A view is of what a surface held before a later pass.
    #[error(
        "pass `{pass}`: a later pass replaced what the view of the surface `{surface}` shows; use a new one from `Gpu::surface_view`"
    )]
    OutdatedView {
        /// The pass.
        pass: String,
        /// Name of the surface.
        surface: String,
    },
    /// The shaders of a pass read memory that they write.
    #[error(
        "pass `{pass}`: its texture unit reads the {bytes} bytes from address {address}, which it also writes; write to other memory, or \
         access it as a target alone"
    )]
    Feedback {
        /// The pass.
        pass: String,
        /// Bytes of the range that is read.
        bytes: u64,
        /// Where it begins.
        address: u64,
    },
    /// A shader accesses memory that its pass does not state.
    #[error(
        "pass `{pass}`: a shader accesses the line at address {line} in a way that the pass does not state; add its range to the `Uses`"
    )]
    Unstated {
        /// The pass.
        pass: String,
        /// Address of the line.
        line: u64,
    },
    /// The frame was stopped.
    #[error("pass `{pass}` is not drawn: the frame was stopped before it")]
    Stopped {
        /// The pass.
        pass: String,
    },
    /// The memory of a frame is too large.
    #[error(
        "pass `{pass}`: the memory of the frame takes {} GiB, more than {} GiB; draw fewer pixels, samples or passes",
        .bytes.div_ceil(1 << 30),
        AddressSpace::MAX_BYTES >> 30
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
    /// The surface is of another GPU.
    #[error("the frame has no such surface; use one that `Gpu::create_surface` returned in this frame")]
    Unknown,
    /// The surface is read and written.
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
    /// The surface has several levels and several samples.
    #[error("it has {0} levels and {1} samples per pixel; resolve the samples into a surface with levels")]
    Levels(u32, u32),
    /// The surface is a target twice.
    #[error("it is a target of the pass twice; remove one of them")]
    Twice,
    /// The pass has too many targets.
    #[error("it is one colour target too many; a pass has up to {MAX_TARGETS}")]
    TooMany,
    /// The surface's format does not fit the target.
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
    /// The surface has no stencil values.
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
