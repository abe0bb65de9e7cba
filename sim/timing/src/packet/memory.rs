//! L2 and memory of the level `packet`: runs of lines enter calendars.

use activity::{LineAccess, LineKind};

use super::Span;
use super::calendar::Calendar;
use super::dram::Dram;
use super::queue::QueueTimes;
use crate::clock::{Clocks, Time};
use crate::demand::CLIENTS;
use crate::spec::MachineSpec;

/// Cycles per slot of the L2 calendar.
const SLOT_CYCLES: u32 = 8;

/// Times of a group of line requests.
#[derive(Clone, Copy, Debug)]
pub(super) struct Fetched {
    /// When the last line is requested.
    pub last_request: Time,
    /// When the L2 accepts the first line.
    pub first: Time,
    /// When the last line read arrives; 0 if none is read.
    pub arrived: Time,
    /// When all transfers are done.
    pub moved: Time,
}

/// Consecutive lines with the same route.
#[derive(Clone, Copy, Debug)]
struct Run {
    head: LineAccess,
    count: u32,
    /// Delay from the request of the first line to that of the last.
    last: Time,
}

/// Requests of a client with a limited rate: the time of the next request, and the requests already made in
/// its cycle.
#[derive(Clone, Copy, Debug)]
struct RequestPacer {
    at: Time,
    used: u32,
    lines_per_cycle: u32,
    period: Time,
}

impl RequestPacer {
    /// Delay from the next request to the last of `count` requests.
    fn delay_of_last(&self, count: u32) -> Time {
        Time::from((self.used + count - 1) / self.lines_per_cycle) * self.period
    }

    /// Delay the next request until `at`, unless it is later already.
    fn delay_until(&mut self, at: Time) {
        if at > self.at {
            (self.at, self.used) = (at, 0);
        }
    }

    /// Advance past `count` requests, the last of them at `last`.
    fn advance(&mut self, count: u32, last: Time) {
        self.used = (self.used + count) % self.lines_per_cycle;
        self.at = if self.used == 0 { last + self.period } else { last };
    }
}

/// The lines moved for an access: the one that memory reads or drains, and the one written back.
fn moved(line: &LineAccess) -> (Option<u32>, Option<u32>) {
    let fetch = matches!(line.kind, LineKind::Fetch | LineKind::Drain).then_some(line.line);
    (fetch, (line.victim != LineAccess::NONE).then_some(line.victim))
}

/// The L2 with its ports, and memory behind it.
#[derive(Clone, Debug)]
pub(super) struct Memory {
    dram: Dram,
    l2: Calendar,
    ports: [QueueTimes; CLIENTS.len()],
    /// Lines per cycle that the client of each port can request.
    lines_per_cycle: [u32; CLIENTS.len()],
    /// When the last request of each port is accepted; requests of a port stay in order.
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
            l2: Calendar::new(Time::from(SLOT_CYCLES) * period, spec.lines_per_cycle.get()),
            ports: std::array::from_fn(|_| QueueTimes::new(spec.queue.get())),
            lines_per_cycle: CLIENTS.map(|unit| machine.common(unit).lines_per_cycle),
            order: [0; CLIENTS.len()],
            period,
            latency: period * Time::from(spec.latency_cycles),
            queue: spec.queue.get(),
            end: 0,
        }
    }

    /// Request `lines` one after another from `start` on, for a client with cycles of `period` grains.
    pub fn request(&mut self, port: usize, lines: &[LineAccess], start: Time, period: Time) -> Fetched {
        let mut fetched = Fetched { last_request: start, first: Time::MAX, arrived: 0, moved: 0 };
        let mut pacer =
            RequestPacer { at: start, used: 0, lines_per_cycle: self.lines_per_cycle[port], period };
        let mut remaining = lines;
        while let Some(&head) = remaining.first() {
            // A run fits into the port's queue.
            let max_count = remaining.len().min(self.queue as usize);
            let route = self.route(&head);
            let count =
                1 + remaining[1..max_count].iter().take_while(|&line| self.route(line) == route).count();
            let count = count as u32;
            remaining = &remaining[count as usize..];
            // The queue of the port has room one cycle after the L2 accepts an earlier request.
            let queue = &self.ports[port];
            pacer.delay_until(
                queue.room_at().max(queue.room_for(count).saturating_sub(pacer.delay_of_last(count))),
            );
            let run = Run { head, count, last: pacer.delay_of_last(count) };
            fetched.last_request = pacer.at + run.last;
            let seen = (pacer.at + period).max(self.order[port]);
            let (first, last) = self.take(&run, seen, &mut fetched);
            self.order[port] = last;
            self.ports[port].note_all(run.count, first + self.period, last + self.period);
            fetched.first = fetched.first.min(first);
            pacer.advance(count, fetched.last_request);
        }
        fetched
    }

    /// Route of a line: whether it is read, and the memory groups of the lines it moves. Lines with equal
    /// routes form a run.
    fn route(&self, line: &LineAccess) -> (bool, Option<u32>, Option<u32>) {
        let (moved, victim) = moved(line);
        let chunk = |line: u32| self.dram.group(line);
        (matches!(line.kind, LineKind::Hit | LineKind::Fetch), moved.map(chunk), victim.map(chunk))
    }

    /// Pass a run through the L2; its first line arrives at `seen`. Returns when the first and the last line
    /// are accepted.
    fn take(&mut self, run: &Run, seen: Time, fetched: &mut Fetched) -> (Time, Time) {
        let Run { head, count, last: later } = *run;
        let (first, end) = self.l2.reserve(seen, u64::from(count) * self.period);
        let mut last = end.saturating_sub(self.period).max(first + later);
        if head.kind == LineKind::Hit {
            fetched.arrived = fetched.arrived.max(last + self.latency);
        }
        let (fetch, victim) = moved(&head);
        for line in [fetch, victim].into_iter().flatten() {
            let seen = Span { from: first + self.period, to: last + self.period };
            let moved = self.dram.transfer(line, count, seen);
            // The channel's queue holds `backlog`; the rest of the run waits in front of the L2.
            last = last.max(moved.issued.saturating_sub(self.dram.backlog()));
            fetched.moved = fetched.moved.max(moved.data);
            if head.kind == LineKind::Fetch && line == head.line {
                fetched.arrived = fetched.arrived.max(moved.data + self.dram.latency() + self.latency);
            }
        }
        fetched.moved = fetched.moved.max(last + self.period);
        self.end = self.end.max(last + self.period);
        (first, last)
    }

    /// When the last line is accepted and the last transfer is done.
    pub fn ends_at(&self) -> Time {
        self.end.max(self.dram.ends_at())
    }

    /// Calendar of the L2.
    pub fn l2(&self) -> &Calendar {
        &self.l2
    }

    /// Row time of the busiest bank.
    pub fn rows(&self) -> Time {
        self.dram.rows()
    }

    /// Bus calendars of all channels.
    pub fn buses(&self) -> impl Iterator<Item = &Calendar> {
        self.dram.buses()
    }
}
