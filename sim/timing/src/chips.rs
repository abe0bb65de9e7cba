//! Memory chips, the same for all levels: their constraints in grains, and the channel, bank and row of a line.

use crate::LINE_BYTES;
use crate::clock::{Clocks, Time, gcd};
use crate::spec::DramSpec;

/// Refresh of a rank in grains.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Refresh {
    /// From one to the next.
    pub interval: Time,
    /// Until a row can open again.
    pub busy: Time,
}

/// Times of the commands of a channel, in grains; [`DramSpec`] explains them.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ChipTimes {
    pub burst: Time,
    pub cas: Time,
    /// From the opening of a row to the column command of a read, and of a write.
    pub activate: [Time; 2],
    pub precharge: Time,
    pub latency: Time,
    pub row: Time,
    /// From the column command of a read, and of a write, until its row may close.
    pub to_precharge: [Time; 2],
    pub activate_to_activate: Time,
    pub four_activates: Time,
    pub write_to_read: Time,
    pub read_to_write: Time,
    pub rank_to_rank: Time,
    pub refresh: Option<Refresh>,
}

impl ChipTimes {
    pub fn new(spec: &DramSpec, clocks: &Clocks) -> Self {
        let period = clocks.period(spec.clock);
        let cycles = |count: u32| period * Time::from(count);
        Self {
            burst: cycles(spec.burst_cycles.get()),
            cas: cycles(spec.cas_cycles.get()),
            activate: [spec.activate_cycles, spec.activate_write_cycles.unwrap_or(spec.activate_cycles)]
                .map(|count| cycles(count.get())),
            precharge: cycles(spec.precharge_cycles.get()),
            latency: cycles(spec.latency_cycles.get()),
            row: cycles(spec.row_cycles.get()),
            to_precharge: [spec.read_to_precharge_cycles, spec.write_to_precharge_cycles]
                .map(|count| cycles(count.get())),
            activate_to_activate: cycles(spec.activate_to_activate_cycles.get()),
            four_activates: cycles(spec.four_activates_cycles.get()),
            write_to_read: cycles(spec.write_to_read_cycles.get()),
            read_to_write: cycles(spec.read_to_write_cycles.get()),
            rank_to_rank: cycles(spec.rank_to_rank_cycles.get()),
            refresh: spec.refresh.map(|refresh| Refresh {
                interval: cycles(refresh.interval_cycles.get()),
                busy: cycles(refresh.busy_cycles.get()),
            }),
        }
    }
}

impl ChipTimes {
    /// Least time from the opening of a row to that of the next in its bank, if one line is read or, `kind`
    /// 1, written.
    pub fn row_cycle(&self, kind: usize) -> Time {
        self.precharge + self.holds(kind, 1)
    }

    /// Least time from the opening of a row until it may close, with `count` lines, at least 1, of a kind.
    pub fn holds(&self, kind: usize, count: u32) -> Time {
        let lines = self.burst * Time::from(count - 1);
        self.row.max(self.activate[kind] + lines + self.to_precharge[kind])
    }

    /// When a row may close that is open for lines of a kind from `opened` on, the last issued at `issued`.
    pub fn may_close(&self, kind: usize, opened: Time, issued: Time) -> Time {
        (issued + self.to_precharge[kind]).max((opened + self.row).saturating_sub(self.activate[kind]))
    }

    /// Time between the activations of a rank that opens row after row.
    pub fn spacing(&self) -> Time {
        self.activate_to_activate.max(self.four_activates.div_ceil(4))
    }

    /// Time for which a refresh keeps all rows of a rank closed.
    pub fn refreshes(&self) -> Option<Refresh> {
        self.refresh.map(|refresh| Refresh { busy: self.precharge + refresh.busy, ..refresh })
    }
}

/// How often a bus turns if its queues are full: once each way for so many lines.
#[derive(Clone, Copy, Debug)]
pub(crate) struct TurnPolicy {
    /// Time for which the bus idles for a turn to writes and one back to reads.
    pub pair: Time,
    /// The same if all lines are of one bank, which has to open another row for each turn.
    pub pair_in_bank: Time,
    /// Places for lines, or for writes if they have their own.
    places: f64,
    drains: bool,
    /// Lines after which the share of writes is old.
    pub memory: u64,
}

impl TurnPolicy {
    pub fn new(spec: &DramSpec, times: &ChipTimes) -> Self {
        let places = spec.write_queue.map_or(spec.queue.get(), |queue| queue.get());
        // In a queue of both the place of the last line one way is taken before the turn. Lines come to one
        // of several channels in chunks of both kinds, and wait for the first that is full: half a chunk of
        // the others is missing. However long the chunks are, the bus turns no more than once each way for
        // two of them.
        let chunk = f64::from(spec.interleave_bytes.get().min(spec.row_bytes.get()) / LINE_BYTES);
        let missing = 0.5 + if spec.channels.get() > 1 { chunk } else { 0.0 };
        let pair = times.write_to_read + times.read_to_write;
        let row = |from: usize, to: usize, turn: Time| {
            (times.to_precharge[from] + times.precharge + times.activate[to])
                .saturating_sub(times.burst)
                .max(turn)
        };
        let places = f64::from(places);
        let used =
            if spec.write_queue.is_some() { places } else { (places - missing).max(places.min(chunk / 2.0)) };
        Self {
            pair,
            pair_in_bank: if pair > 0 {
                row(0, 1, times.read_to_write) + row(1, 0, times.write_to_read)
            } else {
                0
            },
            places: used.max(1.0),
            drains: spec.write_queue.is_some(),
            memory: 8 * places as u64,
        }
    }

    /// Turns there and back for so many reads and writes.
    ///
    /// A queue of writes drains once it is full. In a queue of both, `p` places, lines of one way go until
    /// all places wait for the other: with a share `f` of writes `p / (1 - f)` writes and `p / f` reads in
    /// turn.
    pub fn pairs(&self, lines: [u64; 2]) -> f64 {
        self.pairs_per_line(lines) * (lines[0] + lines[1]) as f64
    }

    /// The same for each of the lines.
    pub fn pairs_per_line(&self, [reads, writes]: [u64; 2]) -> f64 {
        if reads == 0 || writes == 0 {
            return 0.0;
        }
        let [reads, writes] = [reads, writes].map(|count| count as f64);
        let lines = reads + writes;
        if self.drains {
            writes / (lines * self.places)
        } else {
            reads * writes / (lines * lines * self.places)
        }
    }
}

/// Address of a line in the memory chips.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RowAddress {
    /// Channel.
    pub channel: usize,
    /// Bank in the channel, counted through its ranks.
    pub bank: usize,
    /// Row in the bank.
    pub row: u32,
}

/// AddressMap from line numbers to channels, banks and rows. Chunks of lines go round the channels, then along a
/// row, then round the banks of a rank and the ranks.
#[derive(Clone, Copy, Debug)]
pub struct AddressMap {
    lines_per_chunk: Divisor,
    lines_per_row: Divisor,
    /// Consecutive lines that share both a chunk and a row.
    lines_per_group: Divisor,
    channels: Divisor,
    banks: Divisor,
}

/// Divisor of at least 1, usually a power of two.
#[derive(Clone, Copy, Debug)]
struct Divisor {
    by: u32,
    shift: Option<u32>,
}

impl Divisor {
    fn new(by: u32) -> Self {
        Self { by, shift: by.is_power_of_two().then(|| by.trailing_zeros()) }
    }

    /// Quotient and remainder.
    fn divide(self, value: u32) -> (u32, u32) {
        match self.shift {
            Some(shift) => (value >> shift, value & (self.by - 1)),
            None => (value / self.by, value % self.by),
        }
    }
}

impl AddressMap {
    /// Address map of the chips in `spec`.
    pub fn new(spec: &DramSpec) -> Self {
        let [chunk, row] =
            [spec.interleave_bytes, spec.row_bytes].map(|bytes| (bytes.get() / LINE_BYTES).max(1));
        Self::with(chunk, row, spec.channels.get(), spec.ranks.get() * spec.banks.get())
    }

    fn with(lines_per_chunk: u32, lines_per_row: u32, channels: u32, banks: u32) -> Self {
        let lines_per_group = gcd(lines_per_chunk.into(), lines_per_row.into()) as u32;
        let [lines_per_chunk, lines_per_row, lines_per_group, channels, banks] =
            [lines_per_chunk, lines_per_row, lines_per_group, channels, banks].map(Divisor::new);
        Self { lines_per_chunk, lines_per_row, lines_per_group, channels, banks }
    }

    /// Group of a line. All lines of a group have the same channel, bank and row.
    pub fn group(&self, line: u32) -> u32 {
        self.lines_per_group.divide(line).0
    }

    /// Channel, bank and row of a line.
    pub fn locate(&self, line: u32) -> RowAddress {
        let (chunk, rest) = self.lines_per_chunk.divide(line);
        let (round, channel) = self.channels.divide(chunk);
        let row = self.lines_per_row.divide(round * self.lines_per_chunk.by + rest).0;
        let (row, bank) = self.banks.divide(row);
        RowAddress { channel: channel as usize, bank: bank as usize, row }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_go_round_channels_then_rows_then_banks() {
        let map = AddressMap::with(4, 8, 2, 2);
        let at = |line| {
            let RowAddress { channel, bank, row } = map.locate(line);
            (channel, bank, row)
        };
        assert_eq!(
            [0, 3, 4, 7, 8, 16].map(at),
            [(0, 0, 0), (0, 0, 0), (1, 0, 0), (1, 0, 0), (0, 0, 0), (0, 1, 0)]
        );
        assert_eq!(at(32), (0, 0, 1));
    }

    #[test]
    fn lines_of_a_group_have_one_address() {
        for (chunk, row) in [(4, 8), (8, 4), (6, 4), (1, 5)] {
            let map = AddressMap::with(chunk, row, 3, 2);
            for line in 1..500 {
                let same = map.group(line) == map.group(line - 1);
                assert!(!same || map.locate(line) == map.locate(line - 1), "{chunk} {row} {line}");
            }
        }
    }
}
