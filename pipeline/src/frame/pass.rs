//! Pass: draws and a camera, projected to the image plane, with numbered triangles.

use std::ops::Range;

use glam::Vec4;

use super::{Features, Settings};
use crate::depth::BoxGrid;
use crate::geometry::{Camera, Clip, Cull, Geometry, MovingVertex, Projection, Viewport};
use crate::memory::{AddressMap, Allocator};
use crate::setup::Corner;
use crate::shading::Shader;
use crate::texture::Texture;
use crate::traversal::thresholds::{at_rest, blur_px, motion_px};

/// A triangle as it is drawn.
pub(super) struct Staged {
    pub vertices: [MovingVertex; 3],
    /// Whether the lens shears it.
    pub lens: bool,
}

/// Data of a pass that all stages read and none changes.
pub(super) struct Pass<'a> {
    /// Number in the frame.
    pub number: u16,
    pub draws: &'a [Draw<'a>],
    pub settings: &'a Settings<'a>,
    pub projection: Projection,
    /// Vertices on the image plane, by draw.
    pub vertices: Vec<Vec<MovingVertex>>,
    /// First triangle of each draw, and the total number.
    first_triangle: Vec<u32>,
    pub addresses: AddressMap,
    /// Image coordinate of the first column and row.
    pub origin: [f32; 2],
    /// Whether the camera has a lens.
    pub lens: bool,
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
}

impl<'a> Pass<'a> {
    /// A pass with one image of all samples.
    pub fn new(camera: &Camera, draws: &'a [Draw<'a>], settings: &'a Settings<'a>) -> Self {
        Self::with_views(camera, draws, settings, std::iter::once(0..settings.samples.per_pixel()).collect())
    }

    /// A pass with an image for each range of samples, or with depths only.
    pub fn with_views(
        camera: &Camera,
        draws: &'a [Draw<'a>],
        settings: &'a Settings<'a>,
        views: Vec<Range<u32>>,
    ) -> Self {
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
            number: 0,
            draws,
            settings,
            vertices,
            first_triangle,
            addresses: addresses(draws, settings, views.len()),
            origin: [Viewport::edge(0, viewport.width()), Viewport::edge(0, viewport.height())],
            lens: !projection.shear.is_none(),
            clip: camera.clip(),
            still_camera: camera.open() == camera.close(),
            eye: projection.eye(),
            heat: false,
            views,
            projection,
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

fn addresses(draws: &[Draw<'_>], settings: &Settings<'_>, images: usize) -> AddressMap {
    let mut memory = Allocator::default();
    let (viewport, tile_px) = (settings.viewport, settings.spec.tile_px);
    let tiles =
        u64::from(viewport.width().div_ceil(tile_px)) * u64::from(viewport.height().div_ceil(tile_px));
    let pixels = tiles * u64::from(tile_px * tile_px);
    let samples = pixels * u64::from(settings.samples.per_pixel());
    let mut known: Vec<(*const Texture, u64)> = Vec::new();
    let (depth, colour, image) =
        (memory.take(samples * 4), memory.take(samples * 4), memory.take(pixels * 4 * images as u64));
    let vertices = draws
        .iter()
        .map(|draw| memory.take(draw.geometry.open().len() as u64 * u64::from(draw.geometry.vertex_bytes())))
        .collect();
    let textures = draws
        .iter()
        .map(|draw| {
            let Some(texture) = draw.shader.texture() else { return 0 };
            let shared = known.iter().find(|(seen, _)| std::ptr::eq(*seen, texture));
            shared.map(|&(_, address)| address).unwrap_or_else(|| {
                let address = memory.take(texture.bytes());
                known.push((texture, address));
                address
            })
        })
        .collect();
    AddressMap { depth, colour, image, vertices, textures }
}

/// Triangles with a shader.
#[derive(Clone, Copy)]
pub struct Draw<'a> {
    /// Triangles.
    pub geometry: Geometry<'a>,
    /// Shader: its cost and its colours.
    pub shader: &'a dyn Shader,
    /// Culled faces.
    pub cull: Cull,
}
