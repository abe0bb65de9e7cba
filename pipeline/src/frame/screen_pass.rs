//! Full-screen passes: a program runs for every pixel of an image, tile by tile, without triangles.

use activity::{Event, Packet, PacketKind};
use glam::Vec3;
use rayon::prelude::*;

use super::heat::Block;
use super::lanes::{LaneWork, Lanes, Run};
use super::{Gpu, Rendered};
use crate::geometry::Viewport;
use crate::memory::LINE_BYTES;

/// Bytes of a pixel of an image.
const PIXEL_BYTES: u64 = 4;

impl Gpu<'_> {
    /// Draws an image in a pass of its own: `pixel` gives the colour of the pixel at a column and row. What its lanes do is
    /// counted as they do it, in quads of 2 x 2 pixels: the n-th programs of the lanes of a warp run in step, and a lane without one, as
    /// beyond an odd side of the image, is a helper. Helpers fetch what their neighbours fetch; they neither read nor write depth and
    /// colour.
    pub fn shade_pixels(
        &mut self,
        name: &str,
        viewport: Viewport,
        pixel: impl Fn(&Lanes, [u32; 2]) -> Vec3 + Sync,
    ) -> Rendered {
        let image = self.allocate(viewport.pixels() as u64 * PIXEL_BYTES);
        self.open(name, Some(viewport));
        let colours = self.run_pixels(viewport, |lanes, [x, y]| {
            let colour = pixel(lanes, [x, y]);
            lanes.write(image, u64::from(y * viewport.width() + x) * PIXEL_BYTES, PIXEL_BYTES);
            colour
        });
        self.keep(image);
        Rendered {
            images: vec![colours],
            visible: Vec::new(),
            counts: self.counts_of_pass(),
            passed: Vec::new(),
            region: image,
        }
    }

    /// Runs a program for the pixel at every column and row, in the pass that was begun, in quads as [`Self::shade_pixels`]. Returns
    /// its values, row by row.
    pub fn run_pixels<T: Clone + Default + Send>(
        &mut self,
        viewport: Viewport,
        pixel: impl Fn(&Lanes, [u32; 2]) -> T + Sync,
    ) -> Vec<T> {
        let (side, warp_lanes) = (self.spec().tile_px, self.spec().warp_lanes);
        let columns: Vec<u32> = (0..viewport.width()).step_by(side as usize).collect();
        let mut values = vec![T::default(); viewport.pixels()];
        for y0 in (0..viewport.height()).step_by(side as usize) {
            let run = |&x0: &u32| {
                let (lanes, mut runs) = (Lanes::default(), TileRuns::new(side));
                let run = |[x, y]: [u32; 2]| {
                    let value = pixel(&lanes, [x, y]);
                    runs.of([x - x0, y - y0]).extend(lanes.take_runs());
                    value
                };
                let values: Vec<T> = pixels([x0, y0], side, viewport).map(run).collect();
                lanes.count_quads(&runs.quads, warp_lanes);
                (values, lanes.finish(warp_lanes))
            };
            let tiles: Vec<(Vec<T>, LaneWork)> = columns.par_iter().map(run).collect();
            for ((x0, (of_tile, work)), column) in columns.iter().zip(tiles).zip(0..) {
                for ([x, y], value) in pixels([*x0, y0], side, viewport).zip(of_tile) {
                    values[(y * viewport.width() + x) as usize] = value;
                }
                let tile = y0 / side * columns.len() as u32 + column;
                let mut packet = self.packet(PacketKind::Tile, tile, None);
                work.add_to(&mut packet.counts, self.memory(), |_| false);
                let of = [viewport.width(), viewport.height()];
                let end = [(*x0 + side).min(of[0]), (y0 + side).min(of[1])];
                self.push_block(&packet, &Block { first: [*x0, y0], end, of });
            }
        }
        values
    }

    /// Writes the pixels of an image of `viewport` in a pass of its own, in tiles.
    pub fn write_image(&mut self, name: &str, viewport: Viewport) {
        let image = self.allocate(viewport.pixels() as u64 * PIXEL_BYTES);
        self.open(name, Some(viewport));
        let (pixels, tile_pixels) = (viewport.pixels() as u64, u64::from(self.spec().tile_px.pow(2)));
        for (tile, first) in (0..).zip((0..pixels).step_by(tile_pixels as usize)) {
            let count = tile_pixels.min(pixels - first);
            let mut packet = self.packet(PacketKind::Resolve, tile, None);
            packet.counts[Event::PixelsResolved] = count as u32;
            let (from, counts) = (image.address() + first * PIXEL_BYTES, &mut packet.counts);
            for line in from / LINE_BYTES..=(from + count * PIXEL_BYTES - 1) / LINE_BYTES {
                self.memory().colour(line * LINE_BYTES, true, true, counts);
            }
            self.push(&packet, 0);
        }
        self.keep(image);
    }

    /// A packet of the pass that was begun.
    pub(super) fn packet(&self, kind: PacketKind, tile: u32, triangle: Option<u32>) -> Packet {
        let of = triangle.unwrap_or((self.triangles_of_pass() as u32).saturating_sub(1));
        Packet {
            batch: of / self.spec().batch_triangles,
            draw: 0,
            tile,
            triangle: triangle.unwrap_or(Packet::NONE),
            ..Packet::new(kind, self.last_pass())
        }
    }
}

/// Programs of the pixels of a tile, by quad and lane.
struct TileRuns {
    /// Quads in a row.
    across: u32,
    quads: Vec<[Vec<Run>; 4]>,
}

impl TileRuns {
    fn new(side: u32) -> Self {
        let across = side.div_ceil(2);
        Self { across, quads: vec![Default::default(); (across * across) as usize] }
    }

    /// Those of a pixel, by its place in the tile.
    fn of(&mut self, [x, y]: [u32; 2]) -> &mut Vec<Run> {
        &mut self.quads[(y / 2 * self.across + x / 2) as usize][(y % 2 * 2 + x % 2) as usize]
    }
}

/// Pixels of the tile with a given first pixel, row by row.
fn pixels([x0, y0]: [u32; 2], side: u32, viewport: Viewport) -> impl Iterator<Item = [u32; 2]> {
    let columns = x0..viewport.width().min(x0 + side);
    (y0..viewport.height().min(y0 + side)).flat_map(move |y| columns.clone().map(move |x| [x, y]))
}
