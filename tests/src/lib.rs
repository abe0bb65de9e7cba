//! What the end-to-end tests share: running the command, small input files, reading results.
//!
//! The tests themselves are in `tests/`, a subject in each file, named for what it promises.

mod command;
mod glb;
mod inputs;
mod mts;
mod picture;
mod refusals;
mod results;
mod schema;

pub use command::{Ended, Quintile, Running};
pub use glb::Glb;
pub use inputs::{Inputs, real_scenes, root};
pub use mts::mts;
pub use picture::{Bounds, lit_bounds, mean_where};
pub use refusals::Refusals;
pub use results::{FrameRow, Results, number, without_host};
pub use schema::Schema;

/// The command under test, built by cargo from the source of `quintile`.
#[macro_export]
macro_rules! quintile {
    () => {
        $crate::Quintile::new(env!("CARGO_BIN_EXE_quintile-e2e"))
    };
}
