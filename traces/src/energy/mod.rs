//! Energy between any two times, and per frame.

mod histogram;
mod idle;
mod integral;
mod run;
mod segment;
mod statistics;
mod streaming;
mod table;

pub use crate::stats::Spread;
pub use histogram::Histogram;
pub use idle::{Idle, IdleTooShort};
pub use integral::{FrameEnergy, PowerIntegral, TrueFrame};
pub use run::{InverseUnits, Pass, PassError, RunEnergy, RunError, RunOptions, check_passes, passes_j};
pub use segment::{SegmentEnergy, SegmentError};
pub use statistics::{
    Pooled, Repeats, Summary, WarmUp, mean_over_discarded, outliers, pooled, warm_up, whole,
};
pub(crate) use streaming::Sums;
pub use streaming::{energies_j, finishes_s, levels_w};
pub use table::{ExtraColumn, FrameTable, TABLE_COLUMNS, TableError};
