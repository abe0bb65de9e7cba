//! Bounded queue between two units, like a register: changes of a cycle are visible in the next one. Pending
//! line reads of packets and warps, and states of the units over time: busy, starved, blocked or idle.

use std::collections::VecDeque;

use activity::Unit;

use crate::Recorder;
use crate::clock::{Clocks, Time};
use crate::recorder::{Reason, Stalls};

/// FIFO queue. Neither new entries nor new room are visible in the cycle of the change, so the order in which
/// the two units are simulated does not matter.
#[derive(Clone, Debug)]
pub(super) struct Queue<T> {
    items: VecDeque<(Time, T)>,
    capacity: usize,
    popped: usize,
    popped_at: Time,
}

impl<T: Copy> Queue<T> {
    pub fn new(capacity: u32) -> Self {
        Self { items: VecDeque::new(), capacity: capacity as usize, popped: 0, popped_at: Time::MAX }
    }

    /// Number of entries that can be added at `now`.
    pub fn room(&self, now: Time) -> usize {
        let just_freed = if self.popped_at == now { self.popped } else { 0 };
        self.capacity - self.items.len() - just_freed
    }

    /// Add `item`, visible from `seen_at` on.
    pub fn push(&mut self, item: T, seen_at: Time) {
        debug_assert!(self.items.len() < self.capacity);
        self.items.push_back((seen_at, item));
    }

    /// First item, if visible at `now`.
    pub fn head(&self, now: Time) -> Option<T> {
        self.items.front().filter(|(seen_at, _)| *seen_at <= now).map(|(_, item)| *item)
    }

    /// When the first item becomes visible.
    pub fn head_at(&self) -> Option<Time> {
        self.items.front().map(|(seen_at, _)| *seen_at)
    }

    /// Remove the first item; its room is usable after `now`.
    pub fn pop(&mut self, now: Time) {
        self.items.pop_front();
        self.popped = if self.popped_at == now { self.popped + 1 } else { 1 };
        self.popped_at = now;
    }

    pub fn is_empty(&self) -> bool {
        self.items.is_empty()
    }
}

/// Pending reads, one entry per packet or warp.
#[derive(Clone, Debug, Default)]
pub(super) struct Waits {
    /// Number of missing lines, arrival of the last one so far, and when units below the L2 were first accessed.
    waits: Vec<Wait>,
    free: Vec<u32>,
}

#[derive(Clone, Copy, Debug, Default)]
struct Wait {
    missing: u32,
    at: Time,
    /// When a line was first requested below the L2, by the unit in the order of [`BELOW`].
    requested_at: [Option<Time>; BELOW.len()],
}

/// Units below the L2.
const BELOW: [Unit; 3] = [Unit::Llc, Unit::Edram, Unit::Dram];

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

    /// Record that a line is requested from a unit below the L2.
    pub fn requests(&mut self, id: u32, from: Unit, now: Time) {
        let requested_at = BELOW.into_iter().zip(&mut self.waits[id as usize].requested_at);
        for (_, at) in requested_at.filter(|(unit, _)| *unit == from) {
            at.get_or_insert(now);
        }
    }

    /// When all lines have arrived, if known.
    pub fn ready_at(&self, id: u32) -> Option<Time> {
        let wait = self.waits[id as usize];
        (wait.missing == 0).then_some(wait.at)
    }

    /// The unit that the reader waits for: the one farthest from it.
    pub fn waits_for_unit(&self, id: u32, now: Time) -> Unit {
        let requested_at = BELOW.into_iter().zip(self.waits[id as usize].requested_at);
        let farthest = requested_at.rev().find(|(_, at)| at.is_some_and(|at| at < now));
        farthest.map_or(Unit::L2, |(unit, _)| unit)
    }

    /// Close a wait.
    pub fn close(&mut self, id: u32) {
        self.free.push(id);
    }
}

/// State of a unit: the number of busy servers, and why the others do not work.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct State {
    busy: u32,
    reason: Reason,
}

/// Recorder of the time that each unit spends in each state.
#[derive(Clone, Debug)]
pub(super) struct Meter {
    clocks: Clocks,
    servers: [u32; Unit::COUNT],
    now: [(State, Time); Unit::COUNT],
    pub stalls: Stalls,
}

impl Meter {
    pub fn new(clocks: Clocks, servers: [u32; Unit::COUNT]) -> Self {
        let start = (State { busy: 0, reason: Reason::Idle }, 0);
        Self { clocks, servers, now: [start; Unit::COUNT], stalls: Stalls::new(clocks, servers) }
    }

    /// Set the state of `unit` from `now` on: `busy` servers work, the others do not because of `reason`.
    pub fn set(&mut self, unit: Unit, now: Time, busy: u32, reason: Reason, recorder: &mut Recorder) {
        let state = State { busy, reason };
        let (before, since) = self.now[unit as usize];
        if before != state {
            self.write(unit, before, since, now, recorder);
            self.now[unit as usize] = (state, now);
        }
    }

    /// End the frame at `now`.
    pub fn finish(&mut self, now: Time, recorder: &mut Recorder) {
        for unit in Unit::ALL {
            let (state, since) = self.now[unit as usize];
            self.write(unit, state, since, now, recorder);
        }
        self.stalls.end = now;
    }

    fn write(&mut self, unit: Unit, state: State, from: Time, to: Time, recorder: &mut Recorder) {
        if from >= to {
            return;
        }
        let servers = self.servers[unit as usize];
        self.stalls.add(unit, state.busy, state.reason, from, to);
        if state.busy > 0 {
            let (start, end) = (self.clocks.ps(from), self.clocks.ps(to));
            recorder.busy(unit, start, end, u64::from(state.busy), u64::from(servers));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn changes_are_visible_in_the_next_cycle() {
        let mut queue = Queue::new(2);
        queue.push('a', 5);
        queue.push('b', 5);
        assert_eq!((queue.head(4), queue.head(5), queue.room(5)), (None, Some('a'), 0));
        queue.pop(5);
        assert_eq!((queue.head(5), queue.room(5), queue.room(6)), (Some('b'), 0, 1));
    }
}
