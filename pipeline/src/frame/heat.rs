//! Heat maps: where in the image events happen.

use activity::{Event, Packet, PacketKind, Unit};

use super::PipelineSpec;
use super::bin::Bin;
use super::bin::{BinLog, SamplesHere};
use super::pass::Pass;
use crate::geometry::Viewport;

/// Count of one event in each tile of the image.
#[derive(Clone, Debug, PartialEq)]
pub struct HeatMap {
    /// Event.
    pub event: Event,
    /// The passes of this name alone; `None` for all that the frame does.
    pub pass: Option<String>,
    /// Fine tiles, row by row, with the events of each tile alone.
    pub tiles: Vec<TileHeat>,
    /// Coarse tiles, row by row, with the events of the coarse tile as a whole.
    pub coarse: Vec<TileHeat>,
    /// Events without a position: those of vertices, groups and barriers, of passes of another size, and of
    /// emptying the caches at the end.
    pub elsewhere: u64,
    /// Count in every pixel, row by row, for events of samples; otherwise empty.
    pub samples: Vec<u32>,
    /// Events of samples in each fine tile whose pixels are not known.
    spread: Vec<u64>,
    width: u32,
    height: u32,
}

/// A tile clipped to the image, and its count.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TileHeat {
    /// First pixel.
    pub origin: [u32; 2],
    /// Width and height in the image, in pixels.
    pub size: [u32; 2],
    /// Count.
    pub count: u64,
}

/// Where the tiles of a pass in conservative mode are in the image of the frame, for its heat maps: the outer
/// corners of the first and of the last tile, as shares of the image from its left and from its top.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placement {
    /// Outer corner of the tile in column and row 0.
    pub first: [f64; 2],
    /// Outer corner of the tile in the last column and row.
    pub last: [f64; 2],
}

/// Tiles of a grid, from `first` to before `end`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Block {
    pub first: [u32; 2],
    pub end: [u32; 2],
    /// Columns and rows of the grid.
    pub of: [u32; 2],
}

impl Placement {
    /// Columns and rows of the pixels of a block, at least one of each, in an image of this size.
    fn pixels(&self, block: &Block, size: [u32; 2]) -> [[u32; 2]; 2] {
        [0, 1].map(|axis| {
            let at = |tile: u32| {
                let share = f64::from(tile) / f64::from(block.of[axis].max(1));
                let place = self.first[axis] + share * (self.last[axis] - self.first[axis]);
                // NaN becomes 0.
                (place * f64::from(size[axis])).round() as u32
            };
            let [a, b] = [at(block.first[axis]), at(block.end[axis])];
            let low = a.min(b).min(size[axis] - 1);
            [low, a.max(b).clamp(low + 1, size[axis])]
        })
    }
}

impl TileHeat {
    /// Mean number of events per pixel.
    pub fn per_pixel(&self) -> f64 {
        self.count as f64 / f64::from(self.size[0] * self.size[1])
    }
}

impl HeatMap {
    /// Whether occurrences of the event have a position in the image, at least some of them.
    pub fn is_of(event: Event) -> bool {
        !matches!(event.unit(), Unit::Command | Unit::Setup) && event != Event::VertexInvocations
    }

    fn new(event: Event, pass: Option<&str>, spec: &PipelineSpec, viewport: Viewport) -> Self {
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
        let is_of_samples = SamplesHere::EVENTS.contains(&event);
        Self {
            event,
            pass: pass.map(str::to_owned),
            tiles: tiles(spec.tile_px),
            coarse: tiles(spec.coarse_tile_px),
            elsewhere: 0,
            samples: if is_of_samples { vec![0; viewport.pixels()] } else { Vec::new() },
            spread: vec![0; tiles(spec.tile_px).len()],
            width,
            height,
        }
    }

    /// Add a packet of a pass over tiles of the caller.
    fn tile(&mut self, packet: &Packet) {
        let count = u64::from(packet.counts[self.event]);
        match self.tiles.get_mut(packet.tile as usize) {
            Some(tile) => {
                tile.count += count;
                self.spread[packet.tile as usize] += count;
            }
            None => self.elsewhere += count,
        }
    }

    /// Add a packet whose events are spread over tiles, each with its share of so many pixels.
    fn shared(&mut self, packet: &Packet, parts: &[(usize, u64)], pixels: u64) {
        let (count, mut before) = (u64::from(packet.counts[self.event]), 0);
        for (tile, share) in parts {
            let until = before + share;
            let part = count * until / pixels - count * before / pixels;
            before = until;
            self.tiles[*tile].count += part;
            self.spread[*tile] += part;
        }
    }

    /// Fine tiles in a range of pixels, with the number of its pixels in each.
    fn parts(&self, [columns, rows]: [[u32; 2]; 2]) -> Vec<(usize, u64)> {
        let Some(side) = self.tiles.first().map(|tile| tile.size[0].max(tile.size[1])) else {
            return Vec::new();
        };
        let across = self.width.div_ceil(side);
        let cut = |[low, high]: [u32; 2]| {
            let tile = move |tile: u32| (tile, u64::from(high.min((tile + 1) * side) - low.max(tile * side)));
            (low / side..high.div_ceil(side)).map(tile)
        };
        let of_row = |(row, high)| {
            cut(columns).map(move |(column, wide)| ((row * across + column) as usize, wide * high))
        };
        cut(rows).flat_map(of_row).collect()
    }

    /// Add a packet. Tile tests may be in packets of other tiles; [`Self::tests`] adds them.
    fn packet(&mut self, packet: &Packet) {
        let count = u64::from(packet.counts[self.event]);
        if !is_placed(packet) {
            self.elsewhere += count;
        } else if !is_tile_test(self.event) {
            self.tiles[packet.tile as usize].count += count;
        }
    }

    /// Add the tile tests of bin `number`.
    fn tests(&mut self, pass: &Pass<'_>, number: usize, bin: &Bin, log: &BinLog) {
        if !self.samples.is_empty() {
            self.by_pixel(pass, bin, log);
        }
        if !is_tile_test(self.event) {
            return;
        }
        let mut in_tiles = 0;
        for (tile, index, ..) in bin.inside(pass) {
            // A bin without visited fine tiles has no record.
            let count = log.tests.get(index).map_or(0, |tests| tests.of(self.event));
            self.tiles[tile as usize].count += count;
            in_tiles += count;
        }
        let all: u64 = log.work.iter().map(|work| u64::from(work.tests.of(self.event))).sum();
        self.coarse[number].count += all - in_tiles;
    }

    /// Add the sample events of a bin, by pixel.
    fn by_pixel(&mut self, pass: &Pass<'_>, bin: &Bin, log: &BinLog) {
        let side = pass.settings.spec.tile_px;
        for (index, samples) in log.samples.iter().enumerate() {
            let Some(samples) = samples else { continue };
            let [x, y] = bin.tile_origin(pass, index);
            for (pixel, count) in (0..side * side).zip(samples.of(self.event)) {
                let (column, row) = (x + pixel % side, y + pixel / side);
                if column < self.width && row < self.height {
                    self.samples[(row * self.width + column) as usize] += count;
                }
            }
        }
    }

    /// Value of every pixel, row by row. Events known only by tile are spread evenly over the tile.
    pub fn pixels(&self) -> Vec<f32> {
        let mut pixels = vec![0.0_f32; (self.width * self.height) as usize];
        let of_samples = !self.samples.is_empty();
        pixels.iter_mut().zip(&self.samples).for_each(|(pixel, &count)| *pixel = count as f32);
        let spread = |(tile, &count): (&TileHeat, &u64)| TileHeat { count, ..*tile };
        let fine = self.tiles.iter().zip(&self.spread);
        let fine = fine.map(|both| if of_samples { spread(both) } else { *both.0 });
        for tile in fine.chain(self.coarse.iter().copied()).filter(|tile| tile.count > 0) {
            let value = tile.per_pixel() as f32;
            for y in tile.origin[1]..tile.origin[1] + tile.size[1] {
                let first = (y * self.width + tile.origin[0]) as usize;
                pixels[first..first + tile.size[0] as usize].iter_mut().for_each(|pixel| *pixel += value);
            }
        }
        pixels
    }

    /// Total count in the frame.
    pub fn total(&self) -> u64 {
        self.tiles.iter().chain(&self.coarse).map(|tile| tile.count).sum::<u64>() + self.elsewhere
    }
}

/// Heat maps of a frame, over the images of one size.
#[derive(Default)]
pub(super) struct FrameHeat {
    viewport: Option<Viewport>,
    /// Each with whether it counts what is added now.
    maps: Vec<(HeatMap, bool)>,
}

impl FrameHeat {
    /// The same with more maps, of the passes of one name or of all. All maps of a frame are of one size.
    pub fn with(
        mut self,
        pass: Option<&str>,
        events: &[Event],
        spec: &PipelineSpec,
        viewport: Viewport,
    ) -> Self {
        let map = |&event: &Event| (HeatMap::new(event, pass, spec, viewport), pass.is_none());
        self.maps.extend(events.iter().map(map));
        Self { viewport: Some(viewport).filter(|_| !self.maps.is_empty()), ..self }
    }

    /// What is added from now on is of a pass of this name, or of none.
    pub fn begin(&mut self, pass: Option<&str>) {
        for (map, counts) in &mut self.maps {
            *counts = map.pass.is_none() || map.pass.as_deref() == pass;
        }
    }

    fn counting(&mut self) -> impl Iterator<Item = &mut HeatMap> {
        self.maps.iter_mut().filter(|(_, counts)| *counts).map(|(map, _)| map)
    }

    /// Whether there are maps over images of this size.
    pub fn is_of(&self, viewport: Viewport) -> bool {
        self.viewport == Some(viewport)
    }

    /// Add a packet of a drawn pass, of images of the size of the maps or of another one.
    pub fn drawn(&mut self, packet: &Packet, is_on_map: bool) {
        for map in self.counting() {
            if is_on_map { map.packet(packet) } else { map.elsewhere += u64::from(packet.counts[map.event]) }
        }
    }

    /// Add a packet of a drawn pass whose images are parts of that of the maps, each with the pixels of the tile.
    /// Tile tests in a packet of another tile are counted at that tile.
    pub fn drawn_at<I: Iterator<Item = [[u32; 2]; 2]>>(&mut self, packet: &Packet, pixels: impl Fn() -> I) {
        let Some((map, _)) = self.maps.first().filter(|_| is_placed(packet)) else {
            return self.drawn(packet, false);
        };
        let is_inside = |range: &[[u32; 2]; 2]| range[0][1] <= map.width && range[1][1] <= map.height;
        let parts: Vec<_> = pixels().filter(is_inside).flat_map(|range| map.parts(range)).collect();
        if parts.is_empty() {
            return self.drawn(packet, false);
        }
        let all = parts.iter().map(|(_, share)| share).sum();
        self.counting().for_each(|map| map.shared(packet, &parts, all));
    }

    /// Add the tile tests of bin `number` of a pass.
    pub fn tests(&mut self, pass: &Pass<'_>, number: usize, bin: &Bin, log: &BinLog) {
        self.counting().for_each(|map| map.tests(pass, number, bin, log));
    }

    /// Add a packet of a pass over tiles of the caller, of a barrier or of the end of the frame.
    pub fn add(&mut self, packet: &Packet, is_on_map: bool) {
        let is_placed = is_on_map && matches!(packet.kind, PacketKind::Tile | PacketKind::Resolve);
        for map in self.counting() {
            if is_placed { map.tile(packet) } else { map.elsewhere += u64::from(packet.counts[map.event]) }
        }
    }

    /// Add a packet of a pass in conservative mode, whose events are spread over the pixels of a block of its tiles.
    pub fn add_block(&mut self, packet: &Packet, placement: &Placement, block: &Block) {
        let Some((map, _)) = self.maps.first() else { return };
        let range = placement.pixels(block, [map.width, map.height]);
        let parts = map.parts(range);
        let pixels = parts.iter().map(|(_, share)| share).sum();
        self.counting().for_each(|map| map.shared(packet, &parts, pixels));
    }

    /// The maps.
    pub fn into_maps(self) -> Vec<HeatMap> {
        self.maps.into_iter().map(|(map, _)| map).collect()
    }
}

/// Whether a packet of a drawn pass has a place in its image.
fn is_placed(packet: &Packet) -> bool {
    match packet.kind {
        PacketKind::Draw | PacketKind::Vertices | PacketKind::Compute | PacketKind::Barrier(_) => false,
        PacketKind::Tile => true,
        PacketKind::Resolve => packet.counts[Event::PixelsResolved] > 0,
    }
}

/// Whether the event belongs to the tests of a tile.
fn is_tile_test(event: Event) -> bool {
    matches!(event.unit(), Unit::Traversal | Unit::ZCull)
}
