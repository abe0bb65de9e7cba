//! What each unit does from moment to moment: busy, starved, blocked or idle.

use activity::Unit;

use crate::Recorder;
use crate::clock::{Clocks, Time};
use crate::stalls::{Reason, Stalls};

pub(super) use crate::stalls::Reason as Rest;

/// The state of a unit: how many of its servers work, and why the others do not.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct State {
    busy: u32,
    rest: Reason,
}

/// Writes down how long each unit was in which state.
#[derive(Clone, Debug)]
pub(super) struct Meter {
    clocks: Clocks,
    servers: [u32; Unit::COUNT],
    now: [(State, Time); Unit::COUNT],
    pub stalls: Stalls,
}

impl Meter {
    pub fn new(clocks: Clocks, servers: [u32; Unit::COUNT]) -> Self {
        let start = (State { busy: 0, rest: Reason::Idle }, 0);
        Self { clocks, servers, now: [start; Unit::COUNT], stalls: Stalls::new(clocks, servers) }
    }

    /// From `now` on `busy` servers of `unit` work, and the others do not because of `rest`.
    pub fn set(&mut self, unit: Unit, now: Time, busy: u32, rest: Reason, recorder: &mut Recorder) {
        let state = State { busy, rest };
        let (before, since) = self.now[unit as usize];
        if before != state {
            self.write(unit, before, since, now, recorder);
            self.now[unit as usize] = (state, now);
        }
    }

    /// The end of the frame.
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
        self.stalls.add(unit, state.busy, state.rest, from, to);
        if state.busy > 0 {
            let (start, end) = (self.clocks.ps(from), self.clocks.ps(to));
            recorder.busy(unit, start, end, u64::from(state.busy), u64::from(servers));
        }
    }
}
