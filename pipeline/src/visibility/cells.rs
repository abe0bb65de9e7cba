//! One triangle over the cells of a bin, sixteen cells at a time.
//!
//! For every cell, a box of lens and time: where on the screen the triangle may be, which faces it may show, and a linear
//! function in X and Y above each of its edge functions. The edges are linearized about the middle of the box (Munkberg and
//! Akenine-Moeller 2012), and what is left out is bounded term by term. With `dX, dY, du, dv, dt` from the middle, a vertex
//! there at `P` with velocity `V`, depth `w` and change of depth `w'`, and `(s, a)` the shear of the lens in x, `(r, b)` in y,
//!
//! ```text
//! P(d) = P + (du (a w - s) - dX w, dv (b w - r) - dY w) + dt (V + w' (a du - dX, b dv - dY))
//! e(d) = e + linear + (w_j - w_i + dt (w'_j - w'_i)) (dY s du - dX r dv)
//!          + dt [-dX c_a - dY c_b + du (a c_a + s (V_i - V_j)_y) + dv (b c_b + r (V_j - V_i)_x)]
//!          + dt^2 [V_i x V_j + (a du - dX) (w'_i V_j - w'_j V_i)_y + (b dv - dY) (w'_j V_i - w'_i V_j)_x]
//! c_a = w_i V_jy - w_j V_iy + w'_i P_jy - w'_j P_iy        c_b = w_j V_ix - w_i V_jx + w'_j P_ix - w'_i P_jx
//! ```
//!
//! which is exact, as `a r = b s` for a lens. All is in `f32` with an allowance for the rounding of both sides: the sample test
//! sees each vertex within `slack` of its place (see [`Triangle::slack`]), and so does this.

use super::facing::Facing;
use super::layout::{BinSamples, CellRange};
use crate::geometry::Shear;
use crate::sample_test::block::{Seen, View};
use crate::setup::{Corner, Triangle};
use crate::simd::{LANES, Lanes, Mask, Row};

/// What rounding may do to a sum of products of `f32`, as a share of the sum of magnitudes.
const ROUNDING: f32 = 1.0 / 524_288.0;

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
    /// First and last column, and first and last row, of the blocks that may hold it.
    pub columns: [Row; 2],
    pub rows: [Row; 2],
    /// The smallest depth of its vertices.
    pub nearest: Row,
    pub edges: [EdgeRows; 3],
    /// Cells in which it may show a face that is drawn: the one that appears clockwise, and counter-clockwise.
    pub faces: [Mask; 2],
}

/// An edge by cell.
#[derive(Clone, Debug)]
pub(super) struct EdgeRows {
    /// By face: what the edge is at most anywhere in the cell, in the sign of the face, less its slopes times X and Y.
    pub most: [Row; 2],
    pub slope_x: Row,
    pub slope_y: Row,
}

impl CellSetup {
    pub const EMPTY: Self = {
        const ZERO: Row = Row::splat(0.0);
        const EDGE: EdgeRows = EdgeRows { most: [ZERO; 2], slope_x: ZERO, slope_y: ZERO };
        Self {
            x: [ZERO; 2],
            y: [ZERO; 2],
            columns: [ZERO; 2],
            rows: [ZERO; 2],
            nearest: ZERO,
            edges: [EDGE; 3],
            faces: [0; 2],
        }
    };
}

/// A vertex over the cells: in the middle, and how far it may be from the samples anywhere.
#[derive(Clone, Copy)]
struct Vertex<V> {
    seen: Seen<V>,
    velocity: [V; 2],
    dw: V,
    reach: [V; 2],
    w_abs: V,
}

/// Half the extents of a cell and what follows from them.
struct Extent<V> {
    screen: [V; 2],
    lens: [V; 2],
    t: V,
    /// The largest `a du - dX`, in x and y.
    turn: [V; 2],
    /// The largest `s du`.
    shift: [V; 2],
}

/// What a worker needs to know of triangle, camera and bin.
#[derive(Clone, Copy)]
pub(super) struct Scene<'a> {
    pub triangle: &'a Triangle,
    pub facing: &'a Facing,
    pub shear: &'a Shear,
    pub near: f32,
    pub bin: &'a BinSamples,
    /// The largest |X| and |Y| of the image.
    pub half_px: [f32; 2],
    /// Size of a block, and blocks of a bin, across and down.
    pub block_px: [u32; 2],
    pub blocks: [u32; 2],
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
        self.blocks(x, 0, &mut setup.columns);
        self.blocks(y, 1, &mut setup.rows);
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

    /// First and last column or row of the blocks of a bin that may hold samples in `range`, as whole numbers once
    /// cut off.
    #[inline(always)]
    fn blocks<V: Lanes>(&self, range: [V; 2], axis: usize, into: &mut [Row; 2]) {
        // Rounding may put a sample of the last pixel of a block at the first position of the next.
        const ROUNDING_PX: f32 = 1.0 / 64.0;
        let per_px = V::splat(1.0 / self.block_px[axis] as f32);
        let (corner, last) = (self.bin.corner[axis], V::splat((self.blocks[axis] - 1) as f32));
        let first = (range[0] - V::splat(corner + ROUNDING_PX)) * per_px;
        first.max(V::splat(0.0)).min(last).store(&mut into[0].0);
        ((range[1] - V::splat(corner)) * per_px).max(V::splat(0.0)).min(last).store(&mut into[1].0);
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

    #[inline(always)]
    fn vertex<V: Lanes, const MOTION: bool, const LENS: bool>(
        &self,
        corner: &Corner,
        view: &View<V, MOTION, LENS>,
        extent: &Extent<V>,
    ) -> Vertex<V> {
        let seen = view.see(corner);
        let [dx, dy, dw] = [V::splat(corner.delta[0]), V::splat(corner.delta[1]), V::splat(corner.delta[2])];
        let mut w_abs = seen.w.abs();
        let mut velocity = [V::splat(0.0); 2];
        if MOTION {
            velocity = [dx - view.slope[0] * dw, dy - view.slope[1] * dw];
            w_abs = w_abs + extent.t * dw.abs();
        }
        let mut reach = [seen.x.abs(), seen.y.abs()];
        for axis in 0..2 {
            reach[axis] = reach[axis] + extent.turn[axis] * w_abs;
            if LENS {
                reach[axis] = reach[axis] + extent.shift[axis];
            }
            if MOTION {
                reach[axis] = reach[axis] + extent.t * velocity[axis].abs();
            }
        }
        Vertex { seen, velocity, dw, reach, w_abs }
    }

    /// Writes one edge and returns how far rounding may move its value.
    #[inline(always)]
    fn edge<V: Lanes, const MOTION: bool, const LENS: bool>(
        &self,
        i: &Vertex<V>,
        j: &Vertex<V>,
        middle: [V; 2],
        extent: &Extent<V>,
        row: &mut EdgeRows,
    ) -> V {
        let (p, q) = (&i.seen, &j.seen);
        let value = p.x * q.y - q.x * p.y;
        let slope_x = q.w * p.y - p.w * q.y;
        let slope_y = q.x * p.w - p.x * q.w;
        let (slack_x, slack_y) =
            (V::splat(2.0 * self.triangle.slack[0]), V::splat(2.0 * self.triangle.slack[1]));
        let rounding = slack_x * ((i.reach[1] + j.reach[1]) + slack_y)
            + slack_y * (i.reach[0] + j.reach[0])
            + V::splat(ROUNDING) * (i.reach[0] * j.reach[1] + j.reach[0] * i.reach[1]);
        let far = slope_x.abs() * V::splat(self.half_px[0]) + slope_y.abs() * V::splat(self.half_px[1]);
        let mut margin = V::splat(ROUNDING).times_plus(far, rounding + rounding)
            + self.remainder::<V, MOTION, LENS>(i, j, extent);
        if LENS {
            let (a, b) = (V::splat(self.shear.a[0]), V::splat(self.shear.a[1]));
            let (s, r) = (V::splat(self.shear.s[0]), V::splat(self.shear.s[1]));
            let slope_u = a.times_plus(slope_x, s * (q.y - p.y));
            let slope_v = b.times_plus(slope_y, r * (p.x - q.x));
            margin =
                slope_v.abs().times_plus(extent.lens[1], slope_u.abs().times_plus(extent.lens[0], margin));
        }
        if MOTION {
            let slope_t =
                (i.velocity[0] * q.y - j.velocity[0] * p.y) + (p.x * j.velocity[1] - q.x * i.velocity[1]);
            margin = slope_t.abs().times_plus(extent.t, margin);
        }
        let value = value - slope_x * middle[0] - slope_y * middle[1];
        (value + margin).store(&mut row.most[0].0);
        (margin - value).store(&mut row.most[1].0);
        slope_x.store(&mut row.slope_x.0);
        slope_y.store(&mut row.slope_y.0);
        rounding
    }

    /// The most that the linear part leaves out, by the formula above.
    #[inline(always)]
    fn remainder<V: Lanes, const MOTION: bool, const LENS: bool>(
        &self,
        i: &Vertex<V>,
        j: &Vertex<V>,
        extent: &Extent<V>,
    ) -> V {
        let ([turn_x, turn_y], [shift_x, shift_y]) = (extent.turn, extent.shift);
        let (p, q, [vi_x, vi_y], [vj_x, vj_y]) = (&i.seen, &j.seen, i.velocity, j.velocity);
        let mut rest = V::splat(0.0);
        if LENS {
            let mut apart = (q.w - p.w).abs();
            if MOTION {
                apart = apart + extent.t * (j.dw - i.dw).abs();
            }
            rest = apart * (extent.screen[1] * shift_x + extent.screen[0] * shift_y);
        }
        if MOTION {
            let turn_a = (p.w * vj_y - q.w * vi_y) + (i.dw * q.y - j.dw * p.y);
            let turn_b = (q.w * vi_x - p.w * vj_x) + (j.dw * p.x - i.dw * q.x);
            let mut once = extent.screen[0] * turn_a.abs() + extent.screen[1] * turn_b.abs();
            if LENS {
                let by_u = V::splat(self.shear.a[0]) * turn_a + V::splat(self.shear.s[0]) * (vi_y - vj_y);
                let by_v = V::splat(self.shear.a[1]) * turn_b + V::splat(self.shear.s[1]) * (vj_x - vi_x);
                once = once + extent.lens[0] * by_u.abs() + extent.lens[1] * by_v.abs();
            }
            let twice = (vi_x * vj_y - vj_x * vi_y).abs()
                + turn_x * (i.dw * vj_y - j.dw * vi_y).abs()
                + turn_y * (j.dw * vi_x - i.dw * vj_x).abs();
            rest = rest + extent.t * (once + extent.t * twice);
        }
        rest
    }

    /// The cells in which a clockwise face, and those in which a counter-clockwise one, may be seen.
    #[inline(always)]
    fn faces<V: Lanes, const MOTION: bool, const LENS: bool>(
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
                let place = V::load(&range.middle.0);
                det.value = det.value + place * slope.value;
                det.extent = det.extent
                    + place.abs() * slope.extent
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
    /// In the middle.
    value: V,
    /// How far from that it may be anywhere.
    extent: V,
    /// The sum of the magnitudes it is made of.
    magnitude: V,
}

impl<V: Lanes> Polynomial<V> {
    /// By its coefficients, about `t` in either direction by `half`: Taylor's series, which ends.
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

/// The cells there are, of [`LANES`].
pub(super) fn all(cells: usize) -> Mask {
    if cells >= LANES { Mask::MAX } else { (1 << cells) - 1 }
}
