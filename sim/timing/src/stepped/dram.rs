//! Memory cycle by cycle: its channels, and readers waiting for lines.

use activity::{Event, LineAccess, Unit};

use super::queue::{Meter, Waits};
use crate::channel::{Channel, Entry, Places};
use crate::chips::{AddressMap, ChipTimes};
use crate::clock::{Clocks, Time};
use crate::recorder::Reason;
use crate::spec::MachineSpec;
use crate::{LINE_BYTES, Recorder};

/// A wait for a line, and the latency from memory to the reader.
#[derive(Clone, Copy, Debug)]
pub(super) struct Reader {
    pub wait: u32,
    pub latency: Time,
}

/// All channels.
#[derive(Clone, Debug)]
pub(super) struct Dram {
    channels: Vec<Channel<Reader>>,
    map: AddressMap,
    places: Places,
    period: Time,
    times: ChipTimes,
}

impl Dram {
    pub fn new(machine: &MachineSpec, clocks: &Clocks) -> Self {
        let spec = &machine.dram;
        let times = ChipTimes::new(spec, clocks);
        Self {
            channels: vec![Channel::new(spec, &times); spec.channels.get() as usize],
            map: AddressMap::new(spec),
            places: Places::new(machine),
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

    /// Add a line, visible from `seen_at` on; `reader` waits for it.
    fn push(&mut self, line: u32, reader: Option<Reader>, seen_at: Time) {
        let address = self.map.locate(line);
        self.channels[address.channel].push(address, reader, seen_at);
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
            let (moved, has_acted) = self.channels[at].tick(now, &self.places, &self.times);
            acted |= has_acted;
            if let Some(entry) = moved {
                self.moved(&entry, now, waits, clocks.ps(now), recorder);
            }
        }
        let busy = self.channels.iter().filter(|channel| channel.bus_free_at() > now).count() as u32;
        let is_waited_for = self.channels.iter().any(|channel| channel.is_waited_for(now));
        let reason = if is_waited_for { Reason::Starved(Unit::Dram) } else { Reason::Idle };
        meter.set(Unit::Dram, now, busy, reason, recorder);
        acted
    }

    fn moved(
        &self,
        entry: &Entry<Reader>,
        now: Time,
        waits: &mut Waits,
        at_ps: u64,
        recorder: &mut Recorder,
    ) {
        let event = if entry.reader.is_some() { Event::DramReadBytes } else { Event::DramWriteBytes };
        recorder.event(event, u64::from(LINE_BYTES), at_ps);
        if let Some(Reader { wait, latency }) = entry.reader {
            let ChipTimes { cas, burst, latency: controller, .. } = self.times;
            waits.arrives(wait, now + cas + burst + controller + latency);
        }
    }

    /// Earliest time of possible work if no other unit acts.
    pub fn wakes_at(&self, now: Time) -> Option<Time> {
        self.channels.iter().filter_map(|channel| channel.wakes_at(now, &self.times)).min()
    }

    pub fn is_empty(&self) -> bool {
        self.channels.iter().all(Channel::is_empty)
    }

    /// End of the last transfer so far.
    pub fn ends_at(&self) -> Time {
        self.channels.iter().map(Channel::bus_free_at).max().unwrap_or(0)
    }
}
