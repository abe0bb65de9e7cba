//! Surfaces of a frame as targets and as bindings of draws: load and store operations, and what is refused.

use std::sync::Arc;

use glam::Vec4;

use super::gpu::PassError;
use super::pass::{RasterPass, Target};
use crate::geometry::Viewport;
use crate::memory::{AddressSpace, Surface};
use crate::state::{Blend, Clear, Compare, MAX_TARGETS};
use crate::surface::{Format, Layout, SurfaceSpec, Texels};
use crate::texture::Texture;

/// A surface of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct SurfaceId(u32);

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
    /// It is dropped, and not written to memory.
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

/// Targets of a pass: up to [`MAX_TARGETS`] for colours, and one for depths and stencil values.
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
    /// A surface that an earlier pass of the frame stored.
    Surface(SurfaceId),
}

/// Why a pass cannot use a surface.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum SurfaceProblem {
    /// It is of another GPU.
    #[error("the frame has no such surface; use one that `Gpu::create` returned in this frame")]
    Unknown,
    /// It is read and written.
    #[error("it is read and written in the same pass; draw to another surface")]
    Feedback,
    /// Nothing was stored in it.
    #[error("it is read, but no earlier pass of the frame stored anything in it; store it, or clear it")]
    Unwritten,
    /// The sizes differ.
    #[error("it has {0} pixels, but the pass has {1}; make both the same size")]
    Size(String, String),
    /// The samples differ.
    #[error("it has {0} samples per pixel, but the pass has {1}; make both the same")]
    Samples(u32, u32),
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

/// A surface with its place and its contents.
#[derive(Clone, Debug)]
pub(super) struct SurfaceState {
    name: String,
    spec: SurfaceSpec<'static>,
    pub region: Surface,
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
        let region = space.take(Layout::new(spec, tile_px, 0).1);
        let layout = Layout::new(spec, tile_px, region.address()).0;
        let (name, spec) = (spec.name.to_owned(), SurfaceSpec { name: "", ..*spec });
        self.0.push(SurfaceState { name, spec, region, layout, texels: None });
        SurfaceId(self.0.len() as u32 - 1)
    }

    pub fn get(&self, id: SurfaceId) -> Option<&SurfaceState> {
        self.0.get(id.0 as usize)
    }

    pub fn get_mut(&mut self, id: SurfaceId) -> Option<&mut SurfaceState> {
        self.0.get_mut(id.0 as usize)
    }

    /// The error that `problem` is with a surface in a pass.
    pub fn refused(&self, pass: &str, id: SurfaceId, problem: SurfaceProblem) -> PassError {
        let surface = self.get(id).map_or_else(|| format!("number {}", id.0), |state| state.name.clone());
        PassError::Surface { pass: pass.to_owned(), surface, problem }
    }

    /// Checks the targets and bindings of a pass.
    pub fn check(&self, pass: &RasterPass<'_>) -> Result<(), PassError> {
        let none = Attachments::default();
        let targets = if let Target::Surfaces(targets) = pass.target { targets } else { &none };
        self.check_targets(pass, targets)?;
        self.check_bindings(pass, targets)?;
        if let Target::Surfaces(targets) = pass.target { self.check_states(pass, targets) } else { Ok(()) }
    }

    fn check_targets(&self, pass: &RasterPass<'_>, targets: &Attachments) -> Result<(), PassError> {
        let refused = |id, problem| Err(self.refused(pass.name, id, problem));
        if let Some(extra) = targets.colours.get(MAX_TARGETS) {
            return refused(extra.surface, SurfaceProblem::TooMany);
        }
        for (number, (id, is_loaded, _)) in targets.all().enumerate() {
            let Some(state) = self.get(id) else { return refused(id, SurfaceProblem::Unknown) };
            if let Some(problem) = misfit(pass, &state.spec(), number >= targets.colours.len()) {
                return refused(id, problem);
            }
            if targets.all().take(number).any(|(other, ..)| other == id) {
                return refused(id, SurfaceProblem::Twice);
            }
            if is_loaded && state.texels.is_none() {
                return refused(id, SurfaceProblem::Unwritten);
            }
        }
        Ok(())
    }

    fn check_bindings(&self, pass: &RasterPass<'_>, targets: &Attachments) -> Result<(), PassError> {
        for id in pass.read_surfaces() {
            let problem = match self.get(id) {
                None => SurfaceProblem::Unknown,
                Some(_) if targets.all().any(|(target, ..)| target == id) => SurfaceProblem::Feedback,
                Some(state) if state.texels.is_none() => SurfaceProblem::Unwritten,
                Some(_) => continue,
            };
            return Err(self.refused(pass.name, id, problem));
        }
        Ok(())
    }

    fn check_states(&self, pass: &RasterPass<'_>, targets: &Attachments) -> Result<(), PassError> {
        let format = |id| self.get(id).map(|state| state.spec.format);
        for (draw, state) in pass.draws.iter().map(|draw| &draw.state).enumerate() {
            for (number, to) in targets.colours.iter().enumerate() {
                let blends = state.target(number).blend != Blend::Replace;
                if let Some(format) = format(to.surface).filter(|format| blends && !format.can_blend()) {
                    return Err(self.refused(pass.name, to.surface, SurfaceProblem::Blend { draw, format }));
                }
            }
            let tests_depth =
                state.depth.test != Compare::Always || state.depth.write || state.stencil.is_some();
            let Some(depth) = targets.depth else {
                let pass = pass.name.to_owned();
                return if tests_depth { Err(PassError::NoDepths { pass, draw }) } else { continue };
            };
            let lacks =
                format(depth.surface).filter(|format| state.stencil.is_some() && !format.has_stencil());
            if let Some(format) = lacks {
                return Err(self.refused(pass.name, depth.surface, SurfaceProblem::Stencil { draw, format }));
            }
        }
        Ok(())
    }
}

/// Why a surface is no target of a pass, for depths or for colours.
fn misfit(pass: &RasterPass<'_>, spec: &SurfaceSpec<'_>, is_depth: bool) -> Option<SurfaceProblem> {
    let (viewport, samples) = (pass.settings.viewport, pass.settings.samples.per_pixel());
    let size = |of: Viewport| format!("{} x {}", of.width(), of.height());
    if spec.format.is_depth() != is_depth {
        let allowed = if is_depth { "D32 and D24S8, which keep depths" } else { "those for colours" };
        return Some(SurfaceProblem::Format(spec.format, allowed));
    }
    if spec.viewport != viewport {
        return Some(SurfaceProblem::Size(size(spec.viewport), size(viewport)));
    }
    (spec.samples != samples).then_some(SurfaceProblem::Samples(spec.samples, samples))
}
