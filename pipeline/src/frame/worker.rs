//! Worker: rasterizes the triangles of one bin, through tile tests, sample tests and the shading grid.

use activity::Packet;

use super::bin::Bin;
use super::bin::{BinLog, SamplesHere, TestsHere, TileWork, Work};
use super::cells::{Grid, own_pixel};
use super::fragments::{FragmentTests, Fragments};
use super::pass::Pass;
use super::test_selection::TestSelector;
use super::tile_tests::{Remaining, Subject, TestContext, TestTile};
use super::{Ready, Settings, Shading};
use crate::depth::{Bounder, DepthTile, Visible, interval_madds, set_up_madds};
use crate::geometry::Shear;
use crate::memory::depths_fit;
use crate::sample_test::{Hits, SampleTest, StoredSamples, VectorWidth};
use crate::sampling::TileSamples;
use crate::setup::{Corner, PixelRect, Triangle};
use crate::shading::QuadSet;
use crate::state::DrawState;
use crate::tally::Costs;
use crate::traversal::{Box5, Screen, TileRect};
use crate::{sample_test, traversal};

/// Memory reused by a worker.
#[derive(Default)]
pub(super) struct Scratch {
    /// Samples of the bin's tiles, filled on first use.
    samples: Vec<TileSamples>,
    filled: Vec<bool>,
    /// The same samples through a pinhole, for triangles drawn in focus.
    sharp: Vec<TileSamples>,
    sharpened: Vec<bool>,
    hits: Hits,
    fragments: Fragments,
    /// Cells of the shaded samples of a packet.
    cells: Vec<[i32; 2]>,
    quads: QuadSet,
    /// Multiply-adds of depth intervals.
    costs: Costs,
}

/// A worker with its results so far.
pub(super) struct BinWorker<'a, 'p> {
    pass: &'a Pass<'p>,
    bin: &'a mut Bin,
    scratch: &'a mut Scratch,
    log: BinLog,
    /// Draw of the current triangle.
    draw: u32,
    /// Entries of the list that were read.
    listed: u32,
    /// Tile tests since the last packet.
    tests: TileWork,
    /// Depth bounds of the current triangle.
    bounder: Option<(u32, Bounder)>,
}

impl<'a, 'p> BinWorker<'a, 'p> {
    pub fn new(pass: &'a Pass<'p>, bin: &'a mut Bin, scratch: &'a mut Scratch) -> Self {
        let Scratch { samples, filled, sharp, sharpened, .. } = scratch;
        for (tiles, flags) in [(samples, filled), (sharp, sharpened)] {
            tiles.resize_with(bin.tiles.len(), TileSamples::default);
            flags.clear();
            flags.resize(bin.tiles.len(), false);
        }
        if pass.settings.spec.depth.bound.has_planes() {
            scratch.costs.remember();
        }
        let (log, tests) = (BinLog::default(), TileWork::default());
        Self { pass, bin, scratch, log, draw: Packet::NONE, listed: 0, tests, bounder: None }
    }

    /// Rasterize the `listed` triangles of a batch.
    pub fn rasterize(mut self, batch: &[Ready], listed: &[u32]) -> BinLog {
        // About as many packets as triangles; logs that grow are copied.
        self.log.work.reserve(listed.len());
        for &index in listed {
            let ready = &batch[index as usize];
            let draw = self.pass.locate(ready.triangle.id).0 as u32;
            if draw != self.draw {
                self.record_tests();
                self.draw = draw;
                if self.pass.shading_waits() && self.pass.shades_in_order(draw) {
                    self.shade_waiting();
                }
            }
            self.listed += 1;
            self.triangle(ready);
        }
        self.record_tests();
        self.log
    }

    /// Rasterize one triangle in the tiles of the bin.
    fn triangle(&mut self, ready: &Ready) {
        let (side, coarse) = (self.pass.settings.spec.tile_px, self.pass.settings.spec.coarse_tile_px);
        let subject = self.subject(ready);
        let [x0, y0] = self.bin.origin;
        let here = ready.pixels.intersection(&PixelRect { x0, y0, x1: x0 + coarse, y1: y0 + coarse });
        let tiles = here.tiles(side);
        self.tests.coarse_visited += 1;
        let count = (tiles.x1 - tiles.x0) * (tiles.y1 - tiles.y0);
        let coarse_tile = TestTile {
            rect: TileRect::new(self.pass.settings.viewport, self.bin.origin, coarse),
            tiles: Some(count),
            samples: count * self.samples_of_a_tile(),
        };
        let mut remaining = Remaining::all(ready.within);
        let is_left = remaining
            .keep_regions(self.pass.spans.as_ref())
            .and_then(|()| subject.test(&coarse_tile, &mut remaining, &mut self.context()));
        if is_left.is_none() {
            return;
        }
        for row in tiles.y0..tiles.y1 {
            for column in tiles.x0..tiles.x1 {
                let before = self.pass.heat.then_some((self.tests, self.log.work.len()));
                self.tests.visited += 1;
                self.fine(&subject, &remaining, [column * side, row * side]);
                if let Some(before) = before {
                    self.note_tests(before, [column * side, row * side]);
                }
            }
        }
    }

    fn samples_of_a_tile(&self) -> u32 {
        self.pass.settings.spec.tile_px.pow(2) * self.pass.settings.samples.per_pixel()
    }

    fn context(&mut self) -> TestContext<'_> {
        let features = &self.pass.settings.spec.features;
        TestContext { features, work: &mut self.tests, selector: &mut self.bin.selector }
    }

    fn subject<'r>(&self, ready: &'r Ready) -> Subject<'r>
    where
        'a: 'r,
    {
        let shear = &self.pass.projection.shear;
        Subject { triangle: &ready.triangle, lines: ready.lines.as_ref(), shear, image: ready.image }
    }

    /// Record tile tests by tile, for heat maps. They are in the packet made since, or wait for the next one.
    fn note_tests(&mut self, (before, packets): (TileWork, usize), origin: [u32; 2]) {
        let index = self.tile_index(origin);
        let after = self.tested_since(packets).map_or(self.tests, |work| work.tests);
        self.log.tests.resize(self.bin.tiles.len(), TestsHere::default());
        self.log.tests[index].add(&before, &after);
    }

    /// The last packet of a triangle after a number of packets.
    fn tested_since(&self, packets: usize) -> Option<&Work> {
        self.log.work[packets..].last().filter(|work| work.bounded == 0)
    }

    /// Rasterize one triangle in one tile, and record the cost of tiles without hits for `auto`.
    fn fine(&mut self, subject: &Subject<'_>, remaining: &Remaining, origin: [u32; 2]) {
        if !self.pass.settings.spec.features.auto {
            return self.tile(subject, remaining, origin);
        }
        let before = (self.tests.tile_madds(), self.log.work.len());
        self.tile(subject, remaining, origin);
        let packet = self.tested_since(before.1);
        let madds = packet.map_or(self.tests.tile_madds(), |work| {
            work.tests.tile_madds() + work.screen_madds + work.sample_madds
        });
        self.bin
            .selector
            .record_tile(madds.saturating_sub(before.0), packet.is_none_or(|work| work.hit == 0));
    }

    /// Rasterize one triangle in one tile.
    fn tile(&mut self, subject: &Subject<'_>, remaining: &Remaining, origin: [u32; 2]) {
        let rect = TileRect::new(self.pass.settings.viewport, origin, self.pass.settings.spec.tile_px);
        let tile = TestTile { rect, tiles: None, samples: self.samples_of_a_tile() };
        let mut remaining = remaining.at_finer();
        if subject.test(&tile, &mut remaining, &mut self.context()).is_none() {
            return;
        }
        let index = self.tile_index(origin);
        self.fill(index, origin, remaining.within.lens);
        if let Some((within, in_front)) =
            self.visible_part(subject.triangle, &tile.rect, &remaining.within, index)
        {
            if within != remaining.within && remaining.narrow(within).is_none() {
                return;
            }
            let tested = self.samples(subject, &tile, &mut remaining, (index, origin));
            if self.scratch.hits.screened + self.scratch.hits.tested > 0 {
                self.shade_and_store(subject.triangle, index, origin);
                let small = self.small_pixels(subject.triangle, index, origin);
                self.record(subject.triangle.id, (tested, small), in_front, origin);
            }
        }
    }

    /// Test the samples of a tile in each piece of the remaining time. Returns the dimensions of the tests.
    fn samples(
        &mut self,
        subject: &Subject<'_>,
        tile: &TestTile,
        remaining: &mut Remaining,
        (index, origin): (usize, [u32; 2]),
    ) -> [bool; 2] {
        let screened = subject.wants_screen(tile, remaining, &mut self.context());
        remaining.screened = screened;
        let Scratch { samples, sharp, hits, .. } = &mut *self.scratch;
        let drawn_sharp = self.pass.lens && !remaining.within.lens;
        let samples = if drawn_sharp { &sharp[index] } else { &samples[index] };
        let pass = self.pass;
        let stored = self.bin.tiles[index].get_or_insert_with(|| pass.first_tile(samples, origin));
        if pass.heat {
            hits.by_pixel.get_or_insert_default();
        }
        if pass.is_ordered {
            hits.covered.get_or_insert_default();
        }
        hits.clear();
        let mut target = StoredSamples { depth: &mut stored.depth, triangle: &mut stored.triangle };
        let (times, near) = (remaining.times, self.pass.projection.near);
        let (triangle, within) = unclipped(subject.triangle, remaining.within);
        let mut savings = ScreenSavings::default();
        for piece in times.pieces() {
            let within = Box5 { t: piece.t, ..within };
            let screen = screened.then(|| subject.screen(&tile.rect, remaining, piece, &mut self.tests));
            let features = &self.pass.settings.spec.features;
            let mut context =
                TestContext { features, work: &mut self.tests, selector: &mut self.bin.selector };
            let screen = screen.filter(|screen| subject.pays(screen, within.lens, &mut context));
            let before = [hits.screened, hits.tested];
            for within in remaining.boxes(within) {
                let (triangle, screen, target) = (&triangle, screen.as_ref(), &mut target);
                let (image, hits) = (subject.image, &mut *hits);
                SampleTest { triangle, samples, within: &within, image, screen, near, target, hits }
                    .run(VectorWidth::widest());
            }
            if features.auto {
                let counts = [hits.screened - before[0], hits.tested - before[1]];
                savings.add(counts, screen.as_ref(), &mut self.bin.selector);
            }
        }
        if self.pass.settings.spec.features.auto {
            savings.record(hits, [triangle.moving, within.lens], remaining, &mut self.bin.selector);
        }
        [triangle.moving, within.lens]
    }

    /// Store the covered samples in passes whose order matters, where the sample test only lists them;
    /// request the quads to shade and update the depth bounds.
    fn shade_and_store(&mut self, triangle: &Triangle, index: usize, origin: [u32; 2]) {
        let state = self.state();
        let Scratch { samples, hits, fragments, .. } = &mut *self.scratch;
        let Some(tile) = &mut self.bin.tiles[index] else { return };
        if self.pass.is_ordered {
            FragmentTests::new(self.pass, triangle, &samples[index], origin).store(tile, hits, fragments);
        } else if !self.pass.is_depth_only() {
            fragments.nearest(hits);
        }
        if self.pass.shading_waits() && !self.pass.shades_in_order(self.draw) {
            fragments.wait(triangle.id, tile, hits);
        }
        if !hits.written.is_empty() {
            let lowered = tile.record_writes(&hits.written, state.may_raise_depth());
            let counts = self.pass.settings.spec.depth.z_min && tile.is_bounded;
            self.tests.z_min_updates += if counts { lowered } else { 0 };
        }
        self.request_quads((&triangle.corners, triangle.moving), index, origin);
    }

    /// State of the current draw.
    fn state(&self) -> &'a DrawState {
        &self.pass.draws[self.draw as usize].state
    }

    /// Index in the bin of the tile at `origin`.
    fn tile_index(&self, origin: [u32; 2]) -> usize {
        let side = self.pass.settings.spec.tile_px;
        let [column, row] = [0, 1].map(|axis| (origin[axis] - self.bin.origin[axis]) / side);
        (row * Bin::tiles_across(self.pass) + column) as usize
    }

    fn fill(&mut self, index: usize, origin: [u32; 2], lens: bool) {
        let (settings, shear) = (self.pass.settings, &self.pass.projection.shear);
        let Scratch { samples, filled, sharp, sharpened, .. } = &mut *self.scratch;
        let fill = |tile: &mut TileSamples, shear: &Shear, filled: &mut bool| {
            if !std::mem::replace(filled, true) {
                tile.fill(settings.samples, settings.viewport, shear, origin, settings.spec.tile_px);
            }
        };
        fill(&mut samples[index], shear, &mut filled[index]);
        if self.pass.lens && !lens {
            fill(&mut sharp[index], &shear.sharp(), &mut sharpened[index]);
        }
    }

    /// Request the quads of the shaded samples of a tile, seen on a triangle with the given corners that may
    /// be moving.
    fn request_quads(&mut self, (corners, moving): (&[Corner; 3], bool), index: usize, origin: [u32; 2]) {
        let Settings { spec, samples: source, .. } = *self.pass.settings;
        let (samples, side) = (&self.scratch.samples[index], spec.tile_px);
        let per_pixel = source.per_pixel();
        let (quads, shaded) = (&mut self.scratch.quads, &self.scratch.fragments.shaded);
        match self.pass.shading {
            Shading::Cached => {
                let cells = &mut self.scratch.cells;
                cells.clear();
                Grid::new(self.pass, (corners, moving), samples, origin).cells(shaded, cells);
                for &cell in cells.iter() {
                    quads.request(cell, 0);
                }
            }
            Shading::PerSample => {
                for slot in shaded.iter().map(|&slot| usize::from(slot)) {
                    let index = samples.in_pixel(slot, per_pixel) as u16;
                    quads.request(own_pixel(samples, slot, origin, side), index);
                }
            }
        }
        let first = self.log.quads.len();
        self.scratch.quads.drain_into(&mut self.log.quads);
        if self.pass.shading == Shading::PerSample {
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
        let (index, state) = (self.tile_index(origin), self.state());
        let (hits, fragments) = (&self.scratch.hits, &self.scratch.fragments);
        if let Some(edge_madds) = hits.by_pixel.as_deref().filter(|_| self.pass.heat) {
            let madds = [traversal::screen_madds(moving, lens), sample_test::madds(moving, lens)];
            self.log.samples.resize(self.bin.tiles.len(), None);
            self.log.samples[index].get_or_insert_with(SamplesHere::new).add(edge_madds, madds);
        }
        self.log.work.push(Work {
            draw: self.draw,
            triangle,
            tile: Bin::tile_number(self.pass, origin),
            tests: std::mem::take(&mut self.tests),
            screened: hits.screened,
            screen_madds: hits.screened * traversal::screen_madds(moving, lens),
            tested: hits.tested,
            hit: hits.hit,
            unread: if in_front { hits.hit } else { 0 },
            bounded: 0,
            written: hits.written.len() as u32 + fragments.stencils,
            coloured: fragments.coloured,
            passed: fragments.passed,
            sample_madds: hits.tested * sample_test::madds(moving, lens),
            read_pixels: if state.reads_depth() { hits.read_pixels } else { 0 },
            written_pixels: hits.written_pixels,
            coloured_pixels: fragments.coloured_pixels,
            small_pixels,
            quads_end: self.log.quads.len() as u32,
            listed_end: self.listed,
        });
    }

    /// Tile tests since the last packet of a draw become a packet of their own.
    fn record_tests(&mut self) {
        if self.tests.is_empty() {
            return;
        }
        self.log.work.push(Work {
            draw: self.draw,
            triangle: Packet::NONE,
            tile: Bin::tile_number(self.pass, self.bin.origin),
            tests: std::mem::take(&mut self.tests),
            quads_end: self.log.quads.len() as u32,
            listed_end: self.listed,
            ..Work::default()
        });
    }
}

impl BinWorker<'_, '_> {
    /// Shades what still waits after the last batch.
    pub fn shade_rest(mut self) -> BinLog {
        self.shade_waiting();
        self.log
    }

    /// Shades the samples of the bin that wait, tile by tile and triangle by triangle.
    fn shade_waiting(&mut self) {
        for index in 0..self.bin.tiles.len() {
            let Some(tile) = &mut self.bin.tiles[index] else { continue };
            let mut seen: Vec<(u32, u16)> = tile.waiting.iter().copied().zip(0..).collect();
            seen.retain(|(triangle, _)| *triangle != DepthTile::NO_TRIANGLE);
            seen.sort_unstable();
            tile.waiting.fill(DepthTile::NO_TRIANGLE);
            let origin = self.bin.tile_origin(self.pass, index);
            self.fill(index, origin, true);
            for group in seen.chunk_by(|a, b| a.0 == b.0) {
                self.shade_slots(group, index, origin);
            }
        }
    }

    /// Shades samples of a tile that see one triangle.
    fn shade_slots(&mut self, seen: &[(u32, u16)], index: usize, origin: [u32; 2]) {
        let Scratch { samples, hits, fragments, .. } = &mut *self.scratch;
        let triangle = seen[0].0;
        hits.clear();
        for &(_, slot) in seen {
            hits.written.push(slot);
            let pixel = usize::from(samples[index].pixel[usize::from(slot)]);
            hits.written_pixels |= 1 << pixel;
            if let Some(pixels) = &mut hits.by_pixel {
                pixels.written[pixel] += 1;
            }
        }
        fragments.nearest(hits);
        if let Some(pixels) = &mut hits.by_pixel {
            pixels.written = [0; 64];
            self.log.samples.resize(self.bin.tiles.len(), None);
            self.log.samples[index].get_or_insert_with(SamplesHere::new).add(pixels, [0; 2]);
        }
        let (coloured, coloured_pixels) = (fragments.coloured, fragments.coloured_pixels);
        let (corners, moving) = self.pass.moving_corners(triangle);
        self.request_quads((&corners, moving), index, origin);
        self.log.work.push(Work {
            draw: self.pass.locate(triangle).0 as u32,
            triangle,
            tile: Bin::tile_number(self.pass, origin),
            coloured,
            coloured_pixels,
            quads_end: self.log.quads.len() as u32,
            ..Work::default()
        });
    }
}

/// Triangle and box for the sample test. It reads the time of samples only for moving triangles, and their
/// lens position only with a lens, so a clip plane forces that dimension.
fn unclipped(triangle: &Triangle, within: Box5) -> (Triangle, Box5) {
    let whole = Box5::whole(true);
    let clipped_t = within.t[0] > whole.t[0] || within.t[1] < whole.t[1];
    let clipped_lens = [within.u, within.v].iter().any(|[lo, hi]| *lo > -1.0 || *hi < 1.0);
    let triangle = Triangle { moving: triangle.moving || clipped_t, ..*triangle };
    (triangle, Box5 { lens: within.lens || clipped_lens, ..within })
}

/// State of the samples of one pixel.
#[derive(Clone, Copy)]
struct Pixel {
    min: f32,
    max: f32,
    /// Cell that shades all samples so far; `None` if they differ.
    cell: Option<[i32; 2]>,
    seen: bool,
}

impl Pixel {
    const NONE: Self = Self { min: f32::INFINITY, max: 0.0, cell: None, seen: false };

    fn add(&mut self, depth: f32, cell: Option<[i32; 2]>) {
        self.min = self.min.min(depth);
        self.max = self.max.max(depth);
        self.cell = if self.seen { self.cell.filter(|_| self.cell == cell) } else { cell };
        self.seen = true;
    }
}

impl BinWorker<'_, '_> {
    /// Pixels written by `triangle` whose depths and whose colours now compress to half.
    fn small_pixels(&self, triangle: &Triangle, index: usize, origin: [u32; 2]) -> [u64; 2] {
        let Settings { spec, samples: source, .. } = *self.pass.settings;
        let (compression, written) = (spec.memory.compression, self.scratch.hits.written_pixels);
        let Some(stored) = self.bin.tiles[index].as_ref().filter(|_| compression.is_on() && written != 0)
        else {
            return [0; 2];
        };
        let samples = &self.scratch.samples[index];
        let mut grid = Grid::new(self.pass, (&triangle.corners, triangle.moving), samples, origin);
        // Stored colours may be mixed from those of several cells.
        let colours = compression.colour && self.pass.shading == Shading::Cached && !self.pass.is_ordered;
        let mut pixels = [Pixel::NONE; 64];
        for slot in 0..samples.len {
            let pixel = samples.pixel[slot] as usize;
            if written & 1 << pixel != 0 {
                let own = colours && stored.triangle[slot] == triangle.id;
                let cell = own.then(|| grid.cell(slot));
                pixels[pixel].add(stored.depth[slot], cell);
            }
        }
        let count = source.per_pixel();
        let fit = |pixel: &Pixel| {
            let depth = compression.depth && pixel.seen && depths_fit(pixel.min, pixel.max, count);
            [depth, count > 1 && pixel.cell.is_some()]
        };
        pixels.iter().enumerate().fold([0; 2], |[depth, colour], (at, pixel)| {
            let [small, same] = fit(pixel);
            [depth | u64::from(small) << at, colour | u64::from(same) << at]
        })
    }
}

/// Savings of screens in a tile, for the test selector.
#[derive(Default)]
struct ScreenSavings {
    /// Samples considered.
    samples: u32,
    screened: u32,
    taken: u32,
}

impl ScreenSavings {
    /// Add a piece of the time: the numbers of samples screened and tested.
    pub fn add(
        &mut self,
        [screened, tested]: [u32; 2],
        screen: Option<&Screen>,
        selector: &mut TestSelector,
    ) {
        let Some(screen) = screen else {
            self.samples += tested;
            return;
        };
        self.samples += screened;
        self.screened += screened;
        self.taken += screened - tested;
        if screened > 0 {
            let share = f64::from(screened - tested) / f64::from(screened);
            selector.record_screen(screen.gain(), share, f64::from(screened));
        }
    }

    /// Record the cost in these dimensions and the savings of all pieces.
    pub fn record(
        &self,
        hits: &Hits,
        [moving, lens]: [bool; 2],
        remaining: &Remaining,
        selector: &mut TestSelector,
    ) {
        let (test_madds, cost) = (sample_test::madds(moving, lens), traversal::screen_madds(moving, lens));
        if remaining.screened {
            let saved = f64::from(self.taken * test_madds) - f64::from(self.screened * cost);
            let share = saved / f64::from((self.samples * test_madds).max(1));
            selector.record_set_up(share, f64::from(self.samples));
        }
        let madds = hits.screened * cost + hits.tested * test_madds;
        let on_hits = hits.hit * test_madds + hits.hit.min(hits.screened) * cost;
        let misses = [self.samples - hits.hit, madds.saturating_sub(on_hits)];
        selector.record_samples(remaining.facing, misses, [self.samples, madds]);
    }
}

impl BinWorker<'_, '_> {
    /// Part of lens and time that stored depths leave visible in the tile, and whether no stored depth has to
    /// be read for it. `None` if the triangle is hidden.
    fn visible_part(
        &mut self,
        triangle: &Triangle,
        rect: &TileRect,
        within: &Box5,
        index: usize,
    ) -> Option<(Box5, bool)> {
        let (features, depth) = (&self.pass.settings.spec.features, &self.pass.settings.spec.depth);
        let state = self.state();
        if !state.reads_depth() {
            return Some((*within, true));
        }
        let culls = features.z_max && state.fails_without_effect();
        let skips_reads = depth.z_min && state.may_skip_reads();
        if !culls && !skips_reads {
            return Some((*within, false));
        }
        if !self.wants_depth(triangle, within, index) {
            return Some((*within, false));
        }
        self.prepare(triangle);
        let stored = &self.pass.depth;
        if stored.is_loaded() {
            self.bound_loaded(triangle.id, index);
        }
        let Some((_, bounder)) = &self.bounder else { return Some((*within, false)) };
        let mut interval = |part: &Box5| {
            let (depths, madds) = bounder.over_counted(rect, part, Some(&self.scratch.costs));
            self.tests.interval_madds += madds;
            depths.map(|depth| stored.round_depth(depth))
        };
        let visible = if let Some(tile) = &mut self.bin.tiles[index] {
            self.tests.z_updates += if features.z_max { tile.update() } else { 0 };
            tile.boxes.compare(within, state.depth.test, culls, interval)
        } else {
            interval(within);
            Visible::in_cleared(within, state.depth.test, self.pass.clear.depth)
        };
        self.tests.z_tests += visible.compared;
        if features.auto {
            self.record_depth(triangle, within, &visible);
        }
        if !culls {
            return Some((*within, skips_reads && visible.in_front && visible.behind == 0));
        }
        self.tests.boxes_culled += visible.behind;
        self.tests.z_culled += u32::from(visible.within.is_none());
        // The sample test considers a still triangle at all times.
        let time = |part: Box5| Box5 { t: if triangle.moving { part.t } else { within.t }, ..part };
        let front = skips_reads && visible.in_front && (triangle.moving || visible.behind == 0);
        visible.within.map(|part| (time(part), front))
    }

    /// Finds the bounds of the loaded depths of a tile when they are first needed: the unit of depth reads
    /// all of them, in a packet before that of the triangle, and each is compared once, as when
    /// [`super::Gpu::gather_farthest_depths`] does it.
    fn bound_loaded(&mut self, triangle: u32, index: usize) {
        let (origin, pass) = (self.bin.tile_origin(self.pass, index), self.pass);
        let samples = &self.scratch.samples[index];
        let tile = self.bin.tiles[index].get_or_insert_with(|| pass.first_tile(samples, origin));
        if std::mem::replace(&mut tile.is_bounded, true) {
            return;
        }
        tile.update();
        let (count, boxes) = (samples.len as u32, pass.depth_grid().len() as u32);
        self.tests.z_tests += count;
        self.tests.z_updates += if pass.settings.spec.features.z_max { boxes } else { 0 };
        self.tests.z_min_updates += if pass.settings.spec.depth.z_min { boxes } else { 0 };
        self.log.work.push(Work {
            draw: self.draw,
            triangle,
            tile: Bin::tile_number(pass, origin),
            bounded: count,
            read_pixels: samples.pixel[..samples.len].iter().fold(0, |pixels, pixel| pixels | 1 << pixel),
            quads_end: self.log.quads.len() as u32,
            ..Work::default()
        });
    }

    /// Whether stored depths are expected to save more than their test costs.
    fn wants_depth(&mut self, triangle: &Triangle, within: &Box5, index: usize) -> bool {
        let (features, depth) = (&self.pass.settings.spec.features, &self.pass.settings.spec.depth);
        if !features.auto || depth.z_min {
            return true;
        }
        if self.bin.tiles[index].is_none() {
            return false;
        }
        let samples = f64::from(self.samples_of_a_tile()) * Remaining::all(*within).volume(triangle.moving);
        let selector = &mut self.bin.selector;
        let known = self.bounder.as_ref().is_some_and(|(id, _)| *id == triangle.id);
        let set_up = if known { 0 } else { set_up_madds(depth.bound, triangle.moving, within.lens) };
        let cost = interval_madds(depth.bound, triangle.moving, within.lens) + set_up;
        let test_madds = f64::from(sample_test::madds(triangle.moving, within.lens));
        let workload = samples * selector.sample_madds(test_madds);
        selector.wants_depth(f64::from(cost), workload)
    }

    fn record_depth(&mut self, triangle: &Triangle, within: &Box5, visible: &Visible) {
        let before = Remaining::all(*within).volume(triangle.moving);
        let part = visible.within.map_or(0.0, |part| Remaining::all(part).volume(triangle.moving) / before);
        let share = if part.is_finite() { 1.0 - part } else { 0.0 };
        self.bin.selector.record_depth(share, f64::from(self.samples_of_a_tile()) * before);
    }

    /// Prepare the depth bounds of the triangle, once per bin.
    fn prepare(&mut self, triangle: &Triangle) {
        if self.bounder.as_ref().is_none_or(|(id, _)| *id != triangle.id) {
            let (bound, shear) = (self.pass.settings.spec.depth.bound, &self.pass.projection.shear);
            let (bounder, madds) = Bounder::counted(triangle, shear, bound, Some(&self.scratch.costs));
            self.tests.interval_madds += madds;
            self.bounder = Some((triangle.id, bounder));
        }
    }
}
