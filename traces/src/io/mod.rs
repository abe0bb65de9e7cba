//! Trace files: Parquet (native), CSV with a JSON text beside it (interchange), and whole-or-nothing writing.

pub mod atomic;
pub mod csv;
mod error;
mod header;
pub mod parquet;
mod timing;

pub use error::{ReadError, WriteError};

/// The names of the columns that files are written with; read without regard to case.
pub const COLUMNS: [&str; 4] = ["time_ns", "time_s", "voltage_V", "current_A"];
