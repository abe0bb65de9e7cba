//! Trace files.
//!
//! [`read`] takes any of them, as [`ReadOptions`] say: Parquet, JLS, CSV, TSV, gzip. [`Rows`] reads in pieces what does not fit
//! into memory. [`csv`], [`parquet`] and [`jls`] write, and the first two read by the native names alone; what they write is a
//! [`Source`]: a trace in memory, or a [`Recording`], a file of any length.

pub mod atomic;
mod columns;
pub mod csv;
mod error;
mod header;
pub mod jls;
mod options;
pub mod parquet;
mod read;
mod recording;
mod repair;
mod rows;
mod source;
mod timing;
pub mod unfinished;

pub use error::{ReadError, WriteError};
pub use options::ReadOptions;
pub use read::{Loaded, read, read_csv, read_parquet};
pub use recording::Recording;
pub use repair::Repair;
pub use rows::{Rows, SumOfRails, rail_of_sums};
#[cfg(test)]
pub(crate) use source::Cut;
pub use source::{Heading, Sink, Source, Stretch};

/// The names of the columns that files are written with; read without regard to case.
pub const COLUMNS: [&str; 4] = ["time_ns", "time_s", "voltage_V", "current_A"];

pub(crate) use jls::crc32c;
pub(crate) use rows::{Chunk, PackedFile, field_units};
pub(crate) use timing::{Stamps, all_apart, grid, rounded_rate_hz};
