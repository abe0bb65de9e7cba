//! The simulator.

pub mod gpu;
pub mod output;
pub mod timing;
