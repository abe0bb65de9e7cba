//! Pass whose tiles are processed by code of the caller instead of the sample test: conservative mode, queries and
//! full-screen shading. The caller says what its code counted; packets, addresses and caches are made here.

use activity::{Event, Packet, PacketKind};

use super::Gpu;
use crate::geometry::Viewport;
use crate::memory::{LINE_BYTES, Surface};

/// Triangles of a packet of vertices.
const BATCH: usize = 16;
/// Bytes of a pixel of an image.
const PIXEL_BYTES: u64 = 4;

/// Triangles in memory, three vertices each.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TriangleStream {
    /// The vertices.
    pub vertices: Surface,
    /// Bytes of a vertex, at both ends of the shutter if it moves.
    pub vertex_bytes: u32,
    /// Operations of a vertex, for all ends.
    pub vertex_ops: u32,
    /// Multiply-adds of the set-up of a triangle.
    pub setup_madds: u32,
}

/// Work of one triangle, or of a whole buffer, in one tile.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct TileWork {
    /// Tile, row by row from the top left.
    pub tile: u32,
    /// Triangle, numbered within the pass; `None` for work on a buffer.
    pub triangle: Option<u32>,
    /// Tiles tested.
    pub tiles: u32,
    /// Multiply-adds of their tests.
    pub tile_madds: u32,
    /// Depth bounds of tiles compared.
    pub depth_bounds: u32,
    /// Samples or pixel centres tested.
    pub samples: u32,
    /// Multiply-adds of their tests.
    pub sample_madds: u32,
    /// Samples, pixel centres or tiles found inside.
    pub hits: u32,
    /// Stored words of depth read.
    pub depths_read: u32,
    /// Stored words of depth written.
    pub depths_written: u32,
    /// Lanes of the shader.
    pub lanes: u32,
    /// Operations of all lanes.
    pub shader_ops: u32,
    /// Bilinear fetches.
    pub texture_fetches: u32,
    /// Colours written.
    pub colours: u32,
    /// Pixels of an image written.
    pub pixels: u32,
}

/// Unit that accesses memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Client {
    /// Depth unit.
    Depth,
    /// Colour unit.
    Colour,
    /// Texture unit, which only reads.
    Texture,
}

/// An access to a range of a surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Touch {
    /// The unit.
    pub client: Client,
    /// Address of the first byte.
    pub address: u64,
    /// Number of bytes.
    pub bytes: u64,
    /// Whether the access writes.
    pub write: bool,
    /// Whether the range is cleared and unwritten, so that nothing is fetched.
    pub fresh: bool,
}

impl Touch {
    fn lines(&self) -> impl Iterator<Item = u64> + use<> {
        let last = self.address + self.bytes.max(1) - 1;
        (self.address / LINE_BYTES..=last / LINE_BYTES).map(|line| line * LINE_BYTES)
    }
}

impl Gpu<'_> {
    /// Begins a pass whose tiles the caller processes, with the methods below. The tiles are those of an image of the size
    /// of `viewport`, if any.
    pub fn begin(&mut self, name: &str, viewport: Option<Viewport>) {
        self.open(name, viewport);
    }

    /// Draws `triangles` triangles of a stream.
    pub fn draw_stream(&mut self, triangles: usize, stream: &TriangleStream) {
        let mut start = self.packet(PacketKind::Draw, Packet::NONE, None);
        start.counts[Event::Draws] = 1;
        self.push(&start, 0);
        let bytes = u64::from(stream.vertex_bytes);
        for first in (0..triangles).step_by(BATCH) {
            let vertices = 3 * BATCH.min(triangles - first) as u32;
            let mut packet = self.packet(PacketKind::Vertices, Packet::NONE, None);
            let counts = &mut packet.counts;
            counts[Event::Indices] = vertices;
            counts[Event::VerticesFetched] = vertices;
            counts[Event::VertexBytes] = vertices * stream.vertex_bytes;
            counts[Event::VertexInvocations] = vertices;
            counts[Event::ShaderOps] = vertices * stream.vertex_ops;
            counts[Event::TrianglesIn] = vertices / 3;
            counts[Event::TrianglesSetUp] = vertices / 3;
            counts[Event::SetupMadds] = vertices / 3 * stream.setup_madds;
            let from = stream.vertices.address() + 3 * first as u64 * bytes;
            self.memory().vertices(from, u64::from(vertices) * bytes, counts);
            self.push(&packet, vertices as usize / 3);
        }
    }

    /// Adds work in a tile, with its accesses to memory in order.
    pub fn tile(&mut self, work: &TileWork, touches: impl IntoIterator<Item = Touch>) {
        let mut packet = self.packet(PacketKind::Tile, work.tile, work.triangle);
        let counts = &mut packet.counts;
        for (event, count) in work.events() {
            counts[event] = count;
        }
        let memory = self.memory();
        for touch in touches {
            touch.lines().for_each(|line| match touch.client {
                Client::Depth => memory.depth(line, touch.write, touch.fresh, counts),
                Client::Colour => memory.colour(line, touch.write, touch.fresh, counts),
                Client::Texture => memory.texture(line, counts),
            });
        }
        self.push(&packet, 0);
    }

    /// Writes the pixels of `image`, in tiles of `tile_pixels`.
    pub fn write_image(&mut self, image: Surface, tile_pixels: u32) {
        let (pixels, tile_pixels) = (image.bytes() / PIXEL_BYTES, u64::from(tile_pixels.max(1)));
        for (tile, first) in (0..).zip((0..pixels).step_by(tile_pixels as usize)) {
            let count = tile_pixels.min(pixels - first);
            let mut packet = self.packet(PacketKind::Resolve, tile, None);
            packet.counts[Event::PixelsResolved] = count as u32;
            let (address, bytes) = (image.address() + first * PIXEL_BYTES, count * PIXEL_BYTES);
            let written = Touch { client: Client::Colour, address, bytes, write: true, fresh: true };
            let counts = &mut packet.counts;
            written.lines().for_each(|line| self.memory().colour(line, true, true, counts));
            self.push(&packet, 0);
        }
        self.keep(image);
    }

    fn packet(&self, kind: PacketKind, tile: u32, triangle: Option<u32>) -> Packet {
        let of = triangle.unwrap_or((self.triangles_of_pass() as u32).saturating_sub(1));
        Packet {
            batch: of / self.spec().batch_triangles,
            draw: 0,
            tile,
            triangle: triangle.unwrap_or(Packet::NONE),
            ..Packet::new(kind, self.last_pass())
        }
    }
}

impl TileWork {
    fn events(&self) -> [(Event, u32); 14] {
        [
            (Event::TilesVisited, self.tiles),
            (Event::EdgeBoundMadds, self.tile_madds),
            (Event::TileMadds, self.tile_madds),
            (Event::ZCullTests, self.depth_bounds),
            (Event::SamplesTested, self.samples),
            (Event::SampleMadds, self.sample_madds),
            (Event::SamplesHit, self.hits),
            (Event::DepthReads, self.depths_read),
            (Event::DepthWrites, self.depths_written),
            (Event::PixelInvocations, self.lanes),
            (Event::ShaderOps, self.shader_ops),
            (Event::TextureFetches, self.texture_fetches),
            (Event::ColourWrites, self.colours),
            (Event::PixelsResolved, self.pixels),
        ]
    }
}
