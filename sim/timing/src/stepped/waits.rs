//! Who waits for which lines of memory.

use activity::Unit;

use crate::clock::Time;

/// Lines that packets (or warps) still lack.
#[derive(Clone, Debug, Default)]
pub(super) struct Waits {
    /// How many lines are missing, when the last one so far is there, and since when memory is asked.
    waits: Vec<Wait>,
    free: Vec<u32>,
}

#[derive(Clone, Copy, Debug, Default)]
struct Wait {
    missing: u32,
    at: Time,
    fetched_at: Option<Time>,
}

impl Waits {
    /// A new wait for `missing` lines.
    pub fn open(&mut self, missing: u32) -> u32 {
        let wait = Wait { missing, ..Wait::default() };
        let Some(id) = self.free.pop() else {
            self.waits.push(wait);
            return self.waits.len() as u32 - 1;
        };
        self.waits[id as usize] = wait;
        id
    }

    /// A line will be there at `at`.
    pub fn arrives(&mut self, id: u32, at: Time) {
        let wait = &mut self.waits[id as usize];
        wait.missing -= 1;
        wait.at = wait.at.max(at);
    }

    /// A line has to come from memory.
    pub fn fetches(&mut self, id: u32, now: Time) {
        self.waits[id as usize].fetched_at.get_or_insert(now);
    }

    /// When all lines are there, where that is known.
    pub fn ready_at(&self, id: u32) -> Option<Time> {
        let wait = self.waits[id as usize];
        (wait.missing == 0).then_some(wait.at)
    }

    /// Whom to blame for the wait.
    pub fn blame(&self, id: u32, now: Time) -> Unit {
        let asked = self.waits[id as usize].fetched_at.is_some_and(|at| at < now);
        if asked { Unit::Dram } else { Unit::L2 }
    }

    /// The lines were waited for.
    pub fn close(&mut self, id: u32) {
        self.free.push(id);
    }
}
