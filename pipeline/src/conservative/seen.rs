//! A triangle as seen from the middle of a tile.

use glam::DVec3;

use super::{Prepared, Rect, Region, View};

/// Rounding of a handful of operations, in parts of the sum of magnitudes: sixteen of 2^-53 each, and twice that.
pub(super) const ROUNDING: f64 = 1.0 / (1_u64 << 48) as f64;

/// The vertices at both ends of a time interval, seen from the middle of a tile so that little is lost to large coordinates.
#[derive(Clone, Copy, Debug)]
pub(super) struct Seen {
    pub view: View,
    /// `[x - X w, y - Y w, depth]` by end and vertex, `(X, Y)` the middle of the tile.
    pub points: [[[f64; 3]; 3]; 2],
    middle: [f64; 2],
    /// How far the sides of the tile are from its middle.
    pub tile: [[f64; 2]; 2],
    /// How far a vertex seen from a point of the tile and a place on the lens may be off in x and in y.
    pub noise: [f64; 2],
    /// How far a depth may be off.
    pub depth_noise: f64,
    /// The largest magnitudes that entered `points`, with what is not known for certain of these.
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
            // A plane takes `ROUNDING` of this for noise.
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

    /// The same within another region.
    pub fn within(self, prepared: &Prepared, region: &Region) -> Self {
        Self { points: points(&self.view, prepared, self.middle, region), ..self }
    }

    /// Vertex `k` at `end` of the time along `axis`, seen `side` from the middle of the tile through a pinhole.
    pub fn through_pinhole(&self, axis: usize, k: usize, end: usize, side: f64) -> f64 {
        let p = &self.points[end][k];
        p[axis] - side * self.view.weight(p[2])
    }

    /// The same from `place` on the lens.
    pub fn from(&self, axis: usize, k: usize, end: usize, place: f64, side: f64) -> f64 {
        let depth = self.points[end][k][2];
        let (s, a) = self.view.shear();
        self.through_pinhole(axis, k, end, side) + place * (a[axis] * depth - s[axis])
    }

    /// The vertices at both ends as homogeneous points of the image, seen from the middle of the tile through a pinhole.
    pub fn homogeneous(&self) -> [[DVec3; 3]; 2] {
        self.points.map(|end| end.map(|[x, y, depth]| DVec3::new(x, y, self.view.weight(depth))))
    }

    /// The same from `place` on the lens.
    pub fn homogeneous_from(&self, place: [f64; 2]) -> [[DVec3; 3]; 2] {
        let (s, a) = self.view.shear();
        self.points.map(|end| {
            end.map(|[x, y, depth]| {
                let at = |axis: usize, x: f64| x + place[axis] * (a[axis] * depth - s[axis]);
                DVec3::new(at(0, x), at(1, y), self.view.weight(depth))
            })
        })
    }
}

/// The vertices at both ends of a region's time, seen from `middle`.
fn points(view: &View, prepared: &Prepared, middle: [f64; 2], region: &Region) -> [[[f64; 3]; 3]; 2] {
    region.t.map(|t| {
        prepared.at(t).map(|[x, y, depth]| {
            let w = view.weight(depth);
            [x - middle[0] * w, y - middle[1] * w, depth]
        })
    })
}
