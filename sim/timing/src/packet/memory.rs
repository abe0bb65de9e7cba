//! L2 and memory at the level `packet`: calendars that runs of lines are entered into.

use activity::{LineAccess, LineKind};

use super::calendar::Calendar;
use super::dram::Dram;
use super::ring::Ring;
use crate::clock::{Clocks, Time};
use crate::job::CLIENTS;
use crate::spec::MachineSpec;

/// Cycles in a stretch of the calendar.
const STRETCH: u32 = 8;

/// When some lines were asked for, taken and there.
#[derive(Clone, Copy, Debug)]
pub(super) struct Fetched {
    /// When the last was asked for.
    pub asked: Time,
    /// When the first was taken by the L2.
    pub first: Time,
    /// When the last that is read is there; 0 where none is.
    pub there: Time,
    /// When everything has been moved.
    pub moved: Time,
}

/// Lines side by side that go the same way.
#[derive(Clone, Copy, Debug)]
struct Run {
    head: LineAccess,
    count: u32,
    /// From the moment the first is asked for to that of the last.
    last: Time,
}

/// A client asks for so many lines a cycle: when for the next, and how many of its cycle are gone.
#[derive(Clone, Copy, Debug)]
struct Asking {
    at: Time,
    gone: u32,
    lines_per_cycle: u32,
    period: Time,
}

impl Asking {
    /// How long after the next line the last of `count` is asked for.
    fn last(&self, count: u32) -> Time {
        Time::from((self.gone + count - 1) / self.lines_per_cycle) * self.period
    }

    /// The next line is asked for at `at` or, where its cycle began before, in that.
    fn waits(&mut self, at: Time) {
        if at > self.at {
            (self.at, self.gone) = (at, 0);
        }
    }

    /// `count` lines have been asked for, the last of them at `last`.
    fn asked(&mut self, count: u32, last: Time) {
        self.gone = (self.gone + count) % self.lines_per_cycle;
        self.at = if self.gone == 0 { last + self.period } else { last };
    }
}

/// The lines that memory reads or drains, and writes back, for one.
fn moved(line: &LineAccess) -> (Option<u32>, Option<u32>) {
    let fetch = matches!(line.kind, LineKind::Fetch | LineKind::Drain).then_some(line.line);
    (fetch, (line.victim != LineAccess::NONE).then_some(line.victim))
}

/// The L2 with its ports, and memory behind it.
#[derive(Clone, Debug)]
pub(super) struct Memory {
    dram: Dram,
    l2: Calendar,
    ports: [Ring; CLIENTS.len()],
    /// Lines that each port's client asks for in a cycle.
    lines_per_cycle: [u32; CLIENTS.len()],
    /// When the last request of each port was taken: none passes another of its port.
    order: [Time; CLIENTS.len()],
    period: Time,
    latency: Time,
    queue: u32,
    end: Time,
}

impl Memory {
    pub fn new(machine: &MachineSpec, clocks: &Clocks) -> Self {
        let spec = &machine.l2;
        let period = clocks.period(spec.clock);
        Self {
            dram: Dram::new(&machine.dram, clocks),
            l2: Calendar::new(Time::from(STRETCH) * period, spec.lines_per_cycle.get()),
            ports: std::array::from_fn(|_| Ring::new(spec.queue.get())),
            lines_per_cycle: CLIENTS.map(|unit| machine.common(unit).lines_per_cycle),
            order: [0; CLIENTS.len()],
            period,
            latency: period * Time::from(spec.latency_cycles),
            queue: spec.queue.get(),
            end: 0,
        }
    }

    /// A client whose cycles are of `period` asks for `lines` one after another, from `start` on.
    pub fn ask(&mut self, port: usize, lines: &[LineAccess], start: Time, period: Time) -> Fetched {
        let mut fetched = Fetched { asked: start, first: Time::MAX, there: 0, moved: 0 };
        let mut asking = Asking { at: start, gone: 0, lines_per_cycle: self.lines_per_cycle[port], period };
        let mut rest = lines;
        while let Some(&head) = rest.first() {
            // A run is no longer than what the port holds: its lines go the same way.
            let longest = rest.len().min(self.queue as usize);
            let way = self.way(&head);
            let count = 1 + rest[1..longest].iter().take_while(|&line| self.way(line) == way).count();
            let count = count as u32;
            rest = &rest[count as usize..];
            // The port has room a cycle after the L2 took the request so many before.
            let ring = &self.ports[port];
            asking.waits(ring.room_at().max(ring.room_for(count).saturating_sub(asking.last(count))));
            let run = Run { head, count, last: asking.last(count) };
            fetched.asked = asking.at + run.last;
            let seen = (asking.at + period).max(self.order[port]);
            let (first, last) = self.take(&run, seen, &mut fetched);
            self.order[port] = last;
            self.ports[port].note_all(run.count, first + self.period, last + self.period);
            fetched.first = fetched.first.min(first);
            asking.asked(count, fetched.asked);
        }
        fetched
    }

    /// What tells a line from another that goes elsewhere: whether it is read, and where what it moves lies.
    fn way(&self, line: &LineAccess) -> (bool, Option<u32>, Option<u32>) {
        let (moved, victim) = moved(line);
        let chunk = |line: u32| self.dram.chunk(line);
        (matches!(line.kind, LineKind::Hit | LineKind::Fetch), moved.map(chunk), victim.map(chunk))
    }

    /// A run through the L2, the first seen from `seen` on. Says when the first and the last were taken.
    fn take(&mut self, run: &Run, seen: Time, fetched: &mut Fetched) -> (Time, Time) {
        let Run { head, count, last: later } = *run;
        let (first, end) = self.l2.take(seen, u64::from(count) * self.period);
        let mut last = end.saturating_sub(self.period).max(first + later);
        if head.kind == LineKind::Hit {
            fetched.there = fetched.there.max(last + self.latency);
        }
        let (fetch, victim) = moved(&head);
        for line in [fetch, victim].into_iter().flatten() {
            let moved = self.dram.transfer(line, count, (first + self.period, last + self.period));
            // The queue of the channel holds no more than this: the request waits in front of the L2 for the rest.
            last = last.max(moved.issued.saturating_sub(self.dram.backlog()));
            fetched.moved = fetched.moved.max(moved.data);
            if head.kind == LineKind::Fetch && line == head.line {
                fetched.there = fetched.there.max(moved.data + self.dram.latency() + self.latency);
            }
        }
        fetched.moved = fetched.moved.max(last + self.period);
        self.end = self.end.max(last + self.period);
        (first, last)
    }

    /// When the last line is taken and the last transfer over.
    pub fn ends_at(&self) -> Time {
        self.end.max(self.dram.ends_at())
    }

    /// Stretches of the L2's time.
    pub fn l2(&self) -> &Calendar {
        &self.l2
    }

    /// For how long the bank that is busiest with it opens and closes rows.
    pub fn rows(&self) -> Time {
        self.dram.rows()
    }

    /// The buses of all channels.
    pub fn buses(&self) -> impl Iterator<Item = &Calendar> {
        self.dram.buses()
    }
}
