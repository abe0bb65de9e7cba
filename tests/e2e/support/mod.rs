//! Helpers of the end-to-end tests: running the command, small input files, reading results.

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
pub use inputs::{Inputs, real_scene, root};
pub use mts::mts;
pub use picture::{lit_bounds, mean_where};
pub use refusals::Refusals;
pub use results::{Results, number, without_host};
pub use schema::Schema;

/// The command under test.
pub fn quintile() -> Quintile {
    Quintile::new(env!("CARGO_BIN_EXE_quintile"))
}
