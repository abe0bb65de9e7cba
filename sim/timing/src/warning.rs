//! What a level is known to be bad at, seen in its own result.

use crate::{Level, Timed};
use warnings::{Code, Warning};

/// A reason why the time of a frame may be inaccurate at its level.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum AccuracyWarning {
    /// A bank of memory opens and closes rows for this long, over the busy time of the busiest unit: `packet` and `bound` reorder
    /// its lines otherwise than `stepped` does.
    MemoryRows(f64),
    /// A packet comes every so many cycles: at `bound`, short ones wait for a unit each, where no unit is busy for long.
    ShortPackets(f64),
}

/// The time of rows, over that of the busiest unit, from which they decide.
const ROWS: f64 = 0.2;
/// Cycles of a packet below which packets are short.
const SHORT: f64 = 2.0;

impl AccuracyWarning {
    /// Those about a frame at `level`.
    pub fn all(level: Level, timed: &Timed) -> Vec<Self> {
        let rows = timed.rows.filter(|&share| share >= ROWS).map(Self::MemoryRows);
        let cycles = timed.cycles as f64 / timed.packets.max(1) as f64;
        let short = (level == Level::Bound && cycles < SHORT).then_some(Self::ShortPackets(cycles));
        rows.into_iter().chain(short).collect()
    }

    /// Its code among the warnings.
    pub const fn code(self) -> Code {
        match self {
            Self::MemoryRows(_) => Code::MemoryRows,
            Self::ShortPackets(_) => Code::ShortPackets,
        }
    }

    /// How bad it is: more than another of its kind is worse.
    pub fn extent(self) -> f64 {
        match self {
            Self::MemoryRows(share) => share,
            Self::ShortPackets(cycles) => -cycles,
        }
    }

    /// What to tell of a frame.
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
