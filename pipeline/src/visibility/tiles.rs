//! Samples that repeat from tile to tile, as those of a table do: each of its blocks is sorted once, and bins are put together.

use std::collections::HashMap;

use rayon::prelude::*;

use super::bin::{BinSamples, CellBoxes};
use super::sorter::{Plan, Sorter};
use crate::geometry::{Clip, Shear, Viewport};
use crate::sampling::{Sample, SampleTable};
use crate::simd::{Kernel, LANES, Lanes, Row, Width, dispatch};

/// Side of a tile in pixels.
const SIDE_PX: u32 = SampleTable::SHIFT_PX;

/// The sorted blocks of a table, by their samples.
pub(super) struct SortedTiles {
    /// By the address of their samples.
    number: HashMap<usize, usize>,
    tiles: Vec<SortedTile>,
    /// Boxes of lens and time around the samples of all tiles.
    cells: CellBoxes,
}

/// Packets of a tile, in the order of their parts.
struct SortedTile {
    packets: Vec<TilePacket>,
}

/// Sixteen samples of a tile. Lanes without a sample repeat the first one.
struct TilePacket {
    /// Column and row of the block of pixels.
    block: [u32; 2],
    cell: usize,
    /// Position in the pixel, by axis.
    within: [Row; 2],
    /// Column and row of the pixel.
    pixel: [Row; 2],
    /// Lens position, by axis.
    lens: [Row; 2],
    t: Row,
    /// Index in a bin that starts with the tile.
    sample_indices: [u32; LANES],
    /// Lanes with samples.
    len: usize,
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
            number.entry(address(source.block_by_time(origin[0], origin[1])?)).or_insert_with(|| {
                origins.push(origin);
                origins.len() - 1
            });
        }
        let in_tiles = Sorter { plan: &in_tile, ..*sorter };
        let tile = |origin| SortedTile::new(&in_tiles, plan.bin_px, origin);
        let tiles: Vec<_> = origins.into_par_iter().map(tile).collect();
        let samples = (in_tile.block_px[0] * in_tile.block_px[1] * source.per_pixel()) as usize;
        let tiles_in_block =
            plan.block_px.map(|side| (side / SIDE_PX).max(1)).iter().product::<u32>() as usize;
        let is_together = |a: &TilePacket, b: &TilePacket| (a.block, a.cell) == (b.block, b.cell);
        let parts = tiles.iter().flat_map(|tile| tile.packets.chunk_by(is_together));
        let most = parts.map(<[_]>::len).max()?;
        let is_good = samples >= LANES * plan.cells() && most * tiles_in_block <= LANES;
        (is_good && sorter.clip == Clip::NONE).then(|| Self { number, cells: cell_boxes(&tiles), tiles })
    }

    /// Fills the bin at `origin`. Returns whether all of its tiles are whole; else it has to be sorted by itself.
    pub fn fill(&self, sorter: &Sorter<'_>, bin: &mut BinSamples, origin: [u32; 2]) -> bool {
        let Sorter { viewport, source, plan, .. } = *sorter;
        let ([across, down], cells) = (plan.blocks(), plan.cells());
        bin.reset(origin, viewport, [(across * down) as usize, cells]);
        bin.cells.clone_from(&self.cells);
        let mut filled = vec![0; bin.boxes.len()];
        let side = plan.bin_px / SIDE_PX;
        for [x, y] in (0..side * side).map(|tile| [tile % side * SIDE_PX, tile / side * SIDE_PX]) {
            let [px, py] = [origin[0] + x, origin[1] + y];
            if px >= viewport.width() || py >= viewport.height() {
                continue;
            }
            let whole = px + SIDE_PX <= viewport.width() && py + SIDE_PX <= viewport.height();
            let block = source.block_by_time(px, py).filter(|_| whole);
            let Some(&number) = block.and_then(|block| self.number.get(&address(block))) else {
                return false;
            };
            let (packets, filled) = (&self.tiles[number].packets[..], &mut filled[..]);
            dispatch(Width::widest(), Placement { sorter, bin, packets, filled, tile: [x, y] });
        }
        bin.finish_partial();
        true
    }
}

/// Address of a block of samples, which distinguishes it from others.
fn address<T>(block: &T) -> usize {
    std::ptr::from_ref(block).addr()
}

/// Boxes of lens and time around the samples of tiles.
fn cell_boxes(tiles: &[SortedTile]) -> CellBoxes {
    let mut boxes = CellBoxes::default();
    for packet in tiles.iter().flat_map(|tile| &tile.packets) {
        for lane in 0..LANES {
            boxes.u.include(packet.cell, packet.lens[0].0[lane]);
            boxes.v.include(packet.cell, packet.lens[1].0[lane]);
            boxes.t.include(packet.cell, packet.t.0[lane]);
        }
    }
    boxes.finish();
    boxes
}

impl SortedTile {
    /// The tile at `origin`, for bins of `bin_px` pixels squared.
    fn new(sorter: &Sorter<'_>, bin_px: u32, origin: [u32; 2]) -> Self {
        let (bin, source, plan) = (sorter.bin(origin), sorter.source, sorter.plan);
        let per_pixel = source.per_pixel();
        let mut samples = vec![Sample::default(); (SIDE_PX * SIDE_PX * per_pixel) as usize];
        for (pixel, samples) in (0..).zip(samples.chunks_exact_mut(per_pixel as usize)) {
            source.pixel_into(origin[0] + pixel % SIDE_PX, origin[1] + pixel / SIDE_PX, samples);
        }
        let packet = |(number, places): (usize, &[u32; LANES])| {
            let part = number / LANES;
            let (block, cell) = ((part / plan.cells()) as u32, part % plan.cells());
            let block = [block % plan.blocks()[0], block / plan.blocks()[0]];
            TilePacket::new((block, cell, places), &samples, [per_pixel, bin_px])
        };
        Self { packets: bin.sample_indices.iter().enumerate().filter_map(packet).collect() }
    }
}

impl TilePacket {
    /// The samples at these places of a tile; `None` without any.
    fn new(
        (block, cell, places): ([u32; 2], usize, &[u32; LANES]),
        samples: &[Sample],
        [per_pixel, bin_px]: [u32; 2],
    ) -> Option<Self> {
        let len = places.iter().position(|&place| place == BinSamples::NO_SAMPLE).unwrap_or(LANES);
        let all = |of: &dyn Fn(u32) -> f32| {
            Row(std::array::from_fn(|lane| of(places[if lane < len { lane } else { 0 }])))
        };
        let row = |of: fn(&Sample) -> f32| all(&|place| samples.get(place as usize).map_or(0.0, of));
        let in_bin = |place: u32| {
            let (pixel, index) = (place / per_pixel, place % per_pixel);
            (pixel / SIDE_PX * bin_px + pixel % SIDE_PX) * per_pixel + index
        };
        (len > 0).then(|| Self {
            block,
            cell,
            within: [row(|s| s.x), row(|s| s.y)],
            pixel: [
                all(&|place| (place / per_pixel % SIDE_PX) as f32),
                all(&|place| (place / per_pixel / SIDE_PX) as f32),
            ],
            lens: [row(|s| s.u), row(|s| s.v)],
            t: row(|s| s.t),
            sample_indices: places
                .map(|place| if place == BinSamples::NO_SAMPLE { place } else { in_bin(place) }),
            len,
        })
    }

    /// Lowest and highest image position along an axis, with the corner of the tile. The slopes and bases of the samples are
    /// written.
    #[inline(always)]
    fn along<V: Lanes>(
        &self,
        axis: usize,
        corner: f32,
        shear: &Shear,
        [slope, base]: [&mut Row; 2],
    ) -> [f32; 2] {
        // The corner of a pixel is exact.
        let at = (V::splat(corner) + V::load(&self.pixel[axis].0)) + V::load(&self.within[axis].0);
        let lens = V::load(&self.lens[axis].0);
        // As `Shear::ray`, in perspective.
        (at - lens * V::splat(shear.a[axis])).store(&mut slope.0);
        (lens * V::splat(shear.s[axis])).store(&mut base.0);
        [-(V::splat(0.0) - at).largest(), at.largest()]
    }
}

/// Places the packets of the tile at pixel `tile` of a bin. Counts the packets of each cell in a block.
struct Placement<'a, 's> {
    sorter: &'a Sorter<'s>,
    bin: &'a mut BinSamples,
    packets: &'a [TilePacket],
    filled: &'a mut [usize],
    tile: [u32; 2],
}

impl Kernel for Placement<'_, '_> {
    #[inline(always)]
    fn run<V: Lanes>(self) {
        let Self { sorter: Sorter { viewport, source, shear, plan, .. }, bin, packets, filled, tile } = self;
        let (cells, across) = (plan.cells(), plan.blocks()[0]);
        let first = (tile[1] * plan.bin_px + tile[0]) * source.per_pixel();
        let corner = [
            Viewport::edge(bin.origin[0] + tile[0], viewport.width()),
            Viewport::edge(bin.origin[1] + tile[1], viewport.height()),
        ];
        let [column, row] = [tile[0] / plan.block_px[0], tile[1] / plan.block_px[1]];
        for packet in packets {
            let block = ((row + packet.block[1]) * across + column + packet.block[0]) as usize;
            let turn = filled[block * cells + packet.cell];
            filled[block * cells + packet.cell] += 1;
            let number = (block * cells + packet.cell) * LANES + turn;
            let into = &mut bin.packets[number];
            let ([slope_x, slope_y], [base_x, base_y]) = (&mut into.slope, &mut into.lens);
            let x = packet.along::<V>(0, corner[0], shear, [slope_x, base_x]);
            let y = packet.along::<V>(1, corner[1], shear, [slope_y, base_y]);
            into.t = packet.t;
            (packet.len..LANES).for_each(|lane| into.clear(lane));
            // No sample stays no sample.
            bin.sample_indices[number] = packet.sample_indices.map(|index| index.saturating_add(first));
            bin.include((block, packet.cell), turn, cells, [x, y]);
        }
    }
}
