//! A triangle seen from the middle of a box, and the extent of the box.

use super::number::Number;
use super::{Box5, TileRect};
use crate::geometry::Shear;
use crate::setup::Triangle;

/// A vertex relative to a sample: `[x', y', w]` on the image plane.
pub(super) type Point<N> = [N; 3];

/// A triangle moved and sheared so that the middle of a tile, seen from the middle of a part of the lens, is
/// the origin. With offsets `dX, dY, du, dv` from there, and `alpha = a du - dX`, `beta = b dv - dY`, a
/// vertex is
///
/// ```text
/// (x', y') + (alpha w - s du, beta w - s' dv)
/// ```
///
/// In an orthographic view `alpha = a du`, `beta = b dv`, and `dX`, `dY` are subtracted without a factor:
///
/// ```text
/// (x', y') + (alpha w - s du - dX, beta w - s' dv - dY)
/// ```
#[derive(Clone, Copy, Debug)]
pub struct View<N = f64> {
    /// Vertices at both ends of the time interval; equal for a still triangle.
    pub(super) ends: [[Point<N>; 3]; 2],
    /// Middle in X, Y, u, v.
    pub(super) middle: [f32; 4],
    /// Half the extent in X, Y, u, v.
    pub(super) half: [N; 4],
    /// Time interval.
    pub(super) t: [f32; 2],
    pub(super) s: [N; 2],
    pub(super) a: [N; 2],
    pub(super) moving: bool,
    pub(super) lens: bool,
    /// Whether the view is orthographic.
    pub(super) parallel: bool,
    /// Largest |x'| and |y'| of any vertex anywhere in the box.
    pub(super) reach: [N; 2],
    /// Error bound of an edge of the sample test.
    pub(super) rounding: N,
    /// Largest weight of a vertex in the box ([`View::weight`]), and the largest depth that scales rounding
    /// errors.
    pub(super) depth: [N; 2],
}

impl<N: Number> View<N> {
    /// `triangle` seen from the middle of `tile` and `within`.
    pub fn new(triangle: &Triangle, shear: &Shear, tile: &TileRect, within: &Box5) -> Self {
        let (moving, lens) = (triangle.moving, within.lens);
        let [u, v] = if lens { [within.u, within.v] } else { [[0.0; 2]; 2] };
        let ranges = [tile.x, tile.y, u, v];
        // Rounded to the numbers that samples are compared with; the extent is measured from there.
        let middle = ranges.map(|[lo, hi]| 0.5 * (lo + hi));
        let mut half = [N::zero(); 4];
        for axis in 0..if lens { 4 } else { 2 } {
            let [lo, hi] = ranges[axis].map(N::from);
            half[axis] = (hi - N::from(middle[axis])).max(N::from(middle[axis]) - lo);
        }
        let mut view = Self {
            ends: [[[N::zero(); 3]; 3]; 2],
            middle,
            half,
            t: if moving { within.t } else { [0.0; 2] },
            s: shear.s.map(N::from),
            a: shear.a.map(N::from),
            moving,
            lens,
            parallel: shear.parallel,
            reach: [N::zero(); 2],
            rounding: N::zero(),
            depth: [N::zero(); 2],
        };
        view.transform(triangle);
        view.measure(triangle);
        view
    }

    fn transform(&mut self, triangle: &Triangle) {
        let rays = [0, 1].map(|axis| self.middle_ray(axis));
        for end in 0..if self.moving { 2 } else { 1 } {
            for (point, corner) in self.ends[end].iter_mut().zip(&triangle.corners) {
                let open = corner.open.map(N::from);
                *point = if self.moving {
                    let t = N::from(self.t[end]);
                    [0, 1, 2].map(|axis| open[axis] + t * N::from(corner.delta[axis]))
                } else {
                    open
                };
                for (axis, [slope, base]) in rays.into_iter().enumerate() {
                    let seen = if self.lens || self.parallel { point[axis] - base } else { point[axis] };
                    point[axis] = if self.lens || !self.parallel { seen - slope * point[2] } else { seen };
                }
            }
        }
        if !self.moving {
            self.ends[1] = self.ends[0];
        }
    }

    /// Slope and base of the middle, as if it were a sample ([`Shear::ray`]).
    fn middle_ray(&self, axis: usize) -> [N; 2] {
        let [at, lens] = [axis, 2 + axis].map(|k| N::from(self.middle[k]));
        match (self.parallel, self.lens) {
            (false, false) => [at, lens * self.s[axis]],
            (false, true) => [at - lens * self.a[axis], lens * self.s[axis]],
            (true, false) => [N::zero(), at],
            (true, true) => [-(lens * self.a[axis]), at + lens * self.s[axis]],
        }
    }

    /// Factor of an image coordinate for a vertex at this depth; the determinant weights its edge with it,
    /// too.
    pub(super) fn weight(&self, depth: N) -> N {
        if self.parallel { N::from(1.0) } else { depth }
    }

    fn measure(&mut self, triangle: &Triangle) {
        let sway = [0, 1].map(|axis| self.sway(axis));
        for points in &self.ends[..if self.moving { 2 } else { 1 }] {
            for point in points {
                for axis in [0, 1] {
                    self.reach[axis] = self.reach[axis].max(point[axis].abs() + point[2].abs() * sway[axis]);
                }
                self.depth[0] = self.depth[0].max(self.weight(point[2]).abs());
            }
        }
        for axis in [0, 1] {
            if self.lens {
                self.reach[axis] = self.reach[axis] + self.s[axis].abs() * self.half[2 + axis];
            }
            if self.parallel {
                self.reach[axis] = self.reach[axis] + self.half[axis];
            }
        }
        let deepest = |corner: &crate::setup::Corner| corner.open[2].abs() + corner.delta[2].abs();
        self.depth[1] = self.weight(N::from(triangle.corners.iter().map(deepest).fold(0.0, f32::max)));
        // The sample test is exact for points seen from the sample, which are rounded by up to half the slack
        // on each axis.
        let [slack_x, slack_y] = triangle.slack.map(|slack| N::from(2.0 * slack));
        self.rounding = slack_x * (self.reach[1] + slack_y) + slack_y * self.reach[0];
    }

    /// Largest |alpha| (or |beta|): motion of the vertices per unit of depth.
    fn sway(&self, axis: usize) -> N {
        match (self.parallel, self.lens) {
            (false, false) => self.half[axis],
            (false, true) => self.half[axis] + self.a[axis].abs() * self.half[2 + axis],
            (true, false) => N::zero(),
            (true, true) => self.a[axis].abs() * self.half[2 + axis],
        }
    }

    /// Position of the time `t` in the interval, from 0 to 1.
    pub(super) fn phase(&self, t: f32) -> N {
        let [start, end] = self.t.map(N::from);
        if end > start { (N::from(t) - start) / (end - start) } else { N::zero() }
    }

    /// Times of a part of the interval given from 0 to 1, rounded outward. NaN stands for an end.
    pub(super) fn times(&self, part: [N; 2]) -> [f32; 2] {
        let ([start, end], [lo, hi]) = (self.t, part.map(Into::<f64>::into));
        let at = |phase: f64| (f64::from(start) + phase * (f64::from(end) - f64::from(start))) as f32;
        [at(lo).next_down().max(start), at(hi).next_up().min(end)]
    }
}
