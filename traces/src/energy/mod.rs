//! Energy between any two times, and per frame.

mod frame;
mod integral;
mod summary;
mod table;

pub use frame::{FrameEnergy, TrueFrame};
pub use integral::PowerIntegral;
pub use summary::{Spread, Summary};
pub use table::{FrameTable, TABLE_COLUMNS, TableError};
