//! A channel of memory, command by command: first ready, first come (Rixner et al. 2000).
//!
//! In each cycle of its clock a channel takes one column command, which moves a line, and one row command,
//! which closes or opens a row. Each goes to the oldest line whose command the chips can take, so that lines
//! of one direction go on while the bus could not turn yet. With a queue of writes, reads go first until it
//! is full. Refreshes come at fixed times.
//!
//! `stepped` serves all lines so, and `packet`, without refreshes, for the idle time of full queues.

use crate::chips::{ChipTimes, RowAddress};
use crate::clock::Time;
use crate::spec::{DramSpec, MachineSpec};

/// A pending line.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Entry<R> {
    pub seen_at: Time,
    /// Its bank, counted through all ranks.
    bank: usize,
    rank: usize,
    row: u32,
    /// Who waits for it; `None` for writes.
    pub reader: Option<R>,
}

impl<R> Entry<R> {
    /// 0 for a read, 1 for a write.
    fn kind(&self) -> usize {
        usize::from(self.reader.is_none())
    }
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

/// A channel whose readers are `R`.
#[derive(Clone, Debug)]
pub(crate) struct Channel<R> {
    /// In order of arrival.
    entries: Vec<Entry<R>>,
    /// Reads and writes among them.
    held: [usize; 2],
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
pub(crate) struct Places {
    lines: usize,
    /// Places for writes, if they have a queue of their own, and the writes in it that leave no room for
    /// another request.
    writes: Option<[usize; 2]>,
}

impl Places {
    /// The queues of a machine.
    pub fn new(machine: &MachineSpec) -> Self {
        let spec = &machine.dram;
        // The L2 and each level below it may write a line back for a request.
        let most_written = 1 + machine.levels().into_iter().flatten().count();
        Self {
            lines: spec.queue.get() as usize,
            writes: spec
                .write_queue
                .map(|queue| queue.get() as usize)
                .map(|queue| [queue, queue - most_written + 1]),
        }
    }
}

impl<R> Channel<R> {
    /// A channel without lines. `times` are those of its chips.
    pub fn new(spec: &DramSpec, times: &ChipTimes) -> Self {
        let (ranks, banks) = (spec.ranks.get() as usize, spec.banks.get() as usize);
        // Ranks are refreshed in turn.
        let refresh_at = |rank: usize| {
            times.refresh.map_or(Time::MAX, |refresh| refresh.interval * (rank as Time + 1) / ranks as Time)
        };
        Self {
            entries: Vec::new(),
            held: [0; 2],
            banks: vec![Bank::default(); ranks * banks],
            ranks: (0..ranks).map(|rank| Rank { refresh_at: refresh_at(rank), ..Rank::default() }).collect(),
            bus_free_at: 0,
            last_rank: 0,
            writes_at: 0,
            draining: 0,
            serves: None,
            taken: [0; 2],
            taken_at: Time::MAX,
        }
    }

    /// Add a line of a bank, visible from `seen_at` on; `reader` waits for it, if it is read.
    pub fn push(&mut self, RowAddress { bank, row, .. }: RowAddress, reader: Option<R>, seen_at: Time) {
        let rank = bank / (self.banks.len() / self.ranks.len());
        let entry = Entry { seen_at, bank, rank, row, reader };
        self.held[entry.kind()] += 1;
        self.entries.push(entry);
    }

    /// One cycle: a column and a row command, where possible. Returns the line that is moved, if any, and whether
    /// a command was issued.
    pub fn tick(&mut self, now: Time, places: &Places, times: &ChipTimes) -> (Option<Entry<R>>, bool) {
        self.refresh(now, times);
        self.choose(now, places);
        let moved = self.column(now, times);
        let acted = moved.is_some() | self.row(now, times);
        (moved, acted)
    }

    /// Whether a line waits that is visible.
    pub fn is_waited_for(&self, now: Time) -> bool {
        self.entries.iter().any(|entry| entry.seen_at <= now)
    }

    /// Since when lines wait, if some do.
    pub fn waits_since(&self) -> Option<Time> {
        self.entries.iter().map(|entry| entry.seen_at).min()
    }

    /// Whether no line waits.
    pub fn is_empty(&self) -> bool {
        self.entries.is_empty()
    }

    /// When the bus has moved its last line so far.
    pub fn bus_free_at(&self) -> Time {
        self.bus_free_at
    }

    /// Whether the queues have room for so many reads and writes more. A place is free in the cycle after its
    /// line left.
    pub fn has_room(&self, places: &Places, more: [usize; 2], now: Time) -> bool {
        let left = if self.taken_at == now { self.taken } else { [0; 2] };
        let [reads, writes] = std::array::from_fn(|kind| self.held[kind] + left[kind] + more[kind]);
        match places.writes {
            Some([queue, _]) => reads <= places.lines && writes <= queue,
            None => reads + writes <= places.lines,
        }
    }

    /// With a queue of writes: begin to drain it once it is full, or no read waits.
    fn choose(&mut self, now: Time, places: &Places) {
        let Some([_, full]) = places.writes.filter(|_| self.draining == 0) else { return };
        let [_, writes] = self.held;
        let is_read = |entry: &Entry<R>| entry.reader.is_some() && entry.seen_at <= now;
        if writes >= full || !self.entries.iter().any(is_read) {
            self.draining = writes;
        }
        self.serves = Some(self.draining == 0);
    }

    /// Whether a line may be served now.
    fn is_open_to(&self, entry: &Entry<R>, now: Time) -> bool {
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
    fn column_at(&self, entry: &Entry<R>, times: &ChipTimes) -> Time {
        let turned = if entry.reader.is_some() { self.ranks[entry.rank].reads_at } else { self.writes_at };
        let switch = if entry.rank == self.last_rank { 0 } else { times.rank_to_rank };
        self.banks[entry.bank].ready_at[entry.kind()].max(self.bus_free_at + switch).max(turned)
    }

    /// Transfer the oldest line of an open row that the bus can take.
    fn column(&mut self, now: Time, times: &ChipTimes) -> Option<Entry<R>> {
        if self.bus_free_at > now {
            return None;
        }
        let can_move = |entry: &Entry<R>| {
            self.is_open_to(entry, now)
                && self.banks[entry.bank].open == Some(entry.row)
                && self.column_at(entry, times) <= now
        };
        let at = self.entries.iter().position(can_move)?;
        let entry = self.entries.remove(at);
        let kind = entry.kind();
        self.held[kind] -= 1;
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
    fn row_at(&self, entry: &Entry<R>) -> Time {
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
        let can_act = |entry: &&Entry<R>| {
            self.banks[entry.bank].open != Some(entry.row)
                && self.row_at(entry) <= now
                && self.is_open_to(entry, now)
                && !wanted(entry.bank)
        };
        let Some(entry) = self.entries.iter().find(can_act) else { return false };
        let (&Entry { bank, rank, row, .. }, kind) = (entry, entry.kind());
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

    /// Earliest time after `now` at which a command may go.
    pub fn wakes_at(&self, now: Time, times: &ChipTimes) -> Option<Time> {
        let mut first = if self.bus_free_at > now { self.bus_free_at } else { Time::MAX };
        for entry in &self.entries {
            let is_hit = self.banks[entry.bank].open == Some(entry.row);
            let acts = if is_hit { self.column_at(entry, times) } else { self.row_at(entry) };
            for at in [entry.seen_at, acts] {
                first = if at > now { first.min(at) } else { first };
            }
        }
        (first < Time::MAX).then_some(first)
    }
}
