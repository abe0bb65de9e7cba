//! Conservative mode as a mode of the pipeline: triangles stream through vertices, set-up and the tile loop,
//! and every tile that a triangle may touch runs a [`TileShader`]. No sample is tested. Tile tests have the
//! costs of standard mode; the lanes of the shader count what they do.

use std::collections::HashSet;
use std::ops::Range;
use std::sync::Mutex;

use activity::{Event, Packet, PacketCounts, PacketKind};
use rayon::prelude::*;

use super::Gpu;
use super::attachments::PassError;
use super::heat::{Block, Placement};
use super::lanes::{LaneWork, Lanes, lines};
use super::uses::Uses;
use crate::conservative::{Grid, MovingTriangle, Rasterizer, TileLoop, Touch};
use crate::depth::{Numbers, Real};
use crate::geometry::{Projection, Viewport};
use crate::memory::MemoryRange;
use crate::setup::difference_madds;
use crate::tally::{Costs, Kernel};

/// Triangles of a packet of vertices.
const BATCH: usize = 32;
/// Triangles whose tiles are in memory at once.
const TRIANGLES_AT_ONCE: usize = 4096;
/// Lines of a packet that stores what was cleared.
const LINES_OF_PACKET: usize = 16;

/// A triangle in conservative mode.
#[derive(Clone, Debug)]
pub struct Primitive {
    /// Vertices on the image plane, in the units of the tiles' borders.
    pub triangle: MovingTriangle,
    /// View, clip planes in lens and time, and halvings of time.
    pub rasterizer: Rasterizer,
    /// Columns and rows of tiles that are tested (scissor).
    pub scissor: [Range<u32>; 2],
    /// Number of the body that the triangle belongs to, such as the bounding volume of which it is a face.
    /// Triangles of a body follow each other and share the state of the shader.
    pub body: u32,
    /// Whether it is the triangle before it in another clip region, so that its vertices are there.
    pub reuses_vertices: bool,
    /// Whether it is dropped in set-up unless it shows its back: its vertices then appear in the order of x, y.
    pub keeps_back_faces_only: bool,
}

impl Primitive {
    /// Whether set-up drops the triangle because of the face it shows, and its multiply-adds.
    fn is_culled(&self, costs: &Costs) -> (bool, u32) {
        if !self.keeps_back_faces_only {
            return (false, 0);
        }
        let corners = self.triangle.open();
        costs.run(Kernel::Facing, |path| shows_front(path, corners), |tally| _ = shows_front(tally, corners))
    }
}

fn shows_front<N: Numbers>(numbers: N, corners: &[[f64; 3]; 3]) -> bool {
    let [a, b, c] = corners.map(|p| p.map(|at| numbers.number(at)));
    let [along, across] = [b, c].map(|p| [p[0] - a[0], p[1] - a[1]]);
    let area = along[0] * across[1] - across[0] * along[1];
    area.value() <= 0.0
}

/// Triangles drawn in conservative mode.
#[derive(Clone, Copy, Debug)]
pub struct ConservativeDraw<'a> {
    /// The triangles, in order.
    pub primitives: &'a [Primitive],
    /// The tiles.
    pub grid: &'a Grid,
    /// Tiles along a side of a block whose tiles of one triangle make one packet: those of a tile of the image.
    pub block: u32,
    /// The vertices in memory, three of each triangle.
    pub vertices: MemoryRange,
    /// Bytes of a vertex, at both ends of the shutter if it moves.
    pub vertex_bytes: u32,
    /// What moved the vertices to the image plane, at both ends; `None` if they are there in memory.
    pub projection: Option<&'a Projection>,
}

/// A tile that a triangle may touch.
#[derive(Clone, Copy, Debug)]
pub struct TileIntervals<'a> {
    /// Index of the triangle in the draw.
    pub primitive: usize,
    /// Column and row.
    pub tile: [u32; 2],
    /// Intervals of lens position, time and depth.
    pub touch: &'a Touch,
}

/// Shader of conservative mode: runs for every triangle and tile that it may touch. Results have to depend on
/// the arguments alone, and on what was stored before the draw. Its lanes have no helpers: nothing is
/// interpolated, so no lane needs the differences to its neighbours.
pub trait TileShader: Sync {
    /// State that the triangles of a body share.
    type BodyState: Default;
    /// Result for a tile, which is stored in the order of triangles.
    type Output: Send;

    /// Runs on a tile; `None` discards it. What it does is counted as it does it.
    fn run(
        &self,
        state: &mut Self::BodyState,
        lanes: &Lanes,
        tile: &TileIntervals<'_>,
    ) -> Option<Self::Output>;
}

/// A pass in conservative mode. Its targets are cleared when it begins.
#[derive(Debug, Default)]
pub struct ConservativePass {
    /// Lines that hold more than the clear value.
    written: HashSet<u64>,
    workers: IdleLanes,
}

/// Lanes of the workers that are not running, with the costs they know.
#[derive(Debug, Default)]
struct IdleLanes(Mutex<Vec<Lanes>>);

/// Lanes of a worker that is running.
struct BorrowedLanes<'a> {
    lanes: Lanes,
    others: &'a IdleLanes,
}

impl IdleLanes {
    fn worker(&self) -> BorrowedLanes<'_> {
        let known = self.0.lock().ok().and_then(|mut lanes| lanes.pop());
        BorrowedLanes { lanes: known.unwrap_or_else(Lanes::remembering), others: self }
    }
}

impl Drop for BorrowedLanes<'_> {
    fn drop(&mut self) {
        if let Ok(mut lanes) = self.others.0.lock() {
            lanes.push(std::mem::take(&mut self.lanes));
        }
    }
}

/// What happened on the tiles of one body, in order.
struct BodyLog<T> {
    warp_lanes: u32,
    packets: Vec<PacketLog>,
    /// Results with the columns and rows of their tiles.
    outputs: Vec<([u32; 2], T)>,
    /// Work of the tile loop after the last tile of each triangle, with the triangle.
    rest: Vec<(usize, TileLoop)>,
}

/// Tiles of a triangle that follow each other in one block.
struct PacketLog {
    primitive: usize,
    block: u32,
    tests: TileLoop,
    lanes: LaneWork,
}

impl<T> BodyLog<T> {
    fn new(warp_lanes: u32) -> Self {
        Self { warp_lanes, packets: Vec::new(), outputs: Vec::new(), rest: Vec::new() }
    }

    /// Work of the tile loop in the packet of a tile of `block`. The packet before it ends with what `lanes` did.
    fn tests(&mut self, primitive: usize, block: u32, lanes: &Lanes) -> &mut TileLoop {
        if self.packets.last().is_none_or(|last| last.block != block || last.primitive != primitive) {
            self.end_packet(lanes);
            let packet =
                PacketLog { primitive, block, tests: TileLoop::default(), lanes: LaneWork::default() };
            self.packets.push(packet);
        }
        let last = self.packets.len() - 1;
        &mut self.packets[last].tests
    }

    fn end_packet(&mut self, lanes: &Lanes) {
        if let Some(last) = self.packets.last_mut() {
            last.lanes = lanes.finish(self.warp_lanes);
        }
    }
}

impl Gpu<'_> {
    /// Begins a pass in conservative mode, whose shaders access what `uses` states. Heat maps show its work on tiles
    /// where they are in the image of the frame, if they are there at all.
    ///
    /// # Errors
    /// [`PassError::Feedback`] if memory is read and written, [`PassError::Stopped`] and [`PassError::Memory`].
    pub fn begin_conservative(
        &mut self,
        name: &str,
        placement: Option<Placement>,
        uses: Uses,
    ) -> Result<ConservativePass, PassError> {
        self.check_uses(name, &uses)?;
        self.open_placed(name, placement);
        self.use_memory(uses);
        Ok(ConservativePass::default())
    }
}

impl ConservativePass {
    /// Draws triangles with `shader`, as one draw of the pass. `store` is given every result, with the column and
    /// row of its tile. Once the frame is stopped, there are no more.
    ///
    /// # Errors
    /// [`PassError::Unstated`] if a shader accesses memory that the pass does not state.
    pub fn draw<S: TileShader>(
        &mut self,
        gpu: &mut Gpu<'_>,
        draw: &ConservativeDraw<'_>,
        shader: &S,
        mut store: impl FnMut([u32; 2], S::Output),
    ) -> Result<(), PassError> {
        let (first, warp_lanes) = (gpu.triangles_of_pass() as u32, gpu.spec().warp_lanes);
        let numbers = numbered(draw.primitives, first);
        gpu.begin_draw(gpu.draws_of_pass().len() as u32);
        gpu.read_vertices(draw.vertices);
        vertices(gpu, draw, self.workers.worker().lanes.costs());
        for (chunk, from) in chunks(draw.primitives) {
            if gpu.is_stopped() {
                return Ok(());
            }
            let bodies: Vec<&[Primitive]> = chunk.chunk_by(|a, b| a.body == b.body).collect();
            let starts = bodies.iter().scan(from, |next, body| {
                let start = *next;
                *next += body.len();
                Some(start)
            });
            let starts: Vec<usize> = starts.collect();
            let log = |worker: &mut BorrowedLanes<'_>, (body, start): (&&[Primitive], &usize)| {
                log(body, *start, draw, shader, (&worker.lanes, warp_lanes))
            };
            let workers = || self.workers.worker();
            let logs: Vec<BodyLog<S::Output>> =
                bodies.par_iter().zip(&starts).map_init(workers, log).collect();
            for log in logs {
                self.body(gpu, (draw, &numbers), log, &mut store)?;
            }
        }
        Ok(())
    }

    /// Runs a program for each pixel of an image, as [`Gpu::shade_pixels`] does, on the targets of this pass.
    ///
    /// # Errors
    /// As [`Self::draw`].
    pub fn run_pixels<T: Clone + Default + Send>(
        &mut self,
        gpu: &mut Gpu<'_>,
        viewport: Viewport,
        pixel: impl Fn(&Lanes, [u32; 2]) -> T + Sync,
    ) -> Result<Vec<T>, PassError> {
        gpu.run_pixels(viewport, &mut self.written, pixel)
    }

    /// Stores a range of the targets, for later passes or for the host: lines that still hold the clear value are
    /// written.
    ///
    /// # Errors
    /// [`PassError::Unstated`] if it is no target of the pass.
    pub fn store(&mut self, gpu: &mut Gpu<'_>, range: MemoryRange) -> Result<(), PassError> {
        gpu.end_draws();
        let is_cleared = |line: &u64| !self.written.contains(line);
        let cleared: Vec<u64> = lines(range.address(), range.bytes()).filter(is_cleared).collect();
        for (number, lines) in (0..).zip(cleared.chunks(LINES_OF_PACKET)) {
            let mut packet = gpu.packet(PacketKind::Resolve, number, None);
            let work = LaneWork::writing(lines, gpu.uses.may_be_depth(lines[0]));
            gpu.access(&work, &mut packet.counts, &mut self.written)?;
            gpu.push(&packet, 0);
        }
        Ok(())
    }

    /// Emits the packets of a body, one for each triangle and block of tiles.
    fn body<T>(
        &mut self,
        gpu: &mut Gpu<'_>,
        (draw, numbers): (&ConservativeDraw<'_>, &[u32]),
        log: BodyLog<T>,
        store: &mut impl FnMut([u32; 2], T),
    ) -> Result<(), PassError> {
        let mut rest = log.rest.into_iter().peekable();
        for PacketLog { primitive, block, tests, lanes } in log.packets {
            while let Some((primitive, tests)) = rest.next_if(|(before, _)| *before < primitive) {
                emit_tests(gpu, numbers[primitive], &draw.scissor_of(primitive), &tests);
            }
            let mut packet = gpu.packet(PacketKind::Tile, block, Some(numbers[primitive]));
            add(&tests, &mut packet.counts);
            gpu.access(&lanes, &mut packet.counts, &mut self.written)?;
            gpu.push_block(&packet, &draw.tiles_of(block));
        }
        for (tile, output) in log.outputs {
            store(tile, output);
        }
        for (primitive, tests) in rest {
            emit_tests(gpu, numbers[primitive], &draw.scissor_of(primitive), &tests);
        }
        Ok(())
    }
}

impl ConservativeDraw<'_> {
    /// Blocks in a row.
    fn blocks_across(&self) -> u32 {
        self.grid.columns.div_ceil(self.block)
    }

    fn tiles_of(&self, block: u32) -> Block {
        let of = [self.grid.columns, self.grid.rows];
        let first = [block % self.blocks_across(), block / self.blocks_across()].map(|at| at * self.block);
        Block { first, end: [0, 1].map(|axis| (first[axis] + self.block).min(of[axis])), of }
    }

    /// Tiles that are tested for a triangle.
    fn scissor_of(&self, primitive: usize) -> Block {
        let [columns, rows] = &self.primitives[primitive].scissor;
        let of = [self.grid.columns, self.grid.rows];
        Block { first: [columns.start, rows.start], end: [columns.end, rows.end], of }
    }
}

/// Number of each primitive's triangle in the pass.
fn numbered(primitives: &[Primitive], first: u32) -> Vec<u32> {
    let next = primitives.iter().scan(first, |next, primitive| {
        *next += u32::from(!primitive.reuses_vertices);
        Some(next.saturating_sub(1).max(first))
    });
    next.collect()
}

/// Whole bodies of some thousand triangles, each with the index of its first.
fn chunks(primitives: &[Primitive]) -> impl Iterator<Item = (&[Primitive], usize)> {
    let mut from = 0;
    std::iter::from_fn(move || {
        let rest = primitives.get(from..).filter(|rest| !rest.is_empty())?;
        let mut end = rest.len().min(TRIANGLES_AT_ONCE);
        while end < rest.len() && rest[end].body == rest[end - 1].body {
            end += 1;
        }
        from += end;
        Some((&rest[..end], from - end))
    })
}

/// Runs the tile loop and the shader on the triangles of a body.
fn log<S: TileShader>(
    body: &[Primitive],
    start: usize,
    draw: &ConservativeDraw<'_>,
    shader: &S,
    (lanes, warp_lanes): (&Lanes, u32),
) -> BodyLog<S::Output> {
    let across = draw.blocks_across();
    let (mut log, mut state) = (BodyLog::new(warp_lanes), S::BodyState::default());
    for (item, primitive) in body.iter().zip(start..).filter(|(item, _)| !item.is_culled(lanes.costs()).0) {
        let after = item.rasterizer.rasterize_counted(
            &item.triangle,
            draw.grid,
            item.scissor.clone(),
            lanes.costs(),
            |tile, touch, work: &mut TileLoop| {
                let block = tile[1] / draw.block * across + tile[0] / draw.block;
                *log.tests(primitive, block, lanes) += std::mem::take(work);
                let output = shader.run(&mut state, lanes, &TileIntervals { primitive, tile, touch });
                log.outputs.extend(output.map(|output| (tile, output)));
            },
        );
        if after != TileLoop::default() {
            log.rest.push((primitive, after));
        }
    }
    log.end_packet(lanes);
    log
}

/// Emits the packets of the vertices and of set-up.
fn vertices(gpu: &mut Gpu<'_>, draw: &ConservativeDraw<'_>, costs: &Costs) {
    let mut start = gpu.packet(PacketKind::Draw, Packet::NONE, None);
    start.counts[Event::Draws] = 1;
    gpu.push(&start, 0);
    let vertex_ops = draw.projection.map_or(0, Projection::vertex_ops);
    let new: Vec<&Primitive> =
        draw.primitives.iter().filter(|primitive| !primitive.reuses_vertices).collect();
    let bytes = u64::from(draw.vertex_bytes);
    for (number, batch) in (0_u64..).zip(new.chunks(BATCH)) {
        let (vertices, triangles) = (3 * batch.len() as u32, batch.len() as u32);
        let mut packet = gpu.packet(PacketKind::Vertices, Packet::NONE, None);
        let counts = &mut packet.counts;
        counts[Event::Indices] = vertices;
        counts[Event::VerticesFetched] = vertices;
        counts[Event::VertexBytes] = vertices * draw.vertex_bytes;
        counts[Event::VertexInvocations] = vertices;
        counts[Event::TrianglesIn] = triangles;
        for primitive in batch {
            let ends = if primitive.triangle.is_moving() { 2 } else { 1 };
            counts[Event::ShaderOps] += 3 * ends * vertex_ops;
            let (is_culled, madds) = primitive.is_culled(costs);
            let outcome = if is_culled { Event::TrianglesFaceCulled } else { Event::TrianglesSetUp };
            counts[outcome] += 1;
            counts[Event::SetupMadds] += madds;
            if !is_culled {
                counts[Event::SetupMadds] += difference_madds(primitive.triangle.is_moving());
            }
        }
        let from = draw.vertices.address() + 3 * BATCH as u64 * number * bytes;
        gpu.memory().vertices(from, u64::from(vertices) * bytes, counts);
        gpu.push(&packet, triangles as usize);
    }
}

/// Emits tests after the last tile that a triangle touches, among those that are tested.
fn emit_tests(gpu: &mut Gpu<'_>, triangle: u32, tested: &Block, tests: &TileLoop) {
    let mut packet = gpu.packet(PacketKind::Tile, Packet::NONE, Some(triangle));
    add(tests, &mut packet.counts);
    gpu.push_block(&packet, tested);
}

fn add(tests: &TileLoop, counts: &mut PacketCounts) {
    counts[Event::CoarseTilesVisited] += tests.blocks;
    counts[Event::TilesVisited] += tests.tiles;
    counts[Event::TilesCulledSides] += tests.culled_sides;
    counts[Event::TilesCulledEdges] += tests.culled_edges;
    counts[Event::EdgeMadds] += tests.place_madds;
    counts[Event::SidePlaneMadds] += tests.side_madds;
    counts[Event::EdgeBoundMadds] += tests.edge_madds;
    counts[Event::TileMadds] += tests.place_madds + tests.side_madds + tests.edge_madds;
    counts[Event::DepthIntervalMadds] += tests.depth_madds;
}
