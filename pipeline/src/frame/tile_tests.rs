//! The tile tests that are switched on, in order of price: what of lens and time one triangle leaves over one tile.

use super::counters::TileWork;
use super::settings::Features;
use crate::geometry::Shear;
use crate::setup::Triangle;
use crate::traversal::{
    self, Box5, Edges, Facing, LensLines, Piece, Screen, TileRect, Timeline, View, narrow,
};

/// A triangle with what set-up found for its tile tests.
#[derive(Clone, Copy)]
pub(super) struct Subject<'a> {
    pub triangle: &'a Triangle,
    pub lines: Option<&'a LensLines>,
    pub shear: &'a Shear,
}

/// Where in lens and time the triangle may still be seen, and which faces when.
#[derive(Clone, Copy)]
pub(super) struct Left {
    pub within: Box5,
    pub times: Timeline,
    edges: Option<Edges>,
}

impl Left {
    /// Nothing is ruled out in `within`.
    pub fn all(within: Box5) -> Self {
        Self { within, times: Timeline::one(Piece { t: within.t, faces: [true; 2] }), edges: None }
    }

    /// The same in the box `within`.
    fn within(&self, within: Box5) -> Self {
        let times = self.times.meet(&Timeline::one(Piece { t: within.t, faces: [true; 2] }));
        Self { within, times, edges: None }
    }
}

impl Subject<'_> {
    /// What is left over the tile `rect` of what was `left` before, or `None` where the triangle is not seen there. `edges` says whether
    /// facing and edges have a say.
    pub fn test(
        &self,
        rect: &TileRect,
        left: &Left,
        run: &Features,
        edges: bool,
        work: &mut TileWork,
    ) -> Option<Left> {
        let within = self.lens_lines(rect, left.within, run, work)?;
        let within = self.side_planes(rect, within, run, work)?;
        let mut left = left.within(within);
        left.within.t = left.times.hull()?;
        if edges && run.facing {
            self.facing(rect, &mut left, run.facing_splits, work)?;
        }
        if edges && run.edges {
            self.edge_bounds(rect, &mut left, work)?;
        }
        Some(left)
    }

    fn lens_lines(&self, rect: &TileRect, within: Box5, run: &Features, work: &mut TileWork) -> Option<Box5> {
        let Some(lines) = self.lines.filter(|_| run.lens_lines && within.lens) else { return Some(within) };
        let (next, crossings) = lines.narrow(rect, &within);
        work.lens_line_madds += traversal::lens_line_madds(crossings);
        work.culled_lens += u32::from(next.is_none());
        next
    }

    fn side_planes(
        &self,
        rect: &TileRect,
        within: Box5,
        run: &Features,
        work: &mut TileWork,
    ) -> Option<Box5> {
        let plain = !self.triangle.moving && !within.lens && !self.triangle.behind;
        if plain || !run.side_planes {
            return Some(within);
        }
        work.side_plane_madds += traversal::madds(self.triangle.moving, within.lens);
        let next = narrow(self.triangle, self.shear, rect, &within);
        work.culled_sides += u32::from(next.is_none());
        next
    }

    fn facing(&self, rect: &TileRect, left: &mut Left, splits: u32, work: &mut TileWork) -> Option<()> {
        if left.times.pieces().iter().all(Piece::is_decided) {
            return Some(());
        }
        let facing = Facing::new(self.edges(rect, left, work));
        let (times, bisections) = facing.timeline(left.within.t, self.triangle.faces, splits);
        work.facing_madds += traversal::facing_madds(self.triangle.moving, left.within.lens, bisections);
        left.times = left.times.meet(&times);
        let hull = left.times.hull();
        work.culled_facing += u32::from(hull.is_none());
        left.within.t = hull?;
        Some(())
    }

    fn edge_bounds(&self, rect: &TileRect, left: &mut Left, work: &mut TileWork) -> Option<()> {
        let edges = *self.edges(rect, left, work);
        let (times, more) = edges.bounds().timeline(&edges, &left.times, self.triangle.faces);
        work.edge_bound_madds += traversal::edge_bound_madds(self.triangle.moving, left.within.lens) + more;
        left.times = times;
        let hull = left.times.hull();
        work.culled_edges += u32::from(hull.is_none());
        left.within.t = hull?;
        Some(())
    }

    /// The screen for the samples of a piece of the time that is left.
    pub fn screen(&self, rect: &TileRect, left: &mut Left, piece: &Piece, work: &mut TileWork) -> Screen {
        let edges = self.edges(rect, left, work);
        let (screen, whole) = (edges.screen(piece.t, piece.seen(self.triangle.faces)), edges.spans(piece.t));
        work.screen_setup_madds +=
            traversal::screen_setup_madds(self.triangle.moving, left.within.lens, whole);
        screen
    }

    /// The edges over the tile, found at the first use.
    fn edges<'l>(&self, rect: &TileRect, left: &'l mut Left, work: &mut TileWork) -> &'l Edges {
        let within = left.within;
        left.edges.get_or_insert_with(|| {
            work.edge_madds += traversal::edge_madds(self.triangle.moving, within.lens);
            Edges::new(View::new(self.triangle, self.shear, rect, &within))
        })
    }
}
