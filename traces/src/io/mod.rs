//! Trace files.
//!
//! [`read`] takes any of them, as [`ReadOptions`] say: Parquet, JLS, CSV, TSV, gzip. [`Rows`] reads in pieces what does not fit
//! into memory. [`csv`] and [`parquet`] write, and read by the native names alone; [`jls`] writes.

pub mod atomic;
mod columns;
pub mod csv;
mod error;
mod header;
pub mod jls;
mod options;
pub mod parquet;
mod read;
mod repair;
mod rows;
mod timing;

pub use error::{ReadError, WriteError};
pub use options::ReadOptions;
pub use read::{Loaded, read};
pub use repair::Repair;
pub use rows::Rows;

/// The names of the columns that files are written with; read without regard to case.
pub const COLUMNS: [&str; 4] = ["time_ns", "time_s", "voltage_V", "current_A"];

pub(crate) use rows::Chunk;
pub(crate) use timing::{Stamps, grid, rounded_rate_hz};
