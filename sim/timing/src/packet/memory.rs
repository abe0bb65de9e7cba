//! L2 and levels below it at the level `packet`, a calendar each: runs of lines enter them, and go on to memory.

use activity::{LEVELS, LevelRequests, LineAccess, LineKind, Unit};

use super::Span;
use super::arbiter::Arbiter;
use super::bank::Lines;
use super::calendar::{Calendar, QueueTimes, SLOT_CYCLES, Turn};
use super::dram::Dram;
use crate::clock::{Clocks, Time};
use crate::demand::CLIENTS;
use crate::spec::{MachineSpec, SharedCacheSpec};

/// Times of a group of line requests.
#[derive(Clone, Copy, Debug)]
pub(super) struct Fetched {
    /// When the last line is requested.
    pub last_request: Time,
    /// When the L2 accepts the first line.
    pub first: Time,
    /// When the L2 accepts the last line.
    pub last: Time,
    /// When the last line read arrives; 0 if none is read.
    pub arrived: Time,
    /// When all transfers are done.
    pub moved: Time,
}

impl Fetched {
    /// Times before any request, for requests from `start` on.
    pub const fn none(start: Time) -> Self {
        Self { last_request: start, first: Time::MAX, last: 0, arrived: 0, moved: 0 }
    }
}

/// Consecutive lines with the same route.
#[derive(Clone, Copy, Debug)]
struct Run<'a> {
    head: &'a LineAccess,
    count: u32,
    turn: Turn,
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
    fn new(machine: &MachineSpec, clocks: &Clocks, unit: Unit) -> Self {
        let common = machine.common(unit);
        Self {
            at: 0,
            used: 0,
            lines_per_cycle: common.lines_per_cycle.max(1),
            period: clocks.period(common.clock),
        }
    }

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

/// Way of a line through memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Route {
    /// Where it is read; `None` for writes.
    kind: Option<LineKind>,
    levels: [LevelRequests; LEVELS.len()],
    groups: [Option<u32>; 1 + LineAccess::MAX_WRITTEN],
}

/// The L2 with its ports, the levels below it, and memory behind them.
#[derive(Clone, Debug)]
pub(super) struct Memory {
    dram: Dram,
    levels: Levels,
    l2: Arbiter,
    ports: [QueueTimes; CLIENTS.len()],
    /// The requests of the client of each port so far.
    pacers: [RequestPacer; CLIENTS.len()],
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
            dram: Dram::new(machine, clocks),
            levels: Levels::new(machine, clocks),
            l2: Arbiter::new(
                Calendar::new(Time::from(SLOT_CYCLES) * period, spec.lines_per_cycle.get()),
                u64::from(spec.queue.get()) * period,
            ),
            ports: std::array::from_fn(|_| QueueTimes::new(spec.queue.get())),
            pacers: CLIENTS.map(|unit| RequestPacer::new(machine, clocks, unit)),
            order: [0; CLIENTS.len()],
            period,
            latency: period * Time::from(spec.latency_cycles),
            queue: spec.queue.get(),
            end: 0,
        }
    }

    /// Request `lines` one after another from `start` on, and after those before them.
    pub fn request(&mut self, port: usize, lines: &[LineAccess], turn: Turn, start: Time) -> Fetched {
        let mut fetched = Fetched::none(start);
        let mut remaining = lines;
        while !remaining.is_empty() {
            let count = self.request_run(port, remaining, turn, &mut fetched);
            remaining = &remaining[count..];
        }
        fetched
    }

    /// When the L2 accepts the next request of a port at the earliest.
    pub fn next_accepted(&self, port: usize) -> Time {
        self.pacers[port].at.max(self.order[port])
    }

    /// Request the first run of `lines`, of which there are some: those with one route that fit into the queue of the
    /// port. Starts no earlier than the last request in `fetched`. Returns its length.
    pub fn request_run(
        &mut self,
        port: usize,
        lines: &[LineAccess],
        turn: Turn,
        fetched: &mut Fetched,
    ) -> usize {
        let mut pacer = self.pacers[port];
        pacer.at += self.l2.stalled(port);
        pacer.delay_until(fetched.last_request);
        // A run fits into the port's queue.
        let max_count = lines.len().min(self.queue as usize);
        let count = self.on_one_route(&lines[..max_count]);
        // The queue of the port has room one cycle after the L2 accepts an earlier request.
        let queue = &self.ports[port];
        pacer.delay_until(
            queue.room_at().max(queue.room_for(count).saturating_sub(pacer.delay_of_last(count))),
        );
        let run = Run { head: &lines[0], count, turn, last: pacer.delay_of_last(count) };
        fetched.last_request = pacer.at + run.last;
        let seen = (pacer.at + pacer.period).max(self.order[port]);
        let (first, last) = self.take(port, &run, seen, fetched);
        self.order[port] = last;
        self.ports[port].note_all(run.count, first + self.period, last + self.period);
        fetched.first = fetched.first.min(first);
        fetched.last = last;
        pacer.advance(count, fetched.last_request);
        self.pacers[port] = pacer;
        count as usize
    }

    /// Number of lines from the first of `lines` on that take its route.
    fn on_one_route(&self, lines: &[LineAccess]) -> u32 {
        let Some((head, others)) = lines.split_first() else { return 0 };
        // Most lines go no further than the L2, and need no look at memory.
        let following = if head.stays_in_l2() {
            let is_read = head.is_read();
            others.iter().take_while(|line| line.stays_in_l2() && line.is_read() == is_read).count()
        } else {
            let route = self.route(head);
            others.iter().take_while(|line| self.route(line) == route).count()
        };
        1 + following as u32
    }

    /// Route of a line: where it is read, its requests to the levels below, and the memory groups of the lines it
    /// moves. Lines with equal routes form a run.
    fn route(&self, line: &LineAccess) -> Route {
        let mut groups = [None; 1 + LineAccess::MAX_WRITTEN];
        groups.iter_mut().zip(line.moved()).for_each(|(group, line)| *group = Some(self.dram.group(line)));
        Route { kind: line.is_read().then_some(line.kind), levels: line.levels, groups }
    }

    /// Pass a run of a port through the L2; its first line arrives at `seen`. Returns when the first and the
    /// last line are accepted.
    fn take(&mut self, port: usize, run: &Run<'_>, seen: Time, fetched: &mut Fetched) -> (Time, Time) {
        let Run { head, count, turn, last: later } = *run;
        let (mut first, end) = self.l2.reserve_as(turn, port, seen, u64::from(count) * self.period);
        let mut last = end.saturating_sub(self.period).max(first + later);
        if head.kind == LineKind::Hit {
            fetched.arrived = fetched.arrived.max(last + self.latency);
        }
        if head.stays_in_l2() {
            fetched.moved = fetched.moved.max(last + self.period);
            self.end = self.end.max(last + self.period);
            return (first, last);
        }
        let Passed { mut accepted, period, latency, backlog, found } =
            self.levels.pass(head, (count, turn), Span { from: first, to: last }, self.period);
        if let Some(arrived) = found {
            fetched.arrived = fetched.arrived.max(arrived + self.latency);
        }
        // What the queues of the channels do not hold waits in front of the level above.
        let seen = Span { from: accepted.from + period, to: accepted.to + period };
        let seen = self.dram.admits(head, count, seen);
        accepted = Span { from: seen.from - period, to: seen.to - period };
        fetched.moved = fetched.moved.max(seen.to);
        for line in head.moved() {
            let is_read = head.fetched() == Some(line);
            let moved = self.dram.transfer(&Lines { first: line, is_write: !is_read, count, turn, seen });
            fetched.moved = fetched.moved.max(moved);
            if is_read {
                let latency = self.dram.latency() + latency + self.latency;
                fetched.arrived = fetched.arrived.max(moved + latency);
            }
        }
        first = first.max(accepted.from.saturating_sub(backlog));
        last = last.max(accepted.to.saturating_sub(backlog));
        fetched.moved = fetched.moved.max(last + self.period);
        self.end = self.end.max(last + self.period);
        (first, last)
    }

    /// When a client knows that a line accepted at `accepted` is in the L2.
    pub fn acknowledges(&self, accepted: Time) -> Time {
        accepted + self.latency
    }

    /// When the last line is accepted and the last transfer is done.
    pub fn ends_at(&self) -> Time {
        self.end.max(self.levels.ends_at()).max(self.dram.ends_at())
    }

    /// When the last line that made room for others ends.
    pub fn yielded(&self) -> Time {
        let levels = self.levels.calendars().map(|(_, calendar)| calendar);
        let below = self.buses().chain(levels).map(Calendar::yielded);
        below.fold(self.l2.calendar().yielded(), Time::max)
    }

    /// Calendar of the L2.
    pub fn l2(&self) -> &Calendar {
        self.l2.calendar()
    }

    /// Calendars of the levels below the L2.
    pub fn levels(&self) -> impl Iterator<Item = (Unit, &Calendar)> {
        self.levels.calendars()
    }

    /// Bus calendars of all channels.
    pub fn buses(&self) -> impl Iterator<Item = &Calendar> {
        self.dram.buses()
    }
}

/// A run that has passed the levels below the L2.
#[derive(Clone, Copy, Debug)]
struct Passed {
    /// When the last of these levels, or the L2, accepts the first line and the last one.
    accepted: Span,
    /// Cycle of that level.
    period: Time,
    /// Latency of all these levels.
    latency: Time,
    /// Time for which the queues of these levels hold lines back from the L2.
    backlog: Time,
    /// When the L2 has the last line, if these levels have it.
    found: Option<Time>,
}

/// A level below the L2.
#[derive(Clone, Debug)]
struct CacheLevel {
    unit: Unit,
    /// Index in [`LEVELS`].
    at: usize,
    calendar: Calendar,
    period: Time,
    latency: Time,
    /// Time to accept a full queue.
    backlog: Time,
}

/// All levels that the machine has, from the L2 on.
#[derive(Clone, Debug)]
struct Levels {
    levels: Vec<CacheLevel>,
    end: Time,
}

impl Levels {
    fn new(machine: &MachineSpec, clocks: &Clocks) -> Self {
        let level = |((at, unit), spec): ((usize, Unit), Option<&SharedCacheSpec>)| {
            let spec = spec?;
            let period = clocks.period(spec.clock);
            let lines = spec.lines_per_cycle.get();
            Some(CacheLevel {
                unit,
                at,
                calendar: Calendar::new(Time::from(SLOT_CYCLES) * period, lines),
                period,
                latency: period * Time::from(spec.latency_cycles),
                backlog: period * Time::from(spec.queue) / Time::from(lines),
            })
        };
        let levels = LEVELS.into_iter().enumerate().zip(machine.levels()).filter_map(level).collect();
        Self { levels, end: 0 }
    }

    /// Pass `count` lines like `head` that the L2, with cycles of `period`, accepts at `accepted`.
    fn pass(
        &mut self,
        head: &LineAccess,
        (count, turn): (u32, Turn),
        accepted: Span,
        period: Time,
    ) -> Passed {
        let mut passed = Passed { accepted, period, latency: 0, backlog: 0, found: None };
        for level in &mut self.levels {
            let requests = head.levels[level.at];
            if requests.lines() == 0 {
                continue;
            }
            let Span { from, to } = passed.accepted;
            let seen = Span { from: from + passed.period, to: to + passed.period };
            passed.accepted = level.accept(requests.lines() * count, turn, seen);
            passed.latency += level.latency;
            passed.backlog += level.backlog + passed.period;
            passed.period = level.period;
            // The last level with a read has the line.
            if head.kind == LineKind::Below && requests.reads > 0 {
                passed.found = Some(passed.accepted.to + passed.latency);
            }
            self.end = self.end.max(passed.accepted.to + level.period);
        }
        passed
    }

    /// Calendars of all levels.
    fn calendars(&self) -> impl Iterator<Item = (Unit, &Calendar)> {
        self.levels.iter().map(|level| (level.unit, &level.calendar))
    }

    /// When the last line is accepted.
    fn ends_at(&self) -> Time {
        self.end
    }
}

impl CacheLevel {
    /// Accept `lines` lines, of which the first comes at `seen.from` and the last at `seen.to`. Returns when
    /// the first and the last are accepted.
    fn accept(&mut self, lines: u32, turn: Turn, seen: Span) -> Span {
        let (from, end) = self.calendar.reserve_as(turn, seen.from, u64::from(lines) * self.period);
        Span { from, to: end.saturating_sub(self.period).max(seen.to).max(from) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_full_level_accepts_the_last_line_no_earlier_than_the_first() {
        // Eight slots of eight cycles of 37 grains, four lines a cycle, are taken.
        let mut level = CacheLevel {
            unit: Unit::Llc,
            at: 0,
            calendar: Calendar::new(8 * 37, 4),
            period: 37,
            latency: 0,
            backlog: 0,
        };
        level.accept(8 * 8 * 4, Turn::InOrder, Span { from: 0, to: 0 });
        for lines in 1..9 {
            let Span { from, to } = level.accept(lines, Turn::InOrder, Span { from: 3, to: 3 });
            assert!(64 * 37 <= from && from <= to, "{lines}: {from} to {to}");
        }
    }
}
