//! Pending line reads of packets and warps.

use activity::Unit;

use crate::clock::Time;

/// Pending reads, one entry per packet or warp.
#[derive(Clone, Debug, Default)]
pub(super) struct Waits {
    /// Number of missing lines, arrival of the last one so far, and when memory was first accessed.
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
    /// Open a wait for `missing` lines.
    pub fn open(&mut self, missing: u32) -> u32 {
        let wait = Wait { missing, ..Wait::default() };
        let Some(id) = self.free.pop() else {
            self.waits.push(wait);
            return self.waits.len() as u32 - 1;
        };
        self.waits[id as usize] = wait;
        id
    }

    /// Record that a line arrives at `at`.
    pub fn arrives(&mut self, id: u32, at: Time) {
        let wait = &mut self.waits[id as usize];
        wait.missing -= 1;
        wait.at = wait.at.max(at);
    }

    /// Record that a line has to come from memory.
    pub fn fetches(&mut self, id: u32, now: Time) {
        self.waits[id as usize].fetched_at.get_or_insert(now);
    }

    /// When all lines have arrived, if known.
    pub fn ready_at(&self, id: u32) -> Option<Time> {
        let wait = self.waits[id as usize];
        (wait.missing == 0).then_some(wait.at)
    }

    /// The unit that the reader waits for.
    pub fn waits_for_unit(&self, id: u32, now: Time) -> Unit {
        let fetched = self.waits[id as usize].fetched_at.is_some_and(|at| at < now);
        if fetched { Unit::Dram } else { Unit::L2 }
    }

    /// Close a wait.
    pub fn close(&mut self, id: u32) {
        self.free.push(id);
    }
}
