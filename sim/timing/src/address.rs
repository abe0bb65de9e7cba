//! Address map of memory: channel, bank and row of a line.

use crate::LINE_BYTES;
use crate::clock::gcd;
use crate::spec::DramSpec;

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
