//! Bins: coarse tiles, each rasterized by one worker, and the logs of their work.
//!
//! Memory of bins has the set-up records of triangles, and the list of triangles of each bin. Set-up writes
//! them through the triangle buffer, and the tile loop reads them. As in the parameter buffer of a tile-based
//! GPU (Antochi et al., "Memory bandwidth requirements of tile-based rendering", SAMOS 2004), a batch has its
//! records one after the other, and lists grow by lines. Two batches are in memory at once, in turns.

use std::collections::VecDeque;

use activity::{Counts, Event, PacketCounts};

use super::pass::Pass;
use super::test_selection::TestSelector;
use crate::depth::DepthTile;
use crate::geometry::Viewport;
use crate::memory::{AddressSpace, LINE_BYTES, MemorySystem};
use crate::sample_test::PixelHits;
use crate::setup::{PixelRect, Triangle};
use crate::shading::QuadAccess;

/// A coarse tile of the image with its stored samples.
pub(super) struct Bin {
    /// First pixel.
    pub origin: [u32; 2],
    /// Fine tiles, row by row. Tiles outside the image stay untouched.
    pub tiles: Vec<Option<DepthTile>>,
    /// Test selection of the bin, for the feature `auto`.
    pub selector: TestSelector,
}

impl Bin {
    /// Cleared bins of an image, row by row.
    pub fn all(pass: &Pass<'_>) -> Vec<Self> {
        let (viewport, coarse) = (pass.settings.viewport, pass.settings.spec.coarse_tile_px);
        let tiles = Self::tiles_across(pass).pow(2) as usize;
        let [across, down] = [viewport.width(), viewport.height()].map(|side| side.div_ceil(coarse));
        (0..across * down)
            .map(|bin| Self {
                origin: [bin % across * coarse, bin / across * coarse],
                tiles: vec![None; tiles],
                selector: TestSelector::new(),
            })
            .collect()
    }

    pub fn tiles_across(pass: &Pass<'_>) -> u32 {
        pass.settings.spec.coarse_tile_px / pass.settings.spec.tile_px
    }

    /// First pixel of the fine tile `index` of the bin.
    pub fn tile_origin(&self, pass: &Pass<'_>, index: usize) -> [u32; 2] {
        let (across, side) = (Self::tiles_across(pass), pass.settings.spec.tile_px);
        [self.origin[0] + index as u32 % across * side, self.origin[1] + index as u32 / across * side]
    }

    /// Number of the fine tile at `origin` in the whole image.
    pub fn tile_number(pass: &Pass<'_>, origin: [u32; 2]) -> u32 {
        let side = pass.settings.spec.tile_px;
        origin[1] / side * pass.tiles_across() + origin[0] / side
    }

    /// Tiles in the image: number in the image, index in the bin, mask of pixels in the image, and whether a
    /// triangle touched the tile.
    pub fn inside(&self, pass: &Pass<'_>) -> impl Iterator<Item = (u32, usize, u64, bool)> {
        let (viewport, side) = (pass.settings.viewport, pass.settings.spec.tile_px);
        self.tiles.iter().enumerate().filter_map(move |(index, tile)| {
            let [x, y] = self.tile_origin(pass, index);
            let pixels = tile_pixels(viewport, [x, y], side);
            (pixels != 0).then(|| (Self::tile_number(pass, [x, y]), index, pixels, tile.is_some()))
        })
    }
}

/// Mask of the pixels of the tile at `origin` that are in the image, row by row.
pub(super) fn tile_pixels(viewport: Viewport, [x, y]: [u32; 2], side: u32) -> u64 {
    let [columns, rows] = [viewport.width().saturating_sub(x), viewport.height().saturating_sub(y)];
    let [columns, rows] = [columns.min(side), rows.min(side)];
    let row = (1_u64 << columns) - 1;
    (0..rows).fold(0_u64, |mask, r| mask | row << (r * side))
}

/// Tile tests since the last packet of the bin.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct TileWork {
    pub coarse_visited: u32,
    pub visited: u32,
    pub culled_sides: u32,
    pub culled_lens: u32,
    pub culled_facing: u32,
    pub culled_edges: u32,
    pub lens_line_madds: u32,
    pub side_plane_madds: u32,
    pub edge_madds: u32,
    pub facing_madds: u32,
    pub edge_bound_madds: u32,
    pub screen_setup_madds: u32,
    pub z_tests: u32,
    pub z_culled: u32,
    pub z_updates: u32,
    pub z_min_updates: u32,
    pub boxes_culled: u32,
    pub interval_madds: u32,
}

impl TileWork {
    pub fn is_empty(&self) -> bool {
        *self == Self::default()
    }

    /// Multiply-adds of all tile tests.
    pub fn tile_madds(&self) -> u32 {
        self.lens_line_madds
            + self.side_plane_madds
            + self.edge_madds
            + self.facing_madds
            + self.edge_bound_madds
            + self.screen_setup_madds
    }

    pub fn add_to(&self, counts: &mut PacketCounts) {
        counts[Event::CoarseTilesVisited] += self.coarse_visited;
        counts[Event::TilesVisited] += self.visited;
        counts[Event::TilesCulledSides] += self.culled_sides;
        counts[Event::TilesCulledEdges] += self.culled_edges;
        counts[Event::TilesCulledLens] += self.culled_lens;
        counts[Event::TilesCulledFacing] += self.culled_facing;
        counts[Event::LensLineMadds] += self.lens_line_madds;
        counts[Event::SidePlaneMadds] += self.side_plane_madds;
        counts[Event::EdgeMadds] += self.edge_madds;
        counts[Event::FacingMadds] += self.facing_madds;
        counts[Event::EdgeBoundMadds] += self.edge_bound_madds;
        counts[Event::ScreenSetupMadds] += self.screen_setup_madds;
        counts[Event::TileMadds] += self.tile_madds();
        counts[Event::ZCullTests] += self.z_tests;
        counts[Event::TilesCulledZMax] += self.z_culled;
        counts[Event::ZMaxUpdates] += self.z_updates;
        counts[Event::ZMinUpdates] += self.z_min_updates;
        counts[Event::BoxesCulledZMax] += self.boxes_culled;
        counts[Event::DepthIntervalMadds] += self.interval_madds;
    }

    /// Count of `event`.
    pub fn of(&self, event: Event) -> u32 {
        let mut counts = PacketCounts::default();
        self.add_to(&mut counts);
        counts[event]
    }
}

/// Tile tests in one tile, independent of the packets that carry them.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct TestsHere {
    after: Counts,
    before: Counts,
}

impl TestsHere {
    pub fn add(&mut self, before: &TileWork, after: &TileWork) {
        for (sum, work) in [(&mut self.before, before), (&mut self.after, after)] {
            let mut counts = PacketCounts::default();
            work.add_to(&mut counts);
            *sum += &counts;
        }
    }

    /// Count of `event`.
    pub fn of(&self, event: Event) -> u64 {
        self.after[event] - self.before[event]
    }
}

/// Sample events of each pixel of a tile, in the order of [`Self::EVENTS`].
#[derive(Clone, Debug)]
pub(super) struct SamplesHere(Vec<[u32; 7]>);

impl SamplesHere {
    /// Events with a pixel.
    pub const EVENTS: [Event; 7] = [
        Event::SamplesScreened,
        Event::ScreenMadds,
        Event::SamplesTested,
        Event::SampleMadds,
        Event::SamplesHit,
        Event::DepthWrites,
        Event::ColourWrites,
    ];

    /// All counts 0.
    pub fn new() -> Self {
        Self(vec![[0; 7]; 64])
    }

    /// Add the sample tests of `found`, with the multiply-adds per screened and per tested sample.
    pub fn add(&mut self, found: &PixelHits, [screen_madds, test_madds]: [u32; 2]) {
        for (pixel, counts) in self.0.iter_mut().enumerate() {
            let (screened, tested) = (found.screened[pixel], found.tested[pixel]);
            let (hit, written, coloured) = (found.hit[pixel], found.written[pixel], found.coloured[pixel]);
            let here =
                [screened, screened * screen_madds, tested, tested * test_madds, hit, written, coloured];
            counts.iter_mut().zip(here).for_each(|(sum, count)| *sum += count);
        }
    }

    /// Count of `event` in each pixel, row by row; empty for events without a pixel.
    pub fn of(&self, event: Event) -> impl Iterator<Item = u32> + '_ {
        let place = Self::EVENTS.iter().position(|known| *known == event);
        self.0.iter().filter_map(move |counts| Some(counts[place?]))
    }
}

/// One triangle in one tile, reading its loaded depths, or tile tests without a packet of their own.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Work {
    pub draw: u32,
    pub triangle: u32,
    pub tile: u32,
    pub tests: TileWork,
    pub screened: u32,
    pub screen_madds: u32,
    pub tested: u32,
    pub hit: u32,
    /// Hits whose tests need no stored depth.
    pub unread: u32,
    /// Loaded depths that are read to find their bounds.
    pub bounded: u32,
    /// Depth and stencil words written.
    pub written: u32,
    /// Samples with a new colour.
    pub coloured: u32,
    /// Samples of a query that pass all tests.
    pub passed: u32,
    pub sample_madds: u32,
    pub read_pixels: u64,
    pub written_pixels: u64,
    pub coloured_pixels: u64,
    /// Pixels written whose depths and whose colours now compress to half; only with compression.
    pub small_pixels: [u64; 2],
    /// One past the last entry of this work in [`BinLog::quads`].
    pub quads_end: u32,
    /// Entries of the list of the bin that are read up to this work.
    pub listed_end: u32,
}

/// Work of one bin in one batch, in the order of the modelled hardware.
#[derive(Clone, Debug, Default)]
pub(super) struct BinLog {
    pub work: Vec<Work>,
    pub quads: Vec<QuadAccess>,
    /// Tile tests in each tile of the bin, for heat maps only.
    pub tests: Vec<TestsHere>,
    /// Sample events in each tile of the bin, for heat maps only.
    pub samples: Vec<Option<SamplesHere>>,
}

/// Bytes of a vertex position on the image plane at one end of the shutter.
const POSITION_BYTES: u32 = 12;
/// Bytes of the number of a triangle, in its record and in lists.
const NUMBER_BYTES: u64 = 4;
/// Entries of a line of a list.
const LINE_ENTRIES: u32 = (LINE_BYTES / NUMBER_BYTES) as u32;

/// Batches whose triangles are not all drawn.
pub(super) struct BinMemory {
    /// Bins in a row of the image, and in the image.
    across: u32,
    bins: usize,
    batches: VecDeque<BatchBins>,
    /// Which half of the memory the next batch takes.
    odd: bool,
}

/// Records and lists of a batch.
struct BatchBins {
    /// First byte of each record, and the end of the last.
    records: Vec<u64>,
    lists: Vec<List>,
    /// Address of the next line of any list, and of the first.
    next_line: u64,
    first_line: u64,
}

/// Triangles of a bin.
#[derive(Clone, Default)]
struct List {
    entries: u32,
    /// Addresses of its lines.
    lines: Vec<u64>,
}

impl BinMemory {
    /// Memory without batches; `None` if bins take no memory.
    pub fn new(pass: &Pass<'_>) -> Option<Self> {
        let spec = pass.settings.spec;
        spec.memory.bins?;
        let viewport = pass.settings.viewport;
        let [across, down] =
            [viewport.width(), viewport.height()].map(|side| side.div_ceil(spec.coarse_tile_px));
        let bins = across as usize * down as usize;
        Some(Self { across, bins, batches: VecDeque::new(), odd: pass.number % 2 == 1 })
    }

    /// Begin the next batch.
    pub fn begin(&mut self) {
        // A quarter of the upper half of all addresses for each: more than lists and records can fill.
        let quarter = AddressSpace::END / 4;
        let first = AddressSpace::END + if self.odd { quarter } else { 0 };
        self.odd = !self.odd;
        let (lists, first_line) = (vec![List::default(); self.bins], first + 2 * quarter);
        self.batches.push_back(BatchBins { records: vec![first], lists, next_line: first_line, first_line });
    }

    /// Write the record of a triangle of the last batch, and its entry in every bin that it may touch.
    pub fn write(
        &mut self,
        pass: &Pass<'_>,
        (triangle, pixels): (&Triangle, &PixelRect),
        memory: &mut MemorySystem,
        counts: &mut PacketCounts,
    ) {
        let Some(batch) = self.batches.back_mut() else { return };
        let first = batch.records[batch.records.len() - 1];
        let end = first + record_bytes(pass, triangle);
        batch.records.push(end);
        lines_of(first, end).for_each(|line| memory.write_bin(line, counts));
        let bins = pixels.tiles(pass.settings.spec.coarse_tile_px);
        for bin in (bins.y0..bins.y1).flat_map(|row| (bins.x0..bins.x1).map(move |column| (row, column))) {
            counts[Event::BinEntries] += 1;
            memory.write_bin(batch.enter((bin.0 * self.across + bin.1) as usize), counts);
        }
    }

    /// Read the entries `from..to` of the list of a bin of the first batch, which are the triangles `listed`,
    /// and their records.
    pub fn read(
        &self,
        (bin, from): (usize, u32),
        listed: &[u32],
        memory: &mut MemorySystem,
        counts: &mut PacketCounts,
    ) {
        let Some(batch) = self.batches.front() else { return };
        for (entry, &triangle) in (from..).zip(listed) {
            if entry.is_multiple_of(LINE_ENTRIES) {
                memory.read_bin(batch.lists[bin].lines[(entry / LINE_ENTRIES) as usize], counts);
            }
            let record = &batch.records[triangle as usize..][..2];
            lines_of(record[0], record[1]).for_each(|line| memory.read_bin(line, counts));
        }
    }

    /// End the first batch, whose triangles are all drawn. Its lines are not written to memory any more.
    pub fn end(&mut self, memory: &mut MemorySystem) {
        let Some(batch) = self.batches.pop_front() else { return };
        let records = lines_of(batch.records[0], batch.records[batch.records.len() - 1]);
        let lists = (batch.first_line..batch.next_line).step_by(LINE_BYTES as usize);
        records.chain(lists).for_each(|line| memory.discard_bin(line));
    }
}

impl BatchBins {
    /// Address of the line of a new entry of a bin.
    fn enter(&mut self, bin: usize) -> u64 {
        let list = &mut self.lists[bin];
        if list.entries.is_multiple_of(LINE_ENTRIES) {
            list.lines.push(self.next_line);
            self.next_line += LINE_BYTES;
        }
        list.entries += 1;
        list.lines[list.lines.len() - 1]
    }
}

/// Bytes of the set-up record of a triangle: three vertices as they are on the image plane, with the
/// attributes that are shaded, and its number.
fn record_bytes(pass: &Pass<'_>, triangle: &Triangle) -> u64 {
    let geometry = &pass.draws[pass.locate(triangle.id).0].geometry;
    let ends = |still: bool| if still { 1 } else { 2 };
    let attributes = geometry.vertex_bytes() - ends(geometry.is_still()) * POSITION_BYTES;
    let shaded = if pass.is_depth_only() { 0 } else { attributes };
    3 * u64::from(ends(!triangle.moving) * POSITION_BYTES + shaded) + NUMBER_BYTES
}

/// Addresses of the lines that hold the bytes from `first` to `end`.
fn lines_of(first: u64, end: u64) -> impl Iterator<Item = u64> {
    (first / LINE_BYTES..end.div_ceil(LINE_BYTES)).map(|line| line * LINE_BYTES)
}
