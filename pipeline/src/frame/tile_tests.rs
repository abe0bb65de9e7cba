//! The tile tests that are switched on, in order of price: what of lens and time one triangle leaves over one tile.

use super::counters::TileWork;
use super::judge::{Judge, Test};
use super::settings::Features;
use crate::geometry::Shear;
use crate::sample_test;
use crate::setup::Triangle;
use crate::traversal::{
    self, Box5, Edges, Facing, LensLines, Piece, Screen, TileRect, Timeline, View, narrow_counted,
};

/// A triangle with what set-up found for its tile tests.
#[derive(Clone, Copy)]
pub(super) struct Subject<'a> {
    pub triangle: &'a Triangle,
    pub lines: Option<&'a LensLines>,
    pub shear: &'a Shear,
}

/// A tile, with how much there is to do on it.
#[derive(Clone, Copy)]
pub(super) struct Place {
    pub rect: TileRect,
    /// Whether it holds finer tiles, and how many of them are visited.
    pub tiles: Option<u32>,
    /// Samples in those.
    pub samples: u32,
}

/// Which tests to run, what they have done so far and what was learnt from it.
pub(super) struct Run<'a> {
    pub features: &'a Features,
    pub work: &'a mut TileWork,
    pub judge: &'a mut Judge,
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

    /// The same in the box `within`, or `None` where nothing is left.
    pub fn narrowed(&self, within: Box5) -> Option<Self> {
        let times = self.times.meet(&Timeline::one(Piece { t: within.t, faces: [true; 2] }));
        Some(Self { within: Box5 { t: times.hull()?, ..within }, times, edges: None })
    }

    /// The share of all of lens and time that is left; samples are spread evenly over them.
    fn volume(&self, moving: bool) -> f64 {
        let length = |[lo, hi]: [f32; 2]| f64::from((hi - lo).max(0.0));
        let time: f64 = self.times.pieces().iter().map(|piece| length(piece.t)).sum();
        let lens = if self.within.lens { 0.25 * length(self.within.u) * length(self.within.v) } else { 1.0 };
        lens * if moving { time } else { 1.0 }
    }
}

impl Subject<'_> {
    /// What is left at `place` of what was `left` before, or `None` where the triangle is not seen there.
    pub fn test(&self, place: &Place, left: &Left, run: &mut Run<'_>) -> Option<Left> {
        let Features { side_planes, facing, edges, coarse, lens_lines, .. } = *run.features;
        let (moving, lens) = (self.triangle.moving, left.within.lens);
        // Edges found over a coarser tile are those of that tile.
        let mut left = Left { edges: None, ..*left };
        let lines = self.lines.filter(|_| lens_lines && lens);
        if let Some(lines) = lines {
            let price = traversal::lens_line_madds(0);
            left = self.judged(Test::LensLines, price, place, left, run, |left, work| {
                left.narrowed(lens_lines_over(lines, &place.rect, left.within, work)?)
            })?;
        }
        if side_planes && (moving || lens || self.triangle.behind) {
            let price = 4 * traversal::side_madds(moving, lens, self.triangle.behind);
            left = self.judged(Test::SidePlanes, price, place, left, run, |left, work| {
                left.narrowed(self.side_planes(&place.rect, left.within, work)?)
            })?;
        }
        if (facing || edges) && (coarse || place.tiles.is_none()) {
            let (splits, price) = (run.features.facing_splits, self.edge_price(place, &left, run));
            left = self.judged(Test::Edges, price, place, left, run, |mut left, work| {
                if facing {
                    self.facing(&place.rect, &mut left, splits, work)?;
                }
                if edges {
                    self.edge_bounds(&place.rect, &mut left, work)?;
                }
                Some(left)
            })?;
        }
        Some(left)
    }

    /// Runs a test, under `auto` only where it is wanted.
    fn judged(
        &self,
        test: Test,
        price: u32,
        place: &Place,
        left: Left,
        run: &mut Run<'_>,
        kernel: impl FnOnce(Left, &mut TileWork) -> Option<Left>,
    ) -> Option<Left> {
        if !run.features.auto {
            return kernel(left, run.work);
        }
        let at_stake = self.at_stake(place, &left, run);
        if !run.judge.wants(test, place.tiles.is_some(), price, at_stake) {
            return Some(left);
        }
        let before = (left.volume(self.triangle.moving), run.work.tile_madds());
        let after = kernel(left, run.work);
        let left = after.map_or(0.0, |left| left.volume(self.triangle.moving) / before.0);
        let share = if left.is_finite() { 1.0 - left } else { 0.0 };
        let dearer = f64::from(run.work.tile_madds() - before.1) / f64::from(price);
        run.judge.learn(test, place.tiles.is_some(), share, dearer);
        after
    }

    /// The multiply-adds to be expected at `place` for what is `left`.
    fn at_stake(&self, place: &Place, left: &Left, run: &Run<'_>) -> f64 {
        let (moving, lens) = (self.triangle.moving, left.within.lens);
        let full = f64::from(sample_test::madds(moving, lens));
        let screened =
            f64::from(traversal::screen_madds(moving, lens)) + (1.0 - run.judge.share(Test::Screen)) * full;
        let price = if run.features.screen { screened.min(full) } else { full };
        let samples = f64::from(place.samples) * left.volume(moving);
        let tiles = place.tiles.map_or(0.0, |tiles| {
            f64::from(
                tiles
                    * (4 * traversal::side_madds(moving, lens, false) + traversal::edge_madds(moving, lens)),
            )
        });
        // A finer tile costs no more than testing all its samples.
        samples * price + tiles.min(samples * full)
    }

    /// The price of facing and edge bounds; where a screen follows, the edges are found anyway.
    fn edge_price(&self, place: &Place, left: &Left, run: &Run<'_>) -> u32 {
        let (moving, lens) = (self.triangle.moving, left.within.lens);
        let facing = if run.features.facing { traversal::facing_madds(moving, lens, 0) } else { 0 };
        let bounds = if run.features.edges { traversal::edge_bound_madds(moving, lens) } else { 0 };
        let found = traversal::edge_madds(moving, lens);
        let screen = f64::from(found + traversal::screen_setup_madds(moving, lens, true));
        let shared =
            run.features.screen && place.tiles.is_none() && self.saved_by_screen(place, left, run) > screen;
        facing + bounds + if shared { 0 } else { found }
    }

    /// The multiply-adds a screen saves as a rule, but for its set-up.
    fn saved_by_screen(&self, place: &Place, left: &Left, run: &Run<'_>) -> f64 {
        let (moving, lens) = (self.triangle.moving, left.within.lens);
        let (full, screen) = (sample_test::madds(moving, lens), traversal::screen_madds(moving, lens));
        let each = run.judge.share(Test::Screen) * f64::from(full) - f64::from(screen);
        f64::from(place.samples) * left.volume(moving) * each
    }

    fn side_planes(&self, rect: &TileRect, within: Box5, work: &mut TileWork) -> Option<Box5> {
        let (next, madds) = narrow_counted::<f64>(self.triangle, self.shear, rect, &within);
        work.side_plane_madds += madds;
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

    /// Whether to screen the samples of what is left on a fine tile.
    pub fn wants_screen(&self, place: &Place, left: &Left, run: &mut Run<'_>) -> bool {
        if !run.features.auto || !run.features.screen {
            return run.features.screen;
        }
        let (moving, lens) = (self.triangle.moving, left.within.lens);
        let found = if left.edges.is_some() { 0 } else { traversal::edge_madds(moving, lens) };
        let screened =
            f64::from(place.samples) * left.volume(moving) * f64::from(traversal::screen_madds(moving, lens));
        let full =
            f64::from(place.samples) * left.volume(moving) * f64::from(sample_test::madds(moving, lens));
        let pieces = left.times.pieces().len() as u32;
        let set_up = found + pieces * traversal::screen_setup_madds(moving, lens, pieces == 1);
        run.judge.wants(Test::Screen, false, set_up + screened as u32, full)
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

fn lens_lines_over(lines: &LensLines, rect: &TileRect, within: Box5, work: &mut TileWork) -> Option<Box5> {
    let (next, crossings) = lines.narrow(rect, &within);
    work.lens_line_madds += traversal::lens_line_madds(crossings);
    work.culled_lens += u32::from(next.is_none());
    next
}
