//! Which channel, bank and row a line lies in.

use crate::LINE_BYTES;
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
    lines_per_chunk: u32,
    lines_per_row: u32,
    channels: u32,
    banks: u32,
}

impl Map {
    /// The map of these chips.
    pub fn new(spec: &DramSpec) -> Self {
        Self {
            lines_per_chunk: (spec.interleave_bytes / LINE_BYTES).max(1),
            lines_per_row: (spec.row_bytes / LINE_BYTES).max(1),
            channels: spec.channels,
            banks: spec.banks,
        }
    }

    /// The place of line number `line`.
    pub fn place(&self, line: u32) -> RowPlace {
        let chunk = line / self.lines_per_chunk;
        let within = chunk / self.channels * self.lines_per_chunk + line % self.lines_per_chunk;
        let row = within / self.lines_per_row;
        RowPlace {
            channel: (chunk % self.channels) as usize,
            bank: (row % self.banks) as usize,
            row: row / self.banks,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_go_round_channels_then_along_rows_then_round_banks() {
        let map = Map { lines_per_chunk: 4, lines_per_row: 8, channels: 2, banks: 2 };
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
}
