//! `auto`: which of the tests that are switched on are run.
//!
//! A test that costs more than all it could save is not run. What it does save is learnt: for each bin and size of tile a running mean
//! of the share of samples a test took away, in space of lens and time. It is run where that share of what is at stake is more than
//! its price, and every now and then where it is not, so that it is noticed when it begins to pay. A bin sees its triangles in order
//! whichever thread works on it, so the choice is the same for any number of threads.

/// A test `auto` decides about.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Test {
    LensLines,
    SidePlanes,
    /// Facing and edge bounds, which share most of their cost.
    Edges,
    Screen,
}

/// What is known of one test on tiles of one size.
#[derive(Clone, Copy, Debug)]
struct Record {
    /// Running mean of the share of samples it took away. It begins high, so that every test is tried.
    share: f64,
    /// Running mean of what it took over its nominal price: roots come on top, and what is culled early takes less.
    dearer: f64,
    /// How often it was run, with what the first guess counts for.
    runs: f64,
    skipped: u32,
}

/// What a bin has learnt about its tests.
#[derive(Clone, Copy, Debug)]
pub(super) struct Judge {
    records: [[Record; 4]; 2],
}

/// Of so many times that a test does not seem to pay it is run once.
const PROBE: u32 = 64;
/// So many times make the mean; before that it is the plain one.
const MEMORY: f64 = 32.0;

impl Judge {
    /// Nothing learnt yet.
    pub fn new() -> Self {
        Self { records: [[Record { share: 0.75, dearer: 1.0, runs: 3.0, skipped: 0 }; 4]; 2] }
    }

    /// Whether to run `test` for a price of `madds` where `at_stake` multiply-adds follow if it takes nothing away.
    pub fn wants(&mut self, test: Test, coarse: bool, madds: u32, at_stake: f64) -> bool {
        let record = &mut self.records[usize::from(coarse)][test as usize];
        let price = f64::from(madds) * record.dearer;
        if price >= at_stake {
            return false;
        }
        if record.share * at_stake > price {
            return true;
        }
        record.skipped += 1;
        record.skipped.is_multiple_of(PROBE)
    }

    /// Notes the share of samples that `test` took away, and how many times its nominal price that took.
    pub fn learn(&mut self, test: Test, coarse: bool, share: f64, dearer: f64) {
        let record = &mut self.records[usize::from(coarse)][test as usize];
        record.runs = (record.runs + 1.0).min(MEMORY);
        record.share += (share - record.share) / record.runs;
        record.dearer += (dearer - record.dearer) / record.runs;
    }

    /// The share of samples that `test` takes away from fine tiles as a rule.
    pub fn share(&self, test: Test) -> f64 {
        self.records[0][test as usize].share
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_cannot_pay_is_never_run_and_what_pays_always() {
        let mut judge = Judge::new();
        assert!((0..1000).all(|_| !judge.wants(Test::Edges, false, 100, 100.0)));
        assert!((0..1000).all(|_| judge.wants(Test::Edges, false, 100, 1000.0)));
    }

    #[test]
    fn what_takes_nothing_away_is_soon_tried_seldom_and_found_again_when_it_does() {
        let mut judge = Judge::new();
        let runs = |judge: &mut Judge, share: f64| {
            (0..1000)
                .filter(|_| {
                    let runs = judge.wants(Test::Screen, false, 100, 1000.0);
                    if runs {
                        judge.learn(Test::Screen, false, share, 1.0);
                    }
                    runs
                })
                .count()
        };
        let (first, later) = (runs(&mut judge, 0.0), runs(&mut judge, 0.0));
        assert!(first < 80 && (10..=20).contains(&later), "{first} {later}");
        assert!(runs(&mut judge, 0.9) > 700);
        assert!(runs(&mut judge, 0.9) == 1000);
    }
}
