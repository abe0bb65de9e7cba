//! The farthest stored depths of tiles, level by level.

use super::BoxGrid;
use crate::geometry::Viewport;
use crate::sampling::{Sample, SampleSource};

/// Farthest depth of each tile and box of lens and time, with tile sides that double per level.
#[derive(Clone, Debug)]
pub struct Pyramid {
    viewport: Viewport,
    grid: BoxGrid,
    tile_px: u32,
    levels: Vec<Level>,
    half_covered: u64,
}

#[derive(Clone, Debug)]
struct Level {
    columns: u32,
    rows: u32,
    farthest: Vec<f32>,
    /// Depths compared, by tile.
    compared: Vec<u32>,
}

impl Pyramid {
    /// Makes the pyramid of an image. The samples of `source` have `depths` in the order `(y width + x)
    /// per_pixel + index`, infinite for no hit. Tiles of the first level have a side of `tile_px` pixels, 1
    /// or more.
    pub fn new(
        viewport: Viewport,
        source: &dyn SampleSource,
        depths: &[f32],
        tile_px: u32,
        grid: BoxGrid,
    ) -> Self {
        let mut this = Self { viewport, grid, tile_px, levels: Vec::new(), half_covered: 0 };
        let mut level = Level::empty(viewport, tile_px, grid.len());
        let per_pixel = source.per_pixel() as usize;
        let mut samples = vec![Sample::default(); per_pixel];
        let mut covered = vec![[0_u32; 2]; (level.columns * level.rows) as usize];
        for (pixel, depths) in (0..).zip(depths.chunks_exact(per_pixel)) {
            let [x, y] = [pixel % viewport.width(), pixel / viewport.width()];
            source.pixel_into(x, y, &mut samples);
            let tile = (y / tile_px * level.columns + x / tile_px) as usize;
            for (sample, &depth) in samples.iter().zip(depths) {
                let place = tile * grid.len() + grid.of_sample(sample.u, sample.v, sample.t);
                level.farthest[place] = level.farthest[place].max(depth);
                level.compared[tile] += 1;
                covered[tile][usize::from(depth.is_finite())] += 1;
            }
        }
        this.half_covered = covered.iter().filter(|[open, hit]| *open > 0 && hit > open).count() as u64;
        while level.columns * level.rows > 1 {
            let above = level.above(viewport, tile_px << (this.levels.len() + 1), grid.len());
            this.levels.push(std::mem::replace(&mut level, above));
        }
        this.levels.push(level);
        this
    }

    /// Division of lens and time.
    pub fn grid(&self) -> &BoxGrid {
        &self.grid
    }

    /// Image size.
    pub fn viewport(&self) -> Viewport {
        self.viewport
    }

    /// Number of levels; the last one has one tile.
    pub fn levels(&self) -> usize {
        self.levels.len()
    }

    /// Side of a tile of a level in pixels.
    pub fn side_px(&self, level: usize) -> u32 {
        self.tile_px << level
    }

    /// Columns and rows of tiles of a level.
    pub fn size(&self, level: usize) -> [u32; 2] {
        [self.levels[level].columns, self.levels[level].rows]
    }

    /// Farthest depth of a box of a tile.
    pub fn farthest(&self, level: usize, [column, row]: [u32; 2], index: usize) -> f32 {
        let level = &self.levels[level];
        level.farthest[(row * level.columns + column) as usize * self.grid.len() + index]
    }

    /// Depths compared to find the farthest of a tile: of its samples on the first level, else those of its child tiles.
    pub fn compared(&self, level: usize, [column, row]: [u32; 2]) -> u32 {
        self.levels[level].compared[(row * self.levels[level].columns + column) as usize]
    }

    /// Share of tiles in which most, but not all, samples are covered. Their farthest depth is that of the
    /// gaps, so small occluders hide nothing.
    pub fn half_covered(&self) -> f64 {
        let [columns, rows] = self.size(0);
        self.half_covered as f64 / f64::from(columns * rows)
    }
}

impl Level {
    /// A level without samples. A box without samples hides everything, as nothing is visible in it.
    fn empty(viewport: Viewport, side_px: u32, boxes: usize) -> Self {
        let (columns, rows) = (viewport.width().div_ceil(side_px), viewport.height().div_ceil(side_px));
        let tiles = (columns * rows) as usize;
        Self { columns, rows, farthest: vec![f32::NEG_INFINITY; tiles * boxes], compared: vec![0; tiles] }
    }

    /// The next level, with tiles of twice the side.
    fn above(&self, viewport: Viewport, side_px: u32, boxes: usize) -> Self {
        let mut above = Self::empty(viewport, side_px, boxes);
        for (tile, of_tile) in (0..).zip(self.farthest.chunks_exact(boxes)) {
            let [column, row] = [tile % self.columns / 2, tile / self.columns / 2];
            let parent = (row * above.columns + column) as usize;
            for (known, &farthest) in above.farthest[parent * boxes..].iter_mut().zip(of_tile) {
                *known = known.max(farthest);
                above.compared[parent] += 1;
            }
        }
        above
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampling::{LensShape, SampleTable};

    #[test]
    fn every_level_has_the_farthest_depth_of_its_samples() {
        let viewport = Viewport::new(37, 21).unwrap();
        let table = SampleTable::low_discrepancy(4, 3, LensShape::Disk).unwrap();
        let depth = |n: usize| (crate::random::mix(n as u64) % 1000) as f32;
        let depths: Vec<f32> = (0..viewport.pixels() * 4).map(depth).collect();
        let grid = BoxGrid::new([2, 1, 3], true).unwrap();
        let pyramid = Pyramid::new(viewport, &table, &depths, 8, grid);
        assert_eq!((pyramid.levels(), pyramid.size(0), pyramid.size(3)), (4, [5, 3], [1, 1]));
        for level in 0..4 {
            let [columns, rows] = pyramid.size(level);
            let side = pyramid.side_px(level);
            let mut known = vec![f32::NEG_INFINITY; (columns * rows) as usize * 6];
            for pixel in 0..viewport.pixels() as u32 {
                let [x, y] = [pixel % 37, pixel / 37];
                for (index, sample) in table.pixel(x, y).iter().enumerate() {
                    let tile = (y / side * columns + x / side) as usize;
                    let place = &mut known[tile * 6 + grid.of_sample(sample.u, sample.v, sample.t)];
                    *place = place.max(depth(pixel as usize * 4 + index));
                }
            }
            let compared: u32 =
                (0..columns * rows).map(|n| pyramid.compared(level, [n % columns, n / columns])).sum();
            let below = level.checked_sub(1).map(|below| pyramid.size(below));
            assert_eq!(compared, below.map_or(37 * 21 * 4, |[columns, rows]| columns * rows * 6));
            for tile in 0..columns * rows {
                for index in 0..6 {
                    let at = [tile % columns, tile / columns];
                    assert_eq!(pyramid.farthest(level, at, index), known[tile as usize * 6 + index]);
                }
            }
        }
    }
}
