//! `auto`: which of the tests that are switched on are run.
//!
//! What one test takes away another would often have taken away as well, so tests are not judged one by one but as plans: sets of
//! side planes, facing and edge bounds. Now and then a triangle in a tile is put on trial: every plan is worked out on the same
//! box, and what each takes and leaves is remembered. Elsewhere the plan is run that is cheapest as a rule, for as many samples as
//! are at stake there: its own multiply-adds, and the price of a miss for what it leaves too much, which is less than a
//! sample test where a screen would have told it. On a coarse tile a plan is worth the fine tiles that it spares, in
//! which nothing would have been hit. Screens and depths follow the tests and are judged by what they have saved.
//!
//! Trials are as many as a small share of all that was spent can pay for. A bin sees its triangles in order whichever thread works
//! on it, so the choice is the same for any number of threads.

mod mean;
mod plan;

use mean::Mean;
pub(super) use plan::{Plan, Stake};

/// What the last test of a plan does where those before it have left anything, on tiles of one size.
#[derive(Clone, Copy, Debug, Default)]
struct Record {
    /// Multiply-adds.
    madds: Mean,
    /// The share of samples it leaves.
    left: Mean,
    /// How often it leaves any.
    alive: Mean,
}

/// What one test made of one triangle in one tile.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Did {
    /// Multiply-adds.
    pub madds: u32,
    /// Samples there were before.
    pub samples: f64,
    /// The share of them that it left.
    pub left: f64,
}

/// What a plan does as a rule.
#[derive(Clone, Copy, Debug)]
struct Outlook {
    madds: f64,
    left: f64,
    /// How often anything is left.
    alive: f64,
}

/// What a bin has learnt about its tests.
#[derive(Clone, Copy, Debug)]
pub(super) struct Judge {
    plans: [[[Record; Plan::COUNT]; 2]; 2],
    trials: [[f64; 2]; 2],
    depth: Mean,
    /// By what was expected of a screen, what it saved.
    screens: [Mean; GAINS],
    set_ups: Mean,
    screened: Mean,
    miss: [Mean; 2],
    sample: Mean,
    empty_tile: Mean,
    spent: f64,
    explored: [f64; 2],
    asked: u32,
}

/// The share of all multiply-adds that may go into trials.
const EXPLORE: f64 = 1.0 / 256.0;
/// The share of samples that a test may take away beyond what it has, as long as it was not run. The doubt falls with the runs to
/// the power of three quarters, faster than chance alone would have it: the tests of one bin resemble each other.
const DOUBT: f64 = 0.3;
const DOUBT_FALLS: f64 = 0.75;
/// So many trials come first, whatever they take.
const FIRST: f64 = 3.0;
/// Of so many screens or depths that do not seem to pay one is tried.
const TURN: u32 = 8;
/// Classes of screens by what is expected of them.
const GAINS: usize = 8;

impl Record {
    /// What is to be expected of a plan that goes on with this test.
    fn after(&self, before: &Outlook) -> Outlook {
        let doubt = DOUBT / libm::pow(self.alive.weight + 1.0, DOUBT_FALLS);
        Outlook {
            madds: before.madds + before.alive * self.madds.or(0.0, 0.0),
            left: before.left * (self.left.or(1.0, 1.0) - doubt).max(0.0),
            alive: before.alive * (self.alive.or(1.0, 0.1) - doubt).max(0.0),
        }
    }
}

/// The class of a screen of which `gain` is expected.
fn class(gain: f32) -> usize {
    ((gain * GAINS as f32) as usize).min(GAINS - 1)
}

impl Judge {
    /// Nothing learnt yet.
    pub fn new() -> Self {
        Self {
            plans: Default::default(),
            trials: Default::default(),
            depth: Mean::default(),
            screens: Default::default(),
            set_ups: Mean::default(),
            screened: Mean::default(),
            miss: Default::default(),
            sample: Mean::default(),
            empty_tile: Mean::default(),
            spent: 0.0,
            explored: [0.0; 2],
            asked: 0,
        }
    }

    /// The plan to run, or `None` for a trial.
    pub fn plan(&self, stake: &Stake) -> Option<Plan> {
        let (coarse, moving) = (usize::from(stake.tiles.is_some()), usize::from(stake.moving));
        let known = self.trials[coarse][moving] >= FIRST;
        // Where little is at stake nothing could be saved, nor learnt.
        let little = stake.samples * stake.full < stake.found;
        if if little { known } else { known && self.explored[coarse] > EXPLORE * self.spent } {
            return Some(self.cheapest(stake, &self.plans[coarse][moving]));
        }
        little.then_some(Plan(0))
    }

    fn cheapest(&self, stake: &Stake, records: &[Record; Plan::COUNT]) -> Plan {
        let mut outlooks = [Outlook { madds: 0.0, left: 1.0, alive: 1.0 }; Plan::COUNT];
        let mut best = (f64::INFINITY, Plan(0));
        for plan in stake.allowed.within() {
            if let Some((_, parent)) = plan.last() {
                outlooks[plan.0 as usize] = records[plan.0 as usize].after(&outlooks[parent.0 as usize]);
            }
            let cost = self.cost(stake, plan, &outlooks[plan.0 as usize]);
            best = if cost < best.0 { (cost, plan) } else { best };
        }
        best.1
    }

    /// What a plan takes as a rule, with what it leaves to do.
    fn cost(&self, stake: &Stake, plan: Plan, outlook: &Outlook) -> f64 {
        if let Some(tiles) = stake.tiles {
            let most = stake.samples * self.miss_madds(false, stake.full);
            let fine = f64::from(tiles) * self.empty_tile.or(most / f64::from(tiles), 1.0);
            return outlook.madds + outlook.alive * fine.min(most);
        }
        let found = if plan.0 & (Plan::FACING | Plan::EDGES) == 0 { stake.found } else { 0.0 };
        let screen = self.screened.or(0.5, 1.0) * (found + stake.screen);
        let miss = self.miss_madds(plan.has(Plan::FACING), stake.full);
        outlook.madds + outlook.alive * screen + outlook.left * stake.samples * miss
    }

    /// Notes what the last test of a plan did.
    pub fn learn(&mut self, stake: &Stake, plan: Plan, did: &Did) {
        let records = &mut self.plans[usize::from(stake.tiles.is_some())][usize::from(stake.moving)];
        let record = &mut records[plan.0 as usize];
        record.madds.add(f64::from(did.madds), 1.0);
        record.left.add(did.left, did.samples);
        record.alive.add(f64::from(u8::from(did.left > 0.0)), 1.0);
    }

    /// Notes that there was a trial, which took so many multiply-adds.
    pub fn learn_trial(&mut self, stake: &Stake, madds: u32) {
        self.trials[usize::from(stake.tiles.is_some())][usize::from(stake.moving)] += 1.0;
        self.explored[usize::from(stake.tiles.is_some())] += f64::from(madds);
    }

    /// Whether to look at depths, where that costs `price` and `stake` multiply-adds follow.
    pub fn wants_depth(&mut self, price: f64, stake: f64) -> bool {
        let worth = self.depth.or(0.5, 64.0) * stake;
        worth > price || self.tries(price, stake)
    }

    /// Whether to set up screens, where that costs `price` and testing all samples takes `stake`.
    pub fn wants_screen(&mut self, price: f64, stake: f64) -> bool {
        let worth = self.set_ups.or(0.5, 64.0) * stake;
        worth > price || self.tries(price, stake)
    }

    /// Whether to use a screen that is expected to take away the share `gain`, where a sample costs `price` of `full`.
    pub fn wants_samples_screened(&mut self, gain: f32, price: f64, full: f64) -> bool {
        let taken = self.screens[class(gain)].or(f64::from(gain), 64.0);
        taken * full > price || gain > 0.0 && self.tries(price, full)
    }

    /// Now and then, where much would be saved.
    fn tries(&mut self, price: f64, stake: f64) -> bool {
        self.asked += 1;
        self.asked.is_multiple_of(TURN) && price < 0.5 * stake
    }

    /// Notes the share of `samples` that depths have hidden.
    pub fn learn_depth(&mut self, share: f64, samples: f64) {
        self.depth.add(share, samples);
    }

    /// Notes the share of `samples` that a screen took away.
    pub fn learn_screen(&mut self, gain: f32, share: f64, samples: f64) {
        self.screens[class(gain)].add(share, samples);
    }

    /// Notes what screens saved of all that was at stake.
    pub fn learn_set_up(&mut self, share: f64, samples: f64) {
        self.set_ups.add(share, samples);
    }

    /// Whether anything was seen.
    pub fn has_learnt(&self) -> bool {
        self.spent > 0.0
    }

    /// Takes over what another bin has learnt.
    pub fn join(&mut self, other: &Self) {
        let theirs = other.plans.as_flattened().as_flattened();
        for (ours, theirs) in self.plans.as_flattened_mut().as_flattened_mut().iter_mut().zip(theirs) {
            ours.madds.join(&theirs.madds);
            ours.left.join(&theirs.left);
            ours.alive.join(&theirs.alive);
        }
        let mut other = *other;
        for (ours, theirs) in self.means().into_iter().zip(other.means()) {
            ours.join(theirs);
        }
        for (ours, theirs) in self.trials.as_flattened_mut().iter_mut().zip(other.trials.as_flattened()) {
            *ours += theirs;
        }
        self.spent += other.spent;
        [0, 1].into_iter().for_each(|level| self.explored[level] += other.explored[level]);
    }

    fn means(&mut self) -> Vec<&mut Mean> {
        let single =
            [&mut self.depth, &mut self.set_ups, &mut self.screened, &mut self.sample, &mut self.empty_tile];
        single.into_iter().chain(&mut self.screens).chain(&mut self.miss).collect()
    }

    /// Notes whether the samples of a fine tile were screened.
    pub fn learn_screened(&mut self, screened: bool) {
        self.screened.add(f64::from(u8::from(screened)), 1.0);
    }

    /// Notes that screens and sample tests took `miss_madds` for `misses` samples that were not hit, and `madds` for all.
    pub fn learn_samples(
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

    /// Notes what a tile took, and whether nothing was hit in it.
    pub fn learn_tile(&mut self, madds: u32, empty: bool) {
        self.spent += f64::from(madds);
        if empty {
            self.empty_tile.add(f64::from(madds), 1.0);
        }
    }

    /// Multiply-adds for a sample that misses; `full` where none was seen.
    fn miss_madds(&self, facing: bool, full: f64) -> f64 {
        let [mean, other] = [self.miss[usize::from(facing)], self.miss[usize::from(!facing)]];
        mean.or(other.or(full, 1.0), 1.0)
    }

    /// Multiply-adds for a sample; `full` where none was seen.
    pub fn sample_madds(&self, full: f64) -> f64 {
        self.sample.or(full, 1.0)
    }
}

#[cfg(test)]
mod tests;
