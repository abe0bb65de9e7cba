//! Conservative rasterizer: from a triangle to the tiles it may touch.

use std::ops::Range;

use super::edges::miss;
use super::sides::{beyond_near, through_lens, through_pinhole};
use super::triangle::{ROUNDING, Seen};
use super::{MIN_UNCERTAINTY, MovingTriangle, Prepared, Rect, Region, Touch, View};
use crate::depth::plane::{Beam, MovingPlane, normal, tightest};
use crate::depth::{Numbers, Real};
use crate::tally::{Costs, Kernel, Path, Tally};

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

/// Work of the tile loop of conservative mode, with the multiply-adds that its numbers counted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct TileLoop {
    /// Blocks of tiles tested.
    pub blocks: u32,
    /// Tiles tested.
    pub tiles: u32,
    /// Blocks and tiles culled by their sides.
    pub culled_sides: u32,
    /// Blocks and tiles culled by the edges of the triangle or by its depths.
    pub culled_edges: u32,
    /// Multiply-adds of bringing vertices to a tile.
    pub place_madds: u32,
    /// Multiply-adds of side tests.
    pub side_madds: u32,
    /// Multiply-adds of edge tests.
    pub edge_madds: u32,
    /// Multiply-adds of depth intervals.
    pub depth_madds: u32,
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
    pub fn rasterize(&self, triangle: &MovingTriangle, grid: &Grid, each: impl FnMut([u32; 2], &Touch)) {
        self.rasterize_part(&self.prepare(triangle), grid, [0..grid.columns, 0..grid.rows], each);
    }

    /// Rasterize a prepared triangle in the tiles of some columns and rows only.
    pub fn rasterize_part(
        &self,
        prepared: &Prepared,
        grid: &Grid,
        part: [Range<u32>; 2],
        mut each: impl FnMut([u32; 2], &Touch),
    ) {
        let mut each = |tile, touch: &Touch, _: &mut TileLoop| each(tile, touch);
        self.tests(prepared, None).descend(grid, part, &self.clip, &mut each);
    }

    /// The same with the work of the tile loop, counted with `costs`. `each` is given the work since its last call and may
    /// take it; the rest is returned.
    pub fn rasterize_counted(
        &self,
        prepared: &Prepared,
        grid: &Grid,
        part: [Range<u32>; 2],
        costs: &Costs,
        mut each: impl FnMut([u32; 2], &Touch, &mut TileLoop),
    ) -> TileLoop {
        let mut tests = self.tests(prepared, Some(costs));
        tests.descend(grid, part, &self.clip, &mut each);
        tests.work
    }

    /// Prepare a triangle for the tests of all tiles.
    pub fn prepare(&self, triangle: &MovingTriangle) -> Prepared {
        Prepared::new(&Path::new(Kernel::Prepare), triangle, &self.view)
    }

    /// The same with its multiply-adds.
    pub fn prepare_counted(&self, triangle: &MovingTriangle, costs: &Costs) -> (Prepared, u32) {
        let prepared = |path: &Path| Prepared::new(path, triangle, &self.view);
        costs.run(Kernel::Prepare, prepared, |tally| _ = Prepared::new(tally, triangle, &self.view))
    }

    /// Intervals in which a prepared triangle may touch `rect` within `region`, or `None` if it cannot. For
    /// callers with their own tile hierarchy: intervals of a tile are valid for the tiles inside.
    pub fn touch(&self, prepared: &Prepared, rect: &Rect, region: &Region) -> Option<Touch> {
        self.tests(prepared, None).touch(rect, region).ok()
    }

    fn tests<'a>(&'a self, prepared: &'a Prepared, costs: Option<&'a Costs>) -> Tests<'a> {
        Tests { rasterizer: self, prepared, costs, work: TileLoop::default() }
    }
}

/// The test that culled a tile.
#[derive(Clone, Copy)]
enum Culled {
    BySides,
    ByEdges,
}

/// The tests of one triangle, and their work.
struct Tests<'a> {
    rasterizer: &'a Rasterizer,
    prepared: &'a Prepared,
    /// Without costs nothing is counted.
    costs: Option<&'a Costs>,
    work: TileLoop,
}

impl Tests<'_> {
    fn descend(
        &mut self,
        grid: &Grid,
        [columns, rows]: [Range<u32>; 2],
        region: &Region,
        each: &mut impl FnMut([u32; 2], &Touch, &mut TileLoop),
    ) {
        if columns.is_empty() || rows.is_empty() {
            return;
        }
        let rect = grid.rect(&columns, &rows);
        if columns.len() == 1 && rows.len() == 1 {
            self.work.tiles += 1;
            let touch = self.touch(&rect, region);
            if let Some(touch) = self.kept(touch) {
                each([columns.start, rows.start], &touch, &mut self.work);
            }
            return;
        }
        self.work.blocks += 1;
        let mut seen = self.seen(&rect, region);
        let part = self.part(&mut seen, region);
        let Some(region) = self.kept(part) else { return };
        let middle = |range: &Range<u32>| range.start + (range.end - range.start).div_ceil(2);
        let (column, row) = (middle(&columns), middle(&rows));
        for rows in [rows.start..row, row..rows.end] {
            for columns in [columns.start..column, column..columns.end] {
                self.descend(grid, [columns, rows.clone()], &region, each);
            }
        }
    }

    /// Counts the tile if it was culled.
    fn kept<T>(&mut self, tested: Result<T, Culled>) -> Option<T> {
        match tested {
            Err(Culled::BySides) => self.work.culled_sides += 1,
            Err(Culled::ByEdges) => self.work.culled_edges += 1,
            Ok(_) => {}
        }
        tested.ok()
    }

    fn touch(&mut self, rect: &Rect, region: &Region) -> Result<Touch, Culled> {
        let seen = self.seen(rect, region);
        self.halved(seen, region, self.rasterizer.halvings)
    }

    /// Runs a kernel and returns its multiply-adds with the result.
    #[inline(always)]
    fn run<T>(
        &self,
        kernel: Kernel,
        follow: impl FnOnce(&Path) -> T,
        count: impl FnOnce(&Tally),
    ) -> (T, u32) {
        match self.costs {
            Some(costs) => costs.run(kernel, follow, count),
            None => (follow(&Path::new(kernel)), 0),
        }
    }

    fn seen(&mut self, rect: &Rect, region: &Region) -> Seen<f64> {
        let (view, prepared) = (&self.rasterizer.view, self.prepared);
        let (seen, madds) = self.run(
            Kernel::Place,
            |path| Seen::new(path, view, prepared, rect, region),
            |tally| _ = Seen::new(tally, view, prepared, rect, region),
        );
        self.work.place_madds += madds;
        seen
    }

    /// Brings the triangle to the times of `region`, and returns the multiply-adds.
    fn bring(&self, seen: &mut Seen<f64>, region: &Region) -> u32 {
        let (before, prepared) = (&*seen, self.prepared);
        let (points, madds) = self.run(
            Kernel::Within,
            |path| before.points_within(path, prepared, region),
            |tally| _ = before.on(tally).points_within(tally, prepared, region),
        );
        seen.points = points;
        madds
    }

    /// The part of `region` in which the triangle may touch the tile. `seen` is first given for `region`, then
    /// for that part.
    fn part(&mut self, seen: &mut Seen<f64>, region: &Region) -> Result<Region, Culled> {
        let region = self.narrow(seen, region).ok_or(Culled::BySides)?;
        let seen = &*seen;
        let (missed, madds) = self.run(
            Kernel::Edges,
            |path| miss(path, seen, &region),
            |tally| _ = miss(tally, &seen.on(tally), &region),
        );
        self.work.edge_madds += madds;
        if missed { Err(Culled::ByEdges) } else { Ok(region) }
    }

    /// The part of `region` in which the triangle may be inside the sides of the tile and beyond the near depth, or
    /// `None`. Through a lens one side is tested after another: each test uses the part left by the previous ones.
    fn narrow(&mut self, seen: &mut Seen<f64>, region: &Region) -> Option<Region> {
        let (view, prepared) = (&self.rasterizer.view, self.prepared);
        let mut part = *region;
        if view.has_lens() {
            for side in [(0, 0), (0, 1), (1, 0), (1, 1)] {
                let (known, from) = (&*seen, &part);
                let (left, madds) = self.run(
                    Kernel::Side,
                    |path| through_lens(path, known, side, from),
                    |tally| _ = through_lens(tally, &known.on(tally), side, from),
                );
                self.work.side_madds += madds;
                part = left?;
                self.work.side_madds += self.bring(seen, &part);
            }
        } else {
            let (known, t) = (&*seen, part.t);
            let (left, madds) = self.run(
                Kernel::Sides,
                |path| through_pinhole(path, known, t),
                |tally| _ = through_pinhole(tally, &known.on(tally), t),
            );
            self.work.side_madds += madds;
            part.t = left?;
        }
        if view.near() != f64::NEG_INFINITY {
            let (left, madds) = self.run(
                Kernel::Near,
                |path| beyond_near(path, view, prepared, &part),
                |tally| _ = beyond_near(tally, view, prepared, &part),
            );
            self.work.side_madds += madds;
            part = left?;
        }
        if part != *region {
            self.work.side_madds += self.bring(seen, &part);
        }
        Some(part)
    }

    fn halved(&mut self, mut seen: Seen<f64>, region: &Region, halvings: u32) -> Result<Touch, Culled> {
        let region = self.part(&mut seen, region)?;
        if halvings == 0 || !self.prepared.moving || region.t[0] == region.t[1] {
            let view = &self.rasterizer.view;
            let (depths, madds) = self.run(
                Kernel::Depths,
                |path| depths(path, view, &seen, &region),
                |tally| _ = depths(tally, view, &seen.on(tally), &region),
            );
            self.work.depth_madds += madds;
            return depths.map(|z| Touch::new(&region, z)).ok_or(Culled::ByEdges);
        }
        let halves = region.halves().map(|half| {
            let mut seen = seen;
            self.work.place_madds += self.bring(&mut seen, &half);
            self.halved(seen, &half, halvings - 1).ok()
        });
        halves.into_iter().flatten().reduce(|a, b| a.hull(&b)).ok_or(Culled::ByEdges)
    }
}

/// Depth range in which the triangle may touch the tile (thesis, Paper VI, Appendix A, both tests), or
/// `None` if it cannot.
fn depths<N: Numbers>(numbers: N, view: &View, seen: &Seen<N::Number>, region: &Region) -> Option<[f64; 2]> {
    let vertices = seen.points.iter().flatten().map(|p| p[2]);
    let nothing = [f64::INFINITY, f64::NEG_INFINITY].map(N::Number::new);
    let vertices = vertices.fold(nothing, |[lo, hi], z| [lo.smaller(z), hi.larger(z)]);
    let beam = beam(numbers, view, seen, region);
    let planes = seen.points.iter().map(|points| {
        let normal = normal(points);
        // A shorter normal may consist of underflowed products.
        let shortest = N::Number::new(MIN_UNCERTAINTY * MIN_UNCERTAINTY);
        if numbers.branch(normal.iter().all(|n| n.magnitude() < shortest)) {
            return None;
        }
        let plane = MovingPlane::new(normal, [&seen.points[0], &seen.points[1]], seen.size);
        plane.depths(plane.whole(), &beam, [0.0; 2].map(N::Number::new), numbers)
    });
    let [lo, hi] = tightest(planes.chain([Some(vertices)]))?;
    let allowance = N::Number::new(2.0) * seen.depth_noise;
    let widened = |z: N::Number| N::Number::new(ROUNDING) * z.magnitude() + allowance;
    let near = N::Number::new(view.near());
    let (lo, hi) = ((lo - widened(lo)).larger(near), hi + widened(hi));
    (lo <= hi).then_some([lo.value(), hi.value()])
}

/// The rays of a tile from a part of the lens.
fn beam<N: Numbers>(numbers: N, view: &View, seen: &Seen<N::Number>, region: &Region) -> Beam<N::Number> {
    let of = |range: [f64; 2]| range.map(|value| numbers.number(value));
    let lens = numbers.branch(view.has_lens()).then(|| {
        let (s, a) = view.shear();
        ([of(region.u), of(region.v)], of(s), of(a))
    });
    match (lens, numbers.branch(view.is_perspective())) {
        (None, true) => Beam::pinhole(seen.tile),
        (None, false) => Beam::orthographic(seen.tile),
        (Some((lens, s, a)), true) => Beam::lens(seen.tile, lens, s, a),
        (Some((lens, s, a)), false) => Beam::oblique(seen.tile, lens, s, a),
    }
}
