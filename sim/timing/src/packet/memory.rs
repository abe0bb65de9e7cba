//! L2, levels below it and memory of the level `packet`: runs of lines enter calendars. Memory has a calendar per bus, and the latest rows of
//! each bank.

use std::collections::HashMap;

use activity::{LEVELS, LevelRequests, LineAccess, LineKind, Unit};

use super::Span;
use super::calendar::{Calendar, QueueTimes, SLOT_CYCLES, Turn};
use super::levels::{Levels, Passed};
use crate::address::AddressMap;
use crate::clock::{Clocks, Time};
use crate::demand::CLIENTS;
use crate::spec::MachineSpec;

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
    l2: Calendar,
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
            l2: Calendar::new(Time::from(SLOT_CYCLES) * period, spec.lines_per_cycle.get()),
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
        let mut fetched = Fetched { last_request: start, first: Time::MAX, last: 0, arrived: 0, moved: 0 };
        let mut pacer = self.pacers[port];
        pacer.delay_until(start);
        let mut remaining = lines;
        while let Some(head) = remaining.first() {
            // A run fits into the port's queue.
            let max_count = remaining.len().min(self.queue as usize);
            let count = self.on_one_route(&remaining[..max_count]);
            remaining = &remaining[count as usize..];
            // The queue of the port has room one cycle after the L2 accepts an earlier request.
            let queue = &self.ports[port];
            pacer.delay_until(
                queue.room_at().max(queue.room_for(count).saturating_sub(pacer.delay_of_last(count))),
            );
            let run = Run { head, count, turn, last: pacer.delay_of_last(count) };
            fetched.last_request = pacer.at + run.last;
            let seen = (pacer.at + pacer.period).max(self.order[port]);
            let (first, last) = self.take(&run, seen, &mut fetched);
            self.order[port] = last;
            self.ports[port].note_all(run.count, first + self.period, last + self.period);
            fetched.first = fetched.first.min(first);
            fetched.last = last;
            pacer.advance(count, fetched.last_request);
        }
        self.pacers[port] = pacer;
        fetched
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

    /// Pass a run through the L2; its first line arrives at `seen`. Returns when the first and the last line
    /// are accepted.
    fn take(&mut self, run: &Run<'_>, seen: Time, fetched: &mut Fetched) -> (Time, Time) {
        let Run { head, count, turn, last: later } = *run;
        let (mut first, end) = self.l2.reserve_as(turn, seen, u64::from(count) * self.period);
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
        let came = seen.from;
        let seen = self.dram.admits(head, count, seen);
        accepted = Span { from: seen.from - period, to: seen.to - period };
        fetched.moved = fetched.moved.max(seen.to);
        for line in head.moved() {
            let moved = self.dram.transfer(line, count, turn, came, seen);
            fetched.moved = fetched.moved.max(moved);
            if head.fetched() == Some(line) {
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
        below.fold(self.l2.yielded(), Time::max)
    }

    /// Calendar of the L2.
    pub fn l2(&self) -> &Calendar {
        &self.l2
    }

    /// Calendars of the levels below the L2.
    pub fn levels(&self) -> impl Iterator<Item = (Unit, &Calendar)> {
        self.levels.calendars()
    }

    /// Row time of the busiest bank.
    pub fn rows(&self) -> Time {
        self.dram.rows()
    }

    /// Time of the bank with most of it for rows that may not have to be opened.
    pub fn disputed(&self) -> Time {
        self.dram.disputed()
    }

    /// Bus calendars of all channels.
    pub fn buses(&self) -> impl Iterator<Item = &Calendar> {
        self.dram.buses()
    }
}

/// Lines per slot of a bus calendar. The bus idles while a row opens; longer slots would give that idle time
/// to lines that come later.
const BUS_SLOT_LINES: u32 = 4;
/// Lines per slot of a bank calendar.
const BANK_SLOT_LINES: u32 = 32;

/// Groups of lines remembered per channel, over the lines that its queue holds. Some come later in time.
const RECENT_GROUPS: usize = 4;
/// Most groups that are remembered; larger queues are taken as if in order.
const MAX_RECENT_GROUPS: usize = 256;

/// Most rows that are remembered per bank; the queue of a channel may hold lines of as many rows as it has places.
const MAX_REMEMBERED_ROWS: usize = 256;

/// An opened row.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct OpenRow {
    row: u32,
    /// Time of the request that opened it.
    since: Time,
    /// When it is open.
    opened: Time,
    /// When its last line so far is issued.
    until: Time,
    /// When the next row begins to open.
    closes: Time,
    /// Lines of the channel up to its last line so far.
    last: u64,
    /// Time on the bus of lines that joined it.
    joined: Time,
}

impl OpenRow {
    const NONE: Self = Self { row: u32::MAX, since: 0, opened: 0, until: 0, closes: 0, last: 0, joined: 0 };
}

/// A bank: calendar of its row activations, and its latest rows, the newest first.
#[derive(Clone, Debug)]
struct Bank {
    time: Calendar,
    rows: Box<[OpenRow]>,
    /// When the last line of each row before these was issued.
    former: HashMap<u32, Time>,
    /// Time for rows that may not have to be opened.
    disputed: Time,
}

#[derive(Clone, Debug)]
struct Channel {
    bus: Calendar,
    banks: Vec<Bank>,
    /// Lines so far.
    lines: u64,
    /// The latest groups of lines, a ring, and where the oldest is.
    recent: Box<[Waiting]>,
    oldest: usize,
    /// The bank of the last line.
    last_bank: usize,
    /// Lines up to the last that are of its bank.
    of_last_bank: u64,
    /// Scratch memory of [`Self::room_at`].
    leaving: Vec<(Time, u64)>,
    /// When the last line so far is issued.
    last_issued: Time,
}

/// Lines in the queue of a channel.
#[derive(Clone, Copy, Debug, Default)]
struct Waiting {
    /// When they enter it, and when the last is issued.
    seen: Time,
    issued: Time,
    count: u64,
}

impl Channel {
    /// When a queue of `queue` lines has room for `count` more, which come at `seen`: lines leave in any order, one every
    /// `burst`.
    fn room_for(&mut self, count: u64, seen: Time, queue: u64, burst: Time) -> Time {
        let most = queue.saturating_sub(count);
        if self.last_issued <= seen + most * burst {
            return seen;
        }
        let waits = |line: &&Waiting| line.seen <= seen && line.issued > seen;
        self.leaving.clear();
        self.leaving.extend(self.recent.iter().filter(waits).map(|line| (line.issued, line.count)));
        self.leaving.sort_unstable();
        // The last to leave may stay in the queue.
        let mut held = 0;
        for &(issued, count) in self.leaving.iter().rev() {
            if held + count > most {
                return issued.saturating_sub((most - held) * burst).max(seen);
            }
            held += count;
        }
        seen
    }

    /// Whether the last `queue` lines are all of `bank`.
    fn is_of(&self, bank: usize, queue: u64) -> bool {
        self.last_bank == bank && self.of_last_bank >= queue
    }

    fn note(&mut self, bank: usize, lines: Waiting) {
        self.of_last_bank = lines.count + if self.last_bank == bank { self.of_last_bank } else { 0 };
        self.last_bank = bank;
        self.last_issued = self.last_issued.max(lines.issued);
        self.recent[self.oldest] = lines;
        self.oldest = (self.oldest + 1) % self.recent.len();
    }
}

/// Lines of one row in a bank.
#[derive(Clone, Copy, Debug)]
struct RowUse {
    row: u32,
    /// When they arrive, when the row is open, and when the last one is issued.
    seen: Time,
    opened: Time,
    issued: Time,
    /// Lines of the channel up to them, and their time on the bus.
    lines: u64,
    work: Time,
}

/// All channels.
#[derive(Clone, Debug)]
pub(super) struct Dram {
    map: AddressMap,
    channels: Vec<Channel>,
    burst: Time,
    cas: Time,
    activate: Time,
    precharge: Time,
    latency: Time,
    queue: u64,
    /// Time of a full queue of lines of one bank, each of another row, and of all lines that can wait in front of a channel.
    longest_wait: Time,
    longest_way: Time,
    end: Time,
}

impl Dram {
    pub fn new(machine: &MachineSpec, clocks: &Clocks) -> Self {
        let spec = &machine.dram;
        let period = clocks.period(spec.clock);
        let cycles = |count: u32| period * Time::from(count);
        let burst = cycles(spec.burst_cycles.get());
        let [bus, time] =
            [BUS_SLOT_LINES, BANK_SLOT_LINES].map(|lines| Calendar::new(burst * Time::from(lines), 1));
        let rows = MAX_REMEMBERED_ROWS.min(spec.queue.get() as usize);
        let bank = Bank::new(time, rows);
        let longest_line = burst.max(cycles(spec.activate_cycles.get() + spec.precharge_cycles.get()));
        let in_ports = CLIENTS.len() as Time * Time::from(machine.l2.queue.get());
        let remembered = (RECENT_GROUPS * spec.queue.get() as usize).min(MAX_RECENT_GROUPS);
        let channel = Channel {
            bus,
            banks: vec![bank; spec.banks.get() as usize],
            lines: 0,
            recent: vec![Waiting::default(); remembered].into(),
            oldest: 0,
            last_bank: 0,
            of_last_bank: 0,
            leaving: Vec::new(),
            last_issued: 0,
        };
        Self {
            map: AddressMap::new(spec),
            channels: vec![channel; spec.channels.get() as usize],
            burst,
            cas: cycles(spec.cas_cycles.get()),
            activate: cycles(spec.activate_cycles.get()),
            precharge: cycles(spec.precharge_cycles.get()),
            latency: cycles(spec.latency_cycles.get()),
            queue: spec.queue.into(),
            longest_wait: longest_line * Time::from(spec.queue),
            longest_way: longest_line * (Time::from(spec.queue) + in_ports),
            end: 0,
        }
    }

    /// Group of a line; all lines of a group are in the same row.
    pub fn group(&self, line: u32) -> u32 {
        self.map.group(line)
    }

    /// Latency from the end of a transfer to the L2.
    pub fn latency(&self) -> Time {
        self.latency
    }

    /// When the first and the last of `count` requests like `head` enter the queues of their channels, which have room for all
    /// lines of a request at once. They come at `seen`.
    pub fn admits(&mut self, head: &LineAccess, count: u32, seen: Span) -> Span {
        let channel_of = |line| self.map.locate(line).channel;
        let mut enters = seen;
        for line in head.moved() {
            let at = channel_of(line);
            let lines = head.moved().filter(|&other| channel_of(other) == at).count() as u64;
            let channel = &mut self.channels[at];
            let mut room = |count, seen| channel.room_for(count, seen, self.queue, self.burst);
            enters.from = enters.from.max(room(lines, seen.from));
            enters.to = enters.to.max(room(lines * u64::from(count), seen.to));
        }
        Span { from: enters.from, to: enters.to.max(enters.from) }
    }

    /// Transfer `count` lines of one group over the bus of their channel. The first comes to memory at `came` and enters the queue
    /// at `seen.from`, the last at `seen.to`. Returns when the last is transferred.
    pub fn transfer(&mut self, line: u32, count: u32, turn: Turn, came: Time, seen: Span) -> Time {
        let address = self.map.locate(line);
        let channel = &mut self.channels[address.channel];
        let is_alone = channel.is_of(address.bank, self.queue);
        let bank = &mut channel.banks[address.bank];
        let work = self.burst * Time::from(count);
        let open = bank.joins(address.row, seen.from, channel.lines, self.queue);
        let opened = match open {
            Some(at) => {
                let open = bank.rows[at];
                // Rows that are waiting already wait for these lines, too.
                if open.closes < Time::MAX {
                    bank.time.reserve_as(turn, open.opened.max(seen.from), work);
                }
                // A row that is requested later in time, though earlier in the stream, does not keep the line waiting.
                if open.since <= seen.from { open.opened } else { seen.from }
            }
            None => {
                bank.dispute(address.row, came, self.longest_way, self.activate + self.precharge);
                let before = &mut bank.rows[bank.place(seen.from)];
                let opens = self.activate + if *before == OpenRow::NONE { 0 } else { self.precharge };
                // The next row can open once the last line is issued, at the latest when a full queue has left.
                let held = work - self.burst;
                let closes = before.until.max(seen.from).min(seen.from + self.longest_wait);
                let begin = bank.time.reserve_as(turn, closes, opens + held).0;
                before.closes = begin;
                // The bus idles from the end of the last transfer on if the queue has lines of this bank alone. Those that joined
                // their row would fill the gap.
                if is_alone {
                    channel
                        .bus
                        .block(begin + self.burst, opens.saturating_sub(self.burst).min(before.joined));
                }
                begin + opens
            }
        };
        let ready = opened.max(seen.from);
        let end = channel.bus.reserve_as(turn, ready, work).1.max(seen.to + self.burst);
        channel.lines += u64::from(count);
        let used = RowUse {
            row: address.row,
            seen: seen.from,
            opened,
            issued: end - self.burst,
            lines: channel.lines,
            work,
        };
        if let Some(at) = open.filter(|&at| used.issued >= bank.rows[at].closes) {
            bank.delay(at, work);
        }
        bank.note(used, open);
        channel.note(address.bank, Waiting { seen: seen.from, issued: used.issued, count: count.into() });
        self.end = self.end.max(end);
        end + self.cas
    }

    /// End of the last transfer.
    pub fn ends_at(&self) -> Time {
        self.end
    }

    /// Row time of the busiest bank.
    pub fn rows(&self) -> Time {
        let banks = self.channels.iter().flat_map(|channel| &channel.banks);
        let busy = |bank: &Bank| bank.time.slots().map(|(_, _, used, _)| used).sum();
        banks.map(busy).max().unwrap_or(0)
    }

    /// Time of the bank with most of it for rows that may not have to be opened.
    pub fn disputed(&self) -> Time {
        let banks = self.channels.iter().flat_map(|channel| &channel.banks);
        banks.map(|bank| bank.disputed).max().unwrap_or(0)
    }

    /// Bus calendars of all channels.
    pub fn buses(&self) -> impl Iterator<Item = &Calendar> {
        self.channels.iter().map(|channel| &channel.bus)
    }
}

impl Bank {
    /// A bank that remembers `rows` rows.
    fn new(time: Calendar, rows: usize) -> Self {
        Self { time, rows: vec![OpenRow::NONE; rows].into(), former: HashMap::new(), disputed: 0 }
    }

    /// Count the time `opens` of a row that lines open again which came at `came`, if these and the lines before of that row may
    /// have waited side by side. In what order lines leave that wait at ports and in the queue of the channel is not known here,
    /// as those of a client ahead of others come late in the stream. So two lines may meet if the second comes no later after the
    /// first than all those take, `longest_way`.
    fn dispute(&mut self, row: u32, came: Time, longest_way: Time, opens: Time) {
        let known = self.rows.iter().find(|open| open.row == row).map(|open| open.until);
        if known.or_else(|| self.former.get(&row).copied()).is_some_and(|last| came < last + longest_way) {
            self.disputed += opens;
        }
    }

    /// The rows that open after that at place `at` do so later, as more lines of it go first.
    fn delay(&mut self, at: usize, by: Time) {
        for open in &mut self.rows[..at] {
            open.opened += by;
            open.closes = open.closes.saturating_add(by);
        }
        self.rows[at].closes += by;
    }

    /// Place of the latest row that was requested by `seen`, in time. Rows before it come later, though earlier in the stream.
    fn place(&self, seen: Time) -> usize {
        self.rows.iter().position(|open| open.since <= seen).unwrap_or(self.rows.len() - 1)
    }

    /// Place of the opening of `row` that a line joins which enters the queue at `seen`, after `lines` lines of its channel; `None`
    /// if it has to open its row.
    ///
    /// First ready first come (Rixner et al. 2000): a line joins pending lines of its row, ahead of older requests to other
    /// rows, until the next row opens. The exception is a queue full of other lines since the last of its row.
    fn joins(&self, row: u32, seen: Time, lines: u64, queue: u64) -> Option<usize> {
        let latest = self.place(seen);
        let is_pending = |open: &OpenRow| open.row == row && seen < open.closes && lines - open.last < queue;
        let latest = Some(latest).filter(|&at| self.rows[at].row == row);
        latest.or_else(|| self.rows.iter().position(is_pending))
    }

    /// Record lines of a row: those that joined the row at `joined`, or opened theirs.
    fn note(&mut self, used: RowUse, joined: Option<usize>) {
        let RowUse { row, seen, opened, issued, lines, work } = used;
        if let Some(open) = joined.map(|at| &mut self.rows[at]) {
            open.until = open.until.max(issued);
            open.last = lines;
            open.joined += work;
            return;
        }
        let at = self.place(seen);
        let closes = at.checked_sub(1).map_or(Time::MAX, |next| self.rows[next].opened);
        let known = self.rows.iter().skip(at).position(|open| open.row == row).map(|after| at + after);
        let until = known.map_or(issued, |known| self.rows[known].until.max(issued));
        if known.is_none()
            && let Some(oldest) = self.rows.last().filter(|oldest| **oldest != OpenRow::NONE)
        {
            self.former.insert(oldest.row, oldest.until);
        }
        self.rows.copy_within(at..known.unwrap_or(self.rows.len() - 1), at + 1);
        self.rows[at] = OpenRow { row, since: seen, opened, until, closes, last: lines, joined: 0 };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_row_that_opens_again_is_disputed_if_its_lines_may_have_met() {
        let mut bank = Bank::new(Calendar::new(16, 1), 2);
        let used = |row, issued| RowUse { row, seen: issued, opened: issued, issued, lines: 0, work: 1 };
        [(7, 10), (8, 20), (9, 30)].into_iter().for_each(|(row, issued)| bank.note(used(row, issued), None));
        // Row 7 is not among the two remembered any more; row 6 never was open.
        for (row, came, disputed) in [(7, 59, 5), (7, 60, 5), (9, 60, 10), (6, 0, 10)] {
            bank.dispute(row, came, 50, 5);
            assert_eq!(bank.disputed, disputed, "row {row} at {came}");
        }
    }

    #[test]
    fn a_line_joins_others_of_its_row_until_the_next_opens() {
        let used = |row, [seen, opened, issued]: [Time; 3], lines| RowUse {
            row,
            seen,
            opened,
            issued,
            lines,
            work: 1,
        };
        let mut bank = Bank::new(Calendar::new(16, 1), 4);
        let joins =
            |bank: &Bank, row, seen, lines| bank.joins(row, seen, lines, 4).map(|at| bank.rows[at].opened);
        assert_eq!(joins(&bank, 7, 0, 0), None);
        bank.note(used(7, [0, 4, 10], 1), None);
        assert_eq!((joins(&bank, 7, 50, 9), joins(&bank, 8, 5, 1)), (Some(4), None));
        bank.rows[0].closes = 12;
        bank.note(used(8, [5, 16, 20], 2), None);
        assert_eq!([11, 12].map(|seen| joins(&bank, 7, seen, 2)), [Some(4), None]);
        bank.note(used(7, [9, 4, 30], 3), Some(1));
        let rows = |bank: &Bank| [0, 1, 2].map(|at: usize| (bank.rows[at].row, bank.rows[at].until));
        assert_eq!(rows(&bank)[..2], [(8, 20), (7, 30)]);
        // Four lines of other rows came in between.
        bank.note(used(8, [40, 16, 60], 6), Some(0));
        assert_eq!([6, 7].map(|lines| joins(&bank, 7, 9, lines)), [Some(4), None]);
        // A row that comes earlier in time, and later in the stream.
        bank.note(used(9, [3, 12, 13], 7), None);
        assert_eq!((rows(&bank), bank.rows[1].closes), ([(8, 60), (9, 13), (7, 30)], 16));
    }
}
