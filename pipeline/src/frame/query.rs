//! Occlusion queries (thesis, Paper VI, section 3), by samples and by intervals, with their work counted
//! where it is done.

use activity::{Counts, Event, Packet, PacketCounts, PacketKind};
use glam::{Vec3, Vec4};

use super::heat::Block;
use super::{Draw, FrameReport, Gpu, PassError, Placement, Query, RasterPass};
use crate::depth::{Bounder, DepthBound, Pyramid};
use crate::geometry::{Cull, Geometry, MovingVertex, Projection};
use crate::memory::{LINE_BYTES, MemoryRange};
use crate::setup::{SetupResult, Triangle, bounds, set_up_counted};
use crate::shader::{Lane, Shader, ShadingPoint};
use crate::state::{Compare, DepthState, DrawState};
use crate::tally::Costs;
use crate::traversal::{Box5, TileRect, narrow_counted};

/// An axis-aligned box whose corners move linearly.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MovingBox {
    /// Lowest and highest corner at shutter open.
    pub open: [Vec3; 2],
    /// Lowest and highest corner at shutter close.
    pub close: [Vec3; 2],
}

/// Faces of a box, two triangles each; the bits of a corner index select the upper coordinate of an axis.
const FACES: [[u32; 3]; 12] = [
    [0, 2, 3],
    [0, 3, 1],
    [4, 5, 7],
    [4, 7, 6],
    [0, 1, 5],
    [0, 5, 4],
    [2, 6, 7],
    [2, 7, 3],
    [0, 4, 6],
    [0, 6, 2],
    [1, 3, 7],
    [1, 7, 5],
];
/// Corners of a box.
const CORNERS: u32 = 8;
/// Bytes of a corner at both ends of the shutter.
const CORNER_BYTES: u32 = 24;
/// Bytes of a stored depth.
const DEPTH_BYTES: u64 = 4;
/// Bytes of the answer of a query.
const ANSWER_BYTES: u64 = 4;

impl MovingBox {
    /// Triangles, by corner index.
    pub const TRIANGLES: [[u32; 3]; 12] = FACES;

    /// Corners at shutter open and at shutter close.
    pub fn corners(&self) -> [[Vec3; 8]; 2] {
        [self.open, self.close].map(|[low, high]| {
            std::array::from_fn(|corner| {
                let pick = |axis: usize| if corner >> axis & 1 == 0 { low[axis] } else { high[axis] };
                Vec3::new(pick(0), pick(1), pick(2))
            })
        })
    }
}

/// Result and work of an interval query.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct IntervalAnswer {
    /// Whether the object is hidden from all samples.
    pub hidden: bool,
    /// Triangles set up.
    pub triangles: u64,
    /// Tiles tested, on all levels.
    pub tiles: u64,
    /// Depth intervals compared with a farthest depth of four bytes.
    pub compared: u64,
    /// Multiply-adds of set-up, of tile tests and of depth intervals.
    pub madds: [u64; 3],
}

impl IntervalAnswer {
    /// Number of tests.
    pub fn tests(&self) -> u64 {
        self.tiles + self.compared
    }

    /// Bytes of stored depth read.
    pub fn bytes(&self) -> u64 {
        DEPTH_BYTES * self.compared
    }

    /// Multiply-adds of the whole query.
    pub fn all_madds(&self) -> u64 {
        self.madds.iter().sum()
    }
}

/// Interval queries against one pyramid.
#[derive(Debug)]
pub struct IntervalQueries<'a> {
    pyramid: &'a Pyramid,
    projection: &'a Projection,
    bound: DepthBound,
    costs: Costs,
}

/// A triangle of a box, after set-up.
struct Side {
    triangle: Triangle,
    bounder: Bounder,
}

impl<'a> IntervalQueries<'a> {
    /// Makes queries against `pyramid`, whose depths were drawn through `projection`.
    pub fn new(pyramid: &'a Pyramid, projection: &'a Projection) -> Self {
        Self { pyramid, projection, bound: DepthBound::LocalPlanes, costs: Costs::remembered() }
    }

    /// Whether the box, and everything inside, is hidden. Ends at the first tile of the first level that may
    /// see it.
    pub fn query(&self, object: &MovingBox) -> IntervalAnswer {
        let mut answer = IntervalAnswer::default();
        let [open, close] = object.corners();
        let vertices: [MovingVertex; 8] = std::array::from_fn(|n| self.projection.vertex(open[n], close[n]));
        // If the near plane clips the box, its content may be visible without its sides.
        let near = self.projection.near;
        if vertices.iter().any(|vertex| vertex.open[2] <= near || vertex.close[2] <= near) {
            return answer;
        }
        let shear = &self.projection.shear;
        let half_px = self.pyramid.viewport().half_px();
        answer.hidden = (0..).zip(FACES).all(|(id, corners)| {
            let three = corners.map(|corner| &vertices[corner as usize]);
            let (outcome, madds) = set_up_counted(id, three, Cull::None, shear, near, half_px);
            answer.madds[0] += u64::from(madds);
            let SetupResult::Ready(triangle) = outcome else {
                // A triangle without area is invisible.
                return true;
            };
            answer.triangles += 1;
            let (bounder, madds) = Bounder::counted(&triangle, shear, self.bound, Some(&self.costs));
            answer.madds[2] += u64::from(madds);
            self.triangle(&Side { triangle, bounder }, &mut answer)
        });
        answer
    }

    /// Whether a triangle is hidden, starting at the level where it touches four tiles at most.
    fn triangle(&self, side: &Side, answer: &mut IntervalAnswer) -> bool {
        let pixels = bounds(&side.triangle, &self.projection.shear, self.pyramid.viewport());
        if pixels.is_empty() {
            return true;
        }
        let tiles = |level: usize| pixels.tiles(self.pyramid.side_px(level));
        let few = |level: &usize| {
            tiles(*level).x1 - tiles(*level).x0 <= 2 && tiles(*level).y1 - tiles(*level).y0 <= 2
        };
        let level = (0..self.pyramid.levels()).find(few).unwrap_or(self.pyramid.levels() - 1);
        let (tiles, whole) = (tiles(level), Box5::whole(!self.projection.shear.is_none()));
        (tiles.y0..tiles.y1).all(|row| {
            (tiles.x0..tiles.x1).all(|column| self.tile(side, level, [column, row], &whole, answer))
        })
    }

    /// Whether the triangle is hidden in a tile, directly or in all of its child tiles.
    fn tile(
        &self,
        side: &Side,
        level: usize,
        [column, row]: [u32; 2],
        within: &Box5,
        answer: &mut IntervalAnswer,
    ) -> bool {
        let (shear, px) = (&self.projection.shear, self.pyramid.side_px(level));
        let rect = TileRect::new(self.pyramid.viewport(), [column * px, row * px], px);
        answer.tiles += 1;
        let (narrowed, madds) = narrow_counted::<f64>(&side.triangle, shear, &rect, within);
        answer.madds[1] += u64::from(madds);
        let Some(narrowed) = narrowed else { return true };
        if self.behind(side, level, [column, row], &rect, &narrowed, answer) {
            return true;
        }
        if level == 0 {
            return false;
        }
        let [columns, rows] = self.pyramid.size(level - 1);
        (2 * row..(2 * row + 2).min(rows)).all(|row| {
            (2 * column..(2 * column + 2).min(columns))
                .all(|column| self.tile(side, level - 1, [column, row], &narrowed, answer))
        })
    }

    /// Whether the triangle is behind the stored depths in every box of lens and time that it may touch.
    fn behind(
        &self,
        side: &Side,
        level: usize,
        tile: [u32; 2],
        rect: &TileRect,
        within: &Box5,
        answer: &mut IntervalAnswer,
    ) -> bool {
        self.pyramid.grid().overlapping(within).all(|(index, part)| {
            let ([nearest, _], madds) = side.bounder.over_counted(rect, &part, Some(&self.costs));
            answer.compared += 1;
            answer.madds[2] += u64::from(madds);
            nearest > self.pyramid.farthest(level, tile, index)
        })
    }
}

/// Where the tiles of the first level are in the image.
fn placement(pyramid: &Pyramid) -> Placement {
    let (viewport, tiles) = (pyramid.viewport(), pyramid.size(0));
    let sides = [viewport.width(), viewport.height()];
    let end = |axis: usize| f64::from(tiles[axis] * pyramid.side_px(0)) / f64::from(sides[axis]);
    Placement { first: [0.0; 2], last: [0, 1].map(end) }
}

/// Tiles of the first level that a tile of any level covers.
fn block(pyramid: &Pyramid, level: usize, tile: [u32; 2]) -> Block {
    let of = pyramid.size(0);
    let edge = |axis: usize, tile: u32| (tile << level).min(of[axis]);
    let [first, end] = [0, 1].map(|next| [0, 1].map(|axis| edge(axis, tile[axis] + next)));
    Block { first, end, of }
}

impl Gpu<'_> {
    /// Gathers the farthest depths of `stored`, the result of a pass over depth, in a pass of its own. It
    /// needs no wait, as the unit of depth works in order: every stored depth is read and compared once, and
    /// the farthest of each box of a tile are compared for the next level. They are kept in fast memory.
    ///
    /// # Errors
    /// [`PassError::Stopped`] and [`PassError::Memory`].
    pub fn gather_farthest_depths(
        &mut self,
        name: &str,
        pyramid: &Pyramid,
        stored: MemoryRange,
    ) -> Result<(), PassError> {
        self.check_frame(name)?;
        let placement = self.has_heat_of(pyramid.viewport()).then(|| placement(pyramid));
        self.open_placed(name, placement);
        self.note_read(stored.address());
        let first = pyramid.size(0);
        let tiles = u64::from(first[0] * first[1]);
        for level in 0..pyramid.levels() {
            let [columns, rows] = pyramid.size(level);
            for tile in 0..columns * rows {
                let at = [tile % columns, tile / columns];
                let mut packet = self.packet(PacketKind::Tile, tile, None);
                let counts = &mut packet.counts;
                let compares = pyramid.compared(level, at);
                counts[Event::ZCullTests] = compares;
                counts[Event::ZMaxUpdates] = pyramid.grid().len() as u32;
                if level == 0 {
                    counts[Event::DepthReads] = compares;
                    // Depths lie tile by tile, those of all tiles in one surface.
                    let range = [tile, tile + 1].map(|end| u64::from(end) * stored.bytes() / tiles);
                    let lines = range.map(|end| (stored.address() + end).div_ceil(LINE_BYTES));
                    for line in lines[0]..lines[1] {
                        self.memory().depth(line * LINE_BYTES, false, false, counts);
                    }
                }
                self.push_block(&packet, &block(pyramid, level, at));
            }
        }
        Ok(())
    }

    /// Queries boxes in a pass of its own, each as a draw. A query ends at its first tile that may see the box. The
    /// unit of depth writes the answers to memory, a word each.
    ///
    /// # Errors
    /// [`PassError::Stopped`] and [`PassError::Memory`].
    pub fn query_boxes(
        &mut self,
        name: &str,
        queries: &IntervalQueries<'_>,
        objects: &[MovingBox],
    ) -> Result<Vec<IntervalAnswer>, PassError> {
        let corners = self.allocate(objects.len() as u64 * u64::from(CORNERS * CORNER_BYTES));
        let written = self.allocate(objects.len() as u64 * ANSWER_BYTES);
        self.check_frame(name)?;
        self.open(name, None);
        let answers: Vec<_> = objects.iter().map(|object| queries.query(object)).collect();
        let size = self.spec().batch_triangles;
        let queried: Vec<_> = (0..).zip(&answers).collect();
        let batch = |number: u32| FACES.len() as u32 * number / size;
        // All boxes of a batch are set up before the first is traversed.
        for boxes in queried.chunk_by(|&(before, _), &(number, _)| batch(before) == batch(number)) {
            boxes.iter().for_each(|&(number, answer)| {
                self.box_vertices(number, queries.projection, answer, corners);
            });
            boxes.iter().for_each(|&(number, answer)| self.box_tiles(number, answer, written));
        }
        self.keep(written);
        Ok(answers)
    }

    /// Writes the answer of query `number`. Answers follow each other, so the first of a line needs none of
    /// what was there.
    fn write_answer(&mut self, number: u32, answers: MemoryRange, counts: &mut PacketCounts) {
        counts[Event::DepthWrites] += 1;
        let address = answers.address() + u64::from(number) * ANSWER_BYTES;
        self.memory().depth(
            address / LINE_BYTES * LINE_BYTES,
            true,
            address.is_multiple_of(LINE_BYTES),
            counts,
        );
    }

    /// Writes the answers of the queries among the draws of the last pass; `false` if there are none.
    pub(super) fn write_answers(&mut self, draws: &[Draw<'_>]) -> bool {
        let queried: Vec<u32> =
            (0..).zip(draws).filter(|(_, draw)| draw.query.is_some()).map(|(number, _)| number).collect();
        if queried.is_empty() {
            return false;
        }
        let answers = self.allocate(queried.len() as u64 * ANSWER_BYTES);
        for (number, draw) in (0..).zip(queried) {
            let mut packet = Packet { draw, ..self.packet(PacketKind::Tile, Packet::NONE, None) };
            self.write_answer(number, answers, &mut packet.counts);
            self.push(&packet, 0);
        }
        self.keep(answers);
        true
    }

    /// Emits the tiles of a box that the query came to, and its answer.
    fn box_tiles(&mut self, number: u32, answer: &IntervalAnswer, answers: MemoryRange) {
        self.begin_draw(number);
        let mut packet = self.packet(PacketKind::Tile, Packet::NONE, Some(FACES.len() as u32 * number));
        let counts = &mut packet.counts;
        let [_, tile_madds, depth_madds] = answer.madds.map(|madds| madds as u32);
        counts[Event::TilesVisited] = answer.tiles as u32;
        counts[Event::TileMadds] = tile_madds;
        counts[Event::SidePlaneMadds] = tile_madds;
        counts[Event::DepthIntervalMadds] = depth_madds;
        counts[Event::ZCullTests] = answer.compared as u32;
        self.write_answer(number, answers, &mut packet.counts);
        self.push(&packet, 0);
    }

    /// Emits the draw of a box: its eight corners, and the set-up of the triangles that the query came to.
    fn box_vertices(
        &mut self,
        number: u32,
        projection: &Projection,
        answer: &IntervalAnswer,
        corners: MemoryRange,
    ) {
        self.begin_draw(number);
        let mut start = self.packet(PacketKind::Draw, Packet::NONE, None);
        start.counts[Event::Draws] = 1;
        self.push(&start, 0);
        let mut packet = self.packet(PacketKind::Vertices, Packet::NONE, Some(FACES.len() as u32 * number));
        let counts = &mut packet.counts;
        counts[Event::Indices] = 3 * FACES.len() as u32;
        counts[Event::VerticesFetched] = CORNERS;
        counts[Event::VertexBytes] = CORNERS * CORNER_BYTES;
        counts[Event::VertexInvocations] = CORNERS;
        counts[Event::ShaderOps] = CORNERS * 2 * projection.vertex_ops();
        counts[Event::TrianglesIn] = FACES.len() as u32;
        counts[Event::TrianglesSetUp] = answer.triangles as u32;
        counts[Event::SetupMadds] = answer.madds[0] as u32;
        let bytes = u64::from(CORNERS * CORNER_BYTES);
        self.memory().vertices(corners.address() + u64::from(number) * bytes, bytes, counts);
        self.push(&packet, FACES.len());
    }
}

/// Result and work of a sampled query.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SampledAnswer {
    /// Fragments that pass the depth test, until the query ends.
    pub passed: u64,
    /// Samples that were screened or tested; one that passes its screen and is tested then is one.
    pub tested: u64,
    /// Tiles tested, coarse ones included.
    pub tiles: u64,
    /// Comparisons with the farthest depths of a tile, of four bytes each.
    pub compared: u64,
    /// Stored depths of four bytes read.
    pub read: u64,
    /// Multiply-adds of the whole query.
    pub madds: u64,
}

impl SampledAnswer {
    /// Number of tests: of samples, of tiles, and of depths.
    pub fn tests(&self) -> u64 {
        self.tested + self.tiles + self.compared + self.read
    }

    /// Bytes of stored depth read.
    pub fn bytes(&self) -> u64 {
        DEPTH_BYTES * (self.compared + self.read)
    }

    /// From the events of its draw.
    fn of(counts: &Counts, passed: u64) -> Self {
        let all = |events: &[Event]| events.iter().map(|event| counts[*event]).sum::<u64>();
        Self {
            passed,
            tested: counts[Event::SampleReads],
            tiles: all(&[Event::TilesVisited, Event::CoarseTilesVisited]),
            compared: counts[Event::ZCullTests],
            read: counts[Event::DepthReads],
            madds: all(&[
                Event::SetupMadds,
                Event::TileMadds,
                Event::ScreenMadds,
                Event::SampleMadds,
                Event::DepthIntervalMadds,
            ]),
        }
    }
}

/// Answers of sampled queries.
#[derive(Clone, Debug, PartialEq)]
pub struct SampledAnswers {
    /// By object.
    pub answers: Vec<SampledAnswer>,
    /// Work of the pass that drew the occluders and the boxes.
    pub report: FrameReport,
}

/// Sampled queries: bounding boxes drawn over stored depths, with the depth test and without storing any.
#[derive(Clone, Copy)]
pub struct SampledQueries<'a> {
    /// The occluders, whose draws have the default state.
    pub occluders: RasterPass<'a>,
    /// Whether a query ends at the first packet with a sample that passes.
    pub any: bool,
}

/// A query counts fragments and has no colour of its own.
struct Counted;

impl Shader for Counted {
    fn shade(&self, _: &Lane, _: &ShadingPoint, _: Vec4) -> Vec4 {
        Vec4::ONE
    }
}

impl SampledQueries<'_> {
    /// Queries boxes, one after the other, over what the occluders stored. All culling of the hardware
    /// works as for other draws.
    ///
    /// # Errors
    /// [`PassError`] if the hardware cannot draw it.
    pub fn query(&self, objects: &[MovingBox]) -> Result<SampledAnswers, PassError> {
        let mut gpu = Gpu::without_packets(self.occluders.settings.spec)?;
        let query = if self.any { Query::Any } else { Query::Count };
        let answers = gpu.query_samples(&self.occluders.without_image(), query, objects)?;
        Ok(SampledAnswers { answers, report: gpu.finish() })
    }
}

impl Gpu<'_> {
    /// Draws `pass`, and after its draws a box as a query for each object. The pass may have no draws, and
    /// load the depths that an earlier pass stored.
    ///
    /// # Errors
    /// As [`Gpu::draw`].
    pub fn query_samples(
        &mut self,
        pass: &RasterPass<'_>,
        query: Query,
        objects: &[MovingBox],
    ) -> Result<Vec<SampledAnswer>, PassError> {
        let corners: Vec<[[Vec3; 8]; 2]> = objects.iter().map(MovingBox::corners).collect();
        let depth = DepthState { test: Compare::LessEqual, write: false };
        let state = DrawState { depth, ..DrawState::new(Cull::None) };
        let mut draws = pass.draws.to_vec();
        let mut queried: Vec<Option<usize>> = Vec::new();
        for [open, close] in &corners {
            // A geometry is refused only for values that are not finite, which are invisible.
            let geometry = Geometry::new(open, close, &MovingBox::TRIANGLES).ok();
            queried.push(geometry.is_some().then_some(draws.len()));
            let draw =
                |geometry| Draw::new(geometry, &Counted, Cull::None).with_state(state).with_query(query);
            draws.extend(geometry.map(draw));
        }
        let passed = self.draw(&RasterPass { draws: &draws, ..*pass })?.passed;
        let found: Vec<SampledAnswer> = self
            .draws_of_pass()
            .iter()
            .zip(passed)
            .map(|(counts, passed)| SampledAnswer::of(counts, passed))
            .collect();
        let answer = |draw: Option<usize>| draw.map_or_else(SampledAnswer::default, |draw| found[draw]);
        Ok(queried.into_iter().map(answer).collect())
    }
}
