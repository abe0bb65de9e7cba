//! The tile tests that are switched on, in order of price: what of lens and time one triangle leaves over one tile.

use super::counters::TileWork;
use super::judge::{Did, Judge, Plan, Stake};
use super::settings::Features;
use crate::geometry::Shear;
use crate::sample_test;
use crate::setup::Triangle;
use crate::traversal::{
    self, Box5, EdgeBounds, Edges, Facing, LensLines, Piece, SCREEN_GAIN_MADDS as GAIN, Screen, TileRect,
    Timeline, View, narrow_counted,
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
    /// Whether facing was found.
    pub facing: bool,
    /// Whether screens were set up.
    pub screened: bool,
}

impl Left {
    /// Nothing is ruled out in `within`.
    pub fn all(within: Box5) -> Self {
        Self {
            within,
            times: Timeline::one(Piece { t: within.t, faces: [true; 2] }),
            edges: None,
            facing: false,
            screened: false,
        }
    }

    /// The same in the box `within`, or `None` where nothing is left.
    pub fn narrowed(&self, within: Box5) -> Option<Self> {
        let times = self.times.meet(&Timeline::one(Piece { t: within.t, faces: [true; 2] }));
        Some(Self {
            within: Box5 { t: times.hull()?, ..within },
            times,
            edges: None,
            facing: self.facing,
            screened: self.screened,
        })
    }

    /// The share of all of lens and time that is left; samples are spread evenly over them.
    pub fn volume(&self, moving: bool) -> f64 {
        let length = |[lo, hi]: [f32; 2]| f64::from((hi - lo).max(0.0));
        let time: f64 = self.times.pieces().iter().map(|piece| length(piece.t)).sum();
        let lens = if self.within.lens { 0.25 * length(self.within.u) * length(self.within.v) } else { 1.0 };
        lens * if moving { time } else { 1.0 }
    }
}

impl Subject<'_> {
    /// What is left at `place` of what was `left` before, or `None` where the triangle is not seen there.
    pub fn test(&self, place: &Place, left: &Left, run: &mut Run<'_>) -> Option<Left> {
        // Edges found over a coarser tile are those of that tile.
        let mut left = Left { edges: None, facing: false, ..*left };
        let lines = self.lines.filter(|_| run.features.lens_lines && left.within.lens);
        if let Some(lines) = lines {
            left = left.narrowed(lens_lines_over(lines, &place.rect, left.within, run.work)?)?;
        }
        let allowed = self.allowed(place, &left, run.features);
        if !run.features.auto || allowed == Plan(0) {
            return self.plan(allowed, place, left, run);
        }
        let stake = self.stake(allowed, place, &left);
        match run.judge.plan(&stake) {
            Some(plan) => self.watched(&stake, plan, place, left, run),
            None => self.trial(&stake, place, left, run),
        }
    }

    /// The tests that are switched on and can help here.
    fn allowed(&self, place: &Place, left: &Left, features: &Features) -> Plan {
        let here = features.coarse || place.tiles.is_none();
        let sides =
            features.side_planes && (self.triangle.moving || left.within.lens || self.triangle.behind);
        let bits = [
            (sides, Plan::SIDES),
            (features.facing && here, Plan::FACING),
            (features.edges && here, Plan::EDGES),
        ];
        Plan(bits.iter().map(|&(on, bit)| if on { bit } else { 0 }).sum())
    }

    fn plan(&self, plan: Plan, place: &Place, left: Left, run: &mut Run<'_>) -> Option<Left> {
        let tests = [Plan::SIDES, Plan::FACING, Plan::EDGES];
        tests
            .into_iter()
            .filter(|&test| plan.has(test))
            .try_fold(left, |left, test| self.step(test, place, left, run))
    }

    /// The same, learning from it.
    fn watched(
        &self,
        stake: &Stake,
        plan: Plan,
        place: &Place,
        left: Left,
        run: &mut Run<'_>,
    ) -> Option<Left> {
        let Some((_, parent)) = plan.last() else { return Some(left) };
        let left = self.watched(stake, parent, place, left, run)?;
        self.watched_step(stake, plan, place, left, run)
    }

    /// The last test of a plan on what those before it have left.
    fn watched_step(
        &self,
        stake: &Stake,
        plan: Plan,
        place: &Place,
        left: Left,
        run: &mut Run<'_>,
    ) -> Option<Left> {
        let Some((test, _)) = plan.last() else { return Some(left) };
        let (volume, madds) = (left.volume(self.triangle.moving), run.work.tile_madds());
        let rest = self.step(test, place, left, run);
        let after = rest.map_or(0.0, |rest| rest.volume(self.triangle.moving));
        let left = if volume > 0.0 { after / volume } else { f64::from(u8::from(rest.is_some())) };
        let samples = f64::from(place.samples) * volume;
        run.judge.learn(stake, plan, &Did { madds: run.work.tile_madds() - madds, samples, left });
        rest
    }

    /// Every plan on what is `left`; the rest of the fullest one is kept.
    fn trial(&self, stake: &Stake, place: &Place, left: Left, run: &mut Run<'_>) -> Option<Left> {
        let before = run.work.tile_madds();
        let mut lefts = [Some(left); Plan::COUNT];
        for plan in stake.allowed.within() {
            let Some((_, parent)) = plan.last() else { continue };
            let parent = lefts[parent.0 as usize];
            lefts[plan.0 as usize] = parent.and_then(|left| self.watched_step(stake, plan, place, left, run));
        }
        run.judge.learn_trial(stake, run.work.tile_madds() - before);
        lefts[stake.allowed.0 as usize]
    }

    fn step(&self, test: u8, place: &Place, mut left: Left, run: &mut Run<'_>) -> Option<Left> {
        match test {
            Plan::SIDES => return left.narrowed(self.side_planes(&place.rect, left.within, run.work)?),
            Plan::FACING => {
                self.facing(&place.rect, &mut left, run.features.facing_splits, run.work)?;
                left.facing = true;
            }
            _ => self.edge_bounds(&place.rect, &mut left, run.work)?,
        }
        Some(left)
    }

    /// What `auto` has to know of `place` and what is `left` there.
    fn stake(&self, allowed: Plan, place: &Place, left: &Left) -> Stake {
        let (moving, lens) = (self.triangle.moving, left.within.lens);
        Stake {
            allowed,
            moving,
            samples: f64::from(place.samples) * left.volume(moving),
            tiles: place.tiles,
            found: f64::from(traversal::edge_madds(moving, lens)),
            screen: f64::from(traversal::screen_setup_madds(moving, lens, true) + GAIN),
            full: f64::from(sample_test::madds(moving, lens)),
        }
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
        let (times, more) = EdgeBounds::new(&edges).timeline(&edges, &left.times, self.triangle.faces);
        work.edge_bound_madds += traversal::edge_bound_madds(self.triangle.moving, left.within.lens) + more;
        left.times = times;
        let hull = left.times.hull();
        work.culled_edges += u32::from(hull.is_none());
        left.within.t = hull?;
        Some(())
    }

    /// Whether to set up screens for the samples of what is left on a fine tile.
    pub fn wants_screen(&self, place: &Place, left: &Left, run: &mut Run<'_>) -> bool {
        if !run.features.auto || !run.features.screen {
            return run.features.screen;
        }
        let (moving, lens) = (self.triangle.moving, left.within.lens);
        let found = if left.edges.is_some() { 0 } else { traversal::edge_madds(moving, lens) };
        let full =
            f64::from(place.samples) * left.volume(moving) * f64::from(sample_test::madds(moving, lens));
        let pieces = left.times.pieces().len() as u32;
        let set_up = found + pieces * (traversal::screen_setup_madds(moving, lens, pieces == 1) + GAIN);
        let wants = run.judge.wants_screen(f64::from(set_up), full);
        run.judge.learn_screened(wants);
        wants
    }

    /// Whether a screen saves more than it costs, by what it is expected to take away.
    pub fn pays(&self, screen: &Screen, lens: bool, run: &mut Run<'_>) -> bool {
        if !run.features.auto {
            return true;
        }
        run.work.screen_setup_madds += GAIN;
        let moving = self.triangle.moving;
        let (full, price) = (sample_test::madds(moving, lens), traversal::screen_madds(moving, lens));
        run.judge.wants_samples_screened(screen.gain(), f64::from(price), f64::from(full))
    }

    /// The screen for the samples of a piece of the time that is left.
    pub fn screen(&self, rect: &TileRect, left: &mut Left, piece: &Piece, work: &mut TileWork) -> Screen {
        let edges = self.edges(rect, left, work);
        let (screen, whole) =
            (Screen::new(edges, piece.t, piece.seen(self.triangle.faces)), edges.spans(piece.t));
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
