//! Conservative rasterizer: from a triangle to the tiles it may touch.

use std::ops::{AddAssign, Range};

use super::{MovingTriangle, Precision, Rect, Region, Rounded, Touch, View, recentring_madds};
use crate::depth::ExactBounder;
use crate::tally::Costs;
use crate::traversal::{
    Box5, EdgeBounds, Edges, TileRect, TileView as Seen, edge_bound_madds, edge_madds, narrow_by_sides,
    narrow_near,
};

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

/// Work of the tile loop of conservative mode, with the multiply-adds of its tests.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct TileLoop {
    /// Blocks of tiles tested.
    pub blocks: u32,
    /// Tiles tested.
    pub tiles: u32,
    /// Blocks and tiles culled by their sides or by the near depth.
    pub culled_sides: u32,
    /// Blocks and tiles culled by the edges of the triangle or by its depths.
    pub culled_edges: u32,
    /// Multiply-adds of moving vertices to the tiles, and of finding their edges over a tile.
    pub place_madds: u32,
    /// Multiply-adds of tests against sides and the near depth.
    pub side_madds: u32,
    /// Multiply-adds of edge tests.
    pub edge_madds: u32,
    /// Multiply-adds of depth intervals.
    pub depth_madds: u32,
}

impl AddAssign for TileLoop {
    fn add_assign(&mut self, other: Self) {
        self.blocks += other.blocks;
        self.tiles += other.tiles;
        self.culled_sides += other.culled_sides;
        self.culled_edges += other.culled_edges;
        self.place_madds += other.place_madds;
        self.side_madds += other.side_madds;
        self.edge_madds += other.edge_madds;
        self.depth_madds += other.depth_madds;
    }
}

/// Conservative rasterizer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rasterizer {
    view: View,
    clip: Region,
    halvings: u32,
    in_doubles: bool,
    finds_depths: bool,
}

impl Rasterizer {
    /// A rasterizer for the whole lens and shutter in `view`, with tests in `f32`; the time of a touched tile
    /// is halved twice.
    pub fn new(view: View) -> Self {
        Self { view, clip: Region::WHOLE, halvings: 2, in_doubles: false, finds_depths: true }
    }

    /// The rasterizer with tests in `f64`, for tiles smaller than the precision of `f32`.
    #[must_use]
    pub fn in_doubles(self) -> Self {
        Self { in_doubles: true, ..self }
    }

    /// The rasterizer for shaders that read no depths: those of a tile reach from the near depth to infinity, and cull
    /// none.
    #[must_use]
    pub fn without_depths(self) -> Self {
        Self { finds_depths: false, ..self }
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

    /// Call `each` with every tile that `triangle` may touch (column and row) and its intervals, in the order
    /// of a Z-curve over blocks. Does not allocate.
    pub fn rasterize(&self, triangle: &MovingTriangle, grid: &Grid, each: impl FnMut([u32; 2], &Touch)) {
        self.rasterize_part(triangle, grid, [0..grid.columns, 0..grid.rows], each);
    }

    /// Rasterize a triangle in the tiles of some columns and rows only.
    pub fn rasterize_part(
        &self,
        triangle: &MovingTriangle,
        grid: &Grid,
        part: [Range<u32>; 2],
        mut each: impl FnMut([u32; 2], &Touch),
    ) {
        self.in_precision(triangle, (grid, part), None, &mut |tile, touch, _| each(tile, touch));
    }

    /// The same with the work of the tile loop, whose multiply-adds `costs` counts. `each` is given the work since its
    /// last call and may take it; the rest is returned.
    pub fn rasterize_counted(
        &self,
        triangle: &MovingTriangle,
        grid: &Grid,
        part: [Range<u32>; 2],
        costs: &Costs,
        mut each: impl FnMut([u32; 2], &Touch, &mut TileLoop),
    ) -> TileLoop {
        self.in_precision(triangle, (grid, part), Some(costs), &mut each)
    }

    fn in_precision(
        &self,
        triangle: &MovingTriangle,
        part: (&Grid, [Range<u32>; 2]),
        costs: Option<&Costs>,
        each: Each<'_>,
    ) -> TileLoop {
        if self.in_doubles {
            self.tiles::<f64>(triangle, part, costs, each)
        } else {
            self.tiles::<f32>(triangle, part, costs, each)
        }
    }

    fn tiles<C: Precision>(
        &self,
        triangle: &MovingTriangle,
        (grid, [columns, rows]): (&Grid, [Range<u32>; 2]),
        costs: Option<&Costs>,
        each: Each<'_>,
    ) -> TileLoop {
        if columns.is_empty() || rows.is_empty() {
            return TileLoop::default();
        }
        let rect = grid.rect(&columns, &rows);
        let mut tests = Tests::<C>::new(self, triangle, &rect, costs);
        let within = self.clip.outward(self.view.has_lens());
        tests.descend(grid, [columns, rows], within, each);
        tests.work
    }
}

/// What is called with every tile. It is not a parameter of a type, so that the tests are compiled here, in
/// one piece.
type Each<'a> = &'a mut dyn FnMut([u32; 2], &Touch, &mut TileLoop);

/// The test that culled a tile.
#[derive(Clone, Copy)]
enum Culled {
    BySides,
    ByEdges,
}

/// The tests of one triangle, and their work.
struct Tests<'a, C> {
    rasterizer: &'a Rasterizer,
    rounded: Rounded<C>,
    /// Finds depths, if any are.
    bounder: Option<ExactBounder>,
    costs: Option<&'a Costs>,
    work: TileLoop,
}

impl<'a, C: Precision> Tests<'a, C> {
    /// Tests of tiles within `rect`.
    fn new(
        rasterizer: &'a Rasterizer,
        triangle: &MovingTriangle,
        rect: &Rect,
        costs: Option<&'a Costs>,
    ) -> Self {
        let rounded = Rounded::<C>::new(&rasterizer.view, triangle, rect);
        let place_madds = recentring_madds(rounded.triangle.moving, rasterizer.view.is_perspective());
        let bounder = || ExactBounder::new(&rounded.triangle, &rounded.shear, costs);
        let (bounder, depth_madds) = rasterizer.finds_depths.then(bounder).unzip();
        let depth_madds = depth_madds.unwrap_or(0);
        let work = TileLoop { place_madds, depth_madds, ..TileLoop::default() };
        Self { rasterizer, rounded, bounder, costs, work }
    }

    fn descend(
        &mut self,
        grid: &Grid,
        [columns, rows]: [Range<u32>; 2],
        mut within: Box5<C>,
        each: Each<'_>,
    ) {
        if columns.is_empty() || rows.is_empty() {
            return;
        }
        let rect = grid.rect(&columns, &rows);
        if columns.len() == 1 && rows.len() == 1 {
            self.work.tiles += 1;
            let touch = self.touch(&rect, within);
            if let Some(touch) = self.kept(touch) {
                each([columns.start, rows.start], &touch, &mut self.work);
            }
            return;
        }
        self.work.blocks += 1;
        let tile = self.rounded.tile(&rect);
        let part = self.part(&tile, &mut within);
        if self.kept(part).is_none() {
            return;
        }
        let middle = |range: &Range<u32>| range.start + (range.end - range.start).div_ceil(2);
        let (column, row) = (middle(&columns), middle(&rows));
        for rows in [rows.start..row, row..rows.end] {
            for columns in [columns.start..column, column..columns.end] {
                self.descend(grid, [columns, rows.clone()], within, each);
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

    fn touch(&mut self, rect: &Rect, within: Box5<C>) -> Result<Touch, Culled> {
        self.halved(&self.rounded.tile(rect), within, self.rasterizer.halvings)
    }

    /// Narrows `within` to the part in which the triangle may touch the tile: inside its sides, beyond the
    /// near depth, and inside its own edges. Which face it shows does not matter, as it may have no area.
    fn part(&mut self, tile: &TileRect<C>, within: &mut Box5<C>) -> Result<(), Culled> {
        let Rounded { triangle, shear, near, depth_slack, .. } = &self.rounded;
        let (mut is_left, madds) = narrow_by_sides::<f64, C>(triangle, shear, tile, within);
        self.work.side_madds += madds;
        if is_left && self.rasterizer.view.near() != f64::NEG_INFINITY {
            let (beyond, madds) = narrow_near::<f64, C>(triangle, *near, *depth_slack, within);
            self.work.side_madds += madds;
            is_left = beyond;
        }
        if !is_left {
            return Err(Culled::BySides);
        }
        within.t = self.edges(tile, within).ok_or(Culled::ByEdges)?;
        Ok(())
    }

    /// Times at which the triangle may be inside its edges. An edge is bilinear in u and v, so it is bounded by its
    /// bounds from the corners of the lens.
    fn edges(&mut self, tile: &TileRect<C>, within: &Box5<C>) -> Option<[C; 2]> {
        let Rounded { triangle, shear, .. } = &self.rounded;
        let corner = |i: usize, j: usize| Box5 { u: [within.u[i]; 2], v: [within.v[j]; 2], ..*within };
        let first = Edges::<f64, C>::new(Seen::new(triangle, shear, tile, &corner(0, 0)));
        let (mut bounds, mut views) = (EdgeBounds::new(&first), 1);
        if within.lens {
            for (i, j) in [(1, 0), (0, 1), (1, 1)] {
                let other = Edges::<f64, C>::new(Seen::new(triangle, shear, tile, &corner(i, j)));
                bounds = bounds.hull(&EdgeBounds::new(&other));
                views += 1;
            }
        }
        let (times, more) = bounds.times(&first, within.t, [true; 2]);
        self.work.place_madds += views * edge_madds(triangle.moving, within.lens);
        self.work.edge_madds += views * edge_bound_madds(triangle.moving, within.lens) + more;
        times
    }

    fn halved(&mut self, tile: &TileRect<C>, mut within: Box5<C>, halvings: u32) -> Result<Touch, Culled> {
        self.part(tile, &mut within)?;
        let [start, end] = within.t;
        let middle = C::nearest(0.5) * (start + end);
        if halvings == 0 || !self.rounded.triangle.moving || !(start < middle && middle < end) {
            return self.depths(tile, &within).ok_or(Culled::ByEdges);
        }
        let halves = [[start, middle], [middle, end]]
            .map(|t| self.halved(tile, Box5 { t, ..within }, halvings - 1).ok());
        halves.into_iter().flatten().reduce(|a, b| a.hull(&b)).ok_or(Culled::ByEdges)
    }

    /// The intervals with the depths (thesis, Paper VI, Appendix A, both tests), or `None` if there are none.
    fn depths(&mut self, tile: &TileRect<C>, within: &Box5<C>) -> Option<Touch> {
        let near = self.rasterizer.view.near();
        let mut z = [near, f64::INFINITY];
        if let Some(bounder) = &self.bounder {
            let (depths, madds) = bounder.over(tile, within, self.rounded.depth_slack, self.costs);
            self.work.depth_madds += madds;
            let [lo, hi] = self.rounded.depths(depths);
            z = [lo.max(near), hi];
        }
        let Region { u, v, t } = self.rasterizer.clip.within(within);
        [u, v, t, z].iter().all(|[lo, hi]| lo <= hi).then_some(Touch { u, v, t, z })
    }
}
