//! Bins: coarse tiles, each rasterized by one worker, triangle by triangle through its fine tiles.

use super::counters::{BinLog, TileWork, Work};
use super::pass::Pass;
use super::surface::Grid;
use super::vertices::Ready;
use crate::depth::{DepthTile, interval_madds, nearest};
use crate::sample_test::{self, Hits, Target, test_run};
use crate::sampling::TileSamples;
use crate::setup::{PixelRect, Triangle};
use crate::shading::QuadSet;
use crate::traversal::{self, Box5, StillEdges, TileRect, narrow};

/// A coarse tile of the image and what its samples see.
pub(super) struct Bin {
    /// Its first pixel.
    pub origin: [u32; 2],
    /// Its fine tiles, row by row; those outside the image are there and stay untouched.
    pub tiles: Vec<Option<DepthTile>>,
}

/// Memory a worker uses over and over.
#[derive(Default)]
pub(super) struct Scratch {
    /// The samples of the bin's tiles, filled on first use.
    samples: Vec<TileSamples>,
    filled: Vec<bool>,
    hits: Hits,
    quads: QuadSet,
}

impl Bin {
    /// The cleared bins of an image, row by row.
    pub fn all(pass: &Pass<'_>) -> Vec<Self> {
        let (viewport, coarse) = (pass.settings.viewport, pass.settings.spec.coarse_tile_px);
        let tiles = Self::tiles_across(pass).pow(2) as usize;
        let [across, down] = [viewport.width(), viewport.height()].map(|side| side.div_ceil(coarse));
        (0..across * down)
            .map(|bin| Self {
                origin: [bin % across * coarse, bin / across * coarse],
                tiles: vec![None; tiles],
            })
            .collect()
    }

    fn tiles_across(pass: &Pass<'_>) -> u32 {
        pass.settings.spec.coarse_tile_px / pass.settings.spec.tile_px
    }

    /// The first pixel of fine tile `place` of the bin.
    pub fn tile_origin(&self, pass: &Pass<'_>, place: usize) -> [u32; 2] {
        let (across, side) = (Self::tiles_across(pass), pass.settings.spec.tile_px);
        [self.origin[0] + place as u32 % across * side, self.origin[1] + place as u32 / across * side]
    }

    /// The number of the fine tile at `origin` in the whole image.
    pub fn tile_number(pass: &Pass<'_>, origin: [u32; 2]) -> u32 {
        let side = pass.settings.spec.tile_px;
        origin[1] / side * pass.tiles_across() + origin[0] / side
    }

    /// The tiles that lie in the image: number, place in the bin, pixels that do, and whether any triangle came near.
    pub fn inside(&self, pass: &Pass<'_>) -> impl Iterator<Item = (u32, usize, u64, bool)> {
        let (viewport, side) = (pass.settings.viewport, pass.settings.spec.tile_px);
        self.tiles.iter().enumerate().filter_map(move |(place, tile)| {
            let [x, y] = self.tile_origin(pass, place);
            let [columns, rows] = [viewport.width().saturating_sub(x), viewport.height().saturating_sub(y)];
            let [columns, rows] = [columns.min(side), rows.min(side)];
            let row = (1_u64 << columns) - 1;
            let pixels = (0..rows).fold(0_u64, |mask, r| mask | row << (r * side));
            (pixels != 0).then(|| (Self::tile_number(pass, [x, y]), place, pixels, tile.is_some()))
        })
    }

    /// Rasterizes the listed triangles of a batch.
    pub fn rasterize(
        &mut self,
        pass: &Pass<'_>,
        ready: &[Ready],
        list: &[u32],
        scratch: &mut Scratch,
    ) -> BinLog {
        scratch.samples.resize_with(self.tiles.len(), TileSamples::default);
        scratch.filled.clear();
        scratch.filled.resize(self.tiles.len(), false);
        let mut worker =
            Worker { pass, bin: self, scratch, log: BinLog::default(), tests: TileWork::default() };
        for &index in list {
            worker.triangle(&ready[index as usize]);
        }
        worker.finish()
    }
}

/// The triangles of each bin, in order: those whose pixels meet it.
pub(super) fn distribute(pass: &Pass<'_>, ready: &[Ready]) -> Vec<Vec<u32>> {
    let (viewport, coarse) = (pass.settings.viewport, pass.settings.spec.coarse_tile_px);
    let [across, down] = [viewport.width(), viewport.height()].map(|side| side.div_ceil(coarse));
    let mut lists = vec![Vec::new(); (across * down) as usize];
    for (index, Ready { pixels, .. }) in ready.iter().enumerate() {
        let bins = pixels.tiles(coarse);
        for row in bins.y0..bins.y1 {
            for column in bins.x0..bins.x1 {
                lists[(row * across + column) as usize].push(index as u32);
            }
        }
    }
    lists
}

struct Worker<'a, 'p> {
    pass: &'a Pass<'p>,
    bin: &'a mut Bin,
    scratch: &'a mut Scratch,
    log: BinLog,
    tests: TileWork,
}

impl Worker<'_, '_> {
    fn triangle(&mut self, Ready { triangle, pixels }: &Ready) {
        let (side, coarse) = (self.pass.settings.spec.tile_px, self.pass.settings.spec.coarse_tile_px);
        self.tests.coarse_visited += 1;
        let Some(within) = self.tile_test(triangle, None, self.bin.origin, coarse) else { return };
        let edges = (!triangle.moving && !self.pass.lens && self.pass.settings.spec.features.edges)
            .then(|| StillEdges::new(triangle));
        self.tests.tile_madds += if edges.is_some() { StillEdges::SETUP_MADDS } else { 0 };
        let [x0, y0] = self.bin.origin;
        let here = pixels.intersection(&PixelRect { x0, y0, x1: x0 + coarse, y1: y0 + coarse });
        let tiles = here.tiles(side);
        for row in tiles.y0..tiles.y1 {
            for column in tiles.x0..tiles.x1 {
                let origin = [column * side, row * side];
                self.tests.visited += 1;
                if let Some(within) =
                    self.tile_test(triangle, edges.as_ref(), origin, side).map(|b| b.intersect(&within))
                {
                    self.tile(triangle, &within, origin);
                }
            }
        }
    }

    /// The part of lens and time in which the triangle may touch the tile of `side` pixels at `origin`.
    fn tile_test(
        &mut self,
        triangle: &Triangle,
        edges: Option<&StillEdges>,
        origin: [u32; 2],
        side: u32,
    ) -> Option<Box5> {
        let rect = TileRect::new(self.pass.settings.viewport, origin, side);
        if let Some(edges) = edges {
            self.tests.tile_madds += StillEdges::TILE_MADDS;
            if edges.miss(&rect) {
                self.tests.culled_edges += 1;
                return None;
            }
        }
        let whole = Box5::whole(self.pass.lens);
        let plain = !triangle.moving && !self.pass.lens && !triangle.behind;
        if plain || !self.pass.settings.spec.features.side_planes {
            return Some(whole);
        }
        self.tests.tile_madds += traversal::madds(triangle.moving, self.pass.lens);
        let within = narrow(triangle, &self.pass.projection.shear, &rect, &whole);
        self.tests.culled_sides += u32::from(within.is_none());
        within
    }

    fn tile(&mut self, triangle: &Triangle, within: &Box5, origin: [u32; 2]) {
        let spec = self.pass.settings.spec;
        let across = spec.coarse_tile_px / spec.tile_px;
        let [column, row] = [0, 1].map(|axis| (origin[axis] - self.bin.origin[axis]) / spec.tile_px);
        let place = (row * across + column) as usize;
        self.fill(place, origin);
        let samples = &self.scratch.samples[place];
        let stored = self.bin.tiles[place].get_or_insert_with(|| DepthTile::cleared(samples.len));
        if spec.features.z_max {
            let (farthest, updated) = stored.farthest();
            self.tests.z_tests += 1;
            self.tests.z_updates += u32::from(updated);
            self.tests.interval_madds += interval_madds(triangle.moving);
            if nearest(triangle, within.t) > farthest {
                self.tests.z_culled += 1;
                return;
            }
        }
        let hits = &mut self.scratch.hits;
        hits.clear();
        let mut target = Target { depth: &mut stored.depth, triangle: &mut stored.triangle };
        test_run(triangle, samples, within, self.pass.projection.near, &mut target, hits);
        if !hits.written.is_empty() {
            stored.touch();
        }
        if hits.tested > 0 {
            self.ask_for_quads(triangle, place, origin);
            self.record(triangle, origin);
        }
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

    fn record(&mut self, triangle: &Triangle, origin: [u32; 2]) {
        let hits = &self.scratch.hits;
        self.log.work.push(Work {
            triangle: triangle.id,
            tile: Bin::tile_number(self.pass, origin),
            tests: std::mem::take(&mut self.tests),
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
    fn finish(mut self) -> BinLog {
        if !self.tests.is_empty() {
            self.log.work.push(Work {
                triangle: u32::MAX,
                tile: Bin::tile_number(self.pass, self.bin.origin),
                tests: self.tests,
                tested: 0,
                hit: 0,
                written: 0,
                sample_madds: 0,
                read_pixels: 0,
                written_pixels: 0,
                quads_end: self.log.quads.len() as u32,
            });
        }
        self.log
    }
}
