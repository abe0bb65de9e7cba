//! Pass: draws and a camera, projected to the image plane, with numbered triangles.

use std::ops::Range;
use std::sync::Arc;

use glam::Vec4;

use super::attachments::{Attachment, Attachments, Binding, Load, Store, Surfaces};
use super::{Features, PassError, Settings, Shading};
use crate::buffer::{BufferBinding, Buffers};
use crate::depth::{BoxGrid, DepthBoxes, DepthTile};
use crate::geometry::{Camera, Clip, Cull, Geometry, MovingVertex, Projection, Viewport};
use crate::memory::{AddressSpace, LINE_BYTES, MemoryRange};
use crate::sampling::TileSamples;
use crate::setup::Corner;
use crate::shader::{Program, Shader};
use crate::state::{Clear, DepthState, DrawState};
use crate::surface::{BoundSlot, Format, MAX_TARGETS, Texels};
use crate::texture::{Sampler, Texture};
use crate::traversal::{LensSpans, at_rest, blur_px, motion_px};

/// Bytes of a stored depth or colour of one sample, and of a pixel of an image.
pub(super) const SAMPLE_BYTES: u64 = 4;
/// Bytes of the three indices of a triangle.
pub(super) const INDEX_BYTES: u64 = 12;
/// Bytes of the position of a vertex at one end of the shutter.
const POSITION_BYTES: u64 = 12;

/// A triangle as it is drawn.
pub(super) struct Staged {
    pub vertices: [MovingVertex; 3],
    /// Whether the lens shears it.
    pub lens: bool,
}

/// Data of a pass that all stages read and none changes.
pub(super) struct Pass<'a> {
    /// Number in the frame.
    pub number: u32,
    pub draws: &'a [Draw<'a>],
    pub settings: &'a Settings<'a>,
    pub projection: Projection,
    /// Vertices on the image plane, by draw.
    pub vertices: Vec<Vec<MovingVertex>>,
    /// First triangle of each draw, and the total number.
    first_triangle: Vec<u32>,
    pub addresses: AddressMap,
    /// Operations of the shader of each draw.
    pub programs: Vec<Program>,
    /// What the shader of each draw reads, by slot.
    pub bound: Vec<Vec<BoundSlot<'a>>>,
    /// Depths of samples. Without a place they are not in memory.
    pub depth: Plane,
    /// Colours of samples, by target. Without any the pass computes depths only.
    pub colours: Vec<Plane>,
    /// Whether depths and colours are in surfaces of the frame.
    pub is_attached: bool,
    /// Where samples are shaded.
    pub shading: Shading,
    /// Image coordinate of the first column and row.
    pub origin: [f32; 2],
    /// Whether the camera has a lens.
    pub lens: bool,
    /// Ranges of `u` that are tested each on their own.
    pub spans: Option<LensSpans>,
    /// Part of lens and shutter in which anything is drawn.
    pub clip: Clip,
    /// Whether the camera is still while the shutter is open.
    pub still_camera: bool,
    /// Camera position in world space at mid-shutter, homogeneous.
    pub eye: Vec4,
    /// Whether workers record tile tests by tile.
    pub heat: bool,
    /// Range of samples of each image.
    pub views: Vec<Range<u32>>,
    pub clear: Clear,
    /// Whether the result depends on the order of triangles, so that samples are shaded and stored in it.
    pub is_ordered: bool,
}

impl<'a> Pass<'a> {
    /// Prepares pass `number` of a frame, which was checked, and gives its data addresses in `space`. It
    /// reads surfaces and buffers as they are.
    pub fn new(
        pass: &RasterPass<'a>,
        (number, heat): (u32, bool),
        (surfaces, buffers): (&Surfaces, &Buffers),
        space: &mut AddressSpace,
    ) -> Self {
        let RasterPass { camera, draws, settings, .. } = *pass;
        let features = &settings.spec.features;
        let views = pass.target.views(settings.samples.per_pixel());
        let projection = Projection::new(camera, settings.viewport);
        let vertices = draws.iter().map(|draw| projection.images(&draw.geometry)).collect();
        let first_triangle = std::iter::once(0)
            .chain(draws.iter().scan(0, |count, draw| {
                *count += draw.geometry.triangles().len() as u32;
                Some(*count)
            }))
            .collect();
        let viewport = settings.viewport;
        let (depth, colours) = planes(pass, !views.is_empty(), surfaces, space);
        let addresses = AddressMap::new(pass, views.len(), space);
        let is_attached = matches!(pass.target, Target::Surfaces(_));
        let state_matters = |draw: &Draw<'_>| {
            !draw.state.keeps_nearest() || draw.shader.may_discard() || draw.query.is_some()
        };
        Self {
            number,
            draws,
            settings,
            vertices,
            first_triangle,
            bound: bound(draws, &addresses, (surfaces, buffers), space),
            addresses,
            programs: draws.iter().map(|draw| Program::of(draw.shader, colours.len())).collect(),
            origin: [Viewport::edge(0, viewport.width()), Viewport::edge(0, viewport.height())],
            lens: !projection.shear.is_none(),
            spans: features.lens_regions.then(|| LensSpans::new(settings.samples.lens_regions())).flatten(),
            clip: camera.clip(),
            still_camera: camera.open() == camera.close(),
            eye: projection.eye(),
            heat,
            views,
            projection,
            clear: depth.cleared(),
            is_ordered: is_attached || draws.iter().any(state_matters),
            depth,
            colours,
            is_attached,
            shading: if pass.per_sample { Shading::PerSample } else { settings.spec.shading },
        }
    }

    /// Ranges of triangles that are binned together.
    pub fn batches(&self) -> impl ExactSizeIterator<Item = Range<u32>> + use<'_> {
        let total = self.first_triangle[self.draws.len()];
        let size = self.settings.spec.batch_triangles;
        (0..total.div_ceil(size)).map(move |batch| batch * size..total.min(batch * size + size))
    }

    /// Triangles of a draw.
    pub fn triangles_of(&self, draw: usize) -> Range<u32> {
        self.first_triangle[draw]..self.first_triangle[draw + 1]
    }

    /// Draw of a triangle, and its index in the draw.
    pub fn locate(&self, triangle: u32) -> (usize, usize) {
        let draw = self.first_triangle.partition_point(|&first| first <= triangle) - 1;
        (draw, (triangle - self.first_triangle[draw]) as usize)
    }

    /// Draw of a triangle, and its vertex indices.
    pub fn corners(&self, triangle: u32) -> (usize, [usize; 3]) {
        let (draw, index) = self.locate(triangle);
        (draw, self.draws[draw].geometry.triangles()[index].map(|vertex| vertex as usize))
    }

    /// Vertices of a triangle on the image plane.
    pub fn images(&self, triangle: u32) -> [&MovingVertex; 3] {
        let (draw, corners) = self.corners(triangle);
        corners.map(|vertex| &self.vertices[draw][vertex])
    }

    /// A triangle as it is drawn, without motion or blur below the thresholds of the settings.
    pub fn staged(&self, triangle: u32) -> Staged {
        let (images, shear) = (self.images(triangle), &self.projection.shear);
        let Features { still_px, in_focus_px, .. } = self.settings.spec.features;
        let rests = still_px > 0.0 && motion_px(images, shear) <= f64::from(still_px);
        let sharp = in_focus_px > 0.0 && self.lens && blur_px(images, shear) <= f64::from(in_focus_px);
        Staged {
            vertices: if rests { images.map(at_rest) } else { images.map(|v| *v) },
            lens: self.lens && !sharp,
        }
    }

    /// Corners of a triangle, and whether any of them moves.
    pub fn moving_corners(&self, triangle: u32) -> ([Corner; 3], bool) {
        let vertices = self.staged(triangle).vertices;
        (vertices.each_ref().map(Corner::new), vertices.iter().any(|vertex| !vertex.is_still()))
    }

    /// Division of lens and time for depth culling.
    pub fn depth_grid(&self) -> BoxGrid {
        BoxGrid::new(self.settings.spec.depth.boxes, self.lens).unwrap_or_default()
    }

    /// Whether shading waits until hidden surfaces are removed, where draws allow it.
    pub fn shading_waits(&self) -> bool {
        self.settings.spec.features.hidden_surface_removal && !self.is_depth_only()
    }

    /// Whether the samples of a draw have to be shaded before those of the next one: some are discarded, or
    /// something is left of the colours before.
    pub fn shades_in_order(&self, draw: u32) -> bool {
        let Draw { state, shader, .. } = &self.draws[draw as usize];
        let targets = || (0..self.colours.len()).map(|number| state.target(number));
        let leaves = targets().any(|target| target.writes()) && !targets().all(|target| target.replaces());
        shader.may_discard() || leaves
    }

    /// The tile at `origin` with its `samples` before the first draw.
    pub fn first_tile(&self, samples: &TileSamples, origin: [u32; 2]) -> DepthTile {
        let (count, Clear { depth, stencil }) = (samples.len, self.clear);
        let mut tile = DepthTile::cleared(self.depth_grid(), samples, depth);
        if self.shading_waits() {
            tile.waiting = vec![DepthTile::NO_TRIANGLE; count];
        }
        if self.draws.iter().any(|draw| draw.state.stencil.is_some()) {
            tile.stencil = vec![stencil; count];
        }
        if let Some(format) = self.depth.format {
            let stored = self.first_values(&self.depth, samples, origin);
            if self.depth.is_loaded() {
                tile.depth = stored.iter().map(|value| value.x).collect();
                tile.boxes = DepthBoxes::of(self.depth_grid(), samples, &tile.depth);
                tile.is_bounded = false;
            }
            if format.has_stencil() {
                tile.stencil = stored.iter().map(|value| value.y as u8).collect();
            }
        }
        if self.is_ordered {
            let first = |plane| self.first_values(plane, samples, origin);
            tile.colours = self.colours.iter().map(first).collect();
        }
        tile
    }

    /// Values of the samples of a tile before the first draw.
    fn first_values(&self, plane: &Plane, samples: &TileSamples, origin: [u32; 2]) -> Vec<Vec4> {
        match &plane.first {
            First::Cleared(value) => vec![*value; samples.len],
            First::Loaded(texels) => {
                (0..samples.len).map(|slot| texels.get(self.in_image(samples, slot, origin))).collect()
            }
        }
    }

    /// Index in the image of the sample in `slot` of the tile at `origin`.
    pub fn in_image(&self, samples: &TileSamples, slot: usize, origin: [u32; 2]) -> usize {
        let Settings { spec, viewport, samples: source, .. } = *self.settings;
        samples.in_image(slot, origin, spec.tile_px, viewport, source.per_pixel())
    }

    /// Colour targets that `draw` writes to.
    pub fn written_by(&self, draw: u32) -> impl Iterator<Item = (usize, &Plane)> {
        let state = self.draws.get(draw as usize).map(|draw| draw.state);
        let writes = move |number| state.is_some_and(|state| state.target(number).writes());
        self.colours.iter().enumerate().filter(move |(number, _)| writes(*number))
    }

    /// Result of the pass: its images, or the depths of a depth pass.
    pub fn result(&self) -> MemoryRange {
        if self.addresses.image.bytes() > 0 { self.addresses.image } else { self.depth.place }
    }

    /// Whether the pass computes depths only.
    pub fn is_depth_only(&self) -> bool {
        self.colours.is_empty()
    }

    /// Fine tiles of the image.
    pub fn tiles(&self) -> u64 {
        let rows = self.settings.viewport.height().div_ceil(self.settings.spec.tile_px);
        u64::from(self.tiles_across()) * u64::from(rows)
    }

    /// Fine tiles in a row of the image.
    pub fn tiles_across(&self) -> u32 {
        self.settings.viewport.width().div_ceil(self.settings.spec.tile_px)
    }
}

/// Values of all samples of a pass: depths, or the colours of a target.
pub(super) struct Plane {
    pub place: MemoryRange,
    pub sample_bytes: u64,
    /// Format in a surface of the frame; others keep values as they were computed.
    pub format: Option<Format>,
    pub first: First,
    pub is_stored: bool,
}

/// Values before the first draw of a pass.
pub(super) enum First {
    /// The same value everywhere.
    Cleared(Vec4),
    /// The values that an earlier pass left.
    Loaded(Arc<Texels>),
}

impl Plane {
    /// Values that end with the pass, or with the frame.
    fn inner(place: MemoryRange, value: Vec4) -> Self {
        let first = First::Cleared(value);
        Self { place, sample_bytes: SAMPLE_BYTES, format: None, first, is_stored: false }
    }

    /// Values in a surface.
    fn attached<V: Copy>(to: &Attachment<V>, value: impl Fn(V) -> Vec4, surfaces: &Surfaces) -> Option<Self> {
        let state = surfaces.get(to.surface)?;
        let format = state.spec().format;
        let first = match to.load {
            Load::Clear(clear) => First::Cleared(format.round(value(clear))),
            Load::Load => First::Loaded(Arc::clone(state.texels.as_ref()?)),
            Load::Discard => First::Cleared(Vec4::ZERO),
        };
        let (place, is_stored) = (state.region, to.store == Store::Store);
        Some(Self { place, sample_bytes: format.bytes(), format: Some(format), first, is_stored })
    }

    /// Lines of the plane.
    pub fn lines(&self) -> usize {
        self.place.bytes().div_ceil(LINE_BYTES) as usize
    }

    /// Value before the first draw as depth and stencil, where it is the same everywhere.
    fn cleared(&self) -> Clear {
        let First::Cleared(value) = self.first else { return Clear { depth: 0.0, stencil: 0 } };
        Clear { depth: value.x, stencil: value.y as u8 }
    }

    /// Whether lines have to be read before they are changed.
    pub fn is_loaded(&self) -> bool {
        matches!(self.first, First::Loaded(_))
    }

    /// A value as its format stores it.
    pub fn round(&self, value: Vec4) -> Vec4 {
        self.format.map_or(value, |format| format.round(value))
    }

    /// The same for a depth.
    pub fn round_depth(&self, depth: f32) -> f32 {
        self.format.map_or(depth, |format| format.round_depth(depth))
    }
}

/// Depths and colours of a pass. Those of a pass with `images` that are not in surfaces end with it.
fn planes(
    pass: &RasterPass<'_>,
    has_images: bool,
    surfaces: &Surfaces,
    space: &mut AddressSpace,
) -> (Plane, Vec<Plane>) {
    let depth_of = |clear: Clear| Vec4::new(clear.depth, f32::from(clear.stencil), 0.0, 1.0);
    if let Target::Surfaces(targets) = pass.target {
        let colour = |to| Plane::attached(to, |value| value, surfaces);
        let depth = targets.depth.as_ref().and_then(|to| Plane::attached(to, depth_of, surfaces));
        let depth = depth.unwrap_or_else(|| Plane::inner(MemoryRange::NOWHERE, depth_of(pass.clear)));
        return (depth, targets.colours.iter().filter_map(colour).collect());
    }
    let bytes = pass.padded_pixels() * u64::from(pass.settings.samples.per_pixel()) * SAMPLE_BYTES;
    let depth = |place| Plane::inner(place, depth_of(pass.clear));
    if !has_images {
        // The depths of a depth pass are its result.
        return (Plane { is_stored: true, ..depth(space.take(bytes)) }, Vec::new());
    }
    let [depths, colours] = space.samples(bytes);
    (depth(depths), vec![Plane::inner(colours, pass.settings.background.extend(1.0))])
}

/// Addresses of textures; one that several draws use has one.
#[derive(Default)]
struct TextureAddresses(Vec<(*const Texture, u64)>);

impl TextureAddresses {
    /// The address that is known, `given`, or new.
    fn of(&mut self, texture: &Texture, given: Option<u64>, space: &mut AddressSpace) -> u64 {
        let known = self.0.iter().find(|(seen, _)| std::ptr::eq(*seen, texture)).map(|known| known.1);
        let address = given.or(known).unwrap_or_else(|| space.take(texture.bytes()).address());
        self.0.push((texture, address));
        address
    }
}

/// What the shader of each draw reads.
fn bound<'a>(
    draws: &[Draw<'a>],
    addresses: &AddressMap,
    (surfaces, buffers): (&Surfaces, &Buffers),
    space: &mut AddressSpace,
) -> Vec<Vec<BoundSlot<'a>>> {
    let own = draws.iter().map(|draw| draw.shader.texture());
    let own =
        own.zip(&addresses.textures).filter_map(|(texture, at)| Some((std::ptr::from_ref(texture?), (*at)?)));
    let mut known = TextureAddresses(own.collect());
    let mut bind = |binding: &Binding<'a>| match *binding {
        Binding::Texture(texture) => {
            Some(BoundSlot::texture(Sampler::new(texture, known.of(texture, None, space))))
        }
        Binding::Surface(_) | Binding::Levels(_) => {
            let stored = |id| {
                let state = surfaces.get(id)?;
                Some((Arc::clone(state.texels.as_ref()?), state.layout))
            };
            let levels = surfaces.read_by(binding).into_iter().map(stored);
            Some(BoundSlot::surface(levels.collect::<Option<_>>()?))
        }
        Binding::Buffer(ref binding) => Some(BoundSlot::buffer(buffers.bound(binding)?)),
    };
    draws.iter().map(|draw| draw.bindings.iter().filter_map(&mut bind).collect()).collect()
}

/// Where a pass finds the data of its draws, and leaves its images.
#[derive(Clone, Debug)]
pub(super) struct AddressMap {
    /// Images, one after the other.
    pub image: MemoryRange,
    /// Vertices of each draw.
    pub vertices: Vec<VertexBuffer>,
    /// First byte of the texture of each draw, if it has any; draws with the same texture have the same address.
    pub textures: Vec<Option<u64>>,
}

impl AddressMap {
    fn new(pass: &RasterPass<'_>, images: usize, space: &mut AddressSpace) -> Self {
        let viewport = pass.settings.viewport;
        let mip_levels = match pass.target {
            Target::Texture => Texture::bytes_of(viewport.width(), viewport.height()),
            _ => 0,
        };
        let image = space.take((pass.padded_pixels() * SAMPLE_BYTES * images as u64).max(mip_levels));
        let (vertices, textures) = resident(pass.draws, space).unzip();
        Self { image, vertices, textures }
    }
}

/// Addresses of the vertices and the texture of each draw. Those without any get new ones.
pub(super) fn resident<'s>(
    draws: &'s [Draw<'_>],
    space: &'s mut AddressSpace,
) -> impl Iterator<Item = (VertexBuffer, Option<u64>)> + use<'s> {
    let vertices: Vec<VertexBuffer> = draws
        .iter()
        .map(|draw| {
            let (count, stride) = (draw.geometry.open().len() as u64, draw.geometry.vertex_bytes());
            let triangles = draw.geometry.triangles().len() as u64;
            let new = || {
                let vertices = space.take(count * u64::from(stride));
                VertexBuffer { vertices, stride, indices: space.take(triangles * INDEX_BYTES) }
            };
            draw.resident.vertices.unwrap_or_else(new)
        })
        .collect();
    let mut known = TextureAddresses::default();
    draws.iter().zip(vertices).map(move |(draw, vertices)| {
        let texture = draw.shader.texture().map(|texture| known.of(texture, draw.resident.texture, space));
        (vertices, texture)
    })
}

/// An occlusion query: what is found about the samples of a draw.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Query {
    /// How many samples pass.
    Count,
    /// Whether any sample passes. The answer is known where a packet, the work of a triangle in a tile,
    /// leaves the depth test; later packets of the draw in the order of the stream are dropped. The samples
    /// of a packet are tested together, so it is finished. The front end works ahead of the tiles, so
    /// vertices and set-up are not spared. The tile loop is taken to know the answer at once, which is the
    /// best that hardware can do.
    Any,
}

/// Triangles with a shader.
#[derive(Clone, Copy)]
pub struct Draw<'a> {
    /// Triangles.
    pub geometry: Geometry<'a>,
    /// Shader.
    pub shader: &'a dyn Shader,
    /// Which samples are stored, and how.
    pub state: DrawState,
    /// What the shader may read, by slot.
    pub bindings: &'a [Binding<'a>],
    /// Addresses of its data, if an earlier pass of the frame has used them.
    pub resident: Resident,
    /// What is found about its samples, if it is an occlusion query.
    pub query: Option<Query>,
}

impl<'a> Draw<'a> {
    /// A draw of opaque triangles whose data are new to the GPU.
    pub fn new(geometry: Geometry<'a>, shader: &'a dyn Shader, cull: Cull) -> Self {
        let (state, resident) = (DrawState::new(cull), Resident::default());
        Self { geometry, shader, state, bindings: &[], resident, query: None }
    }

    /// The draw with other faces culled.
    #[must_use]
    pub fn culling(self, cull: Cull) -> Self {
        self.with_state(DrawState { cull, ..self.state })
    }

    /// The draw with another state.
    #[must_use]
    pub fn with_state(self, state: DrawState) -> Self {
        Self { state, ..self }
    }

    /// The draw as an occlusion query, which stores nothing. Depths are compared as its state says.
    #[must_use]
    pub fn with_query(self, query: Query) -> Self {
        let depth = DepthState { write: false, ..self.state.depth };
        let others = Default::default();
        let state = DrawState { depth, colour_mask: [false; 4], others, ..self.state };
        Self { state, query: Some(query), ..self }
    }

    /// The draw with a shader that reads `bindings`, the first in slot 0.
    #[must_use]
    pub fn binding(self, bindings: &'a [Binding<'a>]) -> Self {
        Self { bindings, ..self }
    }

    /// Addresses and bytes of the indices of a triangle and of the positions of its vertices, for programs
    /// that read them; `None` unless the draw is [resident](super::Gpu::resident) and has the triangle.
    pub fn data_of(&self, triangle: u32) -> Option<[(u64, u64); 4]> {
        let VertexBuffer { vertices, stride, indices } = self.resident.vertices?;
        let corners = self.geometry.triangles().get(triangle as usize)?;
        let bytes = if self.geometry.is_still() { POSITION_BYTES } else { 2 * POSITION_BYTES };
        let [a, b, c] =
            corners.map(|vertex| (vertices.address() + u64::from(vertex) * u64::from(stride), bytes));
        Some([(indices.address() + u64::from(triangle) * INDEX_BYTES, INDEX_BYTES), a, b, c])
    }

    /// Where its vertices and indices are; `None` unless it is resident.
    pub fn ranges(&self) -> Option<[MemoryRange; 2]> {
        self.resident.vertices.map(|VertexBuffer { vertices, indices, .. }| [vertices, indices])
    }

    /// The draw with the texture of its shader in `region`, as an earlier pass wrote it.
    #[must_use]
    pub fn reading(self, region: MemoryRange) -> Self {
        Self { resident: Resident { texture: Some(region.address()), ..self.resident }, ..self }
    }
}

/// Vertices and indices in memory. A pass that draws them at one time of the shutter still reads both ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct VertexBuffer {
    /// The vertices.
    pub vertices: MemoryRange,
    /// Bytes of a vertex.
    pub stride: u32,
    /// The indices.
    pub indices: MemoryRange,
}

/// Addresses of a draw's data.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Resident {
    pub(super) vertices: Option<VertexBuffer>,
    pub(super) texture: Option<u64>,
}

/// Work of one pass: draws seen by a camera.
#[derive(Clone, Copy)]
pub struct RasterPass<'a> {
    /// Name in reports.
    pub name: &'a str,
    /// The camera.
    pub camera: &'a Camera,
    /// The draws, in order.
    pub draws: &'a [Draw<'a>],
    /// Hardware, image size, samples and background.
    pub settings: &'a Settings<'a>,
    /// What is drawn.
    pub target: Target<'a>,
    /// Depth and stencil value of all samples before the first draw.
    pub clear: Clear,
    /// Whether the result has the pixels of the images.
    pub image: bool,
    /// Whether the result has the visible triangle and the depth of every sample.
    pub visible: bool,
    /// Whether every sample is shaded at its own position, whatever the hardware does otherwise.
    pub per_sample: bool,
    /// First pixel of each of its images in the image of the frame, for heat maps; empty if its image is that of
    /// the frame.
    pub places: &'a [[u32; 2]],
}

/// Result that a pass leaves in memory.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Target<'a> {
    /// One image of all samples.
    Image,
    /// The same, with room for its mip levels, for draws that [read it](Draw::reading).
    Texture,
    /// Several images. Image `k` is the mean of the samples of each pixel whose indices are in range `k`.
    /// Ranges may overlap; indices beyond the samples of a pixel are ignored, and an image without samples is
    /// black.
    Views(&'a [Range<u32>]),
    /// The depths of all samples, such as a shadow map. Nothing is shaded.
    Depth,
    /// Surfaces of the frame. Samples are stored in the order of triangles.
    Surfaces(&'a Attachments),
}

impl Target<'_> {
    /// Samples of each image.
    fn views(&self, per_pixel: u32) -> Vec<Range<u32>> {
        let within = |run: &Range<u32>| run.start..run.end.min(per_pixel).max(run.start);
        match self {
            Self::Image | Self::Texture => std::iter::once(0..per_pixel).collect(),
            Self::Views(views) => views.iter().map(within).collect(),
            Self::Depth | Self::Surfaces(_) => Vec::new(),
        }
    }
}

impl<'a> RasterPass<'a> {
    /// A pass that draws one image.
    pub fn new(camera: &'a Camera, draws: &'a [Draw<'a>], settings: &'a Settings<'a>) -> Self {
        let (name, target, clear) = ("draw", Target::Image, Clear::default());
        let (image, visible, per_sample, places) = (true, false, false, Default::default());
        Self { name, camera, draws, settings, target, clear, image, visible, per_sample, places }
    }

    /// The pass with another name.
    #[must_use]
    pub fn named(self, name: &'a str) -> Self {
        Self { name, ..self }
    }

    /// The pass with another target.
    #[must_use]
    pub fn onto(self, target: Target<'a>) -> Self {
        Self { target, ..self }
    }

    /// The pass without pixels in its result. Its work is the same.
    #[must_use]
    pub fn without_image(self) -> Self {
        Self { image: false, ..self }
    }

    /// The pass with visible triangles and depths in its result.
    #[must_use]
    pub fn with_visible(self) -> Self {
        Self { visible: true, ..self }
    }

    /// The pass with every sample shaded at its own position.
    #[must_use]
    pub fn shaded_per_sample(self) -> Self {
        Self { per_sample: true, ..self }
    }

    /// The pass with its images at `places` within that of the frame, for heat maps. What it does serves all of
    /// them, and each has its part.
    #[must_use]
    pub fn shown_at(self, places: &'a [[u32; 2]]) -> Self {
        Self { places, ..self }
    }

    /// Columns and rows of the pixels of a tile in each place of its images.
    pub(super) fn places_of(&self, tile: u32) -> impl Iterator<Item = [[u32; 2]; 2]> {
        let (viewport, side) = (self.settings.viewport, self.settings.spec.tile_px);
        let (sides, across) = ([viewport.width(), viewport.height()], viewport.width().div_ceil(side));
        let first = [tile % across * side, tile / across * side];
        self.places.iter().map(move |place| {
            [0, 1].map(|axis| [first[axis], (first[axis] + side).min(sides[axis])].map(|at| place[axis] + at))
        })
    }

    /// Pixels of the image, in whole tiles.
    fn padded_pixels(&self) -> u64 {
        let (viewport, tile_px) = (self.settings.viewport, self.settings.spec.tile_px);
        let [across, down] = [viewport.width(), viewport.height()].map(|side| side.div_ceil(tile_px));
        u64::from(across) * u64::from(down) * u64::from(tile_px * tile_px)
    }

    /// Checks that queries that may end early store nothing.
    pub(super) fn check_queries(&self) -> Result<(), PassError> {
        let stores = |draw: &Draw<'_>| {
            let DrawState { depth, stencil, .. } = draw.state;
            depth.write || stencil.is_some() || (0..MAX_TARGETS).any(|to| draw.state.target(to).writes())
        };
        let refused = self.draws.iter().position(|draw| draw.query == Some(Query::Any) && stores(draw));
        refused.map_or(Ok(()), |draw| Err(PassError::QueryStores { pass: self.name.to_owned(), draw }))
    }

    /// Buffers that its draws bind.
    pub(super) fn buffers(&self) -> impl Iterator<Item = &'a BufferBinding> + use<'a> {
        let bindings = self.draws.iter().flat_map(|draw| draw.bindings);
        bindings.filter_map(|binding| if let Binding::Buffer(buffer) = binding { Some(buffer) } else { None })
    }

    /// Triangles of all draws.
    pub fn triangles(&self) -> usize {
        self.draws.iter().map(|draw| draw.geometry.triangles().len()).sum()
    }
}
