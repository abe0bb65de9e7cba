//! Energy between any two times, and per frame.

mod frame;
mod idle;
mod integral;
mod outliers;
mod pieces;
mod pooled;
mod summary;
mod table;
mod warm_up;

pub use frame::{FrameEnergy, TrueFrame};
pub use idle::Idle;
pub use integral::PowerIntegral;
pub use outliers::outliers;
pub(crate) use pieces::Sums;
pub use pieces::{energies_j, finishes_s, levels_w};
pub use pooled::{Pooled, pooled};
pub use summary::{Spread, Summary, whole};
pub use table::{FrameTable, TABLE_COLUMNS, TableError};
pub use warm_up::{WarmUp, mean_over_discarded, warm_up};
