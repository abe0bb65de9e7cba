//! Energy between any two times, and per frame.

mod idle;
mod integral;
mod run;
mod statistics;
mod table;

pub use crate::stats::Spread;
pub use idle::{
    Idle, IdleTooShort, SegmentEnergy, SegmentError, clipped_current, idle_in_frames, negative_power,
};
pub(crate) use integral::Sums;
pub use integral::{FrameEnergy, PowerIntegral, TrueFrame, energies_j, finishes_s, levels_w};
pub use run::{
    FramePart, FramePartError, InverseUnits, RunEnergy, RunEnergyError, RunEnergyOptions, check_parts,
    parts_j,
};
pub use statistics::{
    FrameSummary, Histogram, Pooled, Repeats, WarmUp, mean_over_discarded, outliers, pooled, warm_up, whole,
};
pub use table::{ExtraColumn, FrameTable, TABLE_COLUMNS, TableError};
