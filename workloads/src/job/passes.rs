//! Passes whose packets are made one by one, with their memory accesses.

use activity::{Event, Packet, PacketCounts, PacketKind};
use pipeline::Gpu;
use pipeline::memory::{LINE_BYTES, Surface};

/// Triangles per vertex packet.
const BATCH: usize = 16;
/// Bytes per pixel of an image.
pub(crate) const PIXEL_BYTES: u64 = 4;

/// Front-end work per vertex and triangle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FrontEnd {
    /// Bytes of a vertex, at both ends of the shutter if it moves.
    pub vertex_bytes: u32,
    /// Operations of the vertex shader, for all ends.
    pub vertex_ops: u32,
    /// Multiply-adds of triangle set-up.
    pub setup_madds: u32,
}

/// Work of one triangle, or of a whole buffer, in one tile.
#[derive(Clone, Copy, Debug)]
pub struct TileWork {
    /// Tile, row by row from the top left.
    pub tile: u32,
    /// Triangle, numbered within the pass.
    pub triangle: u32,
    /// Event counts, without memory events.
    pub counts: PacketCounts,
}

/// An access to a range of a buffer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Touch {
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

/// Passes whose packets are made one by one.
pub struct Passes<'a, 'e> {
    gpu: &'a mut Gpu<'e>,
    pass: u32,
    /// Triangles of the current pass so far.
    triangles: u32,
}

impl<'a, 'e> Passes<'a, 'e> {
    /// No pass so far.
    pub fn new(gpu: &'a mut Gpu<'e>) -> Self {
        Self { gpu, pass: 0, triangles: 0 }
    }

    /// Begins a pass; later packets belong to it.
    pub fn begin(&mut self, name: &str) {
        (self.pass, self.triangles) = (self.gpu.begin(name), 0);
    }

    /// A new surface of `bytes`.
    pub fn surface(&mut self, bytes: u64) -> Surface {
        self.gpu.surface(bytes)
    }

    /// Emits a draw of `triangles` triangles with three vertices each, which are in memory from `address` on.
    pub fn draw(&mut self, triangles: usize, address: u64, front_end: &FrontEnd) {
        let mut start = self.packet(PacketKind::Draw, Packet::NONE, self.triangles);
        start.counts[Event::Draws] = 1;
        self.gpu.push(&start, 0);
        let bytes = u64::from(front_end.vertex_bytes);
        for first in (0..triangles).step_by(BATCH) {
            let vertices = 3 * BATCH.min(triangles - first) as u32;
            let mut packet = self.packet(PacketKind::Vertices, Packet::NONE, self.triangles);
            let counts = &mut packet.counts;
            counts[Event::Indices] = vertices;
            counts[Event::VerticesFetched] = vertices;
            counts[Event::VertexBytes] = vertices * front_end.vertex_bytes;
            counts[Event::VertexInvocations] = vertices;
            counts[Event::ShaderOps] = vertices * front_end.vertex_ops;
            counts[Event::TrianglesIn] = vertices / 3;
            counts[Event::TrianglesSetUp] = vertices / 3;
            counts[Event::SetupMadds] = vertices / 3 * front_end.setup_madds;
            let from = address + 3 * first as u64 * bytes;
            self.gpu.memory().vertices(from, u64::from(vertices) * bytes, counts);
            self.gpu.push(&packet, vertices as usize / 3);
            self.triangles += vertices / 3;
        }
    }

    /// Emits work in a tile, with accesses to depth buffers and colour buffers.
    pub fn tile(&mut self, work: &TileWork, depth: &[Touch], colour: &[Touch]) {
        let mut packet = self.packet(PacketKind::Tile, work.tile, work.triangle);
        packet.counts = work.counts;
        for touch in depth {
            let counts = &mut packet.counts;
            touch.lines().for_each(|line| self.gpu.memory().depth(line, touch.write, touch.fresh, counts));
        }
        for touch in colour {
            let counts = &mut packet.counts;
            touch.lines().for_each(|line| self.gpu.memory().colour(line, touch.write, touch.fresh, counts));
        }
        self.gpu.push(&packet, 0);
    }

    /// Emits the writes of the pixels of `image`, one packet per tile of `tile_pixels`.
    pub fn resolve(&mut self, image: Surface, tile_pixels: u32) {
        let (pixels, tile_pixels) = (image.bytes() / PIXEL_BYTES, u64::from(tile_pixels.max(1)));
        for (tile, first) in (0..).zip((0..pixels).step_by(tile_pixels as usize)) {
            let count = tile_pixels.min(pixels - first);
            let mut packet = self.packet(PacketKind::Resolve, tile, Packet::NONE);
            packet.counts[Event::PixelsResolved] = count as u32;
            let (address, bytes) = (image.address() + first * PIXEL_BYTES, count * PIXEL_BYTES);
            let counts = &mut packet.counts;
            let written = Touch { address, bytes, write: true, fresh: true };
            written.lines().for_each(|line| self.gpu.memory().colour(line, true, true, counts));
            self.gpu.push(&packet, 0);
        }
        self.gpu.keep(image);
    }

    fn packet(&self, kind: PacketKind, tile: u32, triangle: u32) -> Packet {
        let of = if triangle == Packet::NONE { self.triangles.saturating_sub(1) } else { triangle };
        Packet {
            batch: of / self.gpu.spec().batch_triangles,
            draw: 0,
            tile,
            triangle,
            ..Packet::new(kind, self.pass)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::job::testing::hardware;
    use activity::Counts;
    use activity::LineAccess;

    #[test]
    fn counts_are_the_sum_of_packets_and_lines_are_emitted_once() {
        let (mut sum, mut lines, mut kinds) = (Counts::default(), 0, Vec::new());
        let hardware = hardware();
        let mut gpu = Gpu::new(&hardware, |packet: &Packet, accesses: &[LineAccess]| {
            sum += &packet.counts;
            lines += accesses.len();
            kinds.push((packet.kind, packet.pass));
        })
        .unwrap();
        let mut passes = Passes::new(&mut gpu);
        passes.begin("first");
        let vertices = passes.surface(20 * 3 * 24);
        passes.draw(20, vertices.address(), &FrontEnd { vertex_bytes: 24, vertex_ops: 8, setup_madds: 60 });
        passes.begin("second");
        let mut counts = PacketCounts::default();
        counts[Event::TilesVisited] = 1;
        let [depths, image] = [130, 400].map(|bytes| passes.surface(bytes));
        let touch = Touch { address: depths.address(), bytes: 130, write: true, fresh: true };
        passes.tile(&TileWork { tile: 3, triangle: 0, counts }, &[touch], &[]);
        passes.resolve(image, 64);
        let report = gpu.finish();
        let total = report.counts();
        assert_eq!((total, report.triangles()), (sum, 20));
        assert_eq!(total[Event::VertexBytes], 20 * 3 * 24);
        assert_eq!((total[Event::DepthLines], total[Event::PixelsResolved]), (3, 100));
        assert_eq!(total[Event::DramWriteBytes], 7 * 64, "100 pixels are 6.25 lines");
        assert!(lines > 0);
        use PacketKind::{Draw, Resolve, Tile, Vertices};
        let expected =
            [(Draw, 0), (Vertices, 0), (Vertices, 0), (Tile, 1), (Resolve, 1), (Resolve, 1), (Resolve, 1)];
        assert_eq!(kinds, expected);
    }
}
