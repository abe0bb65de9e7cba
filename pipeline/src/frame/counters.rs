//! What the tiles of one bin did, before the caches have their say.

use activity::{Counts, Event, PacketCounts};

use crate::sample_test::PixelHits;
use crate::shading::QuadAccess;

/// Tile tests done since the last packet of the bin.
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

    /// How often `event` is among them.
    pub fn of(&self, event: Event) -> u32 {
        let mut counts = PacketCounts::default();
        self.add_to(&mut counts);
        counts[event]
    }
}

/// The tile tests done in one tile, whichever packet they travel in: those of all packets that held some of them, less
/// what these held already.
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

    /// How often `event` is among them.
    pub fn of(&self, event: Event) -> u64 {
        self.after[event] - self.before[event]
    }
}

/// What happened to the samples of each pixel of a tile: [`Self::EVENTS`] in their order.
#[derive(Clone, Debug)]
pub(super) struct SamplesHere(Vec<[u32; 7]>);

impl SamplesHere {
    /// Events of samples, which have a pixel each.
    pub const EVENTS: [Event; 7] = [
        Event::SamplesScreened,
        Event::ScreenMadds,
        Event::SamplesTested,
        Event::SampleMadds,
        Event::SamplesHit,
        Event::DepthWrites,
        Event::ColourWrites,
    ];

    /// Nothing yet.
    pub fn new() -> Self {
        Self(vec![[0; 7]; 64])
    }

    /// Adds what was found, with the multiply-adds of a screen and of a test.
    pub fn add(&mut self, found: &PixelHits, [screen_madds, test_madds]: [u32; 2]) {
        for (pixel, counts) in self.0.iter_mut().enumerate() {
            let (screened, tested) = (found.screened[pixel], found.tested[pixel]);
            let (hit, written) = (found.hit[pixel], found.written[pixel]);
            let here =
                [screened, screened * screen_madds, tested, tested * test_madds, hit, written, written];
            counts.iter_mut().zip(here).for_each(|(sum, count)| *sum += count);
        }
    }

    /// How often `event` happened in each pixel, row by row; nothing for events that are not of samples.
    pub fn of(&self, event: Event) -> impl Iterator<Item = u32> + '_ {
        let place = Self::EVENTS.iter().position(|known| *known == event);
        self.0.iter().filter_map(move |counts| Some(counts[place?]))
    }
}

/// One triangle in one tile, or tile tests that led to none.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Work {
    pub triangle: u32,
    pub tile: u32,
    pub tests: TileWork,
    pub screened: u32,
    pub screen_madds: u32,
    pub tested: u32,
    pub hit: u32,
    /// Hits known to be nearer than what is stored.
    pub unread: u32,
    pub written: u32,
    pub sample_madds: u32,
    pub read_pixels: u64,
    pub written_pixels: u64,
    /// Of these, those whose depths and whose colours now fit in half their room; known where memory compresses them.
    pub small_pixels: [u64; 2],
    /// One past this work's last entry in [`BinLog::quads`].
    pub quads_end: u32,
}

/// Everything one bin did in one batch, in the order of the modelled hardware.
#[derive(Clone, Debug, Default)]
pub(super) struct BinLog {
    pub work: Vec<Work>,
    pub quads: Vec<QuadAccess>,
    /// The tile tests in each tile of the bin, kept for heat maps only.
    pub tests: Vec<TestsHere>,
    /// What happened to the samples of each tile of the bin, kept for heat maps only.
    pub samples: Vec<Option<SamplesHere>>,
}
