//! Conservative rasterizer: from a triangle to the tiles it may touch.

use std::ops::Range;

use super::edges::miss;
use super::sides::narrow;
use super::triangle::{ROUNDING, Seen};
use super::{MIN_UNCERTAINTY, MovingTriangle, Prepared, Rect, Region, Touch, View};
use crate::depth::plane::{Beam, MovingPlane, normal, tightest};

/// A grid of equal tiles.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Grid {
    /// Corner of the first tile.
    pub origin: [f64; 2],
    /// Width and height of a tile, positive.
    pub tile: [f64; 2],
    /// Tiles per row.
    pub columns: u32,
    /// Tiles per column.
    pub rows: u32,
}

impl Grid {
    /// Area of the tiles in these columns and rows; neighbouring tiles share the coordinate of their border.
    pub fn rect(&self, columns: &Range<u32>, rows: &Range<u32>) -> Rect {
        let border = |axis: usize, index: u32| self.origin[axis] + f64::from(index) * self.tile[axis];
        Rect {
            x: [border(0, columns.start), border(0, columns.end)],
            y: [border(1, rows.start), border(1, rows.end)],
        }
    }
}

/// Conservative rasterizer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rasterizer {
    view: View,
    clip: Region,
    halvings: u32,
}

impl Rasterizer {
    /// A rasterizer for the whole lens and shutter in `view`; the time of a touched tile is halved twice.
    pub fn new(view: View) -> Self {
        Self { view, clip: Region::WHOLE, halvings: 2 }
    }

    /// The rasterizer limited to a part of lens and shutter, ends included (user clip planes).
    #[must_use]
    pub fn clipped(self, clip: Region) -> Self {
        Self { clip, ..self }
    }

    /// The rasterizer with the time of a touched tile halved up to `halvings` times. Each part is tested
    /// again: up to `2^halvings` tests, and tighter bounds.
    #[must_use]
    pub fn halving(self, halvings: u32) -> Self {
        Self { halvings, ..self }
    }

    /// Call `each` with every tile that `triangle` may touch (column and row) and its intervals, in rows of
    /// blocks. Does not allocate.
    pub fn rasterize(&self, triangle: &MovingTriangle, grid: &Grid, mut each: impl FnMut([u32; 2], &Touch)) {
        let prepared = self.prepare(triangle);
        self.descend(&prepared, grid, 0..grid.columns, 0..grid.rows, &self.clip, &mut each);
    }

    /// Rasterize a prepared triangle in the tiles of some columns and rows only.
    pub fn rasterize_part(
        &self,
        prepared: &Prepared,
        grid: &Grid,
        [columns, rows]: [Range<u32>; 2],
        mut each: impl FnMut([u32; 2], &Touch),
    ) {
        self.descend(prepared, grid, columns, rows, &self.clip, &mut each);
    }

    /// Prepare a triangle for the tests of all tiles.
    pub fn prepare(&self, triangle: &MovingTriangle) -> Prepared {
        Prepared::new(triangle, &self.view)
    }

    /// Intervals in which a prepared triangle may touch `rect` within `region`, or `None` if it cannot. For
    /// callers with their own tile hierarchy: intervals of a tile are valid for the tiles inside.
    pub fn touch(&self, prepared: &Prepared, rect: &Rect, region: &Region) -> Option<Touch> {
        let seen = Seen::new(&self.view, prepared, rect, region);
        self.halved(prepared, seen, region, self.halvings)
    }

    fn descend(
        &self,
        prepared: &Prepared,
        grid: &Grid,
        columns: Range<u32>,
        rows: Range<u32>,
        region: &Region,
        each: &mut impl FnMut([u32; 2], &Touch),
    ) {
        if columns.is_empty() || rows.is_empty() {
            return;
        }
        let rect = grid.rect(&columns, &rows);
        if columns.len() == 1 && rows.len() == 1 {
            if let Some(touch) = self.touch(prepared, &rect, region) {
                each([columns.start, rows.start], &touch);
            }
            return;
        }
        let mut seen = Seen::new(&self.view, prepared, &rect, region);
        let Some(region) = part(&mut seen, prepared, region) else { return };
        let middle = |range: &Range<u32>| range.start + (range.end - range.start).div_ceil(2);
        let (column, row) = (middle(&columns), middle(&rows));
        for rows in [rows.start..row, row..rows.end] {
            for columns in [columns.start..column, column..columns.end] {
                self.descend(prepared, grid, columns, rows.clone(), &region, each);
            }
        }
    }

    fn halved(&self, prepared: &Prepared, mut seen: Seen, region: &Region, halvings: u32) -> Option<Touch> {
        let region = part(&mut seen, prepared, region)?;
        if halvings == 0 || !prepared.moving || region.t[0] == region.t[1] {
            return self.depths(&seen, &region).map(|z| Touch::new(&region, z));
        }
        let halves = region
            .halves()
            .map(|half| self.halved(prepared, seen.within(prepared, &half), &half, halvings - 1));
        halves.into_iter().flatten().reduce(|a, b| a.hull(&b))
    }

    /// Depth range in which the triangle may touch the tile (thesis, Paper VI, Appendix A, both tests), or
    /// `None` if it cannot.
    fn depths(&self, seen: &Seen, region: &Region) -> Option<[f64; 2]> {
        let vertices = seen.points.iter().flatten().map(|p| p[2]);
        let vertices =
            vertices.fold([f64::INFINITY, f64::NEG_INFINITY], |[lo, hi], z| [lo.min(z), hi.max(z)]);
        let beam = match self.view {
            View::Orthographic { .. } if !self.view.has_lens() => Beam::orthographic(seen.tile),
            View::Orthographic { s, a, .. } => Beam::oblique(seen.tile, [region.u, region.v], s, a),
            View::Perspective { .. } if !self.view.has_lens() => Beam::pinhole(seen.tile),
            View::Perspective { s, a, .. } => Beam::lens(seen.tile, [region.u, region.v], s, a),
        };
        let planes = seen.points.iter().map(|points| {
            let normal = normal(points);
            // A shorter normal may consist of underflowed products.
            if normal.iter().all(|n| n.abs() < MIN_UNCERTAINTY * MIN_UNCERTAINTY) {
                return None;
            }
            let plane = MovingPlane::new(normal, [&seen.points[0], &seen.points[1]], seen.size);
            plane.depths(plane.whole(), &beam, [0.0; 2])
        });
        let [lo, hi] = tightest(planes.chain([Some(vertices)]))?;
        let widened = |z: f64| ROUNDING * z.abs() + 2.0 * seen.depth_noise;
        let (lo, hi) = ((lo - widened(lo)).max(self.view.near()), hi + widened(hi));
        (lo <= hi).then_some([lo, hi])
    }
}

/// The part of `region` in which the triangle may touch the tile. `seen` is first given for `region`, then
/// for that part.
fn part(seen: &mut Seen, prepared: &Prepared, region: &Region) -> Option<Region> {
    let region = narrow(seen, prepared, region)?;
    (!miss(seen, &region)).then_some(region)
}
