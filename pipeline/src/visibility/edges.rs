//! Edges of a triangle over sixteen cells.
//!
//! The edges are linearized about the middle of the box (Munkberg and Akenine-Moeller 2012), and the
//! remainder is bounded term by term. Let `dX, dY, du, dv, dt` be offsets from the middle, `P` the position
//! of a vertex there, `V` its velocity, `w` its depth and `w'` the change of depth. `(s, a)` is the shear of
//! the lens in x, `(r, b)` in y. Then
//!
//! ```text
//! P(d) = P + (du (a w - s) - dX w, dv (b w - r) - dY w) + dt (V + w' (a du - dX, b dv - dY))
//! e(d) = e + linear + (w_j - w_i + dt (w'_j - w'_i)) (dY s du - dX r dv)
//!          + dt [-dX c_a - dY c_b + du (a c_a + s (V_i - V_j)_y) + dv (b c_b + r (V_j - V_i)_x)]
//!          + dt^2 [V_i x V_j + (a du - dX) (w'_i V_j - w'_j V_i)_y + (b dv - dY) (w'_j V_i - w'_i V_j)_x]
//! c_a = w_i V_jy - w_j V_iy + w'_i P_jy - w'_j P_iy        c_b = w_j V_ix - w_i V_jx + w'_j P_ix - w'_i P_jx
//! ```
//!
//! which is exact, as `a r = b s` for a lens. All arithmetic is `f32` with an allowance for the rounding of
//! both sides. The sample test sees each vertex within `slack` of its exact position (see
//! [`crate::setup::Triangle::slack`]), and so does this.

use super::cells::{EdgeRows, Extent, ROUNDING, Scene};
use crate::sample_test::block::{Seen, View};
use crate::setup::Corner;
use crate::simd::Lanes;

/// A vertex over the cells: its position in the middle, and its largest distance from the samples anywhere.
#[derive(Clone, Copy)]
pub(super) struct Vertex<V> {
    seen: Seen<V>,
    velocity: [V; 2],
    dw: V,
    reach: [V; 2],
    pub w_abs: V,
}

impl Scene<'_> {
    /// A vertex of the triangle.
    #[inline(always)]
    pub fn vertex<V: Lanes, const MOTION: bool, const LENS: bool>(
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

    /// Write one edge and return the bound of its rounding error.
    #[inline(always)]
    pub fn edge<V: Lanes, const MOTION: bool, const LENS: bool>(
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
        (value + margin).store(&mut row.bound[0].0);
        (margin - value).store(&mut row.bound[1].0);
        slope_x.store(&mut row.slope_x.0);
        slope_y.store(&mut row.slope_y.0);
        rounding
    }

    /// Bound of the terms left out of the linear part, by the formula above.
    #[inline(always)]
    fn remainder<V: Lanes, const MOTION: bool, const LENS: bool>(
        &self,
        i: &Vertex<V>,
        j: &Vertex<V>,
        extent: &Extent<V>,
    ) -> V {
        let ([turn_x, turn_y], [shift_x, shift_y]) = (extent.turn, extent.shift);
        let (p, q, [vi_x, vi_y], [vj_x, vj_y]) = (&i.seen, &j.seen, i.velocity, j.velocity);
        let mut sum = V::splat(0.0);
        if LENS {
            let mut apart = (q.w - p.w).abs();
            if MOTION {
                apart = apart + extent.t * (j.dw - i.dw).abs();
            }
            sum = apart * (extent.screen[1] * shift_x + extent.screen[0] * shift_y);
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
            sum = sum + extent.t * (once + extent.t * twice);
        }
        sum
    }
}
