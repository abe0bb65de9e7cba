//! Energy between any two times, and per frame.

mod idle;
mod integral;
mod run;
mod statistics;
mod streaming;
mod table;

pub use crate::stats::Spread;
pub use idle::{Idle, IdleTooShort};
pub use integral::{FrameEnergy, PowerIntegral, TrueFrame};
pub use run::{InverseUnits, Pass, RunEnergy, RunError, RunOptions, passes_j};
pub use statistics::{Pooled, Summary, WarmUp, mean_over_discarded, outliers, pooled, warm_up, whole};
pub(crate) use streaming::Sums;
pub use streaming::{energies_j, finishes_s, levels_w};
pub use table::{ExtraColumn, FrameTable, TABLE_COLUMNS, TableError};
