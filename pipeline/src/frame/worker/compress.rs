//! Pixels that fit in half their room after a packet.

use super::super::surface::Grid;
use super::super::{Settings, Shading};
use super::Worker;
use crate::memory::depths_fit;
use crate::setup::Triangle;

/// What is known of the samples of one pixel.
#[derive(Clone, Copy)]
struct Pixel {
    least: f32,
    most: f32,
    /// The cell in which all samples so far are shaded; none where they differ.
    cell: Option<[i32; 2]>,
    seen: bool,
}

impl Pixel {
    const NONE: Self = Self { least: f32::INFINITY, most: 0.0, cell: None, seen: false };

    fn add(&mut self, depth: f32, cell: Option<[i32; 2]>) {
        self.least = self.least.min(depth);
        self.most = self.most.max(depth);
        self.cell = if self.seen { self.cell.filter(|_| self.cell == cell) } else { cell };
        self.seen = true;
    }
}

impl Worker<'_, '_> {
    /// Of the pixels that `triangle` was written into, those whose depths and those whose colours now fit in half their room.
    pub(super) fn small_pixels(&self, triangle: &Triangle, place: usize, origin: [u32; 2]) -> [u64; 2] {
        let Settings { spec, samples: source, .. } = *self.pass.settings;
        let (compression, written) = (spec.memory.compression, self.scratch.hits.written_pixels);
        let Some(stored) = self.bin.tiles[place].as_ref().filter(|_| compression.is_on() && written != 0)
        else {
            return [0; 2];
        };
        let samples = &self.scratch.samples[place];
        let grid = Grid::new(self.pass, &triangle.corners, triangle.moving);
        let colours = compression.colour && spec.shading == Shading::Cached;
        let mut pixels = [Pixel::NONE; 64];
        for slot in 0..samples.len {
            let pixel = samples.pixel[slot] as usize;
            if written & 1 << pixel != 0 {
                let own = colours && stored.triangle[slot] == triangle.id;
                let cell = own.then(|| grid.cell(samples, slot, origin, spec.tile_px));
                pixels[pixel].add(stored.depth[slot], cell);
            }
        }
        let count = source.per_pixel();
        let fit = |pixel: &Pixel| {
            let depth = compression.depth && pixel.seen && depths_fit(pixel.least, pixel.most, count);
            [depth, count > 1 && pixel.cell.is_some()]
        };
        pixels.iter().enumerate().fold([0; 2], |[depth, colour], (at, pixel)| {
            let [small, same] = fit(pixel);
            [depth | u64::from(small) << at, colour | u64::from(same) << at]
        })
    }
}
