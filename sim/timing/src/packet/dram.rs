//! Memory chips at the level `packet`: a calendar for each bus, and for each bank the rows it was last asked for.

use super::calendar::Calendar;
use crate::address::Map;
use crate::clock::{Clocks, Time};
use crate::spec::DramSpec;

/// Lines in a stretch of a bus's calendar. Where it waits for a row it is idle in between: longer stretches would lend that time
/// to lines that come too late for it.
const STRETCH: u32 = 4;
/// The same of a bank, which waits for nobody.
const BANK_STRETCH: u32 = 32;

/// Rows of a bank that are remembered.
const ROWS: usize = 4;

/// A row that was opened.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Open {
    row: u32,
    /// When it was asked for.
    since: Time,
    /// When the last line of it so far is issued.
    until: Time,
    /// Lines of its channel that came before it was opened or are its own.
    own: u64,
}

impl Open {
    const NONE: Self = Self { row: u32::MAX, since: 0, until: 0, own: 0 };
}

/// A bank: when it opened rows, and those it opened last, the latest first.
#[derive(Clone, Debug)]
struct Bank {
    time: Calendar,
    rows: [Open; ROWS],
}

#[derive(Clone, Debug)]
struct Channel {
    bus: Calendar,
    banks: Vec<Bank>,
    /// Lines so far.
    lines: u64,
}

/// When lines went over the bus.
#[derive(Clone, Copy, Debug)]
pub(super) struct Moved {
    /// When the last was issued.
    pub issued: Time,
    /// When its data had passed.
    pub data: Time,
}

/// All channels.
#[derive(Clone, Debug)]
pub(super) struct Dram {
    map: Map,
    channels: Vec<Channel>,
    burst: Time,
    cas: Time,
    activate: Time,
    precharge: Time,
    latency: Time,
    backlog: Time,
    queue: u64,
    end: Time,
}

impl Dram {
    pub fn new(spec: &DramSpec, clocks: &Clocks) -> Self {
        let period = clocks.period(spec.clock);
        let cycles = |count: u32| period * Time::from(count);
        let burst = cycles(spec.burst_cycles.get());
        let [bus, time] = [STRETCH, BANK_STRETCH].map(|lines| Calendar::new(burst * Time::from(lines), 1));
        let bank = Bank { time, rows: [Open::NONE; ROWS] };
        let channel = Channel { bus, banks: vec![bank; spec.banks.get() as usize], lines: 0 };
        Self {
            map: Map::new(spec),
            channels: vec![channel; spec.channels.get() as usize],
            burst,
            cas: cycles(spec.cas_cycles.get()),
            activate: cycles(spec.activate_cycles.get()),
            precharge: cycles(spec.precharge_cycles.get()),
            latency: cycles(spec.latency_cycles.get()),
            backlog: burst * Time::from(spec.queue),
            queue: spec.queue.into(),
            end: 0,
        }
    }

    /// Lines of one chunk lie side by side in one row.
    pub fn chunk(&self, line: u32) -> u32 {
        self.map.chunk(line)
    }

    /// How long a full queue takes.
    pub fn backlog(&self) -> Time {
        self.backlog
    }

    /// From the last data to the L2.
    pub fn latency(&self) -> Time {
        self.latency
    }

    /// `count` lines of one chunk over the bus of its channel, the first seen from `seen.0` on and the last from `seen.1`.
    pub fn transfer(&mut self, line: u32, count: u32, seen: (Time, Time)) -> Moved {
        let place = self.map.place(line);
        let channel = &mut self.channels[place.channel];
        let bank = &mut channel.banks[place.bank];
        let work = self.burst * Time::from(count);
        let opens = bank.opens(place.row, seen.0, channel.lines, self.queue);
        let opens = opens.map(|closes| self.activate + if closes { self.precharge } else { 0 });
        // The next row can be opened when the last line has been asked for.
        let held = work - self.burst;
        let closes = bank.closes_at(seen.0).min(seen.0 + self.backlog);
        let ready = opens.map_or(seen.0, |opens| bank.time.take(closes, opens + held).0 + opens);
        let end = channel.bus.take(ready, work).1.max(seen.1 + self.burst);
        bank.note(place.row, (seen.0, end - self.burst), opens.is_some(), (channel.lines, u64::from(count)));
        channel.lines += u64::from(count);
        self.end = self.end.max(end);
        Moved { issued: end - self.burst, data: end + self.cas }
    }

    /// When the last transfer is over.
    pub fn ends_at(&self) -> Time {
        self.end
    }

    /// For how long the bank that is busiest with it opens and closes rows.
    pub fn rows(&self) -> Time {
        let banks = self.channels.iter().flat_map(|channel| &channel.banks);
        let busy = |bank: &Bank| bank.time.stretches().map(|(_, _, used, _)| used).sum();
        banks.map(busy).max().unwrap_or(0)
    }

    /// The buses of all channels.
    pub fn buses(&self) -> impl Iterator<Item = &Calendar> {
        self.channels.iter().map(|channel| &channel.bus)
    }
}

impl Bank {
    /// Whether a row has to be opened for a line that is seen at `seen`, after `lines` lines of the channel, and if so whether
    /// another has to be closed.
    ///
    /// First ready first come (Rixner et al. 2000): where lines of its row are still to go, it goes with them, whatever else was
    /// asked for since; but for a queue full of others, which keeps it from being seen.
    fn opens(&self, row: u32, seen: Time, lines: u64, queue: u64) -> Option<bool> {
        let latest = self.rows[0].row;
        let goes_along = |open: &Open| open.row == row && open.until > seen && lines - open.own < queue;
        (latest != row && !self.rows.iter().any(goes_along)).then_some(latest != u32::MAX)
    }

    /// When the row that is open can be closed for a line that is seen at `seen`: when its own lines have gone. One that is asked
    /// for later in time, though earlier in the stream, does not matter.
    fn closes_at(&self, seen: Time) -> Time {
        let open = &self.rows[0];
        if open.since <= seen { open.until.max(seen) } else { seen }
    }

    /// `count` lines of `row` are seen and go between two moments, after `lines` lines of the channel.
    fn note(&mut self, row: u32, (seen, at): (Time, Time), opened: bool, (lines, count): (u64, u64)) {
        let known = self.rows.iter().position(|open| open.row == row);
        match known {
            Some(known) if !opened => {
                let open = &mut self.rows[known];
                open.until = open.until.max(at);
                open.own += count;
            }
            _ => {
                let until = known.map_or(at, |known| self.rows[known].until.max(at));
                self.rows.copy_within(..known.unwrap_or(ROWS - 1), 1);
                self.rows[0] = Open { row, since: seen, until, own: lines + count };
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_goes_along_with_others_of_its_row_that_have_not_gone() {
        let mut bank = Bank { time: Calendar::new(16, 1), rows: [Open::NONE; ROWS] };
        assert_eq!(bank.opens(7, 0, 0, 4), Some(false));
        bank.note(7, (0, 10), true, (0, 1));
        assert_eq!((bank.opens(7, 50, 9, 4), bank.opens(8, 5, 1, 4)), (None, Some(true)));
        bank.note(8, (5, 20), true, (1, 1));
        assert_eq!((bank.opens(7, 9, 2, 4), bank.opens(7, 10, 2, 4)), (None, Some(true)));
        bank.note(7, (9, 30), false, (2, 1));
        let [latest, before, ..] = bank.rows.map(|open| (open.row, open.until));
        assert_eq!((latest, before), ((8, 20), (7, 30)));
        assert_eq!([3, 6, 25].map(|seen| bank.closes_at(seen)), [3, 20, 25]);
        // Four lines of others have come since.
        bank.note(8, (40, 60), false, (3, 3));
        assert_eq!((bank.opens(7, 9, 5, 4), bank.opens(7, 9, 6, 4)), (None, Some(true)));
    }
}
