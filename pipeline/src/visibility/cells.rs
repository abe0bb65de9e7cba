//! One triangle over the cells of a bin, sixteen cells at a time.
//!
//! For every cell, a box of lens and time: where on the screen the triangle may be, which faces it may show (`faces`), and a
//! linear function in X and Y above each of its edge functions (`edges`).

use super::bin::CellRange;
use super::scene::{EdgeRows, Extent, ROUNDING, Scene};
use crate::sample_test::block::View;
use crate::simd::{LANES, Lanes, Mask, Row};

/// Depths below this are not divided by.
const TINY: f32 = 1e-30;
/// Results above this are not trusted.
const HUGE: f32 = 1e30;

/// A triangle over the cells of a bin.
#[derive(Clone, Debug)]
pub(super) struct CellSetup {
    /// Where it may be seen: lowest and highest x and y.
    pub x: [Row; 2],
    pub y: [Row; 2],
    /// First and last row of the blocks that may hold it.
    pub rows: [Row; 2],
    /// The smallest depth of its vertices.
    pub nearest: Row,
    pub edges: [EdgeRows; 3],
    /// Cells in which it may show a face that is drawn: the one that appears clockwise, and counter-clockwise.
    pub faces: [Mask; 2],
}

impl CellSetup {
    pub const EMPTY: Self = {
        const ZERO: Row = Row::splat(0.0);
        const EDGE: EdgeRows = EdgeRows { most: [ZERO; 2], slope_x: ZERO, slope_y: ZERO };
        Self { x: [ZERO; 2], y: [ZERO; 2], rows: [ZERO; 2], nearest: ZERO, edges: [EDGE; 3], faces: [0; 2] }
    };
}

impl Scene<'_> {
    /// Fills `setup` and says in which cells the triangle may be seen.
    #[inline(always)]
    pub fn cells<V: Lanes, const MOTION: bool, const LENS: bool>(&self, setup: &mut CellSetup) -> Mask {
        let (x, y, nearest, mut active) = self.boxes::<V, MOTION, LENS>();
        if active == 0 {
            return 0;
        }
        for end in 0..2 {
            x[end].store(&mut setup.x[end].0);
            y[end].store(&mut setup.y[end].0);
        }
        self.rows(y, &mut setup.rows);
        nearest.store(&mut setup.nearest.0);
        let (middle, extent) = self.extent::<V, MOTION, LENS>(x, y);
        let view = self.middle::<V, MOTION, LENS>(middle);
        let [a, b, c] = &self.triangle.corners;
        let vertices =
            [self.vertex(a, &view, &extent), self.vertex(b, &view, &extent), self.vertex(c, &view, &extent)];
        let rounding = [
            self.edge::<V, MOTION, LENS>(&vertices[1], &vertices[2], middle, &extent, &mut setup.edges[0]),
            self.edge::<V, MOTION, LENS>(&vertices[2], &vertices[0], middle, &extent, &mut setup.edges[1]),
            self.edge::<V, MOTION, LENS>(&vertices[0], &vertices[1], middle, &extent, &mut setup.edges[2]),
        ];
        let margin = rounding[0] * vertices[0].w_abs
            + (rounding[1] * vertices[1].w_abs + rounding[2] * vertices[2].w_abs);
        setup.faces = self.faces::<V, MOTION, LENS>(margin, &extent);
        active &= setup.faces[0] | setup.faces[1];
        active
    }

    /// The box on the screen in each cell, the smallest depth, and the cells where both let the triangle be seen.
    #[inline(always)]
    fn boxes<V: Lanes, const MOTION: bool, const LENS: bool>(&self) -> ([V; 2], [V; 2], V, Mask) {
        let cells = &self.bin.cells;
        let times = [V::load(&cells.t.lo.0), V::load(&cells.t.hi.0)];
        let mut nearest = V::splat(f32::INFINITY);
        let mut farthest = V::splat(f32::NEG_INFINITY);
        let mut x = [nearest, farthest];
        let mut y = x;
        for corner in &self.triangle.corners {
            for time in if MOTION { &times[..] } else { &times[..1] } {
                let [mut px, mut py, mut w] =
                    [V::splat(corner.open[0]), V::splat(corner.open[1]), V::splat(corner.open[2])];
                if MOTION {
                    px = px + *time * V::splat(corner.delta[0]);
                    py = py + *time * V::splat(corner.delta[1]);
                    w = w + *time * V::splat(corner.delta[2]);
                }
                nearest = w.min(nearest);
                farthest = w.max(farthest);
                let inverse = V::splat(1.0) / w;
                self.include::<V, LENS>(&mut x, 0, px * inverse, inverse, &cells.u);
                self.include::<V, LENS>(&mut y, 1, py * inverse, inverse, &cells.v);
            }
        }
        // A vertex at or behind the camera may be seen anywhere.
        let ahead = nearest.gt(V::splat(TINY));
        let inverse = V::splat(1.0) / nearest;
        let (x, seen_x) = self.within::<V>(x, 0, inverse, ahead);
        let (y, seen_y) = self.within::<V>(y, 1, inverse, ahead);
        (x, y, nearest, seen_x & seen_y & farthest.gt(V::splat(self.near)))
    }

    /// Widens `range` to where a vertex is seen from both ends of a cell on the lens.
    #[inline(always)]
    fn include<V: Lanes, const LENS: bool>(
        &self,
        range: &mut [V; 2],
        axis: usize,
        at: V,
        inverse: V,
        lens: &CellRange,
    ) {
        if LENS {
            let shear = V::splat(self.shear.a[axis]) - V::splat(self.shear.s[axis]) * inverse;
            let (low, high) = (at + V::load(&lens.lo.0) * shear, at + V::load(&lens.hi.0) * shear);
            range[0] = low.min(high).min(range[0]);
            range[1] = low.max(high).max(range[1]);
        } else {
            range[0] = at.min(range[0]);
            range[1] = at.max(range[1]);
        }
    }

    /// The range widened by what rounding may do, as far as it lies in the bin, and the cells where it does.
    #[inline(always)]
    fn within<V: Lanes>(&self, range: [V; 2], axis: usize, inverse: V, ahead: Mask) -> ([V; 2], Mask) {
        let share = V::splat(4.0 * ROUNDING);
        let pad = V::splat(4.0 * self.triangle.slack[axis]) * inverse
            + share * (range[0].abs().max(range[1].abs()) + V::splat(self.shear.a[axis].abs()));
        let (low, high) = (range[0] - pad, range[1] + pad);
        // Where the arithmetic may have overflowed nothing is known.
        let known = ahead & V::splat(HUGE).gt(pad) & V::splat(HUGE).gt(high - low);
        let [bin_low, bin_high] = [V::splat(self.bin.rect[axis][0]), V::splat(self.bin.rect[axis][1])];
        let low = low.max(bin_low).or_else(known, bin_low);
        let high = high.min(bin_high).or_else(known, bin_high);
        ([low, high], high.ge(low))
    }

    /// First and last row of the blocks of a bin that may hold samples in `range`, as whole numbers once cut off.
    #[inline(always)]
    fn rows<V: Lanes>(&self, range: [V; 2], into: &mut [Row; 2]) {
        // Rounding may put a sample of the last pixel of a block at the first position of the next.
        const ROUNDING_PX: f32 = 1.0 / 64.0;
        let per_px = V::splat(1.0 / self.block_px as f32);
        let last = V::splat((self.block_rows - 1) as f32);
        let first = (range[0] - V::splat(self.bin.top + ROUNDING_PX)) * per_px;
        first.max(V::splat(0.0)).min(last).store(&mut into[0].0);
        ((range[1] - V::splat(self.bin.top)) * per_px).max(V::splat(0.0)).min(last).store(&mut into[1].0);
    }

    /// The middle of the box on the screen and half the extents of the cell.
    #[inline(always)]
    fn extent<V: Lanes, const MOTION: bool, const LENS: bool>(
        &self,
        x: [V; 2],
        y: [V; 2],
    ) -> ([V; 2], Extent<V>) {
        let zero = V::splat(0.0);
        let (half, up) = (V::splat(0.5), V::splat(1.0 + 4.0 * f32::EPSILON));
        let middle = [half * (x[0] + x[1]), half * (y[0] + y[1])];
        let screen =
            [up * (x[1] - middle[0]).max(middle[0] - x[0]), up * (y[1] - middle[1]).max(middle[1] - y[0])];
        let cells = &self.bin.cells;
        let lens = if LENS { [V::load(&cells.u.half.0), V::load(&cells.v.half.0)] } else { [zero; 2] };
        let t = if MOTION { V::load(&cells.t.half.0) } else { zero };
        let (mut turn, mut shift) = (screen, [zero; 2]);
        if LENS {
            for axis in 0..2 {
                turn[axis] = turn[axis] + V::splat(self.shear.a[axis].abs()) * lens[axis];
                shift[axis] = V::splat(self.shear.s[axis].abs()) * lens[axis];
            }
        }
        (middle, Extent { screen, lens, t, turn, shift })
    }

    /// The middle of every cell as if it were a sample.
    #[inline(always)]
    fn middle<V: Lanes, const MOTION: bool, const LENS: bool>(&self, at: [V; 2]) -> View<V, MOTION, LENS> {
        let (cells, zero) = (&self.bin.cells, V::splat(0.0));
        let mut view = View { slope: at, lens: [zero; 2], t: zero };
        if LENS {
            let place = [V::load(&cells.u.middle.0), V::load(&cells.v.middle.0)];
            for axis in 0..2 {
                view.slope[axis] = at[axis] - place[axis] * V::splat(self.shear.a[axis]);
                view.lens[axis] = place[axis] * V::splat(self.shear.s[axis]);
            }
        }
        if MOTION {
            view.t = V::load(&cells.t.middle.0);
        }
        view
    }
}

/// The cells there are, of [`LANES`].
pub(super) fn all(cells: usize) -> Mask {
    if cells >= LANES { Mask::MAX } else { (1 << cells) - 1 }
}
