//! Memory at the level `packet`: a calendar for each bus, and the latest rows of each bank.
//!
//! What the chips allow is in the calendars: a refresh is a pause in them, a row keeps its bank as long as it
//! has to stay open, and every rank has a calendar of its activations. The bus turns as often as it has to
//! with full queues.

use std::collections::HashMap;

use activity::LineAccess;

use super::Span;
use super::calendar::{Calendar, Pauses, Turn};
use crate::chips::{AddressMap, ChipTimes, TurnPolicy};
use crate::clock::{Clocks, Time};
use crate::demand::CLIENTS;
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

/// A row in use: from the line that opened it, or came to it after it had nothing to do, to the last line
/// that came meanwhile.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct OpenRow {
    row: u32,
    /// Time of the first request.
    since: Time,
    /// When it is open.
    opened: Time,
    /// When its last line so far is issued, and when the chips let it close.
    until: Time,
    may_close: Time,
    /// When the next row begins to open.
    closes: Time,
    /// Time on the bus of lines that joined it.
    joined: Time,
}

impl OpenRow {
    const NONE: Self =
        Self { row: u32::MAX, since: 0, opened: 0, until: 0, may_close: 0, closes: 0, joined: 0 };
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
    /// The latest row that was read and that was written, and lines of the channel up to then.
    kinds: [(u32, u64); 2],
}

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

#[derive(Clone, Debug)]
struct Channel {
    bus: Calendar,
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
    /// Their bank in the channel, and their row.
    bank: usize,
    row: u32,
}

impl Channel {
    /// A channel that remembers `groups` groups of lines.
    fn new(bus: Calendar, ranks: Vec<Rank>, banks: Vec<Bank>, groups: usize) -> Self {
        Self {
            bus,
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

/// Lines of one row in a bank.
#[derive(Clone, Copy, Debug)]
struct RowUse {
    row: u32,
    /// When they arrive, when the row is open, and when the last one is issued.
    seen: Time,
    opened: Time,
    issued: Time,
    /// When the chips let the row close.
    may_close: Time,
    /// Their time on the bus.
    work: Time,
}

/// Refreshes of one of `ranks` ranks, which take turns.
fn pauses(times: &ChipTimes, rank: u32, ranks: u32) -> Option<Pauses> {
    let refresh = times.refreshes()?;
    let first = refresh.interval * Time::from(rank + 1) / Time::from(ranks);
    Some(Pauses { first, interval: refresh.interval, length: refresh.busy })
}

/// All channels.
#[derive(Clone, Debug)]
pub(super) struct Dram {
    map: AddressMap,
    channels: Vec<Channel>,
    times: ChipTimes,
    turns: TurnPolicy,
    /// Time between activations of a rank.
    spacing: Time,
    has_ranks: bool,
    queue: u64,
    /// Time of a full queue of lines of one bank, each of another row, and of all lines that can wait in
    /// front of a channel.
    longest_wait: Time,
    longest_way: Time,
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
        let in_ports = CLIENTS.len() as Time * Time::from(machine.l2.queue.get());
        let remembered = (RECENT_GROUPS * queue as usize).min(MAX_RECENT_GROUPS);
        let banks = ranks.iter().flat_map(|rank| vec![bank(rank); banks]).collect();
        let channel = Channel::new(bus.with_pauses(reopening), ranks, banks, remembered);
        Self {
            map: AddressMap::new(spec),
            channels: vec![channel; spec.channels.get() as usize],
            turns: TurnPolicy::new(spec, &times),
            spacing: times.spacing(),
            has_ranks: spec.ranks.get() > 1,
            times,
            queue,
            longest_wait: longest_line * queue,
            longest_way: longest_line * (queue + in_ports),
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
        self.times.cas + self.times.latency
    }

    /// When the first and the last of `count` requests like `head` enter the queues of their channels, which
    /// have room for all lines of a request at once. They come at `seen`.
    pub fn admits(&mut self, head: &LineAccess, count: u32, seen: Span) -> Span {
        let channel_of = |line| self.map.locate(line).channel;
        let mut enters = seen;
        for line in head.moved() {
            let at = channel_of(line);
            let lines = head.moved().filter(|&other| channel_of(other) == at).count() as u64;
            let channel = &mut self.channels[at];
            let mut room = |count, seen| channel.room_for(count, seen, self.queue, self.times.burst);
            enters.from = enters.from.max(room(lines, seen.from));
            enters.to = enters.to.max(room(lines * u64::from(count), seen.to));
        }
        Span { from: enters.from, to: enters.to.max(enters.from) }
    }

    /// Transfer `count` lines of one group over the bus of their channel. The first comes to memory at `came`
    /// and enters the queue at `seen.from`, the last at `seen.to`. Returns when the last is transferred.
    pub fn transfer(
        &mut self,
        (line, is_write): (u32, bool),
        count: u32,
        turn: Turn,
        came: Time,
        seen: Span,
    ) -> Time {
        let kind = usize::from(is_write);
        let (burst, precharge, activate) =
            (self.times.burst, self.times.precharge, self.times.activate[kind]);
        let address = self.map.locate(line);
        let channel = &mut self.channels[address.channel];
        let keeps = self.times.to_precharge[kind];
        let is_alone = channel.is_of(address.bank, self.queue);
        let rank_of_bank = address.bank * channel.ranks.len() / channel.banks.len();
        let rank = &mut channel.ranks[rank_of_bank];
        let bank = &mut channel.banks[address.bank];
        let turns_rows =
            is_alone && self.turns.pair > 0 && bank.turns_rows(kind, address.row, channel.lines, self.queue);
        let work = burst * Time::from(count);
        let open = bank.joins(address.row, seen.from);
        // When the bus idles for the row to open.
        let mut gap = None;
        let opened = match open {
            Some(at) => {
                let open = bank.rows[at];
                // Rows that are waiting already wait for these lines, too.
                if open.closes < Time::MAX {
                    bank.time.reserve_as(turn, open.opened.max(seen.from), work);
                }
                // A row that is requested later in time, though earlier in the stream, does not keep the line
                // waiting.
                if open.since <= seen.from { open.opened } else { seen.from }
            }
            None => {
                bank.dispute(address.row, came, self.longest_way, activate + precharge);
                let at = bank.place(seen.from);
                let before = bank.rows[at];
                let closing = if before == OpenRow::NONE { 0 } else { precharge };
                let opens = closing + activate;
                // The next row can open once the last line is issued and the chips let the row close, at the
                // latest when a full queue has left.
                let held = closing + (activate + work - burst + keeps).max(self.times.row);
                let may_close = if before.since <= seen.from { before.may_close } else { 0 };
                let closes = may_close.max(seen.from).min(seen.from + self.longest_wait);
                let mut begin = bank.time.reserve_as(turn, closes, held).0;
                if self.spacing > 0 {
                    let activates = rank.activations.reserve_as(turn, begin + closing, self.spacing).0;
                    begin = begin.max(activates.saturating_sub(closing));
                }
                bank.rows[at].closes = begin;
                // The bus idles from the end of the last transfer on if the queue has lines of this bank
                // alone. Those that joined their row would fill the gap.
                if is_alone && !turns_rows {
                    channel.bus.block(begin + burst, opens.saturating_sub(burst).min(before.joined));
                }
                gap = Some(begin + burst);
                begin + opens
            }
        };
        let ready = opened.max(seen.from);
        // The calendar of a bus with one rank has its pauses.
        let ready = rank.refresh.filter(|_| self.has_ranks).map_or(ready, |pauses| pauses.after(ready));
        let pair = if turns_rows { self.turns.pair_in_bank } else { self.turns.pair };
        let turned = channel.turns.add(kind, count.into(), pair, &self.turns);
        if turned > 0 {
            // Turns of a bus that waits for one bank are part of the openings of its rows.
            channel.bus.block(gap.filter(|_| turns_rows).unwrap_or(ready), turned);
        }
        let end = channel.bus.reserve_as(turn, ready, work).1.max(seen.to + burst);
        channel.lines += u64::from(count);
        let used = RowUse {
            row: address.row,
            seen: seen.from,
            opened,
            issued: end - burst,
            may_close: (end - burst + keeps).max((opened + self.times.row).saturating_sub(activate)),
            work,
        };
        let delays = open.map(|at| (at, bank.rows[at].closes)).filter(|&(_, closes)| used.issued >= closes);
        if let Some((at, _)) = delays {
            bank.delay(at, work);
        }
        bank.note(used, open);
        if let Some((_, closes)) = delays {
            channel.delay(address.bank, address.row, closes, work);
        }
        channel.note(Waiting {
            seen: seen.from,
            issued: used.issued,
            count: count.into(),
            bank: address.bank,
            row: address.row,
        });
        self.end = self.end.max(end);
        end
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
        Self {
            time,
            rows: vec![OpenRow::NONE; rows].into(),
            former: HashMap::new(),
            disputed: 0,
            kinds: [(u32::MAX, 0); 2],
        }
    }

    /// Count the time `opens` of a row that lines open again which came at `came`, if these and the lines
    /// before of that row may have waited side by side. In what order lines leave that wait at ports and in
    /// the queue of the channel is not known here, as those of a client ahead of others come late in the
    /// stream. So two lines may meet if the second comes no later after the first than all those take,
    /// `longest_way`.
    fn dispute(&mut self, row: u32, came: Time, longest_way: Time, opens: Time) {
        let known = self.rows.iter().filter(|open| open.row == row).map(|open| open.until).max();
        if known.max(self.former.get(&row).copied()).is_some_and(|last| came < last + longest_way) {
            self.disputed += opens;
        }
    }

    /// Note lines of a kind and a row. Whether lines of the other kind, not far from them, are of another row.
    fn turns_rows(&mut self, kind: usize, row: u32, lines: u64, queue: u64) -> bool {
        self.kinds[kind] = (row, lines);
        let (other, last) = self.kinds[1 - kind];
        other != row && other != u32::MAX && lines - last < queue
    }

    /// The rows that open after that at place `at` do so later, as more lines of it go first.
    fn delay(&mut self, at: usize, by: Time) {
        for open in &mut self.rows[..at] {
            open.opened += by;
            open.closes = open.closes.saturating_add(by);
        }
        self.rows[at].closes += by;
    }

    /// Place of the latest row that was requested by `seen`, in time. Rows before it come later, though
    /// earlier in the stream.
    fn place(&self, seen: Time) -> usize {
        self.rows.iter().position(|open| open.since <= seen).unwrap_or(self.rows.len() - 1)
    }

    /// Place of the opening of `row` that a line joins which enters the queue at `seen`; `None` if it has to
    /// open its row.
    ///
    /// First ready first come (Rixner et al. 2000): a line joins pending lines of its row, ahead of older
    /// requests to other rows, until the row closes.
    fn joins(&self, row: u32, seen: Time) -> Option<usize> {
        let latest = self.place(seen);
        let is_open = |&at: &usize| self.rows[at].row == row && seen < self.closed_at(at);
        Some(latest).filter(|&at| self.rows[at].row == row).or_else(|| (0..self.rows.len()).find(is_open))
    }

    /// When the row at a place closes: once the chips let it and the next is requested, even if that can open
    /// only later.
    fn closed_at(&self, at: usize) -> Time {
        let open = &self.rows[at];
        let next = at.checked_sub(1).map_or(Time::MAX, |next| self.rows[next].since);
        open.closes.min(open.may_close.max(next))
    }

    /// Record lines of a row: those that joined the row at `joined`, or opened theirs.
    fn note(&mut self, used: RowUse, joined: Option<usize>) {
        let RowUse { row, seen, opened, issued, may_close, work } = used;
        let at = self.place(seen);
        let begins_anew = |open: &usize| *open == at && seen > self.rows[at].until;
        if let Some(open) = joined.filter(|open| !begins_anew(open)).map(|at| &mut self.rows[at]) {
            open.until = open.until.max(issued);
            open.may_close = open.may_close.max(may_close);
            open.joined += work;
            return;
        }
        let closes = at.checked_sub(1).map_or(Time::MAX, |next| self.rows[next].opened);
        if let Some(oldest) = self.rows.last().filter(|oldest| **oldest != OpenRow::NONE) {
            let until = self.former.entry(oldest.row).or_default();
            *until = oldest.until.max(*until);
        }
        let last = self.rows.len() - 1;
        self.rows.copy_within(at..last, at + 1);
        self.rows[at] = OpenRow { row, since: seen, opened, until: issued, may_close, closes, joined: 0 };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_row_that_opens_again_is_disputed_if_its_lines_may_have_met() {
        let mut bank = Bank::new(Calendar::new(16, 1), 2);
        let used =
            |row, issued| RowUse { row, seen: issued, opened: issued, issued, may_close: issued, work: 1 };
        [(7, 10), (8, 20), (9, 30)].into_iter().for_each(|(row, issued)| bank.note(used(row, issued), None));
        // Row 7 is not among the two remembered any more; row 6 never was open.
        for (row, came, disputed) in [(7, 59, 5), (7, 60, 5), (9, 60, 10), (6, 0, 10)] {
            bank.dispute(row, came, 50, 5);
            assert_eq!(bank.disputed, disputed, "row {row} at {came}");
        }
    }

    #[test]
    fn a_line_joins_others_of_its_row_until_it_closes() {
        let used = |row, [seen, opened, issued]: [Time; 3]| RowUse {
            row,
            seen,
            opened,
            issued,
            may_close: issued,
            work: 1,
        };
        let mut bank = Bank::new(Calendar::new(16, 1), 4);
        let joins = |bank: &Bank, row, seen| bank.joins(row, seen).map(|at| bank.rows[at].opened);
        assert_eq!(joins(&bank, 7, 0), None);
        bank.note(used(7, [0, 4, 10]), None);
        assert_eq!((joins(&bank, 7, 50), joins(&bank, 8, 5)), (Some(4), None));
        // The next row is requested at 5. That of 7 may close at 10, long before the next can open.
        bank.rows[0].closes = 60;
        bank.note(used(8, [5, 64, 70]), None);
        assert_eq!([9, 10].map(|seen| joins(&bank, 7, seen)), [Some(4), None]);
        bank.note(used(7, [9, 4, 30]), Some(1));
        let rows = |bank: &Bank| [0, 1, 2].map(|at: usize| (bank.rows[at].row, bank.rows[at].until));
        assert_eq!(rows(&bank)[..2], [(8, 70), (7, 30)]);
        assert_eq!([29, 30].map(|seen| joins(&bank, 7, seen)), [Some(4), None]);
        // A row that comes earlier in time, and later in the stream.
        bank.note(used(9, [3, 12, 13]), None);
        assert_eq!((rows(&bank), bank.rows[1].closes), ([(8, 70), (9, 13), (7, 30)], 64));
    }

    #[test]
    fn lines_that_join_a_row_keep_those_of_the_next_in_the_queue() {
        let mut channel = Channel::new(Calendar::new(16, 1), Vec::new(), Vec::new(), 4);
        let line = |bank, row, issued| Waiting { seen: 0, issued, count: 1, bank, row };
        let lines = [line(0, 7, 40), line(0, 8, 60), line(1, 8, 60), line(0, 9, 80)];
        lines.into_iter().for_each(|line| channel.note(line));
        channel.delay(0, 7, 30, 5);
        let issued: Vec<_> = channel.recent.iter().map(|line| line.issued).collect();
        assert_eq!((issued, channel.last_issued), (vec![40, 65, 60, 85], 85));
    }

    #[test]
    fn a_row_that_is_used_again_later_keeps_no_line_waiting() {
        let used = |seen| RowUse { row: 7, seen, opened: 4, issued: seen + 6, may_close: seen + 6, work: 1 };
        let mut bank = Bank::new(Calendar::new(16, 1), 4);
        bank.note(used(0), None);
        // While lines of it wait, and then again.
        for seen in [5, 11, 500] {
            let joined = bank.joins(7, seen);
            assert_eq!(joined, Some(0));
            bank.note(used(seen), joined);
        }
        let at = |seen| bank.rows[bank.place(seen)];
        assert_eq!(
            [12, 400, 500].map(|seen| (at(seen).since, at(seen).may_close)),
            [(0, 17), (0, 17), (500, 506)]
        );
    }
}
