//! Which channel, bank and row a line lies in.

use crate::LINE_BYTES;
use crate::clock::gcd;
use crate::spec::DramSpec;

/// The place of a line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RowPlace {
    /// The channel.
    pub channel: usize,
    /// The bank of the channel.
    pub bank: usize,
    /// The row of the bank.
    pub row: u32,
}

/// Addresses go round the channels in chunks, then along a row, then round the banks.
#[derive(Clone, Copy, Debug)]
pub struct Map {
    lines_per_chunk: Divisor,
    lines_per_row: Divisor,
    /// Lines side by side that share a chunk and a row.
    together: Divisor,
    channels: Divisor,
    banks: Divisor,
}

/// A number at least 1 to divide by, most often a power of two.
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

impl Map {
    /// The map of these chips.
    pub fn new(spec: &DramSpec) -> Self {
        let [chunk, row] =
            [spec.interleave_bytes, spec.row_bytes].map(|bytes| (bytes.get() / LINE_BYTES).max(1));
        Self::with(chunk, row, spec.channels.get(), spec.banks.get())
    }

    fn with(lines_per_chunk: u32, lines_per_row: u32, channels: u32, banks: u32) -> Self {
        let together = gcd(lines_per_chunk.into(), lines_per_row.into()) as u32;
        let [lines_per_chunk, lines_per_row, together, channels, banks] =
            [lines_per_chunk, lines_per_row, together, channels, banks].map(Divisor::new);
        Self { lines_per_chunk, lines_per_row, together, channels, banks }
    }

    /// Lines with the same number here have one place.
    pub fn chunk(&self, line: u32) -> u32 {
        self.together.divide(line).0
    }

    /// The place of line number `line`.
    pub fn place(&self, line: u32) -> RowPlace {
        let (chunk, rest) = self.lines_per_chunk.divide(line);
        let (round, channel) = self.channels.divide(chunk);
        let row = self.lines_per_row.divide(round * self.lines_per_chunk.by + rest).0;
        let (row, bank) = self.banks.divide(row);
        RowPlace { channel: channel as usize, bank: bank as usize, row }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_go_round_channels_then_along_rows_then_round_banks() {
        let map = Map::with(4, 8, 2, 2);
        let at = |line| {
            let RowPlace { channel, bank, row } = map.place(line);
            (channel, bank, row)
        };
        assert_eq!(
            [0, 3, 4, 7, 8, 16].map(at),
            [(0, 0, 0), (0, 0, 0), (1, 0, 0), (1, 0, 0), (0, 0, 0), (0, 1, 0)]
        );
        assert_eq!(at(32), (0, 0, 1));
    }

    #[test]
    fn lines_of_a_chunk_have_one_place() {
        for (chunk, row) in [(4, 8), (8, 4), (6, 4), (1, 5)] {
            let map = Map::with(chunk, row, 3, 2);
            for line in 1..500 {
                let same = map.chunk(line) == map.chunk(line - 1);
                assert!(!same || map.place(line) == map.place(line - 1), "{chunk} {row} {line}");
            }
        }
    }
}
