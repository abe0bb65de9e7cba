//! Memory chips: channels, banks and rows, first ready first come (Rixner et al. 2000).

use activity::{Event, LineAccess, LineKind, Unit};

use super::meter::{Meter, Rest};
use super::waits::Waits;
use crate::address::Map;
use crate::clock::{Clocks, Time};
use crate::spec::MachineSpec;
use crate::{LINE_BYTES, Recorder};

/// A line on its way.
#[derive(Clone, Copy, Debug)]
struct Entry {
    seen_at: Time,
    bank: usize,
    row: u32,
    /// Who waits for it, and how long it takes from here to there; `None` for a line that is written.
    reader: Option<(u32, Time)>,
}

#[derive(Clone, Copy, Debug, Default)]
struct Bank {
    open: Option<u32>,
    ready_at: Time,
}

#[derive(Clone, Debug)]
struct Channel {
    /// In the order in which they came.
    entries: Vec<Entry>,
    banks: Vec<Bank>,
    bus_free_at: Time,
    taken: usize,
    taken_at: Time,
}

/// All channels.
#[derive(Clone, Debug)]
pub(super) struct Dram {
    channels: Vec<Channel>,
    map: Map,
    queue: usize,
    period: Time,
    burst: Time,
    cas: Time,
    activate: Time,
    precharge: Time,
    latency: Time,
}

impl Dram {
    pub fn new(machine: &MachineSpec, clocks: &Clocks) -> Self {
        let spec = &machine.dram;
        let period = clocks.period(spec.clock);
        let cycles = |count: u32| period * Time::from(count);
        let channel = Channel {
            entries: Vec::new(),
            banks: vec![Bank::default(); spec.banks.get() as usize],
            bus_free_at: 0,
            taken: 0,
            taken_at: Time::MAX,
        };
        Self {
            channels: vec![channel; spec.channels.get() as usize],
            map: Map::new(spec),
            queue: spec.queue.get() as usize,
            period,
            burst: cycles(spec.burst_cycles.get()),
            cas: cycles(spec.cas_cycles.get()),
            activate: cycles(spec.activate_cycles.get()),
            precharge: cycles(spec.precharge_cycles.get()),
            latency: cycles(spec.latency_cycles.get()),
        }
    }

    pub fn period(&self) -> Time {
        self.period
    }

    /// Whether the lines that `access` moves can be queued.
    pub fn has_room(&self, access: &LineAccess, now: Time) -> bool {
        let moved = matches!(access.kind, LineKind::Fetch | LineKind::Drain).then_some(access.line);
        let victim = (access.victim != LineAccess::NONE).then_some(access.victim);
        let channels = [moved, victim].map(|line| line.map(|line| self.map.place(line).channel));
        match channels {
            [Some(a), Some(b)] if a == b => self.channels[a].room(self.queue, now) >= 2,
            _ => channels
                .into_iter()
                .flatten()
                .all(|channel| self.channels[channel].room(self.queue, now) >= 1),
        }
    }

    /// Queues a line to be seen from `seen_at` on; `reader` as in [`Entry`].
    pub fn push(&mut self, line: u32, reader: Option<(u32, Time)>, seen_at: Time) {
        let place = self.map.place(line);
        self.channels[place.channel].entries.push(Entry {
            seen_at,
            bank: place.bank,
            row: place.row,
            reader,
        });
    }

    /// In each channel, a column command and a row command where they can be given. Says whether any was.
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
            if let Some(entry) = self.channels[at].column(now, self.burst) {
                acted = true;
                self.moved(&entry, now, waits, clocks.ps(now), recorder);
            }
            acted |= self.channels[at].row(now, self.activate, self.precharge);
        }
        let busy = self.channels.iter().filter(|channel| channel.bus_free_at > now).count() as u32;
        let asked = |channel: &Channel| channel.entries.iter().any(|entry| entry.seen_at <= now);
        let rest = if self.channels.iter().any(asked) { Rest::Starved(Unit::Dram) } else { Rest::Idle };
        meter.set(Unit::Dram, now, busy, rest, recorder);
        acted
    }

    fn moved(&self, entry: &Entry, now: Time, waits: &mut Waits, at_ps: u64, recorder: &mut Recorder) {
        let event = if entry.reader.is_some() { Event::DramReadBytes } else { Event::DramWriteBytes };
        recorder.event(event, u64::from(LINE_BYTES), at_ps);
        if let Some((wait, way)) = entry.reader {
            waits.arrives(wait, now + self.cas + self.burst + self.latency + way);
        }
    }

    /// When it may have something to do next, if nobody else does anything.
    pub fn wakes_at(&self, now: Time) -> Option<Time> {
        self.channels.iter().flat_map(|channel| channel.wakes(now)).filter(|&at| at > now).min()
    }

    pub fn is_empty(&self) -> bool {
        self.channels.iter().all(|channel| channel.entries.is_empty())
    }

    /// When the last transfer so far ends.
    pub fn ends_at(&self) -> Time {
        self.channels.iter().map(|channel| channel.bus_free_at).max().unwrap_or(0)
    }
}

impl Channel {
    fn room(&self, queue: usize, now: Time) -> usize {
        let just_freed = if self.taken_at == now { self.taken } else { 0 };
        queue.saturating_sub(self.entries.len() + just_freed)
    }

    /// The oldest line whose row is open goes over the bus, where that is free.
    fn column(&mut self, now: Time, burst: Time) -> Option<Entry> {
        if self.bus_free_at > now {
            return None;
        }
        let open = |entry: &Entry| {
            let bank = &self.banks[entry.bank];
            entry.seen_at <= now && bank.open == Some(entry.row) && bank.ready_at <= now
        };
        let at = self.entries.iter().position(open)?;
        self.bus_free_at = now + burst;
        self.taken = if self.taken_at == now { self.taken + 1 } else { 1 };
        self.taken_at = now;
        Some(self.entries.remove(at))
    }

    /// The oldest line whose row is not open opens it, unless another waits for the one that is.
    fn row(&mut self, now: Time, activate: Time, precharge: Time) -> bool {
        let wanted = |bank: usize| {
            self.entries
                .iter()
                .any(|e| e.bank == bank && e.seen_at <= now && self.banks[bank].open == Some(e.row))
        };
        let closed = |entry: &&Entry| {
            let bank = &self.banks[entry.bank];
            entry.seen_at <= now
                && bank.open != Some(entry.row)
                && bank.ready_at <= now
                && !wanted(entry.bank)
        };
        let Some(&Entry { bank, row, .. }) = self.entries.iter().find(closed) else { return false };
        let bank = &mut self.banks[bank];
        bank.ready_at = now + activate + if bank.open.is_some() { precharge } else { 0 };
        bank.open = Some(row);
        true
    }

    fn wakes(&self, now: Time) -> impl Iterator<Item = Time> {
        let entries = self.entries.iter();
        let own = entries
            .flat_map(|entry| [entry.seen_at, self.banks[entry.bank].ready_at])
            .filter(move |&at| at > now);
        own.chain([self.bus_free_at])
    }
}
