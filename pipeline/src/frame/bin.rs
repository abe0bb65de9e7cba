//! Bins: coarse tiles, each rasterized by one worker, and the logs of their work.

use activity::{Counts, Event, PacketCounts};

use super::pass::Pass;
use super::test_selection::TestSelector;
use crate::depth::DepthTile;
use crate::geometry::Viewport;
use crate::sample_test::PixelHits;
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
