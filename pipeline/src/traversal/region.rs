//! Tiles, boxes of lens and time, and timelines of visible faces.

use crate::geometry::{Clip, Viewport};

/// A tile in pixels from the centre of the image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TileRect {
    /// Range of x.
    pub x: [f32; 2],
    /// Range of y.
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

/// A closed box of lens positions and times.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Box5 {
    /// Lens position.
    pub u: [f32; 2],
    /// Lens position.
    pub v: [f32; 2],
    /// Time.
    pub t: [f32; 2],
    /// Whether the camera has a lens; without one `u` and `v` are unused.
    pub lens: bool,
}

impl Box5 {
    /// The whole lens and shutter.
    pub fn whole(lens: bool) -> Self {
        Self { u: [-1.0, 1.0], v: [-1.0, 1.0], t: [0.0, 1.0], lens }
    }

    /// The box between the clip planes, in standard mode; possibly empty. A sample is drawn if it is in this
    /// box, ends included.
    #[must_use]
    pub fn clipped(&self, clip: &Clip) -> Self {
        let [u, v, t] = clip.half_open();
        self.intersect(&Self { u, v, t, lens: self.lens })
    }

    /// Whether the box is empty.
    pub fn is_empty(&self) -> bool {
        [self.u, self.v, self.t].iter().any(|[lo, hi]| lo > hi)
    }

    /// Intersection of both boxes; possibly empty.
    pub fn intersect(&self, other: &Self) -> Self {
        let both = |a: [f32; 2], b: [f32; 2]| [a[0].max(b[0]), a[1].min(b[1])];
        Self { u: both(self.u, other.u), v: both(self.v, other.v), t: both(self.t, other.t), lens: self.lens }
    }

    /// Smallest box that contains both.
    pub fn hull(&self, other: &Self) -> Self {
        let hull = |a: [f32; 2], b: [f32; 2]| [a[0].min(b[0]), a[1].max(b[1])];
        Self { u: hull(self.u, other.u), v: hull(self.v, other.v), t: hull(self.t, other.t), lens: self.lens }
    }
}

/// Faces that a sample of a box may see: the one that appears clockwise on the screen (positive edges), and
/// the counter-clockwise one.
pub type Faces = [bool; 2];

/// A piece of time with the faces that may be visible in it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Piece {
    /// First and last time, both included. Pieces do not overlap.
    pub t: [f32; 2],
    /// Faces that the triangle may show, drawn or not.
    pub faces: Faces,
}

impl Piece {
    /// Whether the visible face is known.
    pub fn is_decided(&self) -> bool {
        self.faces != [true; 2]
    }

    /// Faces that may be visible and are drawn.
    pub fn seen(&self, drawn: Faces) -> Faces {
        [0, 1].map(|face| self.faces[face] && drawn[face])
    }
}

/// Pieces of time in order.
#[derive(Clone, Copy, Debug)]
pub struct Timeline {
    pieces: [Piece; Self::MAX],
    len: usize,
}

impl Timeline {
    /// Largest number of pieces.
    pub const MAX: usize = 8;
    /// Largest number of time bisections.
    pub const MAX_SPLITS: u32 = Self::MAX.ilog2();

    /// No time.
    pub const fn empty() -> Self {
        Self { pieces: [Piece { t: [0.0; 2], faces: [false; 2] }; Self::MAX], len: 0 }
    }

    /// One piece.
    pub fn one(piece: Piece) -> Self {
        let mut timeline = Self::empty();
        timeline.push(piece);
        timeline
    }

    /// Append a piece. It is merged with the last piece if it follows at once with the same faces. If the
    /// list is full the last piece grows, which is conservative.
    pub fn push(&mut self, piece: Piece) {
        let full = self.len == Self::MAX;
        match self.pieces[..self.len].last_mut() {
            Some(last) if full || (last.faces == piece.faces && last.t[1].next_up() >= piece.t[0]) => {
                last.t[1] = last.t[1].max(piece.t[1]);
                last.faces = [0, 1].map(|face| last.faces[face] | piece.faces[face]);
            }
            _ => {
                self.pieces[self.len] = piece;
                self.len += 1;
            }
        }
    }

    /// The pieces.
    pub fn pieces(&self) -> &[Piece] {
        &self.pieces[..self.len]
    }

    /// Intersection of both timelines.
    pub fn meet(&self, other: &Self) -> Self {
        let mut both = Self::empty();
        for a in self.pieces() {
            for b in other.pieces() {
                let t = [a.t[0].max(b.t[0]), a.t[1].min(b.t[1])];
                let faces = a.seen(b.faces);
                if t[0] <= t[1] && faces != [false; 2] {
                    both.push(Piece { t, faces });
                }
            }
        }
        both
    }

    /// Hull from the first time to the last.
    pub fn hull(&self) -> Option<[f32; 2]> {
        let pieces = self.pieces();
        Some([pieces.first()?.t[0], pieces.last()?.t[1]])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_full_timeline_grows_rather_than_forgets() {
        let mut timeline = Timeline::empty();
        for k in 0..12_u8 {
            let t = f32::from(k);
            timeline.push(Piece { t: [t, t + 0.5], faces: [k % 2 == 0, k % 2 == 1] });
        }
        assert_eq!(timeline.pieces().len(), Timeline::MAX);
        assert_eq!(timeline.hull(), Some([0.0, 11.5]));
        assert_eq!(timeline.pieces()[Timeline::MAX - 1].faces, [true; 2]);
    }
}
