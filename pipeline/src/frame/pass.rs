//! Pass: draws and a camera, projected to the image plane, with numbered triangles.

use std::ops::Range;

use glam::Vec4;

use super::{Features, Settings};
use crate::depth::{BoxGrid, DepthTile};
use crate::geometry::{Camera, Clip, Cull, Geometry, MovingVertex, Projection, Viewport};
use crate::memory::{AddressSpace, Surface};
use crate::sampling::TileSamples;
use crate::setup::Corner;
use crate::shader::{Program, Shader};
use crate::state::{Clear, DrawState};
use crate::texture::Texture;
use crate::traversal::LensSpans;
use crate::traversal::thresholds::{at_rest, blur_px, motion_px};

/// Bytes of a stored depth or colour of one sample, and of a pixel of an image.
pub(super) const SAMPLE_BYTES: u64 = 4;

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
    /// Range of samples of each image. Without ranges the pass computes depths only.
    pub views: Vec<Range<u32>>,
    pub clear: Clear,
    /// Whether the result depends on the order of triangles, so that samples are shaded and stored in it.
    pub is_ordered: bool,
}

impl<'a> Pass<'a> {
    /// Prepares pass `number` of a frame and gives its surfaces addresses in `space`.
    pub fn new(pass: &RasterPass<'a>, (number, heat): (u32, bool), space: &mut AddressSpace) -> Self {
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
        Self {
            number,
            draws,
            settings,
            vertices,
            first_triangle,
            addresses: AddressMap::new(pass, views.len(), space),
            programs: draws.iter().map(|draw| Program::of(draw.shader)).collect(),
            origin: [Viewport::edge(0, viewport.width()), Viewport::edge(0, viewport.height())],
            lens: !projection.shear.is_none(),
            spans: features.lens_regions.then(|| LensSpans::new(settings.samples.lens_regions())).flatten(),
            clip: camera.clip(),
            still_camera: camera.open() == camera.close(),
            eye: projection.eye(),
            heat,
            views,
            projection,
            clear: pass.clear,
            is_ordered: draws.iter().any(|draw| !draw.state.keeps_nearest() || draw.shader.may_discard()),
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

    /// Whether visible samples are shaded after the last triangle.
    pub fn shades_last(&self) -> bool {
        self.settings.spec.features.hidden_surface_removal && !self.is_ordered && !self.is_depth_only()
    }

    /// A cleared tile of `samples`.
    pub fn cleared_tile(&self, samples: &TileSamples) -> DepthTile {
        let (count, Clear { depth, stencil }) = (samples.len, self.clear);
        let mut tile = DepthTile::cleared(self.depth_grid(), samples, depth);
        if self.draws.iter().any(|draw| draw.state.stencil.is_some()) {
            tile.stencil = vec![stencil; count];
        }
        if self.is_ordered && !self.is_depth_only() {
            tile.colour = vec![self.settings.background.extend(1.0); count];
        }
        tile
    }

    /// Whether the pass computes depths only.
    pub fn is_depth_only(&self) -> bool {
        self.views.is_empty()
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

/// Where a pass finds its data.
#[derive(Clone, Debug)]
pub(super) struct AddressMap {
    /// Depths of samples.
    pub depth: Surface,
    /// Colours of samples.
    pub colour: Surface,
    /// Images, one after the other.
    pub image: Surface,
    /// Vertices of each draw.
    pub vertices: Vec<VertexBuffer>,
    /// First byte of the texture of each draw, if it has any; draws with the same texture have the same address.
    pub textures: Vec<Option<u64>>,
}

impl AddressMap {
    fn new(pass: &RasterPass<'_>, images: usize, space: &mut AddressSpace) -> Self {
        let settings = pass.settings;
        let (viewport, tile_px) = (settings.viewport, settings.spec.tile_px);
        let tiles =
            u64::from(viewport.width().div_ceil(tile_px)) * u64::from(viewport.height().div_ceil(tile_px));
        let pixels = tiles * u64::from(tile_px * tile_px);
        let bytes = pixels * u64::from(settings.samples.per_pixel()) * SAMPLE_BYTES;
        // The depths of a depth pass are its result.
        let [depth, colour] = if images == 0 { [space.take(bytes); 2] } else { space.samples(bytes) };
        let mip_levels = match pass.target {
            Target::Texture => Texture::bytes_of(viewport.width(), viewport.height()),
            _ => 0,
        };
        let image = space.take((pixels * SAMPLE_BYTES * images as u64).max(mip_levels));
        let (vertices, textures) = resident(pass.draws, space).unzip();
        Self { depth, colour, image, vertices, textures }
    }

    /// What is left of the pass: its images, or the depths of a depth pass.
    pub fn result(&self) -> Surface {
        if self.image.bytes() > 0 { self.image } else { self.depth }
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
            let new = || VertexBuffer { address: space.take(count * u64::from(stride)).address(), stride };
            draw.resident.vertices.unwrap_or_else(new)
        })
        .collect();
    let mut known: Vec<(*const Texture, u64)> = Vec::new();
    draws.iter().zip(vertices).map(move |(draw, vertices)| {
        let texture = draw.shader.texture().map(|texture| {
            let shared = known.iter().find(|(seen, _)| std::ptr::eq(*seen, texture)).map(|known| known.1);
            let address = draw.resident.texture.or(shared);
            let address = address.unwrap_or_else(|| space.take(texture.bytes()).address());
            known.push((texture, address));
            address
        });
        (vertices, texture)
    })
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
    /// Addresses of its data, if an earlier pass of the frame has used them.
    pub resident: Resident,
}

impl<'a> Draw<'a> {
    /// A draw of opaque triangles whose data are new to the GPU.
    pub fn new(geometry: Geometry<'a>, shader: &'a dyn Shader, cull: Cull) -> Self {
        Self { geometry, shader, state: DrawState::new(cull), resident: Resident::default() }
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

    /// The draw with the texture of its shader in `surface`, as an earlier pass wrote it.
    #[must_use]
    pub fn reading(self, surface: Surface) -> Self {
        Self { resident: Resident { texture: Some(surface.address()), ..self.resident }, ..self }
    }
}

/// Vertices in memory. A pass that draws them at one time of the shutter still reads both ends.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct VertexBuffer {
    /// First byte.
    pub address: u64,
    /// Bytes of a vertex.
    pub stride: u32,
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
}

/// Result that a pass leaves in memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Target<'a> {
    /// One image of all samples.
    Image,
    /// The same, with room for its mip levels, for draws that [read it](Draw::reading).
    Texture,
    /// Several images. Image `k` is the mean of the samples of each pixel whose indices are in range `k`. Ranges may overlap;
    /// indices beyond the samples of a pixel are ignored, and an image without samples is black.
    Views(&'a [Range<u32>]),
    /// The depths of all samples, such as a shadow map. Nothing is shaded.
    Depth,
}

impl Target<'_> {
    /// Samples of each image.
    fn views(&self, per_pixel: u32) -> Vec<Range<u32>> {
        let within = |run: &Range<u32>| run.start..run.end.min(per_pixel).max(run.start);
        match self {
            Self::Image | Self::Texture => std::iter::once(0..per_pixel).collect(),
            Self::Views(views) => views.iter().map(within).collect(),
            Self::Depth => Vec::new(),
        }
    }
}

impl<'a> RasterPass<'a> {
    /// A pass that draws one image.
    pub fn new(camera: &'a Camera, draws: &'a [Draw<'a>], settings: &'a Settings<'a>) -> Self {
        let (name, target, clear) = ("draw", Target::Image, Clear::default());
        Self { name, camera, draws, settings, target, clear, image: true, visible: false }
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

    /// The pass with samples cleared to other values.
    #[must_use]
    pub fn cleared(self, clear: Clear) -> Self {
        Self { clear, ..self }
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

    /// Triangles of all draws.
    pub fn triangles(&self) -> usize {
        self.draws.iter().map(|draw| draw.geometry.triangles().len()).sum()
    }
}
