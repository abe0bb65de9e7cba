//! A GPU as a file: clocks, the sizes that decide what happens, and the rates that decide when.

mod rates;
mod spec;

pub use rates::Rates;
pub use spec::{Clock, GpuError, GpuSpec, UnitSpec, Units};
