//! One cell of a triangle against blocks and against the packets of a block, sixteen at a time.

use super::cells::{CellSetup, EdgeRows};
use super::layout::Boxes;
use crate::simd::{Lanes, Mask, Row};

/// What bounds a triangle in a cell, each number in all lanes.
pub(super) struct CellBounds<V> {
    nearest: V,
    x: [V; 2],
    y: [V; 2],
}

/// The edges of one face of a triangle in a cell.
pub(super) struct FaceBounds<V>([EdgeBound<V>; 3]);

/// An edge is at most `most + x slope_x + y slope_y`, in the sign of the face; `ends` says at which end of a box in x and in y
/// that is largest.
struct EdgeBound<V> {
    most: V,
    slope: [V; 2],
    ends: [usize; 2],
}

impl<V: Lanes> CellBounds<V> {
    #[inline(always)]
    pub fn new(setup: &CellSetup, cell: usize) -> Self {
        Self {
            nearest: V::splat(setup.nearest.0[cell]),
            x: [V::splat(setup.x[0].0[cell]), V::splat(setup.x[1].0[cell])],
            y: [V::splat(setup.y[0].0[cell]), V::splat(setup.y[1].0[cell])],
        }
    }

    /// Those with these farthest depths that the triangle may lie before.
    #[inline(always)]
    pub fn before(&self, farthest: &Row) -> Mask {
        V::load(&farthest.0).ge(self.nearest)
    }

    /// The boxes that the triangle may reach.
    #[inline(always)]
    pub fn meet(&self, boxes: &Boxes) -> Mask {
        V::load(&boxes.x[1].0).ge(self.x[0])
            & self.x[1].ge(V::load(&boxes.x[0].0))
            & V::load(&boxes.y[1].0).ge(self.y[0])
            & self.y[1].ge(V::load(&boxes.y[0].0))
    }
}

impl<V: Lanes> FaceBounds<V> {
    #[inline(always)]
    pub fn new(setup: &CellSetup, cell: usize, face: usize) -> Self {
        let [a, b, c] = &setup.edges;
        Self([EdgeBound::new(a, cell, face), EdgeBound::new(b, cell, face), EdgeBound::new(c, cell, face)])
    }

    /// The boxes in which no edge is known to be below zero.
    #[inline(always)]
    pub fn meet(&self, boxes: &Boxes) -> Mask {
        let [a, b, c] = &self.0;
        a.meet(boxes) & b.meet(boxes) & c.meet(boxes)
    }
}

impl<V: Lanes> EdgeBound<V> {
    #[inline(always)]
    fn new(edge: &EdgeRows, cell: usize, face: usize) -> Self {
        let sign = if face == 0 { 1.0 } else { -1.0 };
        let (x, y) = (sign * edge.slope_x.0[cell], sign * edge.slope_y.0[cell]);
        Self {
            most: V::splat(edge.most[face].0[cell]),
            slope: [V::splat(x), V::splat(y)],
            ends: [usize::from(x > 0.0), usize::from(y > 0.0)],
        }
    }

    #[inline(always)]
    fn meet(&self, boxes: &Boxes) -> Mask {
        let most = V::load(&boxes.x[self.ends[0]].0).times_plus(self.slope[0], self.most);
        let most = V::load(&boxes.y[self.ends[1]].0).times_plus(self.slope[1], most);
        // Where the arithmetic overflowed to NaN nothing is known.
        !V::splat(0.0).gt(most)
    }
}
