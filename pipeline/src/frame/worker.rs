//! One worker at one bin: each triangle through the tile tests, the samples and the shading grid.

use super::bin::Bin;
use super::counters::{BinLog, TileWork, Work};
use super::pass::Pass;
use super::surface::Grid;
use super::vertices::Ready;
use crate::depth::{Bounder, BoxGrid, DepthTile, Visible, interval_madds, set_up_madds};
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
    /// How lens and time are divided for depth culling.
    grid: BoxGrid,
    /// What is known of the depth of one triangle.
    bounder: Option<(u32, Bounder)>,
}

impl<'a, 'p> Worker<'a, 'p> {
    pub fn new(pass: &'a Pass<'p>, bin: &'a mut Bin, scratch: &'a mut Scratch) -> Self {
        scratch.samples.resize_with(bin.tiles.len(), TileSamples::default);
        scratch.filled.clear();
        scratch.filled.resize(bin.tiles.len(), false);
        let grid = pass.depth_grid();
        Self { pass, bin, scratch, log: BinLog::default(), tests: TileWork::default(), grid, bounder: None }
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
                self.tests.visited += 1;
                self.tile(triangle, &within, [column * side, row * side]);
            }
        }
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
        if let Some((within, in_front)) = self.in_sight(triangle, &rect, &within, place) {
            self.samples(triangle, &within, screen.as_ref(), place);
            if self.scratch.hits.screened + self.scratch.hits.tested > 0 {
                self.ask_for_quads(triangle, place, origin);
                self.record(triangle, origin, in_front);
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

    /// Where the depths stored in the tile leave the triangle to be seen, and whether none of them has to be read for it.
    fn in_sight(
        &mut self,
        triangle: &Triangle,
        rect: &TileRect,
        within: &Box5,
        place: usize,
    ) -> Option<(Box5, bool)> {
        let (features, depth) = (&self.pass.settings.spec.features, &self.pass.settings.spec.depth);
        if !features.z_max && !depth.z_min {
            return Some((*within, false));
        }
        self.prepare(triangle);
        let mut visible = Visible::unknown(within);
        if let (Some((_, bounder)), Some(tile)) = (&self.bounder, &mut self.bin.tiles[place]) {
            self.tests.z_updates += if features.z_max { tile.renew() } else { 0 };
            visible = tile.boxes.look(within, |part| bounder.over(rect, part));
        }
        self.tests.z_tests += visible.compared;
        self.tests.interval_madds +=
            visible.compared * interval_madds(depth.bound, triangle.moving, self.pass.lens);
        if !features.z_max {
            return Some((*within, visible.in_front && visible.behind == 0));
        }
        self.tests.boxes_culled += visible.behind;
        self.tests.z_culled += u32::from(visible.within.is_none());
        // The sample test takes a still triangle at all times.
        let time = |rest: Box5| Box5 { t: if triangle.moving { rest.t } else { within.t }, ..rest };
        let front = depth.z_min && visible.in_front && (triangle.moving || visible.behind == 0);
        visible.within.map(|rest| (time(rest), front))
    }

    /// Finds what is known of the depth of a triangle, once in a bin.
    fn prepare(&mut self, triangle: &Triangle) {
        if self.bounder.as_ref().is_none_or(|(id, _)| *id != triangle.id) {
            let bound = self.pass.settings.spec.depth.bound;
            self.tests.interval_madds += set_up_madds(bound, triangle.moving);
            self.bounder = Some((triangle.id, Bounder::new(triangle, &self.pass.projection.shear, bound)));
        }
    }

    fn samples(&mut self, triangle: &Triangle, within: &Box5, screen: Option<&Screen>, place: usize) {
        let samples = &self.scratch.samples[place];
        let grid = self.grid;
        let stored = self.bin.tiles[place].get_or_insert_with(|| DepthTile::cleared(grid, samples));
        let hits = &mut self.scratch.hits;
        hits.clear();
        let mut target = Target { depth: &mut stored.depth, triangle: &mut stored.triangle };
        test_screened(triangle, samples, within, screen, self.pass.projection.near, &mut target, hits);
        if !hits.written.is_empty() {
            let lowered = stored.wrote(&hits.written);
            self.tests.z_min_updates += if self.pass.settings.spec.depth.z_min { lowered } else { 0 };
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
        let samples = &self.scratch.samples[place];
        let grid = Grid::new(self.pass, &triangle.corners, triangle.moving);
        for &slot in &self.scratch.hits.written {
            self.scratch.quads.ask(grid.cell(
                samples,
                slot as usize,
                origin,
                self.pass.settings.spec.tile_px,
            ));
        }
        self.scratch.quads.drain_into(&mut self.log.quads);
    }

    fn record(&mut self, triangle: &Triangle, origin: [u32; 2], in_front: bool) {
        let hits = &self.scratch.hits;
        self.log.work.push(Work {
            triangle: triangle.id,
            tile: Bin::tile_number(self.pass, origin),
            tests: std::mem::take(&mut self.tests),
            screened: hits.screened,
            screen_madds: hits.screened * traversal::screen_madds(triangle.moving, self.pass.lens),
            tested: hits.tested,
            hit: hits.hit,
            unread: if in_front { hits.hit } else { 0 },
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
