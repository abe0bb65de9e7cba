//! Memory at the level `packet`: a calendar for each bus, and the latest rows of each bank.
//!
//! What the chips allow is in the calendars: a refresh is a pause in them, a row keeps its bank as long as it
//! has to stay open, and every rank has a calendar of its activations. The bus turns as often as it has to
//! with full queues of open rows. The lines of a channel also pass its queue ([`Queue`]) command by command, for the time
//! that the bus idles with a full queue beyond that.

use activity::LineAccess;

use super::Span;
use super::bank::{Bank, Lines, OpenRow, RowUse};
use super::calendar::{Calendar, Pauses};
use crate::channel;
use crate::chips::{AddressMap, ChipTimes, RowAddress, TurnPolicy};
use crate::clock::{Clocks, Time, aligned};
use crate::spec::MachineSpec;

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

/// Chips that share the bus of a channel with other ranks.
#[derive(Clone, Debug)]
struct Rank {
    /// Its activations, each as long as the chips want between two.
    activations: Calendar,
    refresh: Option<Pauses>,
}

/// Turns of a bus between reads and writes. Lines wait in the queues until as many as these hold go one way;
/// so the bus turns as rarely as they allow, whatever the order in which lines come.
#[derive(Clone, Copy, Debug, Default)]
struct BusTurns {
    /// The latest reads and writes.
    mix: [u64; 2],
    /// Time for turns that is not taken from the bus yet, in parts of a grain.
    pending: f64,
}

impl BusTurns {
    /// Add `count` lines of a kind, with a turn there and back that takes `pair`. Returns the time for which
    /// the bus idles because of them.
    fn add(&mut self, kind: usize, count: u64, pair: Time, policy: &TurnPolicy) -> Time {
        if pair == 0 {
            return 0;
        }
        self.mix[kind] += count;
        let lines = self.mix[0] + self.mix[1];
        self.pending += (pair * count) as f64 * policy.pairs_per_line(self.mix);
        if lines > policy.memory {
            self.mix = self.mix.map(|kind| kind / 2);
        }
        if self.pending < pair as f64 {
            return 0;
        }
        let pending = self.pending as Time;
        self.pending -= pending as f64;
        pending
    }
}

/// Queue of a channel.
///
/// A calendar keeps its bus busy while any line waits. Real rows may be closed, and the bus turns between reads
/// and writes. The cost depends on the lines, so they are served here command by command, as at `stepped`. Idle
/// time counts only while the queue is full: with room, later lines fill the gap.
#[derive(Clone, Debug)]
struct Queue {
    channel: channel::Channel<()>,
    now: Time,
    /// Idle time that is blocked in the calendar of the bus already, since the queue was last empty.
    booked_idle: Time,
}

impl Queue {
    /// Let a line come at `seen`. Returns for how long the bus idles from then on until there is room for it, beyond
    /// what its calendar has. Lines come in stream order, so `now` may be later.
    fn push(&mut self, address: RowAddress, is_write: bool, seen: Time, rules: &Rules) -> Time {
        let Rules { places, times_without_refresh: times, period, .. } = rules;
        let more = [usize::from(!is_write), usize::from(is_write)];
        let mut idle = 0;
        while !self.channel.is_empty() && (self.now <= seen || !self.channel.has_room(places, more, self.now))
        {
            let free = self.channel.bus_free_at().max(seen);
            let (moved, acted) = self.channel.tick(self.now, places, times);
            if let Some(line) = moved.filter(|_| self.now > free) {
                let since = self.channel.waits_since().unwrap_or(self.now).min(line.seen_at);
                idle += self.now - free.max(since);
            }
            let next = if acted { None } else { self.channel.wakes_at(self.now, times) };
            self.now = aligned(next.unwrap_or(self.now + period), *period);
        }
        if self.channel.is_empty() {
            self.booked_idle = 0;
        }
        self.channel.push(address, (!is_write).then_some(()), seen);
        let new = idle.saturating_sub(self.booked_idle);
        self.booked_idle -= idle - new;
        new
    }
}

#[derive(Clone, Debug)]
struct Channel {
    bus: Calendar,
    queue: Queue,
    turns: BusTurns,
    banks: Vec<Bank>,
    ranks: Vec<Rank>,
    /// Lines so far.
    lines: u64,
    /// The latest groups of lines, a ring, and where the oldest is.
    recent: Box<[Waiting]>,
    oldest: usize,
    /// The bank of the last line.
    last_bank: usize,
    /// Lines up to the last that are of its bank.
    of_last_bank: u64,
    /// Scratch memory of [`Self::room_for`].
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
    /// Their bank in the channel, and their row.
    bank: usize,
    row: u32,
}

impl Channel {
    /// A channel that remembers `groups` groups of lines.
    fn new(bus: Calendar, queue: Queue, ranks: Vec<Rank>, banks: Vec<Bank>, groups: usize) -> Self {
        Self {
            bus,
            queue,
            turns: BusTurns::default(),
            banks,
            ranks,
            lines: 0,
            recent: vec![Waiting::default(); groups].into(),
            oldest: 0,
            last_bank: 0,
            of_last_bank: 0,
            leaving: Vec::new(),
            last_issued: 0,
        }
    }

    /// When a queue of `queue` lines has room for `count` more, which come at `seen`: lines leave in any
    /// order, one every `burst`.
    fn room_for(&mut self, count: u64, seen: Time, queue: u64, burst: Time) -> Time {
        let most = queue.saturating_sub(count);
        if self.last_issued <= seen + most * burst {
            return seen;
        }
        let waits = |line: &&Waiting| line.seen <= seen && line.issued > seen;
        self.leaving.clear();
        self.leaving.extend(self.recent.iter().filter(waits).map(|line| (line.issued, line.count)));
        let mut held: u64 = self.leaving.iter().map(|&(_, count)| count).sum();
        let mut room = seen;
        // Those that leave first. The last of a group may stay in the queue.
        while held > most {
            let first = (0..self.leaving.len()).min_by_key(|&at| self.leaving[at]);
            let Some((issued, count)) = first.map(|at| self.leaving.swap_remove(at)) else { break };
            held -= count;
            room = issued.saturating_sub(most.saturating_sub(held) * burst).max(seen);
        }
        room
    }

    /// Whether the last `queue` lines are all of `bank`.
    fn is_of(&self, bank: usize, queue: u64) -> bool {
        self.last_bank == bank && self.of_last_bank >= queue
    }

    /// Transfer lines of one row. Returns when the last is transferred.
    fn transfer(&mut self, address: RowAddress, lines: &Lines, rules: &Rules) -> Time {
        let kind = usize::from(lines.is_write);
        let RowAddress { bank, row, .. } = address;
        let (work, seen) = (rules.times.burst * Time::from(lines.count), lines.seen);
        let is_alone = self.is_of(bank, rules.queue);
        let turns_rows = is_alone
            && rules.turns.pair > 0
            && self.banks[bank].turns_rows(kind, row, self.lines, rules.queue);
        let joined = self.banks[bank].joins(row, seen.from);
        let (opened, idle) = match joined {
            Some(at) => (self.banks[bank].join(at, lines, work), None),
            None => {
                let (opened, idle) = self.open(address, lines, rules, is_alone && !turns_rows);
                (opened, Some(idle))
            }
        };
        let ready = self.ready(bank, opened.max(seen.from));
        let pair = if turns_rows { rules.turns.pair_in_bank } else { rules.turns.pair };
        let turned = self.turns.add(kind, lines.count.into(), pair, &rules.turns);
        if turned > 0 {
            // Turns of a bus that waits for one bank are part of the openings of its rows.
            self.queue.booked_idle += turned;
            self.bus.block(idle.filter(|_| turns_rows).unwrap_or(ready), turned);
        }
        let end = self.bus.reserve_as(lines.turn, ready, work).1.max(seen.to + rules.times.burst);
        self.lines += u64::from(lines.count);
        let issued = end - rules.times.burst;
        let may_close = rules.times.may_close(kind, opened, issued);
        let used = RowUse { row, seen: seen.from, opened, issued, may_close, work };
        self.note_use(bank, used, lines.count, joined);
        end
    }

    /// Open a row for lines that join none. Returns when it is open, and from when on the bus may idle for it.
    fn open(
        &mut self,
        RowAddress { bank, .. }: RowAddress,
        lines: &Lines,
        rules: &Rules,
        blocks_bus: bool,
    ) -> (Time, Time) {
        let times = &rules.times;
        let (kind, seen) = (usize::from(lines.is_write), lines.seen.from);
        let rank = self.rank_of(bank);
        let bank = &mut self.banks[bank];
        let at = bank.place(seen);
        let before = bank.rows[at];
        let closing = if before == OpenRow::NONE { 0 } else { times.precharge };
        let opens = closing + times.activate[kind];
        // The next row can open once the last line is issued and the chips let the row close, at the latest
        // when a full queue has left.
        let held = closing + times.holds(kind, lines.count);
        let may_close = if before.since <= seen { before.may_close } else { 0 };
        let closes = may_close.max(seen).min(seen + rules.longest_wait);
        let mut begin = bank.time.reserve_as(lines.turn, closes, held).0;
        if times.spacing() > 0 {
            let activations = &mut self.ranks[rank].activations;
            let activates = activations.reserve_as(lines.turn, begin + closing, times.spacing()).0;
            begin = begin.max(activates.saturating_sub(closing));
        }
        bank.rows[at].closes = begin;
        // The bus idles from the end of the last transfer on if the queue has lines of this bank alone. Those
        // that joined their row would fill the gap.
        let idle = begin + times.burst;
        if blocks_bus {
            let length = opens.saturating_sub(times.burst).min(before.joined);
            self.queue.booked_idle += length;
            self.bus.block(idle, length);
        }
        (begin + opens, idle)
    }

    fn rank_of(&self, bank: usize) -> usize {
        bank * self.ranks.len() / self.banks.len()
    }

    /// The first time from `at` on at which the chips of a bank are not in refresh. The calendar of a bus with
    /// one rank has its pauses.
    fn ready(&self, bank: usize, at: Time) -> Time {
        let refresh = self.ranks[self.rank_of(bank)].refresh.filter(|_| self.ranks.len() > 1);
        refresh.map_or(at, |pauses| pauses.after(at))
    }

    /// Record lines of a row that joined the row at `joined`, or opened theirs.
    fn note_use(&mut self, bank: usize, used: RowUse, count: u32, joined: Option<usize>) {
        let rows = &mut self.banks[bank];
        let delays = joined.map(|at| (at, rows.rows[at].closes)).filter(|&(_, closes)| used.issued >= closes);
        if let Some((at, _)) = delays {
            rows.delay(at, used.work);
        }
        rows.note(used, joined);
        if let Some((_, closes)) = delays {
            self.delay(bank, used.row, closes, used.work);
        }
        let RowUse { row, seen, issued, .. } = used;
        self.note(Waiting { seen, issued, count: count.into(), bank, row });
    }

    /// Lines of other rows of the bank that go after `closes` do so later, as more lines of `row` go first.
    fn delay(&mut self, bank: usize, row: u32, closes: Time, by: Time) {
        let waits = |line: &&mut Waiting| line.bank == bank && line.row != row && line.issued > closes;
        for line in self.recent.iter_mut().filter(waits) {
            line.issued += by;
            self.last_issued = self.last_issued.max(line.issued);
        }
    }

    fn note(&mut self, lines: Waiting) {
        self.of_last_bank = lines.count + if self.last_bank == lines.bank { self.of_last_bank } else { 0 };
        self.last_bank = lines.bank;
        self.last_issued = self.last_issued.max(lines.issued);
        self.recent[self.oldest] = lines;
        self.oldest = (self.oldest + 1) % self.recent.len();
    }
}

/// Refreshes of one of `ranks` ranks, which take turns.
fn pauses(times: &ChipTimes, rank: u32, ranks: u32) -> Option<Pauses> {
    let refresh = times.refreshes()?;
    let first = refresh.interval * Time::from(rank + 1) / Time::from(ranks);
    Some(Pauses { first, interval: refresh.interval, length: refresh.busy })
}

/// What all channels have in common.
#[derive(Clone, Debug)]
struct Rules {
    times: ChipTimes,
    /// The calendars have the refreshes.
    times_without_refresh: ChipTimes,
    places: channel::Places,
    period: Time,
    turns: TurnPolicy,
    /// Lines that wait in front of a channel.
    queue: u64,
    /// Time of a full queue of lines of one bank, each of another row.
    longest_wait: Time,
}

/// All channels.
#[derive(Clone, Debug)]
pub(super) struct Dram {
    map: AddressMap,
    channels: Vec<Channel>,
    rules: Rules,
    end: Time,
}

impl Dram {
    pub fn new(machine: &MachineSpec, clocks: &Clocks) -> Self {
        let spec = &machine.dram;
        let times = ChipTimes::new(spec, clocks);
        // Lines of any row may wait in both queues.
        let queue = u64::from(spec.queue.get()) + spec.write_queue.map_or(0, |queue| queue.get().into());
        let [bus, time] =
            [BUS_SLOT_LINES, BANK_SLOT_LINES].map(|lines| Calendar::new(times.burst * Time::from(lines), 1));
        let remembered_rows = MAX_REMEMBERED_ROWS.min(queue as usize);
        let (ranks, banks) = (spec.ranks.get(), spec.banks.get() as usize);
        let rank = |rank: u32| Rank {
            activations: Calendar::new(4 * times.spacing().max(1), 1),
            refresh: pauses(&times, rank, ranks),
        };
        let ranks: Vec<_> = (0..ranks).map(rank).collect();
        let bank = |rank: &Rank| Bank::new(time.clone().with_pauses(rank.refresh), remembered_rows);
        // A bus with one rank has nothing to do until a row is open again.
        let alone = ranks.first().filter(|_| ranks.len() == 1).and_then(|rank| rank.refresh);
        let reopening = alone.map(|pauses| Pauses { length: pauses.length + times.activate[0], ..pauses });
        let longest_line = times.burst.max(times.row_cycle(0).max(times.row_cycle(1)));
        let remembered = (RECENT_GROUPS * queue as usize).min(MAX_RECENT_GROUPS);
        let times_without_refresh = ChipTimes { refresh: None, ..times };
        let queue_of_channel =
            Queue { channel: channel::Channel::new(spec, &times_without_refresh), now: 0, booked_idle: 0 };
        let banks = ranks.iter().flat_map(|rank| vec![bank(rank); banks]).collect();
        let channel = Channel::new(bus.with_pauses(reopening), queue_of_channel, ranks, banks, remembered);
        Self {
            map: AddressMap::new(spec),
            channels: vec![channel; spec.channels.get() as usize],
            rules: Rules {
                turns: TurnPolicy::new(spec, &times),
                times,
                times_without_refresh,
                places: channel::Places::new(machine),
                period: clocks.period(spec.clock),
                queue,
                longest_wait: longest_line * queue,
            },
            end: 0,
        }
    }

    /// Group of a line; all lines of a group are in the same row.
    pub fn group(&self, line: u32) -> u32 {
        self.map.group(line)
    }

    /// Latency of a line that is read, from the end of its place on the bus to the L2. Places begin with the
    /// column command.
    pub fn latency(&self) -> Time {
        self.rules.times.cas + self.rules.times.latency
    }

    /// When the first and the last of `count` requests like `head` enter the queues of their channels, which
    /// have room for all lines of a request at once. They come at `seen`.
    pub fn admits(&mut self, head: &LineAccess, count: u32, seen: Span) -> Span {
        self.pass_queues(head, count, seen);
        let channel_of = |line| self.map.locate(line).channel;
        let mut enters = seen;
        for line in head.moved() {
            let at = channel_of(line);
            let lines = head.moved().filter(|&other| channel_of(other) == at).count() as u64;
            let channel = &mut self.channels[at];
            let mut room =
                |count, seen| channel.room_for(count, seen, self.rules.queue, self.rules.times.burst);
            enters.from = enters.from.max(room(lines, seen.from));
            enters.to = enters.to.max(room(lines * u64::from(count), seen.to));
        }
        Span { from: enters.from, to: enters.to.max(enters.from) }
    }

    /// Let `count` requests like `head` pass the queues of their channels. Buses have no time for other lines while
    /// they idle with a full queue.
    fn pass_queues(&mut self, head: &LineAccess, count: u32, seen: Span) {
        for at in (0..count).map(|request| seen.spread(request, count)) {
            for line in head.moved() {
                let address = self.map.locate(line);
                let channel = &mut self.channels[address.channel];
                let is_write = head.fetched() != Some(line);
                let idle = channel.queue.push(address, is_write, at, &self.rules);
                if idle > 0 {
                    channel.bus.block(at, idle);
                }
            }
        }
    }

    /// Transfer lines of one group over the bus of their channel. Returns when the last is transferred.
    pub fn transfer(&mut self, lines: &Lines) -> Time {
        let address = self.map.locate(lines.first);
        let end = self.channels[address.channel].transfer(address, lines, &self.rules);
        self.end = self.end.max(end);
        end
    }

    /// End of the last transfer.
    pub fn ends_at(&self) -> Time {
        self.end
    }

    /// Bus calendars of all channels.
    pub fn buses(&self) -> impl Iterator<Item = &Calendar> {
        self.channels.iter().map(|channel| &channel.bus)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// One channel of one bank with four places: a line takes a cycle, another row nine.
    fn memory() -> Dram {
        let mut machine = MachineSpec::reference();
        machine.dram = activity::spec::parse(
            "(clock: Core, latency_cycles: 1, queue: 4, channels: 1, banks: 1, row_bytes: 512, interleave_bytes: 64, \
             burst_cycles: 1, cas_cycles: 3, activate_cycles: 4, precharge_cycles: 5)",
            "test",
        )
        .unwrap();
        Dram::new(&machine, &Clocks::new(1e9, 1e9).unwrap())
    }

    /// For how long the bus of a channel idles with a full queue for lines of some rows, which come at once.
    fn idles(rows: &[u32], booked: Time) -> Time {
        let Dram { channels, rules, .. } = memory();
        let mut queue = channels[0].queue.clone();
        let address = |row| RowAddress { channel: 0, bank: 0, row };
        // The first line finds an empty queue, which forgets what is booked.
        queue.push(address(rows[0]), false, 0, &rules);
        queue.booked_idle = booked;
        rows[1..].iter().map(|&row| queue.push(address(row), false, 0, &rules)).sum()
    }

    #[test]
    fn a_bus_idles_with_a_full_queue_while_rows_open() {
        assert_eq!(idles(&[1, 2, 3, 4], 0), 0, "not full");
        // The row of the first opens in four cycles. To close one and open the next takes nine, one of them for a line.
        assert_eq!(idles(&[1, 2, 3, 4, 5], 0), 4);
        assert_eq!(idles(&[1, 2, 3, 4, 5, 6, 7], 0), 4 + 2 * 8);
        // Lines of one row wait for one another only.
        assert_eq!(idles(&[1; 40], 0), 4);
        // The calendar has some of it.
        assert_eq!(idles(&[1, 2, 3, 4, 5, 6, 7], 13), 4 + 2 * 8 - 13);
    }

    #[test]
    fn lines_that_join_a_row_keep_those_of_the_next_in_the_queue() {
        let mut channel = memory().channels.remove(0);
        channel.recent = vec![Waiting::default(); 4].into();
        let line = |bank, row, issued| Waiting { seen: 0, issued, count: 1, bank, row };
        let lines = [line(0, 7, 40), line(0, 8, 60), line(1, 8, 60), line(0, 9, 80)];
        lines.into_iter().for_each(|line| channel.note(line));
        channel.delay(0, 7, 30, 5);
        let issued: Vec<_> = channel.recent.iter().map(|line| line.issued).collect();
        assert_eq!((issued, channel.last_issued), (vec![40, 65, 60, 85], 85));
    }
}
