//! The edges of a triangle over a tile and a box of lens and time.
//!
//! Each edge function is linearized in (X, Y, u, v, t) about the middle of the box, and what is left out is bounded term
//! by term (Munkberg and Akenine-Moeller 2012, whose hyperplanes these are; the remainder is our own). With
//! `alpha = a du - dX`, `beta = b dv - dY`, `sigma = s du`, `tau = s' dv` (`b`, `s'` the lens scales in y) and `dt` from the
//! middle, a vertex seen from a sample is
//!
//! ```text
//! P(d) = P + (alpha w - sigma, beta w - tau) + dt (V + w' (alpha, beta))
//! ```
//!
//! where `V` is its velocity and `w'` the change of its depth. So `e = P_i x P_j` is, exactly,
//!
//! ```text
//! e(d) = e + linear + (w_j - w_i + dt (w'_j - w'_i)) (dY s du - dX s' dv)
//!          + dt [alpha c_a + beta c_b + sigma (V_i - V_j)_y + tau (V_j - V_i)_x]
//!          + dt^2 [V_i x V_j + alpha (w'_i V_j - w'_j V_i)_y + beta (w'_j V_i - w'_i V_j)_x]
//!
//! c_a = w_i V_jy - w_j V_iy + w'_i P_jy - w'_j P_iy        c_b = w_j V_ix - w_i V_jx + w'_j P_ix - w'_i P_jx
//! ```
//!
//! A tile is culled when one edge is below zero everywhere and another above; a sample is when its own linear values say so.
//! Both signs of facing are covered by that.

use super::{Box5, TileRect};
use crate::geometry::Shear;
use crate::setup::{Corner, Triangle};

/// The three edges of a triangle over a box.
#[derive(Clone, Copy, Debug)]
pub struct EdgeBounds {
    middle: [f64; 5],
    half: [f64; 5],
    edges: [Edge; 3],
}

/// `value + gradient . d`, right to within `remainder` of what the sample test computes.
#[derive(Clone, Copy, Debug, Default)]
struct Edge {
    value: f64,
    gradient: [f64; 5],
    remainder: f64,
}

/// The same in the arithmetic of the sample test, for single samples.
#[derive(Clone, Copy, Debug)]
pub struct Screen {
    /// The middle of the box: X, Y, u, v, t.
    pub middle: [f32; 5],
    /// For each edge its value in the middle.
    pub value: [f32; 3],
    /// For each edge its slope along X, Y, u, v, t.
    pub gradient: [[f32; 5]; 3],
    /// For each edge how far the linear value may be off.
    pub margin: [f32; 3],
}

/// A vertex in the middle of the box: place, velocity, depth and change of depth.
#[derive(Clone, Copy, Default)]
struct Vertex {
    p: [f64; 2],
    v: [f64; 2],
    w: f64,
    dw: f64,
    /// The largest |x'| and |y'| anywhere in the box.
    reach: [f64; 2],
}

/// Multiply-adds of bounding the edges over one tile, by dimensions in use, counted from the formulas above: the vertices in
/// the middle, then value, slopes, remainder and extent of each edge.
pub const fn tile_madds(moving: bool, lens: bool) -> u32 {
    let (t, l) = (moving as u32, lens as u32);
    let vertex = 2 + 5 * t + 4 * l;
    let edge = 2 + 4 + 2 + t * (4 + 1 + 8 + 6 + 1) + l * (4 + 2 + 3);
    3 * (vertex + edge)
}

/// Multiply-adds of screening one sample: three edges, one for each dimension in use.
pub const fn screen_madds(moving: bool, lens: bool) -> u32 {
    3 * (2 + moving as u32 + 2 * lens as u32)
}

impl EdgeBounds {
    /// The edges of `triangle` over `tile` and `within`.
    pub fn new(triangle: &Triangle, shear: &Shear, tile: &TileRect, within: &Box5) -> Self {
        let still = [0.0, 0.0];
        let lens = if within.lens { [within.u, within.v] } else { [still; 2] };
        let ranges = [tile.x, tile.y, lens[0], lens[1], if triangle.moving { within.t } else { still }];
        // Rounded to the numbers the screen uses, with the extents measured from there.
        let middle = ranges.map(|[lo, hi]| f64::from(0.5 * (lo + hi)));
        let mut half = [0.0; 5];
        for (axis, [lo, hi]) in ranges.into_iter().enumerate() {
            half[axis] = (f64::from(hi) - middle[axis]).max(middle[axis] - f64::from(lo));
        }
        let scene = Scene { s: shear.s.map(f64::from), a: shear.a.map(f64::from), half };
        let [a, b, c] = &triangle.corners;
        let vertices = [a, b, c].map(|corner| scene.vertex(corner, &middle));
        let slack = triangle.slack.map(f64::from);
        let edge = |i: usize, j: usize| scene.edge(&vertices[i], &vertices[j], slack);
        Self { middle, half, edges: [edge(1, 2), edge(2, 0), edge(0, 1)] }
    }

    /// Whether no sample in the box can be inside.
    pub fn miss(&self) -> bool {
        let [mut below, mut above] = [false; 2];
        for edge in &self.edges {
            let extent = edge.extent(&self.half) + edge.remainder;
            below |= edge.value + extent < 0.0;
            above |= edge.value - extent > 0.0;
        }
        below && above
    }

    /// The screen for single samples of the box.
    pub fn screen(&self) -> Screen {
        // The linear value is rounded a dozen times, each by at most 2^-24 of the sum of magnitudes.
        const ROUNDING: f64 = 1.0 / 1_048_576.0;
        let margin = |edge: &Edge| {
            (edge.remainder + ROUNDING * (edge.value.abs() + edge.extent(&self.half)) * 1.0001) as f32
                * 1.000_001
        };
        Screen {
            middle: self.middle.map(|m| m as f32),
            value: [0, 1, 2].map(|k| self.edges[k].value as f32),
            gradient: [0, 1, 2].map(|k| self.edges[k].gradient.map(|g| g as f32)),
            margin: [0, 1, 2].map(|k| margin(&self.edges[k])),
        }
    }
}

impl Edge {
    /// How far the linear part reaches from its middle value.
    fn extent(&self, half: &[f64; 5]) -> f64 {
        (0..5).map(|axis| self.gradient[axis].abs() * half[axis]).sum()
    }
}

/// The lens and the extents of the box.
struct Scene {
    s: [f64; 2],
    a: [f64; 2],
    half: [f64; 5],
}

impl Scene {
    /// The largest |alpha| and |beta|.
    fn sway(&self) -> [f64; 2] {
        [0, 1].map(|axis| self.half[axis] + self.a[axis].abs() * self.half[2 + axis])
    }

    fn vertex(&self, corner: &Corner, middle: &[f64; 5]) -> Vertex {
        let at = |axis: usize| f64::from(corner.open[axis]) + middle[4] * f64::from(corner.delta[axis]);
        let (w, dw, sway) = (at(2), f64::from(corner.delta[2]), self.sway());
        let mut vertex = Vertex { w, dw, ..Vertex::default() };
        for axis in [0, 1] {
            let slope = middle[2 + axis] * self.a[axis] - middle[axis];
            vertex.p[axis] = at(axis) - middle[2 + axis] * self.s[axis] + slope * w;
            vertex.v[axis] = f64::from(corner.delta[axis]) + slope * dw;
            vertex.reach[axis] = vertex.p[axis].abs()
                + w.abs() * sway[axis]
                + self.s[axis].abs() * self.half[2 + axis]
                + self.half[4] * (vertex.v[axis].abs() + dw.abs() * sway[axis]);
        }
        vertex
    }

    fn edge(&self, i: &Vertex, j: &Vertex, slack: [f64; 2]) -> Edge {
        let along = i.w * j.p[1] - j.w * i.p[1];
        let across = j.w * i.p[0] - i.w * j.p[0];
        let turning = cross(i.v, j.v);
        let half_t = self.half[4];
        Edge {
            // `dt^2` is not negative: half of its term goes into the value.
            value: cross(i.p, j.p) + 0.5 * half_t * half_t * turning,
            gradient: [
                -along,
                -across,
                self.a[0] * along + self.s[0] * (i.p[1] - j.p[1]),
                self.a[1] * across + self.s[1] * (j.p[0] - i.p[0]),
                cross(i.p, j.v) + cross(i.v, j.p),
            ],
            remainder: 0.5 * half_t * half_t * turning.abs() + self.mixed(i, j) + rounding(i, j, slack),
        }
    }

    /// A bound on the terms of second and third order but for the square of time.
    fn mixed(&self, i: &Vertex, j: &Vertex) -> f64 {
        let [half_x, half_y, half_u, half_v, half_t] = self.half;
        let [sway_x, sway_y] = self.sway();
        let skew = half_y * self.s[0].abs() * half_u + half_x * self.s[1].abs() * half_v;
        let lens = ((j.w - i.w).abs() + half_t * (j.dw - i.dw).abs()) * skew;
        let c_a = i.w * j.v[1] - j.w * i.v[1] + i.dw * j.p[1] - j.dw * i.p[1];
        let c_b = j.w * i.v[0] - i.w * j.v[0] + j.dw * i.p[0] - i.dw * j.p[0];
        let time = c_a.abs() * sway_x
            + c_b.abs() * sway_y
            + (i.v[1] - j.v[1]).abs() * self.s[0].abs() * half_u
            + (j.v[0] - i.v[0]).abs() * self.s[1].abs() * half_v;
        let squared =
            (i.dw * j.v[1] - j.dw * i.v[1]).abs() * sway_x + (j.dw * i.v[0] - i.dw * j.v[0]).abs() * sway_y;
        lens + half_t * time + half_t * half_t * squared
    }
}

/// The sample test is exact for points seen from the sample, and these are rounded by up to half the slack on each axis.
fn rounding(i: &Vertex, j: &Vertex, [slack_x, slack_y]: [f64; 2]) -> f64 {
    let [reach_x, reach_y] = [0, 1].map(|axis| i.reach[axis].max(j.reach[axis]));
    2.0 * (slack_x * reach_y + slack_y * reach_x + slack_x * slack_y)
}

fn cross(a: [f64; 2], b: [f64; 2]) -> f64 {
    a[0] * b[1] - a[1] * b[0]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Cull, MovingVertex};
    use crate::setup::{Outcome, set_up};

    fn vertex(open: [f32; 3], close: [f32; 3]) -> MovingVertex {
        MovingVertex { open, close }
    }

    /// The edge opposite vertex 0 at a point of the box, evaluated directly in `f64`.
    fn direct(corners: &[Corner; 3], shear: &Shear, at: [f64; 5]) -> f64 {
        let [x, y, u, v, t] = at;
        let see = |c: &Corner| {
            let p = [0, 1, 2].map(|k| f64::from(c.open[k]) + t * f64::from(c.delta[k]));
            let s = shear.s.map(f64::from);
            let a = shear.a.map(f64::from);
            [p[0] - u * s[0] + (u * a[0] - x) * p[2], p[1] - v * s[1] + (v * a[1] - y) * p[2]]
        };
        cross(see(&corners[1]), see(&corners[2]))
    }

    /// A triangle that moves, turns and is out of focus.
    fn wild(shear: &Shear) -> Triangle {
        let v = [
            vertex([-50.0, 20.0, 3.0], [60.0, 10.0, 5.0]),
            vertex([30.0, -70.0, 4.0], [-20.0, 40.0, 2.5]),
            vertex([80.0, 90.0, 6.0], [70.0, 30.0, 7.0]),
        ];
        match set_up(0, [&v[0], &v[1], &v[2]], Cull::None, shear, 0.1, [64.0; 2]) {
            Outcome::Ready(triangle) => triangle,
            other => panic!("{other:?}"),
        }
    }

    /// The largest difference between the edge and its linear part over a grid of points of the box, corners included.
    fn worst(bounds: &EdgeBounds, triangle: &Triangle, shear: &Shear) -> f64 {
        let edge = bounds.edges[0];
        (0..7_usize.pow(5))
            .map(|step| {
                let d = [0, 1, 2, 3, 4].map(|axis| {
                    bounds.half[axis] * ((step / 7_usize.pow(axis as u32) % 7) as f64 / 3.0 - 1.0)
                });
                let linear: f64 = edge.value + (0..5).map(|k| edge.gradient[k] * d[k]).sum::<f64>();
                let at = [0, 1, 2, 3, 4].map(|k| bounds.middle[k] + d[k]);
                (direct(&triangle.corners, shear, at) - linear).abs()
            })
            .fold(0.0, f64::max)
    }

    #[test]
    fn the_remainder_holds_all_over_the_box() {
        let shear = Shear { s: [90.0, -90.0], a: [15.0, -15.0] };
        let triangle = wild(&shear);
        for (width, lens, time) in [(8.0, 1.25, 0.5), (1.0, 0.1, 0.9), (64.0, 2.0, 0.05), (8.0, 0.0, 0.5)] {
            let tile = TileRect { x: [-8.0, -8.0 + width], y: [16.0, 16.0 + width] };
            let within = Box5 {
                u: [-0.5, -0.5 + lens],
                v: [0.0, 0.5 * lens],
                t: [0.05, 0.05 + time],
                lens: lens > 0.0,
            };
            let bounds = EdgeBounds::new(&triangle, &shear, &tile, &within);
            let (worst, remainder) = (worst(&bounds, &triangle, &shear), bounds.edges[0].remainder);
            assert!(worst <= remainder, "{worst} > {remainder} for {within:?}");
        }
    }

    #[test]
    fn where_one_term_is_left_the_remainder_is_reached() {
        let none = Shear::default();
        let triangle = wild(&none);
        let point = TileRect { x: [-8.0, -8.0], y: [16.0, 16.0] };
        let time = EdgeBounds::new(&triangle, &none, &point, &Box5 { t: [0.0, 1.0], ..Box5::whole(false) });
        let ratio = worst(&time, &triangle, &none) / time.edges[0].remainder;
        assert!((0.999..=1.0).contains(&ratio), "time alone: {ratio}");
        let line = TileRect { x: [-8.0, 0.0], y: [16.0, 16.0] };
        let both = EdgeBounds::new(&triangle, &none, &line, &Box5 { t: [0.0, 0.01], ..Box5::whole(false) });
        let ratio = worst(&both, &triangle, &none) / both.edges[0].remainder;
        assert!((0.98..=1.0).contains(&ratio), "place and time, almost alone: {ratio}");
    }

    #[test]
    fn a_still_triangle_leaves_rounding_only() {
        let v = [[0.0, 0.0, 1.0], [10.0, 0.0, 1.0], [0.0, 10.0, 1.0]].map(|p| vertex(p, p));
        let none = Shear::default();
        let Outcome::Ready(triangle) = set_up(0, [&v[0], &v[1], &v[2]], Cull::None, &none, 0.1, [64.0; 2])
        else {
            panic!("the triangle is visible");
        };
        let miss = |x: f32, y: f32| {
            let tile = TileRect { x: [x, x + 8.0], y: [y, y + 8.0] };
            EdgeBounds::new(&triangle, &none, &tile, &Box5::whole(false)).miss()
        };
        assert!(!miss(0.0, 0.0) && !miss(4.9, -3.0));
        assert!(miss(8.0, 8.0) && miss(5.1, 5.1));
    }
}
