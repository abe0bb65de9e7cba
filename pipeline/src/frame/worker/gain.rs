//! What screens have saved, for `auto` to learn from.

use super::super::judge::Judge;
use super::super::tile_tests::Left;
use crate::sample_test::{self, Hits};
use crate::traversal::{self, Screen};

/// What screens took away in a tile.
#[derive(Default)]
pub(super) struct Gain {
    /// Samples that were looked at.
    samples: u32,
    screened: u32,
    taken: u32,
}

impl Gain {
    /// A piece of the time: how many samples were screened and tested.
    pub fn add(&mut self, [screened, tested]: [u32; 2], screen: Option<&Screen>, judge: &mut Judge) {
        let Some(screen) = screen else {
            self.samples += tested;
            return;
        };
        self.samples += screened;
        self.screened += screened;
        self.taken += screened - tested;
        if screened > 0 {
            let share = f64::from(screened - tested) / f64::from(screened);
            judge.learn_screen(screen.gain(), share, f64::from(screened));
        }
    }

    /// Tells what all of it took in these dimensions, and what it saved.
    pub fn learn(&self, hits: &Hits, [moving, lens]: [bool; 2], left: &Left, judge: &mut Judge) {
        let (full, price) = (sample_test::madds(moving, lens), traversal::screen_madds(moving, lens));
        if left.screened {
            let saved = f64::from(self.taken * full) - f64::from(self.screened * price);
            let share = saved / f64::from((self.samples * full).max(1));
            judge.learn_set_up(share, f64::from(self.samples));
        }
        let madds = hits.screened * price + hits.tested * full;
        let on_hits = hits.hit * full + hits.hit.min(hits.screened) * price;
        let misses = [self.samples - hits.hit, madds.saturating_sub(on_hits)];
        judge.learn_samples(left.facing, misses, [self.samples, madds]);
    }
}
