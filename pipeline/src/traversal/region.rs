//! Tiles, boxes of lens and time, timelines of visible faces, and a triangle seen from the middle of a box.

use super::number::{Coordinate, Number};
use crate::geometry::{Clip, Shear, Viewport};
use crate::setup::{Corner, Triangle};

/// A tile in pixels from the centre of the image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TileRect<C = f32> {
    /// Range of x.
    pub x: [C; 2],
    /// Range of y.
    pub y: [C; 2],
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
pub struct Box5<C = f32> {
    /// Lens position.
    pub u: [C; 2],
    /// Lens position.
    pub v: [C; 2],
    /// Time.
    pub t: [C; 2],
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
pub struct TimePieces {
    pieces: [Piece; Self::MAX],
    len: usize,
}

impl TimePieces {
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

    /// Keep the part in a range of time.
    pub fn clip(&mut self, range: [f32; 2]) {
        let [piece] = &mut self.pieces[..self.len] else {
            *self = self.meet(&Self::one(Piece { t: range, faces: [true; 2] }));
            return;
        };
        piece.t = [piece.t[0].max(range[0]), piece.t[1].min(range[1])];
        let is_left = piece.t[0] <= piece.t[1] && piece.faces != [false; 2];
        self.len = usize::from(is_left);
    }

    /// Hull from the first time to the last.
    pub fn hull(&self) -> Option<[f32; 2]> {
        let pieces = self.pieces();
        Some([pieces.first()?.t[0], pieces.last()?.t[1]])
    }
}

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
pub struct TileView<N = f64, C = f32> {
    /// Vertices at both ends of the time interval; equal for a still triangle.
    pub(super) ends: [[Point<N>; 3]; 2],
    /// Middle in X, Y, u, v.
    pub(super) middle: [C; 4],
    /// Half the extent in X, Y, u, v.
    pub(super) half: [N; 4],
    /// Time interval.
    pub(super) t: [C; 2],
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
    /// Largest weight of a vertex in the box ([`TileView::weight`]), and the largest depth that scales rounding
    /// errors.
    pub(super) depth: [N; 2],
}

impl<N: Number, C: Coordinate> TileView<N, C> {
    /// `triangle` seen from the middle of `tile` and `within`.
    #[inline(always)]
    pub fn new(triangle: &Triangle<C>, shear: &Shear<C>, tile: &TileRect<C>, within: &Box5<C>) -> Self {
        let (moving, lens) = (triangle.moving, within.lens);
        let [u, v] = if lens { [within.u, within.v] } else { [[C::ZERO; 2]; 2] };
        let ranges = [tile.x, tile.y, u, v];
        // Rounded to the numbers that samples are compared with; the extent is measured from there.
        let middle = ranges.map(|[lo, hi]| C::nearest(0.5) * (lo + hi));
        let mut half = [N::zero(); 4];
        for axis in 0..if lens { 4 } else { 2 } {
            let [lo, hi] = ranges[axis].map(N::of);
            half[axis] = (hi - N::of(middle[axis])).max(N::of(middle[axis]) - lo);
        }
        let mut view = Self {
            ends: [[[N::zero(); 3]; 3]; 2],
            middle,
            half,
            t: if moving { within.t } else { [C::ZERO; 2] },
            s: shear.s.map(N::of),
            a: shear.a.map(N::of),
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

    #[inline(always)]
    fn transform(&mut self, triangle: &Triangle<C>) {
        let rays = [self.middle_ray(0), self.middle_ray(1)];
        for end in 0..if self.moving { 2 } else { 1 } {
            let t = N::of(self.t[end]);
            for (point, corner) in self.ends[end].iter_mut().zip(&triangle.corners) {
                for ((at, open), delta) in point.iter_mut().zip(&corner.open).zip(&corner.delta) {
                    let open = N::of(*open);
                    *at = if self.moving { open + t * N::of(*delta) } else { open };
                }
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
        let [at, lens] = [axis, 2 + axis].map(|k| N::of(self.middle[k]));
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

    #[inline(always)]
    fn measure(&mut self, triangle: &Triangle<C>) {
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
        let deepest = |corner: &Corner<C>| corner.open[2].abs() + corner.delta[2].abs();
        self.depth[1] = self.weight(N::of(triangle.corners.iter().map(deepest).fold(C::ZERO, C::max)));
        // The sample test is exact for points seen from the sample, which are rounded by up to half the slack
        // on each axis.
        let [slack_x, slack_y] = triangle.slack.map(|slack| N::of(C::nearest(2.0) * slack));
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
    pub(super) fn phase(&self, t: C) -> N {
        let [start, end] = self.t.map(N::of);
        if end > start { (N::of(t) - start) / (end - start) } else { N::zero() }
    }

    /// Times of a part of the interval given from 0 to 1, rounded outward. NaN stands for an end.
    pub(super) fn times(&self, part: [N; 2]) -> [C; 2] {
        let ([start, end], [lo, hi]) = (self.t, part.map(Into::<f64>::into));
        let [from, to]: [f64; 2] = self.t.map(Into::into);
        let at = |phase: f64| C::nearest(from + phase * (to - from));
        [at(lo).next_down().max(start), at(hi).next_up().min(end)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn clipping_is_meeting_one_piece() {
        let faces = [[true, false], [false, true], [true; 2], [false; 2]];
        for count in 0..4 {
            let mut timeline = TimePieces::empty();
            for (piece, from) in (0..count).zip([0.0, 0.25, 0.6]) {
                timeline.push(Piece { t: [from, from + 0.2], faces: faces[piece] });
            }
            for (t, faces) in [[0.0, 1.0], [0.1, 0.3], [0.22, 0.24], [0.45, 0.7], [0.7, 0.5]]
                .iter()
                .zip(faces.iter().cycle())
            {
                let mut timeline = timeline;
                if count == 1 {
                    timeline.pieces[0].faces = *faces;
                }
                let met = timeline.meet(&TimePieces::one(Piece { t: *t, faces: [true; 2] }));
                timeline.clip(*t);
                assert_eq!(timeline.pieces(), met.pieces());
            }
        }
    }

    #[test]
    fn a_full_timeline_grows_rather_than_forgets() {
        let mut timeline = TimePieces::empty();
        for k in 0..12_u8 {
            let t = f32::from(k);
            timeline.push(Piece { t: [t, t + 0.5], faces: [k % 2 == 0, k % 2 == 1] });
        }
        assert_eq!(timeline.pieces().len(), TimePieces::MAX);
        assert_eq!(timeline.hull(), Some([0.0, 11.5]));
        assert_eq!(timeline.pieces()[TimePieces::MAX - 1].faces, [true; 2]);
    }
}
