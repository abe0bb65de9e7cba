//! Cells of the shading grid that the samples of a tile are shaded in, sixteen at a time.

use super::pass::Pass;
use crate::sample_test::{Crossing, SampleRows, View};
use crate::sampling::TileSamples;
use crate::setup::Corner;
use crate::shading::{REFERENCE_TIME, cell_at, places};
use crate::simd::{Kernel, LANES, Lanes, Mask, VectorWidth, dispatch};

/// Shading grid over one triangle, for the samples of one tile.
pub(super) struct Grid<'a> {
    corners: &'a [Corner; 3],
    reference: [[f32; 3]; 3],
    image: [f32; 2],
    /// Whether every sample uses its own pixel, as those of a still triangle in focus do.
    plain: bool,
    samples: &'a TileSamples,
    /// First pixel of the tile.
    origin: [u32; 2],
    side_px: u32,
    cells: Cells,
}

/// Cells of a block of samples.
struct Cells {
    /// First slot of the block; none has the largest number.
    base: usize,
    /// By axis; undefined for samples whose surface point is not in front of the camera.
    at: [[i32; LANES]; 2],
    in_front: Mask,
}

impl<'a> Grid<'a> {
    /// Grid over the triangle with these `corners`, which may be `moving`, for a tile of `pass` that starts
    /// at pixel `origin`.
    pub fn new(
        pass: &Pass<'_>,
        (corners, moving): (&'a [Corner; 3], bool),
        samples: &'a TileSamples,
        origin: [u32; 2],
    ) -> Self {
        let cells = Cells { base: usize::MAX, at: [[0; LANES]; 2], in_front: 0 };
        let (plain, side_px) = (!moving && !pass.lens, pass.settings.spec.tile_px);
        let reference = reference(pass, corners);
        Self { corners, reference, image: pass.origin, plain, samples, origin, side_px, cells }
    }

    /// Cell of the sample in `slot`. A sample whose surface point is behind the camera at the reference uses
    /// its own pixel.
    #[inline]
    pub fn cell(&mut self, slot: usize) -> [i32; 2] {
        let (base, lane) = (slot / LANES * LANES, slot % LANES);
        if !self.plain && self.cells.base != base {
            self.find(base);
        }
        if self.plain || self.cells.in_front >> lane & 1 == 0 {
            return own_pixel(self.samples, slot, self.origin, self.side_px);
        }
        [0, 1].map(|axis| self.cells.at[axis][lane])
    }

    /// Appends the cells of the samples in `slots` to `found`.
    pub fn cells(&self, slots: &[u16], found: &mut Vec<[i32; 2]>) {
        let own = |&slot: &u16| own_pixel(self.samples, slot.into(), self.origin, self.side_px);
        if self.plain {
            return found.extend(slots.iter().map(own));
        }
        let first = found.len();
        let mut in_front = true;
        let (grid, all_in_front) = (self, &mut in_front);
        dispatch(VectorWidth::widest(), CellsOf { grid, slots, found, all_in_front });
        if !in_front {
            let cells = found[first..].iter_mut().zip(slots);
            cells.filter(|(cell, _)| **cell == BEHIND).for_each(|(cell, slot)| *cell = own(slot));
        }
    }

    /// Finds the cells of the block from `base` on.
    fn find(&mut self, base: usize) {
        self.cells.base = base;
        let Self { corners, reference, image, samples, .. } = *self;
        let (rows, cells) = (SampleRows::of(samples, base), &mut self.cells);
        dispatch(VectorWidth::widest(), Block { corners, reference: &reference, image, rows, cells });
    }
}

/// The cells of sixteen samples, with the operations of the sample test in their order.
struct Block<'a> {
    corners: &'a [Corner; 3],
    reference: &'a [[f32; 3]; 3],
    image: [f32; 2],
    rows: SampleRows<'a>,
    cells: &'a mut Cells,
}

impl Kernel for Block<'_> {
    #[inline(always)]
    fn run<V: Lanes>(self) {
        let crossing = Crossing::new(self.corners, &View::<V, true, true>::load(&self.rows));
        let (places, in_front) = places(self.reference, crossing.weights(), self.image);
        self.cells.in_front = in_front;
        for (cells, places) in self.cells.at.iter_mut().zip(places) {
            let mut place = [0.0; LANES];
            places.store(&mut place);
            for (cell, place) in cells.iter_mut().zip(place) {
                *cell = cell_at(place);
            }
        }
    }
}

/// Stands for the cell of a sample whose surface point is behind the camera; beyond all cells.
const BEHIND: [i32; 2] = [i32::MIN; 2];

/// The cells of any samples of a tile, gathered sixteen at a time.
struct CellsOf<'a, 'g> {
    grid: &'a Grid<'g>,
    slots: &'a [u16],
    found: &'a mut Vec<[i32; 2]>,
    /// Cleared if the point of any sample is not.
    all_in_front: &'a mut bool,
}

impl Kernel for CellsOf<'_, '_> {
    #[inline(always)]
    fn run<V: Lanes>(self) {
        let Grid { corners, reference, image, samples, .. } = self.grid;
        let mut cells = Cells { base: 0, at: [[0; LANES]; 2], in_front: 0 };
        for slots in self.slots.chunks(LANES) {
            let gathered = Gathered::new(samples, slots);
            let rows = gathered.rows();
            Block { corners, reference, image: *image, rows, cells: &mut cells }.run::<V>();
            for lane in 0..slots.len() {
                let is_in_front = cells.in_front >> lane & 1 == 1;
                *self.all_in_front &= is_in_front;
                self.found.push(if is_in_front { [cells.at[0][lane], cells.at[1][lane]] } else { BEHIND });
            }
        }
    }
}

/// Data of up to sixteen samples of a tile; other lanes repeat the last one.
struct Gathered {
    slope: [[f32; LANES]; 2],
    lens: [[f32; LANES]; 2],
    t: [f32; LANES],
}

impl Gathered {
    #[inline(always)]
    fn new(samples: &TileSamples, slots: &[u16]) -> Self {
        let mut gathered = Self { slope: [[0.0; LANES]; 2], lens: [[0.0; LANES]; 2], t: [0.0; LANES] };
        for lane in 0..LANES {
            let slot = usize::from(slots[lane.min(slots.len() - 1)]);
            for axis in 0..2 {
                gathered.slope[axis][lane] = samples.slope[axis][slot];
                gathered.lens[axis][lane] = samples.lens[axis][slot];
            }
            gathered.t[lane] = samples.t[slot];
        }
        gathered
    }

    #[inline(always)]
    fn rows(&self) -> SampleRows<'_> {
        let Self { slope: [slope_x, slope_y], lens: [lens_x, lens_y], t } = self;
        SampleRows { slope: [slope_x, slope_y], lens: [lens_x, lens_y], t }
    }
}

/// Vertices at the reference, as homogeneous points of the image plane.
pub(super) fn reference(pass: &Pass<'_>, corners: &[Corner; 3]) -> [[f32; 3]; 3] {
    corners.map(|corner| pass.projection.shear.homogeneous(corner.at(REFERENCE_TIME)))
}

/// Pixel of the sample in `slot` of a tile.
pub(super) fn own_pixel(samples: &TileSamples, slot: usize, tile: [u32; 2], side: u32) -> [i32; 2] {
    let pixel = u32::from(samples.pixel[slot]);
    [(tile[0] + pixel % side) as i32, (tile[1] + pixel / side) as i32]
}
