//! One worker at one bin: each triangle through the tile tests, the samples and the shading grid.

use super::bin::Bin;
use super::counters::{BinLog, TestsHere, TileWork, Work};
use super::pass::Pass;
use super::surface::{Grid, own_pixel};
use super::vertices::Ready;
use super::{Settings, Shading};
use crate::depth::{DepthTile, interval_madds, nearest};
use crate::sample_test::{self, Hits, Target, test_screened};
use crate::sampling::TileSamples;
use crate::setup::{PixelRect, Triangle};
use crate::shading::QuadSet;
use crate::traversal::{self, Box5, EdgeBounds, Screen, TileRect, narrow};

/// Memory a worker uses over and over.
#[derive(Default)]
pub(super) struct Scratch {
    /// The samples of the bin's tiles, filled on first use.
    samples: Vec<TileSamples>,
    filled: Vec<bool>,
    hits: Hits,
    quads: QuadSet,
}

/// A worker with what it has found so far.
pub(super) struct Worker<'a, 'p> {
    pass: &'a Pass<'p>,
    bin: &'a mut Bin,
    scratch: &'a mut Scratch,
    log: BinLog,
    /// Tile tests since the last packet.
    tests: TileWork,
}

impl<'a, 'p> Worker<'a, 'p> {
    pub fn new(pass: &'a Pass<'p>, bin: &'a mut Bin, scratch: &'a mut Scratch) -> Self {
        scratch.samples.resize_with(bin.tiles.len(), TileSamples::default);
        scratch.filled.clear();
        scratch.filled.resize(bin.tiles.len(), false);
        Self { pass, bin, scratch, log: BinLog::default(), tests: TileWork::default() }
    }

    /// One triangle through the tiles of the bin.
    pub fn triangle(&mut self, Ready { triangle, pixels }: &Ready) {
        let (side, coarse) = (self.pass.settings.spec.tile_px, self.pass.settings.spec.coarse_tile_px);
        self.tests.coarse_visited += 1;
        let rect = TileRect::new(self.pass.settings.viewport, self.bin.origin, coarse);
        let Some(within) = self.side_planes(triangle, &rect) else { return };
        let [x0, y0] = self.bin.origin;
        let here = pixels.intersection(&PixelRect { x0, y0, x1: x0 + coarse, y1: y0 + coarse });
        let tiles = here.tiles(side);
        for row in tiles.y0..tiles.y1 {
            for column in tiles.x0..tiles.x1 {
                let before = (self.tests, self.log.work.len());
                self.tests.visited += 1;
                self.tile(triangle, &within, [column * side, row * side]);
                if self.pass.heat {
                    self.note_tests(before, [column * side, row * side]);
                }
            }
        }
    }

    /// Notes where tile tests were done, for heat maps. They are in the packet that was made since, or wait for the next.
    fn note_tests(&mut self, (before, packets): (TileWork, usize), origin: [u32; 2]) {
        let place = self.place(origin);
        let after = self.log.work[packets..].last().map_or(self.tests, |work| work.tests);
        self.log.tests.resize(self.bin.tiles.len(), TestsHere::default());
        self.log.tests[place].add(&before, &after);
    }

    /// One triangle in one tile, as far as the tests let it.
    fn tile(&mut self, triangle: &Triangle, within: &Box5, origin: [u32; 2]) {
        let rect = TileRect::new(self.pass.settings.viewport, origin, self.pass.settings.spec.tile_px);
        let Some(within) = self.side_planes(triangle, &rect).map(|narrowed| narrowed.intersect(within))
        else {
            return;
        };
        let Some(screen) = self.edges(triangle, &rect, &within) else { return };
        let place = self.place(origin);
        self.fill(place, origin);
        if !self.behind_all(triangle, &within, place) {
            self.samples(triangle, &within, screen.as_ref(), place);
            if self.scratch.hits.screened + self.scratch.hits.tested > 0 {
                self.ask_for_quads(triangle, place, origin);
                self.record(triangle, origin);
            }
        }
    }

    /// The part of lens and time in which the triangle may lie within the sides of a tile.
    fn side_planes(&mut self, triangle: &Triangle, rect: &TileRect) -> Option<Box5> {
        let whole = Box5::whole(self.pass.lens);
        let plain = !triangle.moving && !self.pass.lens && !triangle.behind;
        if plain || !self.pass.settings.spec.features.side_planes {
            return Some(whole);
        }
        self.tests.tile_madds += traversal::madds(triangle.moving, self.pass.lens);
        let within = narrow(triangle, &self.pass.projection.shear, rect, &whole);
        self.tests.culled_sides += u32::from(within.is_none());
        within
    }

    /// Nothing where the edges say that no sample of the tile is inside; otherwise the screen for single samples, if it
    /// is switched on.
    fn edges(&mut self, triangle: &Triangle, rect: &TileRect, within: &Box5) -> Option<Option<Screen>> {
        let features = &self.pass.settings.spec.features;
        if !features.edges && !features.screen {
            return Some(None);
        }
        self.tests.tile_madds += traversal::tile_madds(triangle.moving, self.pass.lens);
        let bounds = EdgeBounds::new(triangle, &self.pass.projection.shear, rect, within);
        if features.edges && bounds.miss() {
            self.tests.culled_edges += 1;
            return None;
        }
        Some(features.screen.then(|| bounds.screen()))
    }

    /// Whether every sample of the tile is known to see something nearer.
    fn behind_all(&mut self, triangle: &Triangle, within: &Box5, place: usize) -> bool {
        if !self.pass.settings.spec.features.z_max {
            return false;
        }
        let (farthest, updated) =
            self.bin.tiles[place].as_mut().map_or((f32::INFINITY, false), DepthTile::farthest);
        let behind = nearest(triangle, within.t) > farthest;
        self.tests.z_tests += 1;
        self.tests.z_updates += u32::from(updated);
        self.tests.interval_madds += interval_madds(triangle.moving);
        self.tests.z_culled += u32::from(behind);
        behind
    }

    fn samples(&mut self, triangle: &Triangle, within: &Box5, screen: Option<&Screen>, place: usize) {
        let samples = &self.scratch.samples[place];
        let stored = self.bin.tiles[place].get_or_insert_with(|| DepthTile::cleared(samples.len));
        let hits = &mut self.scratch.hits;
        hits.clear();
        let mut target = Target { depth: &mut stored.depth, triangle: &mut stored.triangle };
        test_screened(triangle, samples, within, screen, self.pass.projection.near, &mut target, hits);
        if !hits.written.is_empty() {
            stored.touch();
        }
    }

    /// The place of the tile at `origin` in the bin.
    fn place(&self, origin: [u32; 2]) -> usize {
        let side = self.pass.settings.spec.tile_px;
        let [column, row] = [0, 1].map(|axis| (origin[axis] - self.bin.origin[axis]) / side);
        (row * Bin::tiles_across(self.pass) + column) as usize
    }

    fn fill(&mut self, place: usize, origin: [u32; 2]) {
        if !self.scratch.filled[place] {
            let settings = self.pass.settings;
            let shear = &self.pass.projection.shear;
            self.scratch.samples[place].fill(
                settings.samples,
                settings.viewport,
                shear,
                origin,
                settings.spec.tile_px,
            );
            self.scratch.filled[place] = true;
        }
    }

    fn ask_for_quads(&mut self, triangle: &Triangle, place: usize, origin: [u32; 2]) {
        let Settings { spec, viewport, samples: source, .. } = *self.pass.settings;
        let (samples, side) = (&self.scratch.samples[place], spec.tile_px);
        let per_pixel = source.per_pixel();
        let grid = Grid::new(self.pass, &triangle.corners, triangle.moving);
        for slot in self.scratch.hits.written.iter().map(|&slot| slot as usize) {
            match spec.shading {
                Shading::Cached => self.scratch.quads.ask(grid.cell(samples, slot, origin, side), 0),
                Shading::PerSample => {
                    let index =
                        samples.in_image(slot, origin, side, viewport, per_pixel) % per_pixel as usize;
                    self.scratch.quads.ask(own_pixel(samples, slot, origin, side), index as u16);
                }
            }
        }
        let first = self.log.quads.len();
        self.scratch.quads.drain_into(&mut self.log.quads);
        if spec.shading == Shading::PerSample {
            // Samples are shaded pixel by pixel rather than in the order of time.
            self.log.quads[first..]
                .sort_unstable_by_key(|access| (access.quad[1], access.quad[0], access.sample));
        }
    }

    fn record(&mut self, triangle: &Triangle, origin: [u32; 2]) {
        let hits = &self.scratch.hits;
        self.log.work.push(Work {
            triangle: triangle.id,
            tile: Bin::tile_number(self.pass, origin),
            tests: std::mem::take(&mut self.tests),
            screened: hits.screened,
            screen_madds: hits.screened * traversal::screen_madds(triangle.moving, self.pass.lens),
            tested: hits.tested,
            hit: hits.hit,
            written: hits.written.len() as u32,
            sample_madds: hits.tested * sample_test::madds(triangle.moving, self.pass.lens),
            read_pixels: hits.read_pixels,
            written_pixels: hits.written_pixels,
            quads_end: self.log.quads.len() as u32,
        });
    }

    /// Tile tests that led to no packet of their own travel in one at the end.
    pub fn finish(mut self) -> BinLog {
        if !self.tests.is_empty() {
            let tile = Bin::tile_number(self.pass, self.bin.origin);
            let quads_end = self.log.quads.len() as u32;
            self.log.work.push(Work {
                triangle: u32::MAX,
                tile,
                tests: self.tests,
                quads_end,
                ..Work::default()
            });
        }
        self.log
    }
}
