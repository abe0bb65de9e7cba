//! Tiles, and boxes of lens and time.

use crate::depth::{down, up};
use crate::traversal::Box5;

/// A closed rectangle of the image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rect {
    /// First and last x.
    pub x: [f64; 2],
    /// First and last y.
    pub y: [f64; 2],
}

/// A closed box of lens and time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Region {
    /// Lens position, within [-1, 1].
    pub u: [f64; 2],
    /// Lens position, within [-1, 1].
    pub v: [f64; 2],
    /// Time, within [0, 1].
    pub t: [f64; 2],
}

/// Where, when and how deep a triangle may touch a tile.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Touch {
    /// Lens position `u^`; all of the region asked for where there is no lens.
    pub u: [f64; 2],
    /// Lens position `v^`.
    pub v: [f64; 2],
    /// Time `t^`.
    pub t: [f64; 2],
    /// Depth `z^`.
    pub z: [f64; 2],
}

impl Region {
    /// All of the lens and the whole shutter.
    pub const WHOLE: Self = Self { u: [-1.0, 1.0], v: [-1.0, 1.0], t: [0.0, 1.0] };

    /// Both halves of the time.
    pub(super) fn halves(&self) -> [Self; 2] {
        let [lo, hi] = self.t;
        let middle = 0.5 * (lo + hi);
        [Self { t: [lo, middle], ..*self }, Self { t: [middle, hi], ..*self }]
    }
}

impl Touch {
    pub(super) fn new(region: &Region, z: [f64; 2]) -> Self {
        Self { u: region.u, v: region.v, t: region.t, z }
    }

    /// The intervals that hold both.
    #[must_use]
    pub fn hull(&self, other: &Self) -> Self {
        let hull = |a: [f64; 2], b: [f64; 2]| [a[0].min(b[0]), a[1].max(b[1])];
        Self {
            u: hull(self.u, other.u),
            v: hull(self.v, other.v),
            t: hull(self.t, other.t),
            z: hull(self.z, other.z),
        }
    }

    /// Its place on the lens and in time.
    pub fn region(&self) -> Region {
        Region { u: self.u, v: self.v, t: self.t }
    }

    /// The same rounded outward, to ask [`DepthBoxes`](crate::depth::DepthBoxes) with: box and depths. `lens` says whether the
    /// camera has one.
    pub fn outward(&self, lens: bool) -> (Box5, [f32; 2]) {
        (Box5 { u: outward(self.u), v: outward(self.v), t: outward(self.t), lens }, outward(self.z))
    }
}

/// The narrowest range of `f32` that holds this one.
fn outward([lo, hi]: [f64; 2]) -> [f32; 2] {
    [down(lo), up(hi)]
}
