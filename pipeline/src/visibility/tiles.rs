//! Samples that repeat from tile to tile, as those of a table do: each of its blocks is sorted once, and bins are put together.

use std::collections::HashMap;

use rayon::prelude::*;

use super::bin::{BinSamples, EMPTY_RANGE};
use super::sorter::{Plan, Sorter};
use crate::geometry::{Clip, Viewport};
use crate::sampling::{Sample, SampleTable};
use crate::simd::LANES;

/// Side of a tile in pixels.
const SIDE_PX: u32 = SampleTable::SHIFT_PX;

/// The sorted blocks of a table, by their samples.
pub(super) struct SortedTiles {
    /// By the address of their samples.
    number: HashMap<usize, usize>,
    tiles: Vec<SortedTile>,
}

/// Packets of a tile, in the order of their parts.
struct SortedTile {
    packets: Vec<TilePacket>,
}

/// Sixteen samples of a tile. Lanes without a sample repeat the first one.
struct TilePacket {
    /// Block of pixels, times the number of cells, plus the cell.
    part: usize,
    x: [f32; LANES],
    y: [f32; LANES],
    u: [f32; LANES],
    v: [f32; LANES],
    t: [f32; LANES],
    /// Column and row of the pixel.
    pixel: [[u8; LANES]; 2],
    /// Index in the pixel.
    index: [u32; LANES],
    /// Lanes with samples.
    len: usize,
    /// Lowest and highest lens positions and times.
    ranges: [[f32; 2]; 3],
}

impl SortedTiles {
    /// Sorts the tiles of the image of `sorter`. `None` if its samples do not repeat, or if packets of a tile would not be full or
    /// not fit into a block.
    pub fn new(sorter: &Sorter<'_>) -> Option<Self> {
        let Sorter { viewport, source, plan, .. } = *sorter;
        let [across, down] = [viewport.width(), viewport.height()].map(|side| side / SIDE_PX);
        let in_tile =
            Plan { block_px: plan.block_px.map(|side| side.min(SIDE_PX)), bin_px: SIDE_PX, ..*plan };
        let (mut number, mut origins) = (HashMap::new(), Vec::new());
        for (column, row) in (0..down).flat_map(|row| (0..across).map(move |column| (column, row))) {
            let origin = [column * SIDE_PX, row * SIDE_PX];
            number.entry(source.block_by_time(origin[0], origin[1])?.as_ptr().addr()).or_insert_with(|| {
                origins.push(origin);
                origins.len() - 1
            });
        }
        let sorter = Sorter { plan: &in_tile, ..*sorter };
        let tiles: Vec<_> = origins.into_par_iter().map(|origin| SortedTile::new(&sorter, origin)).collect();
        let samples = (in_tile.block_px[0] * in_tile.block_px[1] * source.per_pixel()) as usize;
        let tiles_in_block =
            plan.block_px.map(|side| (side / SIDE_PX).max(1)).iter().product::<u32>() as usize;
        let parts = tiles.iter().flat_map(|tile| tile.packets.chunk_by(|a, b| a.part == b.part));
        let most = parts.map(<[_]>::len).max()?;
        let is_good = samples >= LANES * plan.cells() && most * tiles_in_block <= LANES;
        (is_good && sorter.clip == Clip::NONE).then_some(Self { number, tiles })
    }

    /// Fills the bin at `origin`. Returns whether all of its tiles are whole; else it has to be sorted by itself.
    pub fn fill(&self, sorter: &Sorter<'_>, bin: &mut BinSamples, origin: [u32; 2]) -> bool {
        let Sorter { viewport, source, plan, .. } = *sorter;
        let ([across, down], cells) = (plan.blocks(), plan.cells());
        bin.reset(origin, viewport, [(across * down) as usize, cells]);
        let mut filled = vec![0; bin.boxes.len()];
        let side = plan.bin_px / SIDE_PX;
        for [x, y] in (0..side * side).map(|tile| [tile % side * SIDE_PX, tile / side * SIDE_PX]) {
            let [px, py] = [origin[0] + x, origin[1] + y];
            if px >= viewport.width() || py >= viewport.height() {
                continue;
            }
            let whole = px + SIDE_PX <= viewport.width() && py + SIDE_PX <= viewport.height();
            let block = source.block_by_time(px, py).filter(|_| whole);
            let Some(&number) = block.and_then(|block| self.number.get(&block.as_ptr().addr())) else {
                return false;
            };
            let blocks_across = SIDE_PX / plan.block_px[0].min(SIDE_PX);
            for packet in &self.tiles[number].packets {
                let (part, cell) = ((packet.part / cells) as u32, packet.part % cells);
                let [column, row] = [part % blocks_across, part / blocks_across];
                let [column, row] = [x / plan.block_px[0] + column, y / plan.block_px[1] + row];
                let block_cell = (row * across + column) as usize * cells + cell;
                sorter.place(bin, (block_cell, filled[block_cell]), packet, [x, y]);
                filled[block_cell] += 1;
            }
        }
        bin.finish();
        true
    }
}

impl SortedTile {
    fn new(sorter: &Sorter<'_>, origin: [u32; 2]) -> Self {
        let (bin, source) = (sorter.bin(origin), sorter.source);
        let per_pixel = source.per_pixel() as usize;
        let mut samples = vec![Sample::default(); (SIDE_PX * SIDE_PX) as usize * per_pixel];
        for (pixel, samples) in (0..).zip(samples.chunks_exact_mut(per_pixel)) {
            source.pixel_into(origin[0] + pixel % SIDE_PX, origin[1] + pixel / SIDE_PX, samples);
        }
        let packet = |(number, places): (usize, &[u32; LANES])| {
            TilePacket::new((number / LANES, places), &samples, per_pixel)
        };
        Self { packets: bin.sample_indices.iter().enumerate().filter_map(packet).collect() }
    }
}

impl TilePacket {
    /// The samples at these places of a tile; `None` without any.
    fn new((part, places): (usize, &[u32; LANES]), samples: &[Sample], per_pixel: usize) -> Option<Self> {
        let len = places.iter().position(|&place| place == BinSamples::NO_SAMPLE).unwrap_or(LANES);
        let places: [usize; LANES] =
            std::array::from_fn(|lane| places[if lane < len { lane } else { 0 }] as usize);
        let row = |of: fn(&Sample) -> f32| places.map(|place| samples.get(place).map_or(0.0, of));
        let (u, v, t) = (row(|s| s.u), row(|s| s.v), row(|s| s.t));
        let side = SIDE_PX as usize;
        (len > 0).then(|| Self {
            part,
            x: row(|s| s.x),
            y: row(|s| s.y),
            pixel: [
                places.map(|place| (place / per_pixel % side) as u8),
                places.map(|place| (place / per_pixel / side) as u8),
            ],
            index: places.map(|place| (place % per_pixel) as u32),
            len,
            ranges: [range(&u), range(&v), range(&t)],
            u,
            v,
            t,
        })
    }
}

/// Lowest and highest of some numbers.
fn range(row: &[f32; LANES]) -> [f32; 2] {
    row.iter().fold(EMPTY_RANGE, |[lo, hi], &at| [lo.min(at), hi.max(at)])
}

impl Sorter<'_> {
    /// Places a packet of the tile at pixel `tile` of the bin: as packet number `turn` of a cell in a block.
    fn place(
        &self,
        bin: &mut BinSamples,
        (block_cell, turn): (usize, usize),
        packet: &TilePacket,
        tile: [u32; 2],
    ) {
        let (number, cells) = (block_cell * LANES + turn, self.plan.cells());
        let sides = [self.viewport.width(), self.viewport.height()];
        let into = &mut bin.packets[number];
        let mut box_of = [[0.0; 2]; 2];
        for (axis, (within, lens)) in [(&packet.x, &packet.u), (&packet.y, &packet.v)].into_iter().enumerate()
        {
            let first = bin.origin[axis] + tile[axis];
            let edges: [f32; SIDE_PX as usize] =
                std::array::from_fn(|pixel| Viewport::edge(first + pixel as u32, sides[axis]));
            let pixels = &packet.pixel[axis];
            let at: [f32; LANES] =
                std::array::from_fn(|lane| edges[usize::from(pixels[lane] % SIDE_PX as u8)] + within[lane]);
            for lane in 0..LANES {
                [into.slope[axis].0[lane], into.lens[axis].0[lane]] =
                    self.shear.ray(axis, at[lane], lens[lane]);
            }
            box_of[axis] = range(&at);
        }
        into.t.0 = packet.t;
        let pixels = packet.pixel[0].iter().zip(&packet.pixel[1]).zip(packet.index);
        let places = bin.sample_indices[number].iter_mut().zip(pixels).take(packet.len);
        for (place, ((&column, &row), index)) in places {
            let [x, y] = [tile[0] + u32::from(column), tile[1] + u32::from(row)];
            *place = (y * self.plan.bin_px + x) * self.source.per_pixel() + index;
        }
        (packet.len..LANES).for_each(|lane| into.clear(lane));
        bin.include((block_cell / cells, block_cell % cells), turn, cells, (box_of, packet.ranges));
    }
}
