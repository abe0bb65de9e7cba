//! Moving triangles in `f64`, and their vertices relative to a tile.

use glam::DVec3;

use super::{Rect, Region, View};

/// A triangle whose vertices `[x, y, depth]` move linearly from `open` to `close`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MovingTriangle {
    open: [[f64; 3]; 3],
    close: [[f64; 3]; 3],
    uncertainty: [f64; 3],
}

/// Larger coordinates may overflow in the tests.
const MAX_COORDINATE: f64 = 1e60;

impl MovingTriangle {
    /// An exact triangle, or `None` if a coordinate is not finite or beyond 1e60.
    pub fn new(open: [[f64; 3]; 3], close: [[f64; 3]; 3]) -> Option<Self> {
        Self::uncertain(open, close, [0.0; 3])
    }

    /// A triangle whose vertices have an error of at most `uncertainty` on each axis, at both ends. `None` as
    /// for [`Self::new`].
    pub fn uncertain(open: [[f64; 3]; 3], close: [[f64; 3]; 3], uncertainty: [f64; 3]) -> Option<Self> {
        let mut all = open.iter().chain(&close).chain([&uncertainty]).flatten();
        all.all(|c| c.abs() <= MAX_COORDINATE).then_some(Self { open, close, uncertainty })
    }

    /// Vertices when the shutter opens.
    pub fn open(&self) -> &[[f64; 3]; 3] {
        &self.open
    }

    /// Vertices when the shutter closes.
    pub fn close(&self) -> &[[f64; 3]; 3] {
        &self.close
    }
}

/// Smallest uncertainty of a coordinate. Products of three such errors do not underflow, so values that
/// underflow stay within the noise.
pub const MIN_UNCERTAINTY: f64 = 1e-90;

/// A triangle prepared for the tests of tiles.
#[derive(Clone, Copy, Debug)]
pub struct Prepared {
    pub(super) triangle: MovingTriangle,
    pub(super) moving: bool,
    /// Largest magnitude on each axis.
    pub(super) size: [f64; 3],
    /// Largest magnitude of a weight.
    pub(super) weight: f64,
    /// Error bound of a weight.
    pub(super) weight_off: f64,
}

impl Prepared {
    pub(super) fn new(triangle: &MovingTriangle, view: &View) -> Self {
        let all = || triangle.open.iter().chain(&triangle.close);
        let size = [0, 1, 2].map(|axis| all().map(|p| p[axis].abs()).fold(0.0, f64::max));
        let perspective = matches!(view, View::Perspective { .. });
        let uncertainty = triangle.uncertainty.map(|off| off.max(MIN_UNCERTAINTY));
        Self {
            triangle: MovingTriangle { uncertainty, ..*triangle },
            moving: triangle.open != triangle.close,
            size,
            weight: if perspective { size[2] } else { 1.0 },
            weight_off: if perspective { uncertainty[2] } else { 0.0 },
        }
    }

    pub(super) fn uncertainty(&self) -> &[f64; 3] {
        &self.triangle.uncertainty
    }

    /// Vertices at time `t`; at the ends of the shutter exactly as given.
    pub(super) fn at(&self, t: f64) -> [[f64; 3]; 3] {
        if t == 1.0 {
            return self.triangle.close;
        }
        let (open, close) = (&self.triangle.open, &self.triangle.close);
        [0, 1, 2].map(|k| [0, 1, 2].map(|axis| open[k][axis] + t * (close[k][axis] - open[k][axis])))
    }
}

/// Rounding error of a few operations, relative to the sum of magnitudes: sixteen of 2^-53 each, and twice
/// that.
pub(super) const ROUNDING: f64 = 1.0 / (1_u64 << 48) as f64;

/// Vertices at both ends of a time interval, relative to the middle of a tile, so that large coordinates lose
/// little precision.
#[derive(Clone, Copy, Debug)]
pub(super) struct Seen {
    pub view: View,
    /// `[x - X w, y - Y w, depth]` by end and vertex; `(X, Y)` is the middle of the tile.
    pub points: [[[f64; 3]; 3]; 2],
    middle: [f64; 2],
    /// Distances of the tile's sides from its middle.
    pub tile: [[f64; 2]; 2],
    /// Error bound in x and y of a vertex seen from a point of the tile and a lens position.
    pub noise: [f64; 2],
    /// Error bound of a depth.
    pub depth_noise: f64,
    /// Largest magnitudes of the terms of `points`, uncertainty included.
    pub size: [f64; 3],
}

impl Seen {
    pub fn new(view: &View, prepared: &Prepared, rect: &Rect, region: &Region) -> Self {
        let sides = [rect.x, rect.y];
        let middle = sides.map(|[lo, hi]| 0.5 * (lo + hi));
        let (s, a) = view.shear();
        let (weight, unsure, off) = (prepared.weight, prepared.uncertainty(), prepared.weight_off);
        let noise = [0, 1].map(|axis| {
            let (lens, side) = (a[axis].abs(), sides[axis][0].abs().max(sides[axis][1].abs()));
            let sum = prepared.size[axis] + s[axis].abs() + lens * prepared.size[2] + side * weight;
            ROUNDING * sum + unsure[axis] + lens * unsure[2] + side * off
        });
        let size = [0, 1, 2].map(|axis| {
            let moved = if axis < 2 { middle[axis].abs() * weight } else { 0.0 };
            let unsure = unsure[axis] + if axis < 2 { middle[axis].abs() * off } else { 0.0 };
            // A plane uses `ROUNDING` times this as noise.
            prepared.size[axis] + moved + unsure / ROUNDING
        });
        Self {
            view: *view,
            points: points(view, prepared, middle, region),
            middle,
            tile: [0, 1].map(|axis| sides[axis].map(|side| side - middle[axis])),
            noise,
            depth_noise: ROUNDING * prepared.size[2] + unsure[2],
            size,
        }
    }

    /// The same triangle within another region.
    pub fn within(self, prepared: &Prepared, region: &Region) -> Self {
        Self { points: points(&self.view, prepared, self.middle, region), ..self }
    }

    /// Vertex `k` at `end` of the time along `axis`, seen through a pinhole from `side`, relative to the
    /// middle of the tile.
    pub fn through_pinhole(&self, axis: usize, k: usize, end: usize, side: f64) -> f64 {
        let p = &self.points[end][k];
        p[axis] - side * self.view.weight(p[2])
    }

    /// The same vertex seen from `lens` on the lens.
    pub fn from(&self, axis: usize, k: usize, end: usize, lens: f64, side: f64) -> f64 {
        let depth = self.points[end][k][2];
        let (s, a) = self.view.shear();
        self.through_pinhole(axis, k, end, side) + lens * (a[axis] * depth - s[axis])
    }

    /// Vertices at both ends as homogeneous points of the image, seen through a pinhole from the middle of
    /// the tile.
    pub fn homogeneous(&self) -> [[DVec3; 3]; 2] {
        self.points.map(|end| end.map(|[x, y, depth]| DVec3::new(x, y, self.view.weight(depth))))
    }

    /// The same vertices seen from `lens` on the lens.
    pub fn homogeneous_from(&self, lens: [f64; 2]) -> [[DVec3; 3]; 2] {
        let (s, a) = self.view.shear();
        self.points.map(|end| {
            end.map(|[x, y, depth]| {
                let at = |axis: usize, x: f64| x + lens[axis] * (a[axis] * depth - s[axis]);
                DVec3::new(at(0, x), at(1, y), self.view.weight(depth))
            })
        })
    }
}

/// Vertices at both ends of a region's time, seen from `middle`.
fn points(view: &View, prepared: &Prepared, middle: [f64; 2], region: &Region) -> [[[f64; 3]; 3]; 2] {
    region.t.map(|t| {
        prepared.at(t).map(|[x, y, depth]| {
            let w = view.weight(depth);
            [x - middle[0] * w, y - middle[1] * w, depth]
        })
    })
}
