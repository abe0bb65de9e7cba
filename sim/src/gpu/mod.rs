//! A GPU as a file: clocks, the sizes that decide what happens, and the rates that decide when.

mod spec;

pub use spec::{GpuError, GpuSpec, PowerFiles};
