//! A unit at its place at the level `packet`.

use super::Visit;
use super::memory::{Fetched, Memory};
use super::ring::Ring;
use crate::clock::{Clocks, Time};
use crate::job::{Place, port};
use crate::spec::MachineSpec;

/// The first edge of a clock at or after `at`. Most moments are edges already.
pub(super) fn aligned(at: Time, period: Time) -> Time {
    if period == 1 { at } else { at.next_multiple_of(period) }
}

/// The state of a unit.
#[derive(Clone, Debug)]
pub(super) struct Station {
    pub latency: Time,
    /// The queue in front: when those in it began to be served.
    pub queue: Ring,
    period: Time,
    /// When it can begin with the next packet, and when it can ask for the next line.
    free: Time,
    asks: Time,
    left: Time,
    port: Option<usize>,
    /// Those that wait behind for their lines.
    behind: Option<Ring>,
}

/// What became of a packet at a unit.
#[derive(Clone, Copy, Debug)]
pub(super) struct Served {
    pub start: Time,
    pub busy_to: Time,
    pub leave: Time,
    pub fetched: Option<Fetched>,
}

impl Station {
    pub fn new(place: Place, machine: &MachineSpec, clocks: &Clocks) -> Self {
        let common = machine.common(place.unit());
        let period = clocks.period(common.clock);
        let port = port(place.unit());
        Self {
            latency: period * Time::from(common.latency_cycles),
            queue: Ring::new(common.queue),
            period,
            free: 0,
            asks: 0,
            left: 0,
            port,
            behind: port.map(|_| Ring::new(common.in_flight)),
        }
    }

    /// When it can begin with another packet.
    pub fn free(&self) -> Time {
        self.free
    }

    /// The first edge of its clock at or after `at`.
    pub fn edge(&self, at: Time) -> Time {
        aligned(at, self.period)
    }

    /// Grains of a cycle.
    pub fn period(&self) -> Time {
        self.period
    }

    /// The later of an edge of its clock and the first one at or after `at`.
    fn later(&self, edge: Time, at: Time) -> Time {
        if at <= edge { edge } else { aligned(at, self.period) }
    }

    /// A packet comes by.
    pub fn serve(&mut self, visit: &Visit<'_>, memory: &mut Memory) -> Served {
        let start = visit.arrive.max(self.free);
        let busy_to = start + self.period * Time::from(visit.job.service[visit.place as usize]);
        let fetched = self.fetch(visit, start, memory);
        let asked = fetched.as_ref().map_or(busy_to, |fetched| self.later(busy_to, fetched.asked));
        let waits = fetched.as_ref().map_or(0, |fetched| fetched.there).max(visit.room);
        let leave = match &self.behind {
            None => {
                self.free = self.later(asked, waits);
                self.free
            }
            Some(behind) => {
                self.free = asked.max(behind.room_at());
                self.later(self.free.max(self.left), waits)
            }
        };
        if let Some(behind) = &mut self.behind {
            behind.note(leave);
        }
        self.left = leave;
        self.queue.note(start + 1);
        Served { start, busy_to, leave, fetched }
    }

    fn fetch(&mut self, visit: &Visit<'_>, start: Time, memory: &mut Memory) -> Option<Fetched> {
        let port = self.port?;
        if visit.job.lines[port] == 0 {
            return None;
        }
        let range = visit.job.lines_of(port);
        let first = visit.job.first_line;
        let lines = &visit.lines[range.start - first..range.end - first];
        let fetched = memory.ask(port, lines, start.max(self.asks), self.period);
        self.asks = fetched.asked + self.period;
        Some(fetched)
    }
}
