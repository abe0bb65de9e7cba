//! Moving triangles in `f64`.

use super::View;

/// A triangle whose vertices `[x, y, depth]` move on straight lines from `open` to `close`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MovingTriangle {
    open: [[f64; 3]; 3],
    close: [[f64; 3]; 3],
    uncertainty: [f64; 3],
}

/// Larger coordinates might overflow in the tests.
const MOST: f64 = 1e60;

impl MovingTriangle {
    /// A triangle that is known exactly, or `None` when a coordinate is not finite or beyond 1e60.
    pub fn new(open: [[f64; 3]; 3], close: [[f64; 3]; 3]) -> Option<Self> {
        Self::uncertain(open, close, [0.0; 3])
    }

    /// A triangle each of whose vertices may be off by `uncertainty` on each axis, at either end, or `None` as above.
    pub fn uncertain(open: [[f64; 3]; 3], close: [[f64; 3]; 3], uncertainty: [f64; 3]) -> Option<Self> {
        let mut all = open.iter().chain(&close).chain([&uncertainty]).flatten();
        all.all(|c| c.abs() <= MOST).then_some(Self { open, close, uncertainty })
    }

    /// The vertices when the shutter opens.
    pub fn open(&self) -> &[[f64; 3]; 3] {
        &self.open
    }

    /// The vertices when the shutter closes.
    pub fn close(&self) -> &[[f64; 3]; 3] {
        &self.close
    }
}

/// No coordinate is taken to be surer than this: products of three that are off by as much are numbers that there are, so that what
/// vanishes below the smallest of them stays within the noise.
pub const LEAST_UNCERTAINTY: f64 = 1e-90;

/// A triangle with what every tile asks of it.
#[derive(Clone, Copy, Debug)]
pub struct Prepared {
    pub(super) triangle: MovingTriangle,
    pub(super) moving: bool,
    /// The largest magnitude on each axis.
    pub(super) size: [f64; 3],
    /// The largest magnitude of a weight.
    pub(super) weight: f64,
    /// How far a weight may be off.
    pub(super) weight_off: f64,
}

impl Prepared {
    pub(super) fn new(triangle: &MovingTriangle, view: &View) -> Self {
        let all = || triangle.open.iter().chain(&triangle.close);
        let size = [0, 1, 2].map(|axis| all().map(|p| p[axis].abs()).fold(0.0, f64::max));
        let perspective = matches!(view, View::Perspective { .. });
        let uncertainty = triangle.uncertainty.map(|off| off.max(LEAST_UNCERTAINTY));
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

    /// The vertices at time `t`: at the ends of the shutter as given, to the last bit.
    pub(super) fn at(&self, t: f64) -> [[f64; 3]; 3] {
        if t == 1.0 {
            return self.triangle.close;
        }
        let (open, close) = (&self.triangle.open, &self.triangle.close);
        [0, 1, 2].map(|k| [0, 1, 2].map(|axis| open[k][axis] + t * (close[k][axis] - open[k][axis])))
    }
}
