//! States of the units over time: busy, starved, blocked or idle.

use activity::Unit;

use crate::Recorder;
use crate::clock::{Clocks, Time};
use crate::stalls::{Reason, Stalls};

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
