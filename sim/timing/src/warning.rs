//! Known inaccuracies of a level, detected in its own results.

use crate::{Level, Timed};
use warnings::{Code, Warning};

/// Reason why the time of a frame may be inaccurate at its level.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum AccuracyWarning {
    /// Row time of the busiest memory bank over the busy time of the busiest unit. `packet` and `bound` order
    /// its lines differently from `stepped`.
    MemoryRows(f64),
    /// Core cycles per packet. At `bound`, short packets wait for one unit each, so no unit is busy for long.
    ShortPackets(f64),
}

/// Smallest row time over busy time that gives a warning.
const MIN_ROW_RATIO: f64 = 0.2;
/// Packets with fewer cycles than this give a warning.
const MIN_PACKET_CYCLES: f64 = 2.0;

impl AccuracyWarning {
    /// All warnings about a frame at `level`.
    pub fn all(level: Level, timed: &Timed) -> Vec<Self> {
        let rows = timed.rows.filter(|&share| share >= MIN_ROW_RATIO).map(Self::MemoryRows);
        let cycles = timed.cycles as f64 / timed.packets.max(1) as f64;
        let short =
            (level == Level::Bound && cycles < MIN_PACKET_CYCLES).then_some(Self::ShortPackets(cycles));
        rows.into_iter().chain(short).collect()
    }

    /// Warning code.
    pub const fn code(self) -> Code {
        match self {
            Self::MemoryRows(_) => Code::MemoryRows,
            Self::ShortPackets(_) => Code::ShortPackets,
        }
    }

    /// Severity, comparable among warnings of one kind; larger is worse.
    pub fn extent(self) -> f64 {
        match self {
            Self::MemoryRows(share) => share,
            Self::ShortPackets(cycles) => -cycles,
        }
    }

    /// Warning about a frame.
    pub fn warning(self, frame: u32, level: Level) -> Warning {
        let name = level.name();
        match self {
            Self::MemoryRows(share) => Warning::new(
                Code::MemoryRows,
                format!(
                    "a bank of memory opens and closes rows for {share:.1} times as long as any unit works in frame {frame}: \
                     times at `{name}` may be far off, as what counts is which lines wait side by side; use --timing \
                     stepped, or let --accuracy choose"
                ),
            ),
            Self::ShortPackets(cycles) => Warning::new(
                Code::ShortPackets,
                format!(
                    "a packet comes every {cycles:.1} cycles of frame {frame}: with packets so short `{name}` is up to a \
                     quarter too short; use --timing packet, or let --accuracy choose"
                ),
            ),
        }
    }
}
