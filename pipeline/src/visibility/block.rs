//! One cell of a triangle against blocks and against the packets of a block, sixteen at a time.

use super::bin::Boxes;
use super::cells::CellSetup;
use super::scene::EdgeRows;
use crate::simd::{Lanes, Mask, Row};

/// What bounds a triangle in a cell, each number in all lanes.
pub(super) struct CellBounds<V> {
    nearest: V,
    x: [V; 2],
    y: [V; 2],
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

/// The boxes in which, for a face that may be seen, no edge is known to be below zero in the sign of the face.
#[inline(always)]
pub(super) fn in_front_of_edges<V: Lanes>(setup: &CellSetup, cell: usize, boxes: &Boxes) -> Mask {
    let mut shown = 0;
    for face in 0..2 {
        if setup.faces[face] >> cell & 1 != 0 {
            let [a, b, c] = &setup.edges;
            shown |= in_front::<V>(a, cell, face, boxes)
                & in_front::<V>(b, cell, face, boxes)
                & in_front::<V>(c, cell, face, boxes);
        }
    }
    shown
}

/// The same for one edge and face: `most` and the slopes, where in a box they are largest.
#[inline(always)]
fn in_front<V: Lanes>(edge: &EdgeRows, cell: usize, face: usize, boxes: &Boxes) -> Mask {
    let sign = if face == 0 { 1.0 } else { -1.0 };
    let (x, y) = (sign * edge.slope_x.0[cell], sign * edge.slope_y.0[cell]);
    let (end_x, end_y) = (usize::from(x > 0.0), usize::from(y > 0.0));
    let most = V::load(&boxes.x[end_x].0).times_plus(V::splat(x), V::splat(edge.most[face].0[cell]));
    let most = V::load(&boxes.y[end_y].0).times_plus(V::splat(y), most);
    // Where the arithmetic overflowed to NaN nothing is known.
    !V::splat(0.0).gt(most)
}
