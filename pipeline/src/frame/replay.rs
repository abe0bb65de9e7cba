//! Replay: the logs of the workers in the order of the modelled hardware, through its caches.

use activity::{Event, LineAccess, Packet, PacketCounts, PacketKind};

use super::Shading;
use super::bin::{Bin, BinLog, BinMemory, Work};
use super::pass::{INDEX_BYTES, Pass, Plane, Query, SAMPLE_BYTES, VertexBuffer};
use super::resolve::{SampleLine, TileResolve, tile_lines};
use super::shaded::{QuadWork, ShadedTriangle};
use super::warps::Warps;
use crate::memory::{AccessOutcome, Cache, CacheError, LINE_BYTES, MemorySystem};
use crate::random::mix;
use crate::sampling::Sample;
use crate::setup::{PixelRect, Triangle};
use crate::shading::{QUAD_LANES, QuadAccess};

/// State of a pass, and the caches of the frame.
pub(super) struct Replay<'a> {
    pass: &'a Pass<'a>,
    memory: &'a mut MemorySystem,
    shading: Cache,
    reuse: Reuse,
    /// Last line of indices that was read.
    last_indices: u64,
    bins: Option<BinMemory>,
    /// Depth lines that no longer hold the clear value.
    depth_used: Vec<bool>,
    /// The same of colours, by target.
    colour_used: Vec<Vec<bool>>,
    /// Pixels of each tile whose depths and whose colours compress to half; empty without compression.
    small: Vec<[u64; 2]>,
    /// Samples of queries that passed so far, by draw.
    pub passed: Vec<u64>,
}

/// Recently shaded vertices, first in first out.
struct Reuse {
    recent: Vec<(usize, u32)>,
    next: usize,
}

impl Reuse {
    fn contains_or_insert(&mut self, vertex: (usize, u32)) -> bool {
        if self.recent.contains(&vertex) {
            return true;
        }
        self.recent[self.next] = vertex;
        self.next = (self.next + 1) % self.recent.len();
        false
    }
}

impl<'a> Replay<'a> {
    pub fn new(pass: &'a Pass<'a>, memory: &'a mut MemorySystem) -> Result<Self, CacheError> {
        let spec = pass.settings.spec;
        let used = |plane: &Plane| vec![plane.is_loaded(); plane.lines()];
        let mut small = Vec::new();
        if spec.memory.compression.is_on() {
            memory.compress(compressed(pass));
        }
        if spec.memory.compression.is_on() && !pass.is_attached {
            let tile_bytes =
                u64::from(spec.tile_px.pow(2) * pass.settings.samples.per_pixel()) * SAMPLE_BYTES;
            small = vec![[0; 2]; pass.depth.place.bytes().div_ceil(tile_bytes) as usize];
        }
        Ok(Self {
            pass,
            memory,
            small,
            passed: vec![0; pass.draws.len()],
            shading: Cache::new(spec.shading_cache)?,
            reuse: Reuse { recent: vec![(usize::MAX, 0); spec.vertex_reuse as usize], next: 0 },
            last_indices: u64::MAX,
            bins: BinMemory::new(pass),
            depth_used: used(&pass.depth),
            colour_used: pass.colours.iter().map(used).collect(),
        })
    }

    /// Begin a batch of triangles, whose vertices come next.
    pub fn begin_batch(&mut self) {
        self.bins.iter_mut().for_each(BinMemory::begin);
    }

    /// End the first batch that has not ended: all its triangles are drawn.
    pub fn end_batch(&mut self) {
        self.bins.iter_mut().for_each(|bins| bins.end(self.memory));
    }

    /// Write a triangle to its bins, which are those of `pixels`.
    pub fn set_up(&mut self, triangle: &Triangle, pixels: &PixelRect, counts: &mut PacketCounts) {
        let (pass, memory) = (self.pass, &mut *self.memory);
        self.bins.iter_mut().for_each(|bins| bins.write(pass, (triangle, pixels), memory, counts));
    }

    /// Fetch the indices of a triangle, and fetch and shade its vertices that were not shaded recently.
    pub fn vertices(&mut self, draw: usize, triangle: u32, counts: &mut PacketCounts) {
        let geometry = &self.pass.draws[draw].geometry;
        let ops = self.pass.projection.vertex_ops() + self.pass.programs[draw].vertex_ops;
        let VertexBuffer { vertices, stride: bytes, indices } = self.pass.addresses.vertices[draw];
        self.indices(indices.address() + self.pass.locate(triangle).1 as u64 * INDEX_BYTES, counts);
        let ends = if geometry.is_still() && self.pass.still_camera { 1 } else { 2 };
        for vertex in self.pass.corners(triangle).1 {
            if self.reuse.contains_or_insert((draw, vertex as u32)) {
                continue;
            }
            counts[Event::VerticesFetched] += 1;
            counts[Event::VertexBytes] += bytes;
            counts[Event::VertexInvocations] += 1;
            counts[Event::ShaderOps] += ends * ops;
            let at = vertices.address() + vertex as u64 * u64::from(bytes);
            self.memory.vertices(at, u64::from(bytes), counts);
        }
    }

    /// Fetch the indices of a triangle at `address`, unless they are in the line before.
    fn indices(&mut self, address: u64, counts: &mut PacketCounts) {
        for line in address / LINE_BYTES..=(address + INDEX_BYTES - 1) / LINE_BYTES {
            if std::mem::replace(&mut self.last_indices, line) != line {
                self.memory.vertices(line * LINE_BYTES, LINE_BYTES, counts);
            }
        }
    }

    /// Emit a packet with the lines requested from the L2 since the previous packet.
    pub fn emit(&mut self, packet: &Packet, emit: &mut impl FnMut(&Packet, &[LineAccess])) {
        emit(packet, self.memory.log());
        self.memory.clear_log();
    }

    /// Emit the packets of one bin in one batch. Work of a query whose answer an earlier packet gave is not done.
    pub fn bin(
        &mut self,
        batch: u32,
        (number, list): (usize, &[u32]),
        log: &BinLog,
        emit: &mut impl FnMut(&Packet, &[LineAccess]),
    ) {
        let (mut first_quad, mut first_listed) = (0, 0);
        for work in &log.work {
            let listed_end = work.listed_end.max(first_listed);
            let from = std::mem::replace(&mut first_listed, listed_end);
            let quads = &log.quads[first_quad..work.quads_end as usize];
            first_quad = work.quads_end as usize;
            // Bounds of loaded depths are for later draws, too.
            if self.is_answered(work.draw as usize) && work.bounded == 0 {
                continue;
            }
            self.passed[work.draw as usize] += u64::from(work.passed);
            let mut packet = self.tile(batch, work, quads);
            let listed = &list[from as usize..listed_end as usize];
            if let Some(bins) = &self.bins {
                bins.read((number, from), listed, self.memory, &mut packet.counts);
            }
            self.emit(&packet, emit);
        }
    }

    fn is_answered(&self, draw: usize) -> bool {
        self.pass.draws[draw].query == Some(Query::Any) && self.passed[draw] > 0
    }

    fn tile(&mut self, batch: u32, work: &Work, quads: &[QuadAccess]) -> Packet {
        let mut packet = Packet {
            batch,
            draw: work.draw,
            tile: work.tile,
            triangle: work.triangle,
            ..Packet::new(PacketKind::Tile, self.pass.number)
        };
        let counts = &mut packet.counts;
        work.tests.add_to(counts);
        counts[Event::SampleReads] = work.screened.max(work.tested);
        counts[Event::SamplesScreened] = work.screened;
        counts[Event::ScreenMadds] = work.screen_madds;
        counts[Event::SamplesTested] = work.tested;
        counts[Event::SamplesHit] = work.hit;
        counts[Event::SampleMadds] = work.sample_madds;
        counts[Event::DepthReads] = work.hit - work.unread + work.bounded;
        counts[Event::DepthReadsSkipped] = work.unread;
        counts[Event::DepthWrites] = work.written;
        self.colours(work, counts);
        self.compress(work);
        let base = self.pass.depth.place.address();
        let used = work.read_pixels | work.written_pixels;
        self.lines(work.tile, used, SAMPLE_BYTES, |this, line, pixels| {
            let write = pixels & work.written_pixels != 0;
            let fresh = !this.depth_used[line as usize];
            this.depth_used[line as usize] |= write;
            this.memory.depth(base + line * LINE_BYTES, write, fresh, counts);
        });
        if !quads.is_empty() {
            match self.pass.shading {
                Shading::Cached => self.shade(work.triangle, quads, counts),
                Shading::PerSample => self.shade_samples(work.triangle, quads, counts),
            }
        }
        for (target, plane) in self.pass.written_by(work.draw) {
            let base = plane.place.address();
            self.lines(work.tile, work.coloured_pixels, plane.sample_bytes, |this, line, _| {
                let fresh = !std::mem::replace(&mut this.colour_used[target][line as usize], true);
                this.memory.colour(base + line * LINE_BYTES, true, fresh, counts);
            });
        }
        packet
    }

    /// Counts the words of colour that the samples of a packet write, in all targets.
    fn colours(&self, work: &Work, counts: &mut PacketCounts) {
        for (target, plane) in self.pass.written_by(work.draw) {
            let words = work.coloured * (plane.sample_bytes / SAMPLE_BYTES) as u32;
            counts[Event::ColourWrites] += words;
            if self.pass.draws[work.draw as usize].state.target(target).reads() {
                counts[Event::SamplesBlended] += words;
            }
        }
    }

    /// Record which lines of the tile compress to half after a packet. If a line spans several tiles, the one
    /// written last decides.
    fn compress(&mut self, work: &Work) {
        let Some(small) = self.small.get_mut(work.tile as usize) else { return };
        let now: [u64; 2] =
            std::array::from_fn(|of| small[of] & !work.written_pixels | work.small_pixels[of]);
        *small = now;
        let [depth, colour, _] = compressed(self.pass);
        let bases = [depth, colour];
        self.lines(work.tile, work.written_pixels, SAMPLE_BYTES, |this, line, _| {
            let pixels = this.pixels_of(work.tile, line);
            for (base, small) in bases.into_iter().zip(now) {
                this.memory.set_compressed(base + line * LINE_BYTES, small & pixels == pixels);
            }
        });
    }

    /// Pixels of a tile that have samples in `line`.
    fn pixels_of(&self, tile: u32, line: u64) -> u64 {
        let spec = self.pass.settings.spec;
        let pixel_bytes = u64::from(self.pass.settings.samples.per_pixel()) * SAMPLE_BYTES;
        let all = u64::from(spec.tile_px * spec.tile_px);
        let first_byte = u64::from(tile) * all * pixel_bytes;
        let at = |byte: u64| byte.saturating_sub(first_byte) / pixel_bytes;
        let (first, last) = (at(line * LINE_BYTES), at((line + 1) * LINE_BYTES - 1).min(all - 1));
        (first..=last).fold(0, |pixels, pixel| pixels | 1 << pixel)
    }

    /// Look up the quads of a packet in the shading cache, and shade those that miss.
    fn shade(&mut self, triangle: u32, quads: &[QuadAccess], counts: &mut PacketCounts) {
        let surface = ShadedTriangle::new(self.pass, triangle);
        let mut warps = Warps::new(self.pass.settings.spec.warp_lanes);
        for access in quads {
            counts[Event::ShadingLookups] += u32::from(access.lookups);
            let hit = self.shading.access(quad_key(triangle, access.quad), false) == AccessOutcome::Hit;
            counts[Event::ShadingHits] += u32::from(access.lookups) - u32::from(!hit);
            if hit {
                continue;
            }
            let memory = &mut self.memory;
            let work = surface.quad(access.quad, |line| memory.texture(line, counts));
            count_quad(access, work, &mut warps, counts);
        }
        counts[Event::ShaderOps] += warps.ops();
    }

    /// Shade the quads of a packet at every sample, without a shading cache.
    fn shade_samples(&mut self, triangle: u32, quads: &[QuadAccess], counts: &mut PacketCounts) {
        let surface = ShadedTriangle::new(self.pass, triangle);
        let source = self.pass.settings.samples;
        let mut warps = Warps::new(self.pass.settings.spec.warp_lanes);
        let mut samples: [Vec<Sample>; 4] =
            std::array::from_fn(|_| vec![Sample::default(); source.per_pixel() as usize]);
        for pixels in quads.chunk_by(|a, b| a.quad == b.quad) {
            if surface.needs_samples() {
                for (lane, of_pixel) in (0..).zip(&mut samples) {
                    let [x, y] = pixels[0].quad.map(|part| 2 * part as u32);
                    source.pixel_into(x + lane % 2, y + lane / 2, of_pixel);
                }
            }
            for access in pixels {
                let memory = &mut self.memory;
                let line = |line| memory.texture(line, counts);
                let work = surface.quad_at(access, &samples, line);
                count_quad(access, work, &mut warps, counts);
            }
        }
        counts[Event::ShaderOps] += warps.ops();
    }

    /// Call `each` for every line of a tile's samples, of `sample_bytes` each, that holds one of `pixels`,
    /// with the mask of these pixels.
    fn lines(
        &mut self,
        tile: u32,
        pixels: u64,
        sample_bytes: u64,
        mut each: impl FnMut(&mut Self, u64, u64),
    ) {
        let spec = self.pass.settings.spec;
        let pixel_bytes = u64::from(self.pass.settings.samples.per_pixel()) * sample_bytes;
        let first_byte = u64::from(tile) * u64::from(spec.tile_px * spec.tile_px) * pixel_bytes;
        tile_lines([first_byte, pixel_bytes], pixels, |line, held| each(self, line, held));
    }

    /// Emit the packets that end the tiles of a bin: their samples are resolved, or stored: in surfaces, or as the
    /// depths of a depth pass.
    pub fn resolve(&mut self, batch: u32, bin: &Bin, emit: &mut impl FnMut(&Packet, &[LineAccess])) {
        for (tile, _, pixels, touched) in bin.inside(self.pass) {
            let packet = if self.pass.is_attached || self.pass.is_depth_only() {
                self.store_tile(tile, pixels)
            } else {
                Some(self.resolve_tile(tile, pixels, touched))
            };
            if let Some(packet) = packet {
                self.emit(&Packet { batch, ..packet }, emit);
            }
        }
    }

    /// Stores the clear value where nothing was drawn, and drops what is not stored. `None` if there is
    /// nothing to do.
    fn store_tile(&mut self, tile: u32, pixels: u64) -> Option<Packet> {
        let mut packet = Packet { tile, ..Packet::new(PacketKind::Resolve, self.pass.number) };
        let (pass, before) = (self.pass, packet.counts);
        for (target, plane) in pass.colours.iter().enumerate() {
            self.lines(tile, pixels, plane.sample_bytes, |this, line, _| {
                let address = plane.place.address() + line * LINE_BYTES;
                let is_used = std::mem::replace(&mut this.colour_used[target][line as usize], true);
                if !plane.is_stored {
                    this.memory.discard(address);
                } else if !is_used {
                    this.memory.colour(address, true, true, &mut packet.counts);
                }
            });
        }
        if pass.depth.format.is_some() || !pass.is_attached {
            let plane = &pass.depth;
            self.lines(tile, pixels, plane.sample_bytes, |this, line, _| {
                let address = plane.place.address() + line * LINE_BYTES;
                let is_used = std::mem::replace(&mut this.depth_used[line as usize], true);
                if !plane.is_stored {
                    this.memory.discard(address);
                } else if !is_used {
                    this.memory.depth(address, true, true, &mut packet.counts);
                }
            });
        }
        (packet.counts != before).then_some(packet)
    }

    fn resolve_tile(&mut self, tile: u32, pixels: u64, touched: bool) -> Packet {
        let mut packet = Packet { tile, ..Packet::new(PacketKind::Resolve, self.pass.number) };
        let count = pixels.count_ones();
        let mut work = TileResolve { pixels: count * self.pass.views.len() as u32, ..TileResolve::default() };
        if touched {
            let samples: u32 = self.pass.views.iter().map(ExactSizeIterator::len).sum::<usize>() as u32;
            work.samples = count * samples;
            let [depth, colour, _] = compressed(self.pass);
            self.lines(tile, pixels, SAMPLE_BYTES, |this, line, _| {
                let [colour, depth] = [colour, depth].map(|base| base + line * LINE_BYTES);
                let is_fresh = !this.colour_used[0][line as usize];
                work.reads.push(SampleLine {
                    address: colour,
                    is_fresh,
                    dropped: [Some(colour), Some(depth)],
                });
            });
        }
        let side = u64::from(self.pass.settings.spec.tile_px);
        let bytes = side * side * SAMPLE_BYTES;
        for view in 0..self.pass.views.len() as u64 {
            let first =
                self.pass.addresses.image.address() + (view * self.pass.tiles() + u64::from(tile)) * bytes;
            work.writes.extend(first / LINE_BYTES..=(first + bytes - 1) / LINE_BYTES);
        }
        work.count(self.memory, &mut packet.counts);
        packet
    }
}

/// Addresses of depths and colours that may be compressed, and the end of the colours. Surfaces are not.
fn compressed(pass: &Pass<'_>) -> [u64; 3] {
    let colours = pass.colours.first().map_or(pass.depth.place, |plane| plane.place);
    let all = [pass.depth.place.address(), colours.address(), pass.addresses.image.address()];
    if pass.is_attached { [0; 3] } else { all }
}

/// Count a quad of four lanes, all but their operations; lanes that were not requested are helpers.
fn count_quad(access: &QuadAccess, work: QuadWork, warps: &mut Warps, counts: &mut PacketCounts) {
    counts[Event::QuadsShaded] += 1;
    counts[Event::PixelInvocations] += 4;
    counts[Event::HelperInvocations] += 4 - access.lanes.count_ones();
    counts[Event::CentroidInvocations] += work.centroids;
    warps.start(QUAD_LANES.len() as u32, work.ops);
    counts[Event::TextureFetches] += work.fetches;
}

/// Key of a quad in the shading cache, hashed so that sets are used evenly in all directions.
fn quad_key(triangle: u32, quad: [i32; 2]) -> u64 {
    let [x, y] = quad.map(|part| u64::from(part as u32));
    mix(mix(u64::from(triangle)) ^ (x << 32 | y))
}
