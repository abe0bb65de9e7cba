//! Which model of time a run uses.
//!
//! The models are in the package `timing`; here a level is a name and a clock that packets are pushed into.

mod doubt;
mod level;
mod method;

pub use doubt::Doubt;
pub use level::{FrameClock, Level, TimingError};
pub use method::{Method, Sampling};
