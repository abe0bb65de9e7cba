//! Memory chips cycle by cycle: first ready, first come (Rixner et al. 2000), and readers waiting for lines.

use activity::{Event, LineAccess, Unit};

use super::meter::Meter;
use super::queue::Waits;
use crate::address::AddressMap;
use crate::clock::{Clocks, Time};
use crate::spec::MachineSpec;
use crate::stalls::Reason;
use crate::{LINE_BYTES, Recorder};

/// A pending line.
#[derive(Clone, Copy, Debug)]
struct Entry {
    seen_at: Time,
    bank: usize,
    row: u32,
    /// The waiting reader and the latency from here to it; `None` for writes.
    reader: Option<Reader>,
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
    ready_at: Time,
}

#[derive(Clone, Debug)]
struct Channel {
    /// In order of arrival.
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
    map: AddressMap,
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
            map: AddressMap::new(spec),
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

    /// Whether the lines moved by `access` fit in the queues.
    pub fn has_room(&self, access: &LineAccess, now: Time) -> bool {
        let channels = access.moved().map(|line| self.map.locate(line).channel);
        channels.clone().all(|channel| {
            let lines = channels.clone().filter(|other| *other == channel).count();
            self.channels[channel].room(self.queue, now) >= lines
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
        self.channels[address.channel].entries.push(Entry {
            seen_at,
            bank: address.bank,
            row: address.row,
            reader,
        });
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
            if let Some(entry) = self.channels[at].column(now, self.burst) {
                acted = true;
                self.moved(&entry, now, waits, clocks.ps(now), recorder);
            }
            acted |= self.channels[at].row(now, self.activate, self.precharge);
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
            waits.arrives(wait, now + self.cas + self.burst + self.latency + latency);
        }
    }

    /// Earliest time of possible work if no other unit acts.
    pub fn wakes_at(&self, now: Time) -> Option<Time> {
        self.channels.iter().flat_map(|channel| channel.wakes(now)).filter(|&at| at > now).min()
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
    fn room(&self, queue: usize, now: Time) -> usize {
        let just_freed = if self.taken_at == now { self.taken } else { 0 };
        queue.saturating_sub(self.entries.len() + just_freed)
    }

    /// Transfer the oldest line of an open row, if the bus is free.
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

    /// Open the row of the oldest line whose row is closed, unless a line waits for the open row of that
    /// bank.
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
