//! Boxes in screen, lens and time.

use crate::geometry::{Clip, Viewport};

/// A tile in pixels from the centre of the image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TileRect {
    /// First and last x.
    pub x: [f32; 2],
    /// First and last y.
    pub y: [f32; 2],
}

impl TileRect {
    /// The tile of `side_px` pixels whose first pixel is `(px, py)`.
    pub fn new(viewport: Viewport, [px, py]: [u32; 2], side_px: u32) -> Self {
        let (width, height) = (viewport.width(), viewport.height());
        Self {
            x: [Viewport::edge(px, width), Viewport::edge((px + side_px).min(width), width)],
            y: [Viewport::edge(py, height), Viewport::edge((py + side_px).min(height), height)],
        }
    }
}

/// A box of lens positions and times, ends included.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Box5 {
    /// Lens position.
    pub u: [f32; 2],
    /// Lens position.
    pub v: [f32; 2],
    /// Time.
    pub t: [f32; 2],
    /// Whether the camera has a lens at all; without one `u` and `v` mean nothing.
    pub lens: bool,
}

impl Box5 {
    /// All of the lens and the whole shutter.
    pub fn whole(lens: bool) -> Self {
        Self { u: [-1.0, 1.0], v: [-1.0, 1.0], t: [0.0, 1.0], lens }
    }

    /// What lies between the clip planes, in standard mode; may be empty. A sample is in where it is in this box, ends included.
    #[must_use]
    pub fn clipped(&self, clip: &Clip) -> Self {
        let [u, v, t] = clip.half_open();
        self.intersect(&Self { u, v, t, lens: self.lens })
    }

    /// Whether nothing lies in it.
    pub fn is_empty(&self) -> bool {
        [self.u, self.v, self.t].iter().any(|[lo, hi]| lo > hi)
    }

    /// What lies in both boxes; may be empty.
    pub fn intersect(&self, other: &Self) -> Self {
        let both = |a: [f32; 2], b: [f32; 2]| [a[0].max(b[0]), a[1].min(b[1])];
        Self { u: both(self.u, other.u), v: both(self.v, other.v), t: both(self.t, other.t), lens: self.lens }
    }

    /// The smallest box that holds both.
    pub fn hull(&self, other: &Self) -> Self {
        let hull = |a: [f32; 2], b: [f32; 2]| [a[0].min(b[0]), a[1].max(b[1])];
        Self { u: hull(self.u, other.u), v: hull(self.v, other.v), t: hull(self.t, other.t), lens: self.lens }
    }
}
