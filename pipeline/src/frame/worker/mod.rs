//! One worker at one bin: each triangle through the tile tests, the samples and the shading grid.

use super::bin::Bin;
use super::counters::{BinLog, SamplesHere, TestsHere, TileWork, Work};
use super::pass::Pass;
use super::surface::{Grid, own_pixel};
use super::tile_tests::{Left, Place, Run, Subject};
use super::vertices::Ready;
use super::{Settings, Shading};
use crate::depth::{Bounder, BoxGrid, DepthTile};
use crate::geometry::Shear;
use crate::sample_test::{self, Hits, Target, test_screened};
use crate::sampling::TileSamples;
use crate::setup::{PixelRect, Triangle};
use crate::shading::QuadSet;
use crate::traversal::{self, Box5, TileRect};

mod compress;
mod gain;
mod in_sight;

use gain::Gain;

/// Memory a worker uses over and over.
#[derive(Default)]
pub(super) struct Scratch {
    /// The samples of the bin's tiles, filled on first use.
    samples: Vec<TileSamples>,
    filled: Vec<bool>,
    /// The same as through a pinhole, for triangles that are drawn in focus.
    sharp: Vec<TileSamples>,
    sharpened: Vec<bool>,
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
        let Scratch { samples, filled, sharp, sharpened, .. } = scratch;
        for (tiles, flags) in [(samples, filled), (sharp, sharpened)] {
            tiles.resize_with(bin.tiles.len(), TileSamples::default);
            flags.clear();
            flags.resize(bin.tiles.len(), false);
        }
        let grid = pass.depth_grid();
        Self { pass, bin, scratch, log: BinLog::default(), tests: TileWork::default(), grid, bounder: None }
    }

    /// Rasterizes the `listed` triangles of a batch.
    pub fn rasterize(mut self, batch: &[Ready], listed: &[u32]) -> BinLog {
        for &index in listed {
            self.triangle(&batch[index as usize]);
        }
        self.finish()
    }

    /// One triangle through the tiles of the bin.
    fn triangle(&mut self, ready: &Ready) {
        let (side, coarse) = (self.pass.settings.spec.tile_px, self.pass.settings.spec.coarse_tile_px);
        let subject = self.subject(ready);
        let [x0, y0] = self.bin.origin;
        let here = ready.pixels.intersection(&PixelRect { x0, y0, x1: x0 + coarse, y1: y0 + coarse });
        let tiles = here.tiles(side);
        self.tests.coarse_visited += 1;
        let count = (tiles.x1 - tiles.x0) * (tiles.y1 - tiles.y0);
        let place = Place {
            rect: TileRect::new(self.pass.settings.viewport, self.bin.origin, coarse),
            tiles: Some(count),
            samples: count * self.samples_of_a_tile(),
        };
        let Some(left) = subject.test(&place, &Left::all(ready.within), &mut self.run()) else { return };
        for row in tiles.y0..tiles.y1 {
            for column in tiles.x0..tiles.x1 {
                let before = (self.tests, self.log.work.len());
                self.tests.visited += 1;
                self.fine(&subject, &left, [column * side, row * side]);
                if self.pass.heat {
                    self.note_tests(before, [column * side, row * side]);
                }
            }
        }
    }

    fn samples_of_a_tile(&self) -> u32 {
        self.pass.settings.spec.tile_px.pow(2) * self.pass.settings.samples.per_pixel()
    }

    fn run(&mut self) -> Run<'_> {
        let features = &self.pass.settings.spec.features;
        Run { features, work: &mut self.tests, judge: &mut self.bin.judge }
    }

    fn subject<'r>(&self, ready: &'r Ready) -> Subject<'r>
    where
        'a: 'r,
    {
        let shear = &self.pass.projection.shear;
        Subject { triangle: &ready.triangle, lines: ready.lines.as_ref(), shear }
    }

    /// Notes where tile tests were done, for heat maps. They are in the packet that was made since, or wait for the next.
    fn note_tests(&mut self, (before, packets): (TileWork, usize), origin: [u32; 2]) {
        let place = self.place(origin);
        let after = self.log.work[packets..].last().map_or(self.tests, |work| work.tests);
        self.log.tests.resize(self.bin.tiles.len(), TestsHere::default());
        self.log.tests[place].add(&before, &after);
    }

    /// One triangle in one tile; `auto` learns what that takes where nothing is hit.
    fn fine(&mut self, subject: &Subject<'_>, left: &Left, origin: [u32; 2]) {
        if !self.pass.settings.spec.features.auto {
            return self.tile(subject, left, origin);
        }
        let before = (self.tests.tile_madds(), self.log.work.len());
        self.tile(subject, left, origin);
        let packet = self.log.work[before.1..].last();
        let madds = packet.map_or(self.tests.tile_madds(), |work| {
            work.tests.tile_madds() + work.screen_madds + work.sample_madds
        });
        self.bin.judge.learn_tile(madds.saturating_sub(before.0), packet.is_none_or(|work| work.hit == 0));
    }

    /// One triangle in one tile, as far as the tests let it.
    fn tile(&mut self, subject: &Subject<'_>, left: &Left, origin: [u32; 2]) {
        let rect = TileRect::new(self.pass.settings.viewport, origin, self.pass.settings.spec.tile_px);
        let tile = Place { rect, tiles: None, samples: self.samples_of_a_tile() };
        let Some(mut left) = subject.test(&tile, left, &mut self.run()) else { return };
        let place = self.place(origin);
        self.fill(place, origin, left.within.lens);
        if let Some((within, in_front)) = self.in_sight(subject.triangle, &tile.rect, &left.within, place) {
            if within != left.within {
                let Some(rest) = left.narrowed(within) else { return };
                left = rest;
            }
            let tested = self.samples(subject, &tile, &mut left, place);
            if self.scratch.hits.screened + self.scratch.hits.tested > 0 {
                if !self.pass.is_depth_only() {
                    self.ask_for_quads(subject.triangle, place, origin);
                }
                let small = self.small_pixels(subject.triangle, place, origin);
                self.record(subject.triangle.id, (tested, small), in_front, origin);
            }
        }
    }

    /// The samples of a tile in each piece of the time that is left. Says in which dimensions they were tested.
    fn samples(&mut self, subject: &Subject<'_>, tile: &Place, left: &mut Left, place: usize) -> [bool; 2] {
        let screened = subject.wants_screen(tile, left, &mut self.run());
        left.screened = screened;
        let Scratch { samples, sharp, hits, .. } = &mut *self.scratch;
        let drawn_sharp = self.pass.lens && !left.within.lens;
        let samples = if drawn_sharp { &sharp[place] } else { &samples[place] };
        let grid = self.grid;
        let stored = self.bin.tiles[place].get_or_insert_with(|| DepthTile::cleared(grid, samples));
        if self.pass.heat {
            hits.by_pixel.get_or_insert_default();
        }
        hits.clear();
        let mut target = Target { depth: &mut stored.depth, triangle: &mut stored.triangle };
        let (times, near) = (left.times, self.pass.projection.near);
        let (triangle, within) = unclipped(subject.triangle, left.within);
        let mut gain = Gain::default();
        for piece in times.pieces() {
            let within = Box5 { t: piece.t, ..within };
            let screen = screened.then(|| subject.screen(&tile.rect, left, piece, &mut self.tests));
            let features = &self.pass.settings.spec.features;
            let mut run = Run { features, work: &mut self.tests, judge: &mut self.bin.judge };
            let screen = screen.filter(|screen| subject.pays(screen, within.lens, &mut run));
            let before = [hits.screened, hits.tested];
            test_screened(&triangle, samples, &within, screen.as_ref(), near, &mut target, hits);
            if features.auto {
                let did = [hits.screened - before[0], hits.tested - before[1]];
                gain.add(did, screen.as_ref(), &mut self.bin.judge);
            }
        }
        if self.pass.settings.spec.features.auto {
            gain.learn(hits, [triangle.moving, within.lens], left, &mut self.bin.judge);
        }
        if !hits.written.is_empty() {
            let lowered = stored.wrote(&hits.written);
            self.tests.z_min_updates += if self.pass.settings.spec.depth.z_min { lowered } else { 0 };
        }
        [triangle.moving, within.lens]
    }

    /// The place of the tile at `origin` in the bin.
    fn place(&self, origin: [u32; 2]) -> usize {
        let side = self.pass.settings.spec.tile_px;
        let [column, row] = [0, 1].map(|axis| (origin[axis] - self.bin.origin[axis]) / side);
        (row * Bin::tiles_across(self.pass) + column) as usize
    }

    fn fill(&mut self, place: usize, origin: [u32; 2], lens: bool) {
        let (settings, shear) = (self.pass.settings, &self.pass.projection.shear);
        let Scratch { samples, filled, sharp, sharpened, .. } = &mut *self.scratch;
        let fill = |tile: &mut TileSamples, shear: &Shear, filled: &mut bool| {
            if !std::mem::replace(filled, true) {
                tile.fill(settings.samples, settings.viewport, shear, origin, settings.spec.tile_px);
            }
        };
        fill(&mut samples[place], shear, &mut filled[place]);
        if self.pass.lens && !lens {
            fill(&mut sharp[place], &shear.sharp(), &mut sharpened[place]);
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

    fn record(
        &mut self,
        triangle: u32,
        ([moving, lens], small_pixels): ([bool; 2], [u64; 2]),
        in_front: bool,
        origin: [u32; 2],
    ) {
        let place = self.place(origin);
        let hits = &self.scratch.hits;
        if let Some(found) = hits.by_pixel.as_deref().filter(|_| self.pass.heat) {
            let madds = [traversal::screen_madds(moving, lens), sample_test::madds(moving, lens)];
            self.log.samples.resize(self.bin.tiles.len(), None);
            self.log.samples[place].get_or_insert_with(SamplesHere::new).add(found, madds);
        }
        self.log.work.push(Work {
            triangle,
            tile: Bin::tile_number(self.pass, origin),
            tests: std::mem::take(&mut self.tests),
            screened: hits.screened,
            screen_madds: hits.screened * traversal::screen_madds(moving, lens),
            tested: hits.tested,
            hit: hits.hit,
            unread: if in_front { hits.hit } else { 0 },
            written: hits.written.len() as u32,
            sample_madds: hits.tested * sample_test::madds(moving, lens),
            read_pixels: hits.read_pixels,
            written_pixels: hits.written_pixels,
            small_pixels,
            quads_end: self.log.quads.len() as u32,
        });
    }

    /// Tile tests that led to no packet of their own travel in one at the end.
    fn finish(mut self) -> BinLog {
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

/// The triangle and the box as the sample test has to take them: it looks at the time of samples where the triangle moves and at their place
/// on the lens where there is one, so a clip plane asks for either.
fn unclipped(triangle: &Triangle, within: Box5) -> (Triangle, Box5) {
    let whole = Box5::whole(true);
    let clipped_t = within.t[0] > whole.t[0] || within.t[1] < whole.t[1];
    let clipped_lens = [within.u, within.v].iter().any(|[lo, hi]| *lo > -1.0 || *hi < 1.0);
    let triangle = Triangle { moving: triangle.moving || clipped_t, ..*triangle };
    (triangle, Box5 { lens: within.lens || clipped_lens, ..within })
}
