//! Where in the image events happen.

use activity::{Event, Packet, PacketKind, Unit};

use super::bin::Bin;
use super::counters::{BinLog, SamplesHere};
use super::pass::Pass;

/// How often an event happened in each tile of the image.
#[derive(Clone, Debug, PartialEq)]
pub struct HeatMap {
    /// The event.
    pub event: Event,
    /// Fine tiles, row by row, each with what happened there alone.
    pub tiles: Vec<TileHeat>,
    /// Coarse tiles, row by row, each with what happened once for the whole of it.
    pub coarse: Vec<TileHeat>,
    /// What happened nowhere in the image: to vertices, or when the caches were emptied at the end.
    pub elsewhere: u64,
    /// Every pixel, row by row, where the event is one of samples, which have a pixel each; else nothing.
    pub samples: Vec<u32>,
    width: u32,
    height: u32,
}

/// A tile, cut to the image, and how often the event happened in it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TileHeat {
    /// Its first pixel.
    pub origin: [u32; 2],
    /// Pixels of it in the image, across and down.
    pub size: [u32; 2],
    /// How often.
    pub count: u64,
}

impl TileHeat {
    /// Events in a pixel, on average.
    pub fn per_pixel(&self) -> f64 {
        self.count as f64 / f64::from(self.size[0] * self.size[1])
    }
}

impl HeatMap {
    /// Whether the event has a place in the image at all, be it that some of them have none.
    pub fn is_of(event: Event) -> bool {
        !matches!(event.unit(), Unit::Command | Unit::Setup) && event != Event::VertexInvocations
    }

    pub(super) fn new(event: Event, pass: &Pass<'_>) -> Self {
        let (spec, viewport) = (pass.settings.spec, pass.settings.viewport);
        let [width, height] = [viewport.width(), viewport.height()];
        let tiles = |side: u32| {
            let across = width.div_ceil(side);
            let tile = |index: u32| {
                let origin = [index % across * side, index / across * side];
                let size = [side.min(width - origin[0]), side.min(height - origin[1])];
                TileHeat { origin, size, count: 0 }
            };
            (0..across * height.div_ceil(side)).map(tile).collect()
        };
        Self {
            event,
            tiles: tiles(spec.tile_px),
            coarse: tiles(spec.coarse_tile_px),
            elsewhere: 0,
            samples: vec![
                0;
                if SamplesHere::EVENTS.contains(&event) { (width * height) as usize } else { 0 }
            ],
            width,
            height,
        }
    }

    /// Counts a packet. Tile tests travel in packets of other tiles; they are counted in [`Self::tests`].
    pub(super) fn packet(&mut self, packet: &Packet) {
        let count = u64::from(packet.counts[self.event]);
        let placed = match packet.kind {
            PacketKind::Draw | PacketKind::Vertices => false,
            PacketKind::Tile => true,
            PacketKind::Resolve => packet.counts[Event::PixelsResolved] > 0,
        };
        if !placed {
            self.elsewhere += count;
        } else if !is_tile_test(self.event) {
            self.tiles[packet.tile as usize].count += count;
        }
    }

    /// Counts the tile tests of a bin, `number` row by row.
    pub(super) fn tests(&mut self, pass: &Pass<'_>, number: usize, bin: &Bin, log: &BinLog) {
        if !self.samples.is_empty() {
            self.by_pixel(pass, bin, log);
        }
        if !is_tile_test(self.event) {
            return;
        }
        let mut in_tiles = 0;
        for (tile, place, ..) in bin.inside(pass) {
            // A bin of which no fine tile was visited has noted none.
            let count = log.tests.get(place).map_or(0, |tests| tests.of(self.event));
            self.tiles[tile as usize].count += count;
            in_tiles += count;
        }
        let all: u64 = log.work.iter().map(|work| u64::from(work.tests.of(self.event))).sum();
        self.coarse[number].count += all - in_tiles;
    }

    /// Counts what happened to the samples of a bin, pixel by pixel.
    fn by_pixel(&mut self, pass: &Pass<'_>, bin: &Bin, log: &BinLog) {
        let side = pass.settings.spec.tile_px;
        for (place, samples) in log.samples.iter().enumerate() {
            let Some(samples) = samples else { continue };
            let [x, y] = bin.tile_origin(pass, place);
            for (pixel, count) in (0..side * side).zip(samples.of(self.event)) {
                let (column, row) = (x + pixel % side, y + pixel / side);
                if column < self.width && row < self.height {
                    self.samples[(row * self.width + column) as usize] += count;
                }
            }
        }
    }

    /// The value of every pixel, row by row: events there. What has a tile but no pixel is spread evenly over the tile.
    pub fn pixels(&self) -> Vec<f32> {
        if !self.samples.is_empty() {
            return self.samples.iter().map(|&count| count as f32).collect();
        }
        let mut pixels = vec![0.0_f32; (self.width * self.height) as usize];
        for tile in self.tiles.iter().chain(&self.coarse) {
            let value = tile.per_pixel() as f32;
            for y in tile.origin[1]..tile.origin[1] + tile.size[1] {
                let first = (y * self.width + tile.origin[0]) as usize;
                pixels[first..first + tile.size[0] as usize].iter_mut().for_each(|pixel| *pixel += value);
            }
        }
        pixels
    }

    /// All of the event in the frame.
    pub fn total(&self) -> u64 {
        self.tiles.iter().chain(&self.coarse).map(|tile| tile.count).sum::<u64>() + self.elsewhere
    }
}

/// Whether the event is counted by the tests of a tile.
fn is_tile_test(event: Event) -> bool {
    matches!(event.unit(), Unit::Traversal | Unit::ZCull)
}
