//! Memory chips command by command: first ready, first come (Rixner et al. 2000), and readers waiting for lines.
//!
//! In each cycle of its clock a channel takes one column command, which moves a line, and one row command,
//! which closes or opens a row. Each goes to the oldest line whose command the chips can take, so that lines
//! of one direction go on while the bus could not turn yet. With a queue of writes, reads go first until it
//! is full. Refreshes come at fixed times.

use activity::{Event, LineAccess, Unit};

use super::queue::{Meter, Waits};
use crate::chips::{AddressMap, ChipTimes};
use crate::clock::{Clocks, Time};
use crate::recorder::Reason;
use crate::spec::MachineSpec;
use crate::{LINE_BYTES, Recorder};

/// A pending line.
#[derive(Clone, Copy, Debug)]
struct Entry {
    seen_at: Time,
    /// Its bank, counted through all ranks.
    bank: usize,
    rank: usize,
    row: u32,
    /// The waiting reader and the latency from here to it; `None` for writes.
    reader: Option<Reader>,
}

impl Entry {
    /// 0 for a read, 1 for a write.
    fn kind(&self) -> usize {
        usize::from(self.reader.is_none())
    }
}

/// A wait for a line, and the latency from memory to the reader.
#[derive(Clone, Copy, Debug)]
pub(super) struct Reader {
    pub wait: u32,
    pub latency: Time,
}

#[derive(Clone, Copy, Debug, Default)]
struct Bank {
    open: Option<u32>,
    /// When its open row takes column commands that read, and that write; without one, when a row can open.
    ready_at: [Time; 2],
    /// When its open row may close.
    closes_at: Time,
}

/// Chips that share the wires of a channel with other ranks.
#[derive(Clone, Copy, Debug, Default)]
struct Rank {
    /// When each of the latest four activations allows another, a ring, and where the oldest is.
    windows: [Time; 4],
    oldest: usize,
    /// When the latest activation allows another.
    activates_at: Time,
    /// When the latest write allows a read.
    reads_at: Time,
    /// When the next refresh is due.
    refresh_at: Time,
}

impl Rank {
    /// When a row can open.
    fn activates_at(&self) -> Time {
        self.activates_at.max(self.windows[self.oldest])
    }

    fn activate(&mut self, now: Time, times: &ChipTimes) {
        self.activates_at = now + times.activate_to_activate;
        self.windows[self.oldest] = now + times.four_activates;
        self.oldest = (self.oldest + 1) % self.windows.len();
    }
}

#[derive(Clone, Debug)]
struct Channel {
    /// In order of arrival.
    entries: Vec<Entry>,
    banks: Vec<Bank>,
    ranks: Vec<Rank>,
    bus_free_at: Time,
    /// The rank of the last line.
    last_rank: usize,
    /// When the latest read allows a write.
    writes_at: Time,
    /// With a queue of writes: writes that go before the next read.
    draining: usize,
    /// Whether reads or writes alone are served; `None` for both.
    serves: Option<bool>,
    /// Reads and writes taken from their queues at `taken_at`.
    taken: [usize; 2],
    taken_at: Time,
}

/// Queues of a channel.
#[derive(Clone, Copy, Debug)]
struct Places {
    lines: usize,
    /// Places for writes, if they have a queue of their own, and the writes in it that leave no room for
    /// another request.
    writes: Option<[usize; 2]>,
}

/// All channels.
#[derive(Clone, Debug)]
pub(super) struct Dram {
    channels: Vec<Channel>,
    map: AddressMap,
    places: Places,
    period: Time,
    times: ChipTimes,
}

impl Dram {
    pub fn new(machine: &MachineSpec, clocks: &Clocks) -> Self {
        let spec = &machine.dram;
        let times = ChipTimes::new(spec, clocks);
        let (ranks, banks) = (spec.ranks.get() as usize, spec.banks.get() as usize);
        // The L2 and each level below it may write a line back for a request.
        let most_written = 1 + machine.levels().into_iter().flatten().count();
        // Ranks are refreshed in turn.
        let refresh_at = |rank: usize| {
            times.refresh.map_or(Time::MAX, |refresh| refresh.interval * (rank as Time + 1) / ranks as Time)
        };
        let channel = Channel {
            entries: Vec::new(),
            banks: vec![Bank::default(); ranks * banks],
            ranks: (0..ranks).map(|rank| Rank { refresh_at: refresh_at(rank), ..Rank::default() }).collect(),
            bus_free_at: 0,
            last_rank: 0,
            writes_at: 0,
            draining: 0,
            serves: None,
            taken: [0; 2],
            taken_at: Time::MAX,
        };
        Self {
            channels: vec![channel; spec.channels.get() as usize],
            map: AddressMap::new(spec),
            places: Places {
                lines: spec.queue.get() as usize,
                writes: spec
                    .write_queue
                    .map(|queue| queue.get() as usize)
                    .map(|queue| [queue, queue - most_written + 1]),
            },
            period: clocks.period(spec.clock),
            times,
        }
    }

    pub fn period(&self) -> Time {
        self.period
    }

    /// Whether the lines moved by `access` fit in the queues.
    pub fn has_room(&self, access: &LineAccess, now: Time) -> bool {
        let channel_of = |line| self.map.locate(line).channel;
        access.moved().map(channel_of).all(|channel| {
            let reads = access.fetched().into_iter().filter(|&line| channel_of(line) == channel).count();
            let writes = access.written().filter(|&line| channel_of(line) == channel).count();
            self.channels[channel].has_room(&self.places, [reads, writes], now)
        })
    }

    /// Add the lines moved by `access`, visible from `seen_at` on; `reader` waits for the line read.
    pub fn push_all(&mut self, access: &LineAccess, reader: Option<Reader>, seen_at: Time) {
        access.written().for_each(|line| self.push(line, None, seen_at));
        if let Some(line) = access.fetched() {
            self.push(line, reader, seen_at);
        }
    }

    /// Add a line, visible from `seen_at` on; `reader` as in [`Entry`].
    fn push(&mut self, line: u32, reader: Option<Reader>, seen_at: Time) {
        let address = self.map.locate(line);
        let channel = &mut self.channels[address.channel];
        let rank = address.bank / (channel.banks.len() / channel.ranks.len());
        channel.entries.push(Entry { seen_at, bank: address.bank, rank, row: address.row, reader });
    }

    /// Issue one column command and one row command per channel, where possible. Returns whether any was
    /// issued.
    pub fn tick(
        &mut self,
        now: Time,
        waits: &mut Waits,
        meter: &mut Meter,
        recorder: &mut Recorder,
        clocks: &Clocks,
    ) -> bool {
        let mut acted = false;
        for at in 0..self.channels.len() {
            let channel = &mut self.channels[at];
            channel.refresh(now, &self.times);
            channel.choose(now, &self.places);
            let moved = channel.column(now, &self.times);
            acted |= moved.is_some() | channel.row(now, &self.times);
            if let Some(entry) = moved {
                self.moved(&entry, now, waits, clocks.ps(now), recorder);
            }
        }
        let busy = self.channels.iter().filter(|channel| channel.bus_free_at > now).count() as u32;
        let is_seen = |channel: &Channel| channel.entries.iter().any(|entry| entry.seen_at <= now);
        let reason =
            if self.channels.iter().any(is_seen) { Reason::Starved(Unit::Dram) } else { Reason::Idle };
        meter.set(Unit::Dram, now, busy, reason, recorder);
        acted
    }

    fn moved(&self, entry: &Entry, now: Time, waits: &mut Waits, at_ps: u64, recorder: &mut Recorder) {
        let event = if entry.reader.is_some() { Event::DramReadBytes } else { Event::DramWriteBytes };
        recorder.event(event, u64::from(LINE_BYTES), at_ps);
        if let Some(Reader { wait, latency }) = entry.reader {
            let ChipTimes { cas, burst, latency: controller, .. } = self.times;
            waits.arrives(wait, now + cas + burst + controller + latency);
        }
    }

    /// Earliest time of possible work if no other unit acts.
    pub fn wakes_at(&self, now: Time) -> Option<Time> {
        let wakes = self.channels.iter().flat_map(|channel| channel.wakes(&self.times));
        wakes.filter(|&at| at > now).min()
    }

    pub fn is_empty(&self) -> bool {
        self.channels.iter().all(|channel| channel.entries.is_empty())
    }

    /// End of the last transfer so far.
    pub fn ends_at(&self) -> Time {
        self.channels.iter().map(|channel| channel.bus_free_at).max().unwrap_or(0)
    }
}

impl Channel {
    /// Whether the queues have room for so many reads and writes more. A place is free in the cycle after its
    /// line left.
    fn has_room(&self, places: &Places, more: [usize; 2], now: Time) -> bool {
        let mut held = if self.taken_at == now { self.taken } else { [0; 2] };
        self.entries.iter().for_each(|entry| held[entry.kind()] += 1);
        let [reads, writes] = std::array::from_fn(|kind| held[kind] + more[kind]);
        match places.writes {
            Some([queue, _]) => reads <= places.lines && writes <= queue,
            None => reads + writes <= places.lines,
        }
    }

    /// With a queue of writes: begin to drain it once it is full, or no read waits.
    fn choose(&mut self, now: Time, places: &Places) {
        let Some([_, full]) = places.writes.filter(|_| self.draining == 0) else { return };
        let writes = self.entries.iter().filter(|entry| entry.reader.is_none()).count();
        let is_read = |entry: &Entry| entry.reader.is_some() && entry.seen_at <= now;
        if writes >= full || !self.entries.iter().any(is_read) {
            self.draining = writes;
        }
        self.serves = Some(self.draining == 0);
    }

    /// Whether a line may be served now.
    fn is_open_to(&self, entry: &Entry, now: Time) -> bool {
        entry.seen_at <= now && self.serves.is_none_or(|reads| entry.reader.is_some() == reads)
    }

    /// Refresh the ranks for which it is due by `now`: once their lines have moved, all rows close together.
    ///
    /// Nothing was issued since it was due, so its times follow from the last commands, even if that is long ago.
    fn refresh(&mut self, now: Time, times: &ChipTimes) {
        let Some(refresh) = times.refresh else { return };
        let banks_per_rank = self.banks.len() / self.ranks.len();
        let banks = self.banks.chunks_mut(banks_per_rank);
        for (at, (rank, banks)) in self.ranks.iter_mut().zip(banks).enumerate() {
            while rank.refresh_at <= now {
                let moved = if at == self.last_rank { self.bus_free_at } else { 0 };
                let begin = banks.iter().fold(rank.refresh_at.max(moved), |begin, bank| {
                    begin.max(if bank.open.is_some() { bank.closes_at } else { bank.ready_at[0] })
                });
                let closing = if banks.iter().any(|bank| bank.open.is_some()) { times.precharge } else { 0 };
                let ready_at = begin + closing + refresh.busy;
                banks.fill(Bank { open: None, ready_at: [ready_at; 2], closes_at: ready_at });
                rank.refresh_at += refresh.interval;
            }
        }
    }

    /// When the column command of a line with an open row can be issued.
    fn column_at(&self, entry: &Entry, times: &ChipTimes) -> Time {
        let turned = if entry.reader.is_some() { self.ranks[entry.rank].reads_at } else { self.writes_at };
        let switch = if entry.rank == self.last_rank { 0 } else { times.rank_to_rank };
        self.banks[entry.bank].ready_at[entry.kind()].max(self.bus_free_at + switch).max(turned)
    }

    /// Transfer the oldest line of an open row that the bus can take.
    fn column(&mut self, now: Time, times: &ChipTimes) -> Option<Entry> {
        if self.bus_free_at > now {
            return None;
        }
        let can_move = |entry: &Entry| {
            self.is_open_to(entry, now)
                && self.banks[entry.bank].open == Some(entry.row)
                && self.column_at(entry, times) <= now
        };
        let at = self.entries.iter().position(can_move)?;
        let entry = self.entries.remove(at);
        let kind = entry.kind();
        (self.bus_free_at, self.last_rank) = (now + times.burst, entry.rank);
        if kind == 0 {
            self.writes_at = self.bus_free_at + times.read_to_write;
        } else {
            self.ranks[entry.rank].reads_at = self.bus_free_at + times.write_to_read;
            self.draining = self.draining.saturating_sub(1);
        }
        let bank = &mut self.banks[entry.bank];
        bank.closes_at = bank.closes_at.max(now + times.to_precharge[kind]);
        if self.taken_at != now {
            (self.taken, self.taken_at) = ([0; 2], now);
        }
        self.taken[kind] += 1;
        Some(entry)
    }

    /// When the row command of a line whose row is not open can be issued: the open row of its bank closes,
    /// or its own opens.
    fn row_at(&self, entry: &Entry) -> Time {
        let bank = &self.banks[entry.bank];
        if bank.open.is_some() {
            bank.closes_at
        } else {
            bank.ready_at[0].max(self.ranks[entry.rank].activates_at())
        }
    }

    /// Open the row of the oldest line that needs and can do so, or close another that it finds open in its
    /// bank, unless a line waits for that one.
    fn row(&mut self, now: Time, times: &ChipTimes) -> bool {
        let wanted = |bank: usize| {
            let open = self.banks[bank].open;
            open.is_some()
                && self
                    .entries
                    .iter()
                    .any(|e| e.bank == bank && open == Some(e.row) && self.is_open_to(e, now))
        };
        let can_act = |entry: &&Entry| {
            self.is_open_to(entry, now)
                && self.banks[entry.bank].open != Some(entry.row)
                && self.row_at(entry) <= now
                && !wanted(entry.bank)
        };
        let Some(entry) = self.entries.iter().find(can_act) else { return false };
        let (Entry { bank, rank, row, .. }, kind) = (*entry, entry.kind());
        let bank = &mut self.banks[bank];
        if bank.open.take().is_some() {
            bank.ready_at = [now + times.precharge; 2];
        } else {
            let ready_at = times.activate.map(|activate| now + activate);
            *bank = Bank { open: Some(row), ready_at, closes_at: now + times.row.max(times.activate[kind]) };
            self.ranks[rank].activate(now, times);
        }
        true
    }

    fn wakes(&self, times: &ChipTimes) -> impl Iterator<Item = Time> {
        let acts = |entry: &Entry| {
            if self.banks[entry.bank].open == Some(entry.row) {
                self.column_at(entry, times)
            } else {
                self.row_at(entry)
            }
        };
        self.entries.iter().flat_map(move |entry| [entry.seen_at, acts(entry)]).chain([self.bus_free_at])
    }
}
