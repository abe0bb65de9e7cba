//! Division of lens and time into boxes (thesis, Paper VI, section 3), and the farthest stored depths of
//! tiles in them, level by level.

use std::ops::Range;

use serde::{Deserialize, Serialize};

use super::DepthBound;
use crate::geometry::Viewport;
use crate::sampling::{Sample, SampleSource};
use crate::traversal::Box5;

/// Settings of depth culling.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct DepthSpec {
    /// Method of bounding the depth of a triangle over a tile.
    pub bound: DepthBound,
    /// Number of boxes of lens and time along u, v and t, each 1 to [`BoxGrid::MAX`]. Each box keeps its
    /// farthest and nearest depth.
    pub boxes: [u32; 3],
    /// Skip the reading of stored depths if a triangle is in front of all of them (`z_min`).
    pub z_min: bool,
}

impl Default for DepthSpec {
    fn default() -> Self {
        Self { bound: DepthBound::default(), boxes: [1; 3], z_min: false }
    }
}

/// Lens and time divided into equal boxes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BoxGrid {
    counts: [u32; 3],
    lens: bool,
}

impl Default for BoxGrid {
    /// One box.
    fn default() -> Self {
        Self { counts: [1; 3], lens: false }
    }
}

impl BoxGrid {
    /// Largest number of boxes along one axis.
    pub const MAX: u32 = 16;
    /// Ranges of u, v and t.
    const ENDS: [[f32; 2]; 3] = [[-1.0, 1.0], [-1.0, 1.0], [0.0, 1.0]];

    /// `counts` boxes along u, v and t, or `None` if one is not 1 to [`Self::MAX`]. Without a lens only time
    /// is divided.
    pub fn new([u, v, t]: [u32; 3], lens: bool) -> Option<Self> {
        let counts = if lens { [u, v, t] } else { [1, 1, t] };
        [u, v, t].iter().all(|count| (1..=Self::MAX).contains(count)).then_some(Self { counts, lens })
    }

    /// Number of boxes.
    pub fn len(&self) -> usize {
        self.counts.iter().map(|&count| count as usize).product()
    }

    /// Always false; there is at least one box.
    pub fn is_empty(&self) -> bool {
        false
    }

    /// Lower border of box `index` of `axis`, or the end of the axis for the index after the last.
    fn border(&self, axis: usize, index: u32) -> f32 {
        let [lo, hi] = Self::ENDS[axis];
        lo + (hi - lo) * index as f32 / self.counts[axis] as f32
    }

    /// Box of a coordinate along `axis`.
    fn index(&self, axis: usize, coordinate: f32) -> u32 {
        (1..self.counts[axis]).filter(|&index| self.border(axis, index) <= coordinate).count() as u32
    }

    /// Box of the sample at `u`, `v`, `t`.
    pub fn of_sample(&self, u: f32, v: f32, t: f32) -> usize {
        self.number([self.index(0, u), self.index(1, v), self.index(2, t)])
    }

    fn number(&self, [u, v, t]: [u32; 3]) -> usize {
        ((t * self.counts[1] + v) * self.counts[0] + u) as usize
    }

    /// Boxes that may contain a sample of `within`, each with its intersection.
    pub fn overlapping(&self, within: &Box5) -> impl Iterator<Item = (usize, Box5)> + use<> {
        let (grid, within) = (*self, *within);
        let run = |axis: usize, [lo, hi]: [f32; 2]| -> Range<u32> {
            if lo > hi { 0..0 } else { grid.index(axis, lo)..grid.index(axis, hi) + 1 }
        };
        let lens = if grid.lens { [run(0, within.u), run(1, within.v)] } else { [0..1, 0..1] };
        let [us, vs] = lens;
        run(2, within.t).flat_map(move |t| {
            let us = us.clone();
            vs.clone().flat_map(move |v| {
                us.clone().map(move |u| (grid.number([u, v, t]), grid.part(&within, [u, v, t])))
            })
        })
    }

    fn part(&self, within: &Box5, [u, v, t]: [u32; 3]) -> Box5 {
        let cut = |axis: usize, index: u32, [lo, hi]: [f32; 2]| {
            [lo.max(self.border(axis, index)), hi.min(self.last(axis, index))]
        };
        let t = cut(2, t, within.t);
        if self.lens {
            Box5 { u: cut(0, u, within.u), v: cut(1, v, within.v), t, ..*within }
        } else {
            Box5 { t, ..*within }
        }
    }

    /// Largest float in box `index`, just below the next border.
    fn last(&self, axis: usize, index: u32) -> f32 {
        let end = self.border(axis, index + 1);
        if index + 1 == self.counts[axis] { end } else { end.next_down() }
    }
}

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

    /// Depths compared to find the farthest of a tile: of its samples on the first level, else those of its
    /// child tiles.
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
pub(super) mod tests {
    use super::*;
    use crate::geometry::{Shear, Viewport};
    use crate::sampling::{LensShape, SampleTable, TileSamples};

    /// A tile of samples.
    pub fn samples() -> TileSamples {
        let table = SampleTable::low_discrepancy(16, 3, LensShape::Disk).unwrap();
        let mut samples = TileSamples::default();
        samples.fill(&table, Viewport::new(8, 8).unwrap(), &Shear::default(), [0, 0], 8);
        samples
    }

    /// Whether the sample in `slot` is in the box.
    pub fn holds(within: &Box5, samples: &TileSamples, slot: usize) -> bool {
        let inside = |[lo, hi]: [f32; 2], coordinate: f32| (lo..=hi).contains(&coordinate);
        let lens = inside(within.u, samples.u[slot]) && inside(within.v, samples.v[slot]);
        inside(within.t, samples.t[slot]) && (lens || !within.lens)
    }

    #[test]
    fn every_sample_lies_in_its_box_and_in_no_other() {
        let samples = samples();
        for lens in [false, true] {
            let grid = BoxGrid::new([3, 2, 5], lens).unwrap();
            let parts: Vec<_> = grid.overlapping(&Box5::whole(lens)).collect();
            assert_eq!(parts.len(), if lens { 30 } else { 5 });
            for slot in 0..samples.len {
                let own = grid.of_sample(samples.u[slot], samples.v[slot], samples.t[slot]);
                for (index, part) in &parts {
                    assert_eq!(holds(part, &samples, slot), *index == own, "{slot} {part:?}");
                }
            }
        }
    }

    #[test]
    fn grids_have_at_least_one_box_and_not_too_many() {
        assert!(BoxGrid::new([0, 1, 1], true).is_none());
        assert!(BoxGrid::new([1, 17, 1], true).is_none());
        assert_eq!(BoxGrid::new([4, 4, 4], false).unwrap().len(), 4);
    }

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
