//! One triangle over the cells of a bin, sixteen cells at a time.
//!
//! For every cell, a box of lens and time: where on the screen the triangle may be, which faces it may show
//! ([`Facing`]), and a linear function in X and Y above each of its edge functions (`edges`).

use super::sorter::{BinSamples, Boxes, CellRange};
use crate::geometry::Shear;
use crate::sample_test::View;
use crate::setup::{Corner, Triangle, cross};
use crate::simd::{LANES, Lanes, Mask, Row};

/// Smaller depths are not used as divisors.
const MIN_DIVISOR: f32 = 1e-30;
/// Larger results are not used.
const MAX_RESULT: f32 = 1e30;

/// A triangle over the cells of a bin.
#[derive(Clone, Debug)]
pub(super) struct CellSetup {
    /// Screen box in which it may be visible: lowest and highest x and y.
    pub x: [Row; 2],
    pub y: [Row; 2],
    /// First and last row of blocks that may contain it.
    pub rows: [Row; 2],
    /// Smallest depth of its vertices.
    pub nearest: Row,
    pub edges: [EdgeRows; 3],
    /// Cells in which it may show a drawn face: the one that appears clockwise, and counter-clockwise.
    pub faces: [Mask; 2],
}

impl CellSetup {
    pub const EMPTY: Self = {
        const ZERO: Row = Row::splat(0.0);
        const EDGE: EdgeRows = EdgeRows { bound: [ZERO; 2], slope_x: ZERO, slope_y: ZERO };
        Self { x: [ZERO; 2], y: [ZERO; 2], rows: [ZERO; 2], nearest: ZERO, edges: [EDGE; 3], faces: [0; 2] }
    };
}

impl Scene<'_> {
    /// Fill `setup` and return the cells in which the triangle may be visible.
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

    /// Screen box in each cell, the smallest depth, and the cells in which both allow the triangle to be
    /// visible.
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
        // A vertex at or behind the camera may appear anywhere.
        let ahead = nearest.gt(V::splat(MIN_DIVISOR));
        let inverse = V::splat(1.0) / nearest;
        let (x, seen_x) = self.within::<V>(x, 0, inverse, ahead);
        let (y, seen_y) = self.within::<V>(y, 1, inverse, ahead);
        (x, y, nearest, seen_x & seen_y & farthest.gt(V::splat(self.near)))
    }

    /// Widen `range` by the images of a vertex from both ends of a cell on the lens.
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

    /// The range widened by the rounding error and clipped to the bin, and the cells in which it is not
    /// empty.
    #[inline(always)]
    fn within<V: Lanes>(&self, range: [V; 2], axis: usize, inverse: V, ahead: Mask) -> ([V; 2], Mask) {
        let share = V::splat(4.0 * ROUNDING);
        let pad = V::splat(4.0 * self.triangle.slack[axis]) * inverse
            + share * (range[0].abs().max(range[1].abs()) + V::splat(self.shear.a[axis].abs()));
        let (low, high) = (range[0] - pad, range[1] + pad);
        // After a possible overflow nothing is known.
        let known = ahead & V::splat(MAX_RESULT).gt(pad) & V::splat(MAX_RESULT).gt(high - low);
        let [bin_low, bin_high] = [V::splat(self.bin.rect[axis][0]), V::splat(self.bin.rect[axis][1])];
        let low = low.max(bin_low).or_else(known, bin_low);
        let high = high.min(bin_high).or_else(known, bin_high);
        ([low, high], high.ge(low))
    }

    /// First and last row of the blocks of a bin that may contain samples in `range`, as integers after
    /// truncation.
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

    /// Middle of the screen box, and half the extents of the cell.
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

    /// Middle of every cell, as if it were a sample.
    #[inline(always)]
    fn middle<V: Lanes, const MOTION: bool, const LENS: bool>(&self, at: [V; 2]) -> View<V, MOTION, LENS> {
        let (cells, zero) = (&self.bin.cells, V::splat(0.0));
        let mut view = View { slope: at, lens: [zero; 2], t: zero };
        if LENS {
            let position = [V::load(&cells.u.middle.0), V::load(&cells.v.middle.0)];
            for axis in 0..2 {
                view.slope[axis] = at[axis] - position[axis] * V::splat(self.shear.a[axis]);
                view.lens[axis] = position[axis] * V::splat(self.shear.s[axis]);
            }
        }
        if MOTION {
            view.t = V::load(&cells.t.middle.0);
        }
        view
    }
}

/// Mask of the existing cells, out of [`LANES`].
pub(super) fn all(cells: usize) -> Mask {
    if cells >= LANES { Mask::MAX } else { (1 << cells) - 1 }
}

/// Rounding error of a sum of products of `f32`, relative to the sum of magnitudes.
pub(super) const ROUNDING: f32 = 1.0 / 524_288.0;

/// Triangle, camera and bin, as needed for bounds over cells.
#[derive(Clone, Copy)]
pub(super) struct Scene<'a> {
    pub triangle: &'a Triangle,
    pub facing: &'a Facing,
    pub shear: &'a Shear,
    pub near: f32,
    pub bin: &'a BinSamples,
    /// Largest |X| and |Y| of the image.
    pub half_px: [f32; 2],
    /// Height of a block, and rows of blocks in a bin.
    pub block_px: u32,
    pub block_rows: u32,
}

/// An edge, by cell.
#[derive(Clone, Debug)]
pub(super) struct EdgeRows {
    /// By face: upper bound of the edge in the cell, in the sign of the face, less its slopes times X and Y.
    pub bound: [Row; 2],
    pub slope_x: Row,
    pub slope_y: Row,
}

/// Half the extents of a cell, and derived values.
pub(super) struct Extent<V> {
    pub screen: [V; 2],
    pub lens: [V; 2],
    pub t: V,
    /// Largest `a du - dX`, in x and y.
    pub turn: [V; 2],
    /// Largest `s du`.
    pub shift: [V; 2],
}

impl Scene<'_> {
    /// Cells in which a clockwise face, and those in which a counter-clockwise face, may be visible.
    #[inline(always)]
    pub fn faces<V: Lanes, const MOTION: bool, const LENS: bool>(
        &self,
        margin: V,
        extent: &Extent<V>,
    ) -> [Mask; 2] {
        let (cells, constant) = (&self.bin.cells, &self.facing.constant);
        let t = V::load(&cells.t.middle.0);
        let mut det = Polynomial::new::<MOTION>(constant, t, extent.t);
        if LENS {
            for (axis, range) in [&cells.u, &cells.v].into_iter().enumerate() {
                let slope = Polynomial::new::<MOTION>(&self.facing.lens[axis], t, extent.t);
                let position = V::load(&range.middle.0);
                det.value = det.value + position * slope.value;
                det.extent = det.extent
                    + position.abs() * slope.extent
                    + extent.lens[axis] * (slope.value.abs() + slope.extent);
                det.magnitude = det.magnitude + slope.magnitude;
            }
        }
        let extent = det.extent + margin + V::splat(ROUNDING) * det.magnitude;
        let zero = V::splat(0.0);
        let mut faces = [!zero.gt(det.value + extent), !(det.value - extent).gt(zero)];
        for (face, drawn) in faces.iter_mut().zip(self.triangle.faces) {
            *face = if drawn { *face } else { 0 };
        }
        faces
    }
}

/// A polynomial in time over a cell.
struct Polynomial<V> {
    /// Value in the middle.
    value: V,
    /// Largest difference from it anywhere.
    extent: V,
    /// Sum of the magnitudes of its terms.
    magnitude: V,
}

impl<V: Lanes> Polynomial<V> {
    /// A polynomial with the given coefficients, about `t` in either direction by `half`: its finite Taylor
    /// series.
    #[inline(always)]
    fn new<const MOTION: bool>(coefficients: &[f32], t: V, half: V) -> Self {
        let magnitude = V::splat(coefficients.iter().map(|c| c.abs()).sum());
        if !MOTION {
            return Self { value: V::splat(coefficients[0]), extent: V::splat(0.0), magnitude };
        }
        let cubic = coefficients.get(3).copied().unwrap_or(0.0);
        let [c0, c1] = [V::splat(coefficients[0]), V::splat(coefficients[1])];
        let [c2, c3] = [V::splat(coefficients[2]), V::splat(cubic)];
        let value = ((c3 * t + c2) * t + c1) * t + c0;
        let first = (V::splat(3.0) * c3 * t + V::splat(2.0) * c2) * t + c1;
        let second = V::splat(3.0) * c3 * t + c2;
        let extent = ((c3.abs() * half + second.abs()) * half + first.abs()) * half;
        Self { value, extent, magnitude }
    }
}

/// Bounds of a triangle in a cell, each number in all lanes.
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

    /// Lanes with farthest depths behind the triangle's nearest depth.
    #[inline(always)]
    pub fn before(&self, farthest: &Row) -> Mask {
        V::load(&farthest.0).ge(self.nearest)
    }

    /// Boxes that the triangle may touch.
    #[inline(always)]
    pub fn meet(&self, boxes: &Boxes) -> Mask {
        V::load(&boxes.x[1].0).ge(self.x[0])
            & self.x[1].ge(V::load(&boxes.x[0].0))
            & V::load(&boxes.y[1].0).ge(self.y[0])
            & self.y[1].ge(V::load(&boxes.y[0].0))
    }
}

/// Boxes in which, for some face that may be visible, no edge is known to be negative in the sign of the
/// face.
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

/// The same for one edge and face, with `bound` and the slopes evaluated at their maximum in a box.
#[inline(always)]
fn in_front<V: Lanes>(edge: &EdgeRows, cell: usize, face: usize, boxes: &Boxes) -> Mask {
    let sign = if face == 0 { 1.0 } else { -1.0 };
    let (x, y) = (sign * edge.slope_x.0[cell], sign * edge.slope_y.0[cell]);
    let (end_x, end_y) = (usize::from(x > 0.0), usize::from(y > 0.0));
    let bound = V::load(&boxes.x[end_x].0).times_plus(V::splat(x), V::splat(edge.bound[face].0[cell]));
    let bound = V::load(&boxes.y[end_y].0).times_plus(V::splat(y), bound);
    // Overflow to NaN proves nothing.
    !V::splat(0.0).gt(bound)
}

/// Facing determinant of a triangle, by powers of `t`: a polynomial of lens and time.
///
/// With the vertices `p_k = (x, y, w)`, sheared to the lens position `(u, v)`,
///
/// ```text
/// det(u, v, t) = det[x, y, w] - u s.x sum(y_i w_j - y_j w_i) - v s.y sum(w_i x_j - w_j x_i)
/// ```
///
/// since the part of the shear that grows with depth adds a multiple of one row to another. The first term is
/// cubic in `t`, the sums are quadratic. The edge functions weighted by depth add up to `det`. So a sample
/// inside, beyond the near depth, sees all edges with the sign of `det`, and the face is known before any
/// sample is tested.
#[derive(Clone, Copy, Debug)]
pub(super) struct Facing {
    /// Part independent of the lens.
    pub constant: [f32; 4],
    /// Factors of `u` and `v`.
    pub lens: [[f32; 3]; 2],
}

type Point = [f64; 3];

impl Facing {
    /// Computed in `f64` and rounded to `f32`. Each coefficient is within 2^-24 of itself plus 2^-48 of the
    /// products in it.
    pub fn new(corners: &[Corner; 3], shear: &Shear) -> Self {
        let open = corners.map(|corner| corner.open.map(f64::from));
        let delta = corners.map(|corner| corner.delta.map(f64::from));
        let normal = |i: usize, j: usize| {
            [cross(open[i], open[j]), mixed(i, j, &open, &delta), cross(delta[i], delta[j])]
        };
        let normals = [normal(1, 2), normal(2, 0), normal(0, 1)];
        let mut constant = [0.0; 4];
        for (power, part) in constant.iter_mut().enumerate() {
            // The determinant is the first vertex times the normal of the opposite edge.
            let still = if power < 3 { dot(open[0], normals[0][power]) } else { 0.0 };
            let moved = if power > 0 { dot(delta[0], normals[0][power - 1]) } else { 0.0 };
            *part = (still + moved) as f32;
        }
        let lens = [0, 1].map(|axis| {
            let s = f64::from(shear.s[axis]);
            [0, 1, 2].map(|power| -(s * normals.iter().map(|n| n[power][axis]).sum::<f64>()) as f32)
        });
        Self { constant, lens }
    }
}

fn mixed(i: usize, j: usize, open: &[Point; 3], delta: &[Point; 3]) -> Point {
    let (a, b) = (cross(open[i], delta[j]), cross(delta[i], open[j]));
    [0, 1, 2].map(|axis| a[axis] + b[axis])
}

fn dot(a: Point, b: Point) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::MovingVertex;

    #[test]
    fn the_polynomial_is_the_determinant_of_the_sheared_vertices() {
        let shear = Shear::new([3.0, -3.0], [0.5, -0.5]);
        let ends = [
            ([1.0, 2.0, 4.0], [2.0, -1.0, 5.0]),
            ([-3.0, 0.5, 6.0], [0.0, 1.0, -2.0]),
            ([2.0, -4.0, 3.0], [1.0, 1.0, 7.0]),
        ];
        let corners = ends.map(|(open, close)| Corner::new(&MovingVertex { open, close }));
        let facing = Facing::new(&corners, &shear);
        for (u, v, t) in [(0.0, 0.0, 0.0), (0.5, -0.25, 0.25), (-1.0, 0.75, 0.5), (0.3, 0.9, 1.0)] {
            let p = corners.map(|corner| {
                let [x, y, w] = corner.at(t as f32).map(f64::from);
                [x + u * (0.5 * w - 3.0), y + v * (-0.5 * w + 3.0), w]
            });
            let horner = |c: &[f32]| c.iter().rev().fold(0.0, |sum, &c| sum * t + f64::from(c));
            let ours = horner(&facing.constant) + u * horner(&facing.lens[0]) + v * horner(&facing.lens[1]);
            let expected = dot(p[0], cross(p[1], p[2]));
            assert!((ours - expected).abs() < 1e-4, "{ours} {expected} at {u} {v} {t}");
        }
    }
}
