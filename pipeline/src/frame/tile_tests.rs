//! Enabled tile tests of one triangle over one tile, in order of cost: which part of lens and time remains.

use super::Features;
use super::bin::TileWork;
use super::test_selection::{TestPlan, TestResult, TestSelector, Workload};
use crate::geometry::Shear;
use crate::sample_test;
use crate::setup::Triangle;
use crate::traversal::{
    self, Box5, EdgeBounds, Edges, Facing, LensLines, LensSpan, LensSpans, Piece, SCREEN_GAIN_MADDS as GAIN,
    Screen, TileRect, TileView, TimePieces, narrow_counted,
};

/// A triangle with the results of its set-up.
#[derive(Clone, Copy)]
pub(super) struct Subject<'a> {
    pub triangle: &'a Triangle,
    pub lines: Option<&'a LensLines>,
    pub shear: &'a Shear,
    /// Range of image coordinates between clip planes, if there are any.
    pub image: Option<[[f32; 2]; 2]>,
}

/// A tile with its amount of work.
#[derive(Clone, Copy)]
pub(super) struct TestTile {
    pub rect: TileRect,
    /// Number of fine tiles to visit in a coarse tile; `None` for a fine tile.
    pub tiles: Option<u32>,
    /// Samples in these tiles.
    pub samples: u32,
}

/// Enabled tests, their work so far and the statistics of the bin.
pub(super) struct TestContext<'a> {
    pub features: &'a Features,
    pub work: &'a mut TileWork,
    pub selector: &'a mut TestSelector,
}

/// Remaining part of lens and time in which the triangle may be visible, and the visible faces over time.
#[derive(Clone, Copy)]
pub(super) struct Remaining {
    pub within: Box5,
    pub times: TimePieces,
    /// Remaining regions of the lens, if they are tested each on their own.
    spans: Option<LensSpans>,
    edges: Option<Edges>,
    /// Whether the facing test was run.
    pub facing: bool,
    /// Whether screens were set up.
    pub screened: bool,
}

impl Remaining {
    /// Everything in `within` remains.
    pub fn all(within: Box5) -> Self {
        Self {
            within,
            times: TimePieces::one(Piece { t: within.t, faces: [true; 2] }),
            spans: None,
            edges: None,
            facing: false,
            screened: false,
        }
    }

    /// Keep the part in the regions `spans` of the lens. `None` if it is empty.
    pub fn keep_regions(&mut self, spans: Option<&LensSpans>) -> Option<()> {
        self.spans = spans.filter(|_| self.within.lens).copied();
        self.narrow(self.within)
    }

    /// Keep the part inside the box `within`. `None` if it is empty.
    pub fn narrow(&mut self, mut within: Box5) -> Option<()> {
        if let Some(spans) = &mut self.spans {
            (*spans, within) = spans.within(&within)?;
        }
        self.times.clip(within.t);
        self.within = Box5 { t: self.times.hull()?, ..within };
        self.edges = None;
        Some(())
    }

    /// The same part at the start of the tests of a finer tile, where edges of a coarser one are not valid.
    pub fn at_finer(&self) -> Self {
        Self { edges: None, facing: false, ..*self }
    }

    /// Boxes of the remaining samples in a piece of the time.
    pub fn boxes(&self, within: Box5) -> impl Iterator<Item = Box5> + use<'_> {
        let spans = self.spans.iter().flat_map(|spans| spans.as_slice());
        let parts = spans.filter_map(move |span| span.within(&within));
        let whole = self.spans.is_none().then_some(within);
        whole.into_iter().chain(parts.map(move |LensSpan { u, t }| Box5 { u, t, ..within }))
    }

    /// Fraction of the whole lens and shutter that remains. Samples are distributed evenly over it.
    pub fn volume(&self, moving: bool) -> f64 {
        let length = |[lo, hi]: [f32; 2]| f64::from((hi - lo).max(0.0));
        let time = |[from, to]: [f32; 2]| -> f64 {
            let pieces = self.times.pieces().iter();
            if moving {
                pieces.map(|piece| length([piece.t[0].max(from), piece.t[1].min(to)])).sum()
            } else {
                1.0
            }
        };
        match &self.spans {
            Some(spans) => 0.5 * length(self.within.v) * spans.share(|span| time(span.t)),
            None if self.within.lens => {
                0.25 * length(self.within.u) * length(self.within.v) * time(self.within.t)
            }
            None => time(self.within.t),
        }
    }
}

impl Subject<'_> {
    /// Run the tests at `tile` on the part `remaining` so far, and keep what is left. `None` if the triangle
    /// is not visible there.
    pub fn test(
        &self,
        tile: &TestTile,
        remaining: &mut Remaining,
        context: &mut TestContext<'_>,
    ) -> Option<()> {
        let lines = self.lines.filter(|_| context.features.lens_lines && remaining.within.lens);
        if let Some(lines) = lines {
            let left = lens_lines_over(lines, &tile.rect, remaining.within, context.work)?;
            if remaining.narrow(left).is_none() {
                context.work.culled_lens += 1;
                return None;
            }
        }
        let allowed = self.allowed(tile, remaining, context.features);
        if !context.features.auto || allowed == TestPlan(0) {
            return self.run_plan(allowed, tile, remaining, context);
        }
        let workload = self.workload(allowed, tile, remaining);
        match context.selector.choose(&workload) {
            Some(plan) => plan
                .steps()
                .try_for_each(|step| self.step_recorded(&workload, step, tile, remaining, context)),
            None => self.explore(&workload, tile, remaining, context),
        }
    }

    /// Tests that are enabled and can help here.
    fn allowed(&self, tile: &TestTile, remaining: &Remaining, features: &Features) -> TestPlan {
        let here = features.coarse || tile.tiles.is_none();
        let sides =
            features.side_planes && (self.triangle.moving || remaining.within.lens || self.triangle.behind);
        let bits = [
            (sides, TestPlan::SIDES),
            (features.facing && here, TestPlan::FACING),
            (features.edges && here, TestPlan::EDGES),
        ];
        TestPlan(bits.iter().map(|&(on, bit)| if on { bit } else { 0 }).sum())
    }

    fn run_plan(
        &self,
        plan: TestPlan,
        tile: &TestTile,
        remaining: &mut Remaining,
        context: &mut TestContext<'_>,
    ) -> Option<()> {
        for test in [TestPlan::SIDES, TestPlan::FACING, TestPlan::EDGES] {
            if plan.has(test) {
                self.step(test, tile, remaining, context)?;
            }
        }
        Some(())
    }

    /// Run the last test of a plan on the part kept by the tests before it, and record the outcome.
    fn step_recorded(
        &self,
        workload: &Workload,
        plan: TestPlan,
        tile: &TestTile,
        remaining: &mut Remaining,
        context: &mut TestContext<'_>,
    ) -> Option<()> {
        let Some((test, _)) = plan.last() else { return Some(()) };
        let (volume, madds) = (remaining.volume(self.triangle.moving), context.work.tile_madds());
        let is_left = self.step(test, tile, remaining, context);
        let after = is_left.map_or(0.0, |()| remaining.volume(self.triangle.moving));
        let kept = if volume > 0.0 { after / volume } else { f64::from(u8::from(is_left.is_some())) };
        let samples = f64::from(tile.samples) * volume;
        context.selector.record(
            workload,
            plan,
            &TestResult { madds: context.work.tile_madds() - madds, samples, kept },
        );
        is_left
    }

    /// Run all plans on `remaining` and record them; keeps the result of the fullest plan.
    fn explore(
        &self,
        workload: &Workload,
        tile: &TestTile,
        remaining: &mut Remaining,
        context: &mut TestContext<'_>,
    ) -> Option<()> {
        let before = context.work.tile_madds();
        let mut by_plan = [Some(*remaining); TestPlan::COUNT];
        for plan in workload.allowed.within() {
            let Some((_, parent)) = plan.last() else { continue };
            let mut part = by_plan[parent.0 as usize];
            let is_left =
                part.as_mut().and_then(|part| self.step_recorded(workload, plan, tile, part, context));
            by_plan[plan.0 as usize] = part.filter(|_| is_left.is_some());
        }
        context.selector.record_exploration(workload, context.work.tile_madds() - before);
        *remaining = by_plan[workload.allowed.0 as usize]?;
        Some(())
    }

    fn step(
        &self,
        test: u8,
        tile: &TestTile,
        remaining: &mut Remaining,
        context: &mut TestContext<'_>,
    ) -> Option<()> {
        match test {
            TestPlan::SIDES => self.side_planes(&tile.rect, remaining, context.work),
            TestPlan::FACING => {
                self.facing(&tile.rect, remaining, context.features.facing_splits, context.work)?;
                remaining.facing = true;
                Some(())
            }
            _ => self.edge_bounds(&tile.rect, remaining, context.work),
        }
    }

    /// Workload of `remaining` at `tile` for the test selector.
    fn workload(&self, allowed: TestPlan, tile: &TestTile, remaining: &Remaining) -> Workload {
        let (moving, lens) = (self.triangle.moving, remaining.within.lens);
        Workload {
            allowed,
            moving,
            samples: f64::from(tile.samples) * remaining.volume(moving),
            tiles: tile.tiles,
            edge_madds: f64::from(traversal::edge_madds(moving, lens)),
            screen_setup_madds: f64::from(traversal::screen_setup_madds(moving, lens, true) + GAIN),
            test_madds: f64::from(sample_test::madds(moving, lens)),
        }
    }

    /// Side planes over the whole lens, or over each of its regions.
    fn side_planes(&self, rect: &TileRect, remaining: &mut Remaining, work: &mut TileWork) -> Option<()> {
        let (triangle, shear, within) = (self.triangle, self.shear, &remaining.within);
        let (next, madds) = match &mut remaining.spans {
            None => narrow_counted::<f64>(triangle, shear, rect, within),
            Some(spans) => {
                let (next, madds) = spans.narrow_counted::<f64>(triangle, shear, rect, within);
                let keep = |(kept, next)| {
                    *spans = kept;
                    next
                };
                (next.map(keep), madds)
            }
        };
        work.side_plane_madds += madds;
        work.culled_sides += u32::from(next.is_none());
        remaining.narrow(next?)
    }

    fn facing(
        &self,
        rect: &TileRect,
        remaining: &mut Remaining,
        splits: u32,
        work: &mut TileWork,
    ) -> Option<()> {
        if remaining.times.pieces().iter().all(Piece::is_decided) {
            return Some(());
        }
        let facing = Facing::new(self.edges(rect, remaining, work));
        let (times, bisections) = facing.timeline(remaining.within.t, self.triangle.faces, splits);
        work.facing_madds += traversal::facing_madds(self.triangle.moving, remaining.within.lens, bisections);
        remaining.times = remaining.times.meet(&times);
        let hull = remaining.times.hull();
        work.culled_facing += u32::from(hull.is_none());
        remaining.within.t = hull?;
        Some(())
    }

    fn edge_bounds(&self, rect: &TileRect, remaining: &mut Remaining, work: &mut TileWork) -> Option<()> {
        let edges = *self.edges(rect, remaining, work);
        let (times, more) = EdgeBounds::new(&edges).timeline(&edges, &remaining.times, self.triangle.faces);
        work.edge_bound_madds +=
            traversal::edge_bound_madds(self.triangle.moving, remaining.within.lens) + more;
        remaining.times = times;
        let hull = remaining.times.hull();
        work.culled_edges += u32::from(hull.is_none());
        remaining.within.t = hull?;
        Some(())
    }

    /// Whether to set up screens for the remaining samples of a fine tile.
    pub fn wants_screen(
        &self,
        tile: &TestTile,
        remaining: &Remaining,
        context: &mut TestContext<'_>,
    ) -> bool {
        if !context.features.auto || !context.features.screen {
            return context.features.screen;
        }
        let (moving, lens) = (self.triangle.moving, remaining.within.lens);
        let edge_madds = if remaining.edges.is_some() { 0 } else { traversal::edge_madds(moving, lens) };
        let test_madds =
            f64::from(tile.samples) * remaining.volume(moving) * f64::from(sample_test::madds(moving, lens));
        let pieces = remaining.times.pieces().len() as u32;
        let set_up = edge_madds + pieces * (traversal::screen_setup_madds(moving, lens, pieces == 1) + GAIN);
        let wants = context.selector.wants_screen(f64::from(set_up), test_madds);
        context.selector.record_screened(wants);
        wants
    }

    /// Whether the expected savings of a screen exceed its cost.
    pub fn pays(&self, screen: &Screen, lens: bool, context: &mut TestContext<'_>) -> bool {
        if !context.features.auto {
            return true;
        }
        context.work.screen_setup_madds += GAIN;
        let moving = self.triangle.moving;
        let (test_madds, cost) = (sample_test::madds(moving, lens), traversal::screen_madds(moving, lens));
        context.selector.wants_samples_screened(screen.gain(), f64::from(cost), f64::from(test_madds))
    }

    /// Screen for the samples of one piece of the remaining time.
    pub fn screen(
        &self,
        rect: &TileRect,
        remaining: &mut Remaining,
        piece: &Piece,
        work: &mut TileWork,
    ) -> Screen {
        let edges = self.edges(rect, remaining, work);
        let (screen, whole) =
            (Screen::new(edges, piece.t, piece.seen(self.triangle.faces)), edges.spans(piece.t));
        work.screen_setup_madds +=
            traversal::screen_setup_madds(self.triangle.moving, remaining.within.lens, whole);
        screen
    }

    /// Edges over the tile, computed on first use.
    fn edges<'l>(&self, rect: &TileRect, remaining: &'l mut Remaining, work: &mut TileWork) -> &'l Edges {
        let within = remaining.within;
        remaining.edges.get_or_insert_with(|| {
            work.edge_madds += traversal::edge_madds(self.triangle.moving, within.lens);
            Edges::new(TileView::new(self.triangle, self.shear, rect, &within))
        })
    }
}

fn lens_lines_over(lines: &LensLines, rect: &TileRect, within: Box5, work: &mut TileWork) -> Option<Box5> {
    let (next, crossings) = lines.narrow(rect, &within);
    work.lens_line_madds += traversal::lens_line_madds(crossings);
    work.culled_lens += u32::from(next.is_none());
    next
}
