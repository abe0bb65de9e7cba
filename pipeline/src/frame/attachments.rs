//! Surfaces of a frame as targets and as bindings of draws, with load and store operations.

use std::sync::Arc;

use glam::Vec4;

use super::error::{PassError, SurfaceProblem};
use crate::memory::{AddressSpace, Surface};
use crate::state::Clear;
use crate::surface::{Layout, SurfaceSpec, Texels};
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
    /// A surface that an earlier pass of the frame stored.
    Surface(SurfaceId),
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
}
