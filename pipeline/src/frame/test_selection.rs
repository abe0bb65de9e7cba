//! Adaptive test selection for the feature `auto`: which of the enabled tile tests to run.
//!
//! Tests overlap in what they cull, so whole plans are compared: sets of side planes, facing and edge bounds.
//! For some triangles and tiles, an exploration runs every plan on the same box and records its cost and the
//! samples it keeps. Otherwise the plan of least expected cost for the workload runs. The cost of a plan is
//! its multiply-adds plus the cost of the samples it keeps without need. Such a sample costs less than a full
//! sample test if a screen would have rejected it. On a coarse tile a plan saves the visits of fine tiles
//! without hits. Screens and depth tests follow the tile tests and are selected by their measured savings.
//!
//! Explorations use a small fixed share of all multiply-adds. A bin processes its triangles in order on any
//! thread, so the selection is the same for any number of threads.

/// Statistics of the last test of a plan, given that the tests before it kept samples, for one size of tiles.
#[derive(Clone, Copy, Debug, Default)]
struct TestRecord {
    /// Multiply-adds.
    madds: Mean,
    /// Fraction of samples kept.
    kept: Mean,
    /// Fraction of runs that keep any sample.
    nonempty: Mean,
}

/// Result of one test of one triangle in one tile.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct TestResult {
    /// Multiply-adds.
    pub madds: u32,
    /// Samples before the test.
    pub samples: f64,
    /// Fraction of them kept.
    pub kept: f64,
}

/// Expected result of a plan.
#[derive(Clone, Copy, Debug)]
struct Expected {
    madds: f64,
    kept: f64,
    /// Probability that any sample is kept.
    nonempty: f64,
}

/// Test selector of a bin, with its statistics.
#[derive(Clone, Copy, Debug)]
pub(super) struct TestSelector {
    plans: [[[TestRecord; TestPlan::COUNT]; 2]; 2],
    explorations: [[f64; 2]; 2],
    depth: Mean,
    /// Savings of screens, by class of their expected gain.
    screens: [Mean; GAIN_CLASSES],
    set_ups: Mean,
    screened: Mean,
    miss: [Mean; 2],
    sample: Mean,
    empty_tile: Mean,
    spent_madds: f64,
    explored_madds: [f64; 2],
    unprofitable: u32,
}

/// Share of all multiply-adds that explorations may use.
const EXPLORATION_SHARE: f64 = 1.0 / 256.0;
/// Optimistic bonus: culled fraction assumed beyond the measured one for a test without runs. It falls with
/// the number of runs to the power of 3/4, faster than for independent runs, as the tests of one bin resemble
/// each other.
const OPTIMISM_BONUS: f64 = 0.3;
const BONUS_EXPONENT: f64 = 0.75;
/// Explorations to run first, at any cost.
const MIN_EXPLORATIONS: f64 = 3.0;
/// One in this number of screens or depth tests that seem too expensive is run nevertheless.
const RETRY_INTERVAL: u32 = 8;
/// Number of classes of the expected gain of screens.
const GAIN_CLASSES: usize = 8;

impl TestRecord {
    /// Expected result of a plan that continues `before` with this test.
    fn after(&self, before: &Expected) -> Expected {
        let bonus = OPTIMISM_BONUS / libm::pow(self.nonempty.weight + 1.0, BONUS_EXPONENT);
        Expected {
            madds: before.madds + before.nonempty * self.madds.or(0.0, 0.0),
            kept: before.kept * (self.kept.or(1.0, 1.0) - bonus).max(0.0),
            nonempty: before.nonempty * (self.nonempty.or(1.0, 0.1) - bonus).max(0.0),
        }
    }
}

/// Class of a screen with the expected gain `gain`.
fn class(gain: f32) -> usize {
    ((gain * GAIN_CLASSES as f32) as usize).min(GAIN_CLASSES - 1)
}

impl TestSelector {
    /// A selector without statistics.
    pub fn new() -> Self {
        Self {
            plans: Default::default(),
            explorations: Default::default(),
            depth: Mean::default(),
            screens: Default::default(),
            set_ups: Mean::default(),
            screened: Mean::default(),
            miss: Default::default(),
            sample: Mean::default(),
            empty_tile: Mean::default(),
            spent_madds: 0.0,
            explored_madds: [0.0; 2],
            unprofitable: 0,
        }
    }

    /// The plan to run, or `None` for an exploration.
    pub fn choose(&self, workload: &Workload) -> Option<TestPlan> {
        let (coarse, moving) = (usize::from(workload.tiles.is_some()), usize::from(workload.moving));
        let known = self.explorations[coarse][moving] >= MIN_EXPLORATIONS;
        // A small workload leaves nothing to save or to learn.
        let is_small = workload.samples * workload.test_madds < workload.edge_madds;
        let budget_used = self.explored_madds[coarse] > EXPLORATION_SHARE * self.spent_madds;
        if known && (is_small || budget_used) {
            return Some(self.cheapest(workload, &self.plans[coarse][moving]));
        }
        is_small.then_some(TestPlan(0))
    }

    fn cheapest(&self, workload: &Workload, records: &[TestRecord; TestPlan::COUNT]) -> TestPlan {
        let mut expectations = [Expected { madds: 0.0, kept: 1.0, nonempty: 1.0 }; TestPlan::COUNT];
        let mut best = (f64::INFINITY, TestPlan(0));
        for plan in workload.allowed.within() {
            if let Some((_, parent)) = plan.last() {
                expectations[plan.0 as usize] =
                    records[plan.0 as usize].after(&expectations[parent.0 as usize]);
            }
            let cost = self.cost(workload, plan, &expectations[plan.0 as usize]);
            best = if cost < best.0 { (cost, plan) } else { best };
        }
        best.1
    }

    /// Expected multiply-adds of a plan, including the work that remains after it.
    fn cost(&self, workload: &Workload, plan: TestPlan, expected: &Expected) -> f64 {
        if let Some(tiles) = workload.tiles {
            let untested = workload.samples * self.miss_madds(false, workload.test_madds);
            let fine = f64::from(tiles) * self.empty_tile.or(untested / f64::from(tiles), 1.0);
            return expected.madds + expected.nonempty * fine.min(untested);
        }
        let edge_madds =
            if plan.0 & (TestPlan::FACING | TestPlan::EDGES) == 0 { workload.edge_madds } else { 0.0 };
        let screen = self.screened.or(0.5, 1.0) * (edge_madds + workload.screen_setup_madds);
        let miss = self.miss_madds(plan.has(TestPlan::FACING), workload.test_madds);
        expected.madds + expected.nonempty * screen + expected.kept * workload.samples * miss
    }

    /// Record the outcome of the last test of a plan.
    pub fn record(&mut self, workload: &Workload, plan: TestPlan, outcome: &TestResult) {
        let records = &mut self.plans[usize::from(workload.tiles.is_some())][usize::from(workload.moving)];
        let record = &mut records[plan.0 as usize];
        record.madds.add(f64::from(outcome.madds), 1.0);
        record.kept.add(outcome.kept, outcome.samples);
        record.nonempty.add(f64::from(u8::from(outcome.kept > 0.0)), 1.0);
    }

    /// Record an exploration and its multiply-adds.
    pub fn record_exploration(&mut self, workload: &Workload, madds: u32) {
        self.explorations[usize::from(workload.tiles.is_some())][usize::from(workload.moving)] += 1.0;
        self.explored_madds[usize::from(workload.tiles.is_some())] += f64::from(madds);
    }

    /// Whether to test depths: the test costs `cost`, the work after it `workload` multiply-adds.
    pub fn wants_depth(&mut self, cost: f64, workload: f64) -> bool {
        let worth = self.depth.or(0.5, 64.0) * workload;
        worth > cost || self.retries(cost, workload)
    }

    /// Whether to set up screens: set-up costs `cost`, testing all samples `workload` multiply-adds.
    pub fn wants_screen(&mut self, cost: f64, workload: f64) -> bool {
        let worth = self.set_ups.or(0.5, 64.0) * workload;
        worth > cost || self.retries(cost, workload)
    }

    /// Whether to use a screen with the expected gain `gain`: a screened sample costs `cost`, a tested one
    /// `test_madds`.
    pub fn wants_samples_screened(&mut self, gain: f32, cost: f64, test_madds: f64) -> bool {
        let taken = self.screens[class(gain)].or(f64::from(gain), 64.0);
        taken * test_madds > cost || gain > 0.0 && self.retries(cost, test_madds)
    }

    /// Whether to run a test that seems too expensive, occasionally, if it may save much.
    fn retries(&mut self, cost: f64, workload: f64) -> bool {
        self.unprofitable += 1;
        self.unprofitable.is_multiple_of(RETRY_INTERVAL) && cost < 0.5 * workload
    }

    /// Record the fraction of `samples` hidden by depth.
    pub fn record_depth(&mut self, share: f64, samples: f64) {
        self.depth.add(share, samples);
    }

    /// Record the fraction of `samples` rejected by a screen.
    pub fn record_screen(&mut self, gain: f32, share: f64, samples: f64) {
        self.screens[class(gain)].add(share, samples);
    }

    /// Record the fraction of the workload saved by screens.
    pub fn record_set_up(&mut self, share: f64, samples: f64) {
        self.set_ups.add(share, samples);
    }

    /// Whether any statistics were recorded.
    pub fn has_records(&self) -> bool {
        self.spent_madds > 0.0
    }

    /// Add the statistics of another bin.
    pub fn merge(&mut self, other: &Self) {
        let records = other.plans.as_flattened().as_flattened();
        for (own, other) in self.plans.as_flattened_mut().as_flattened_mut().iter_mut().zip(records) {
            own.madds.merge(&other.madds);
            own.kept.merge(&other.kept);
            own.nonempty.merge(&other.nonempty);
        }
        let mut other = *other;
        for (own, other) in self.means().into_iter().zip(other.means()) {
            own.merge(other);
        }
        for (own, other) in
            self.explorations.as_flattened_mut().iter_mut().zip(other.explorations.as_flattened())
        {
            *own += other;
        }
        self.spent_madds += other.spent_madds;
        [0, 1].into_iter().for_each(|level| self.explored_madds[level] += other.explored_madds[level]);
    }

    fn means(&mut self) -> Vec<&mut Mean> {
        let single =
            [&mut self.depth, &mut self.set_ups, &mut self.screened, &mut self.sample, &mut self.empty_tile];
        single.into_iter().chain(&mut self.screens).chain(&mut self.miss).collect()
    }

    /// Record whether the samples of a fine tile were screened.
    pub fn record_screened(&mut self, screened: bool) {
        self.screened.add(f64::from(u8::from(screened)), 1.0);
    }

    /// Record the multiply-adds of screens and sample tests: `miss_madds` for `misses` samples without a hit,
    /// and `madds` for all `samples`.
    pub fn record_samples(
        &mut self,
        facing: bool,
        [misses, miss_madds]: [u32; 2],
        [samples, madds]: [u32; 2],
    ) {
        let add = |mean: &mut Mean, count: u32, madds: u32| {
            if count > 0 {
                mean.add(f64::from(madds) / f64::from(count), f64::from(count));
            }
        };
        add(&mut self.miss[usize::from(facing)], misses, miss_madds);
        add(&mut self.sample, samples, madds);
    }

    /// Record the multiply-adds of a tile, and whether it had no hit.
    pub fn record_tile(&mut self, madds: u32, empty: bool) {
        self.spent_madds += f64::from(madds);
        if empty {
            self.empty_tile.add(f64::from(madds), 1.0);
        }
    }

    /// Expected multiply-adds of a sample without a hit; `test_madds` without statistics.
    fn miss_madds(&self, facing: bool, test_madds: f64) -> f64 {
        let [mean, other] = [self.miss[usize::from(facing)], self.miss[usize::from(!facing)]];
        mean.or(other.or(test_madds, 1.0), 1.0)
    }

    /// Expected multiply-adds of a sample; `test_madds` without statistics.
    pub fn sample_madds(&self, test_madds: f64) -> f64 {
        self.sample.or(test_madds, 1.0)
    }
}

/// Running mean with a finite memory.
#[derive(Clone, Copy, Debug, Default)]
struct Mean {
    sum: f64,
    pub weight: f64,
}

/// Total weight beyond which old values decay, in units of the weight of a new value.
const MAX_WEIGHT_IN_SAMPLES: f64 = 256.0;

impl Mean {
    /// Add `value` with `weight`.
    pub fn add(&mut self, value: f64, weight: f64) {
        let kept = if self.weight > MAX_WEIGHT_IN_SAMPLES * weight.max(1.0) {
            1.0 - 1.0 / MAX_WEIGHT_IN_SAMPLES
        } else {
            1.0
        };
        self.sum = self.sum * kept + value * weight;
        self.weight = self.weight * kept + weight;
    }

    pub fn merge(&mut self, other: &Self) {
        self.sum += other.sum;
        self.weight += other.weight;
    }

    /// The mean, combined with `guess` of weight `prior`.
    pub fn or(&self, guess: f64, prior: f64) -> f64 {
        let weight = self.weight + prior;
        if weight > 0.0 { (self.sum + guess * prior) / weight } else { guess }
    }
}

/// A set of tile tests, one bit each.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct TestPlan(pub u8);

/// Workload for which a plan is chosen.
#[derive(Clone, Copy, Debug)]
pub(super) struct Workload {
    /// Tests that may run.
    pub allowed: TestPlan,
    pub moving: bool,
    /// Expected samples in the remaining part of lens and time.
    pub samples: f64,
    /// Number of fine tiles to visit; `None` for a fine tile.
    pub tiles: Option<u32>,
    /// Multiply-adds of finding the edges, which screens also need.
    pub edge_madds: f64,
    /// Multiply-adds of setting up a screen.
    pub screen_setup_madds: f64,
    /// Multiply-adds of a sample test.
    pub test_madds: f64,
}

impl TestPlan {
    pub const SIDES: u8 = 1;
    pub const FACING: u8 = 2;
    pub const EDGES: u8 = 4;
    /// Number of subsets of the three tests.
    pub const COUNT: usize = 8;

    /// All plans with these tests; each plan comes after the plans it continues.
    pub fn within(self) -> impl Iterator<Item = Self> {
        (0..Self::COUNT as u8).map(Self).filter(move |plan| plan.0 & !self.0 == 0)
    }

    pub fn has(self, test: u8) -> bool {
        self.0 & test != 0
    }

    /// The plans of its first test, of its first two tests and so on, up to the plan itself.
    pub fn steps(self) -> impl Iterator<Item = Self> {
        [Self::SIDES, Self::FACING, Self::EDGES]
            .into_iter()
            .filter(move |&test| self.has(test))
            .map(move |test| Self(self.0 & (2 * test - 1)))
    }

    /// The last test of the plan, and the plan without it.
    pub fn last(self) -> Option<(u8, Self)> {
        let last = [Self::EDGES, Self::FACING, Self::SIDES].into_iter().find(|&test| self.has(test))?;
        Some((last, Self(self.0 & !last)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const WORKLOAD: Workload = Workload {
        allowed: TestPlan(7),
        moving: true,
        samples: 256.0,
        tiles: None,
        edge_madds: 141.0,
        screen_setup_madds: 99.0,
        test_madds: 27.0,
    };

    /// A selector after `rounds` explorations in which each test took `madds` and kept the fraction `kept` of its
    /// plan.
    fn trained(rounds: u32, madds: u32, kept: impl Fn(TestPlan) -> f64) -> TestSelector {
        let mut selector = TestSelector::new();
        selector.record_tile(1_000_000_000, false);
        for _ in 0..rounds {
            for plan in WORKLOAD.allowed.within().filter(|plan| plan.last().is_some()) {
                selector.record(
                    &WORKLOAD,
                    plan,
                    &TestResult { madds, samples: WORKLOAD.samples, kept: kept(plan) },
                );
            }
            selector.record_exploration(&WORKLOAD, 1_000_000_000);
        }
        selector
    }

    #[test]
    fn unknown_plans_are_explored_and_small_workloads_run_no_test() {
        let selector = TestSelector::new();
        assert_eq!(selector.choose(&WORKLOAD), None);
        assert_eq!(selector.choose(&Workload { samples: 2.0, ..WORKLOAD }), Some(TestPlan(0)));
    }

    #[test]
    fn a_test_without_effect_is_abandoned() {
        let selector = trained(1000, 200, |_| 1.0);
        assert_eq!(selector.choose(&WORKLOAD), Some(TestPlan(0)));
    }

    #[test]
    fn of_two_tests_with_the_same_effect_one_is_run() {
        // Side planes cull nine tenths, facing nothing, and edges the same as side planes. The screen needs the
        // edges in any case.
        let selector = trained(1000, 100, |plan| match plan.last() {
            Some((TestPlan::SIDES, _)) => 0.1,
            Some((TestPlan::EDGES, before)) if !before.has(TestPlan::SIDES) => 0.1,
            _ => 1.0,
        });
        assert_eq!(selector.choose(&WORKLOAD), Some(TestPlan(TestPlan::EDGES)));
    }

    #[test]
    fn a_test_that_helps_the_next_one_is_run() {
        let selector = trained(1000, 100, |plan| match plan.last() {
            Some((TestPlan::EDGES, before)) if before.has(TestPlan::FACING) => 0.1,
            _ => 1.0,
        });
        assert_eq!(selector.choose(&WORKLOAD), Some(TestPlan(TestPlan::FACING | TestPlan::EDGES)));
    }

    #[test]
    fn plans_come_after_the_plans_they_continue() {
        let all: Vec<_> = TestPlan(7).within().collect();
        assert_eq!(all.len(), TestPlan::COUNT);
        for plan in &all {
            if let Some((test, before)) = plan.last() {
                assert!(before.0 < plan.0 && plan.has(test) && !before.has(test), "{plan:?}");
            }
        }
        assert_eq!(TestPlan(5).within().count(), 4);
    }

    #[test]
    fn statistics_are_shared_between_bins() {
        let mut selector = TestSelector::new();
        selector.merge(&trained(1000, 200, |_| 1.0));
        assert!(selector.has_records());
        assert_eq!(selector.choose(&WORKLOAD), Some(TestPlan(0)));
    }

    #[test]
    fn useless_screens_are_used_rarely_and_effective_ones_always() {
        for (share, min, max) in [(0.0, 10, 140), (1.0, 1000, 1000)] {
            let mut selector = TestSelector::new();
            (0..100).for_each(|_| selector.record_screen(0.5, share, 256.0));
            let used = (0..1000).filter(|_| selector.wants_samples_screened(0.5, 9.0, 27.0)).count();
            assert!((min..=max).contains(&used), "{used}");
        }
    }
}
