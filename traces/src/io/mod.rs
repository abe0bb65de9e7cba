//! Trace files: one file or folder per format, with its reader and its writer.
//!
//! [`FORMATS`] lists all of them. [`read`] reads a file, as [`ReadOptions`] say; [`Rows`] reads one in pieces that does not
//! fit into memory. [`save`] and the modules of the formats write a [`TraceReader`]: a trace in memory, or a [`Recording`],
//! a file of any length. [`perfetto`] also writes timelines of frames and units.

pub mod atomic;
mod columns;
pub mod csv;
mod error;
mod formats;
pub mod jls;
pub mod parquet;
pub mod perfetto;
mod recording;
mod repair;
mod rows;
mod samples;
mod sum_of_rails;
mod time_base;

pub use error::{ReadError, WriteError};
pub use formats::{FORMATS, TraceFormat, endings, readable, save};
pub use recording::{Loaded, Recording, open, read, read_csv, read_parquet};
pub use repair::{Repair, RepairKind};
pub use rows::Rows;
#[cfg(test)]
pub(crate) use samples::SplitTrace;
pub use samples::{TraceChunk, TraceHeader, TraceReader, TraceWriter};
pub use sum_of_rails::{SumOfRails, rail_of_sums};

pub(crate) use columns::RowBatch;
pub(crate) use parquet::{PagedFile, field_units};
pub(crate) use time_base::{Stamps, all_apart, grid, rate_of_steps_hz, rate_to_last_row_hz};

/// The names of the columns that files are written with; read without regard to case.
pub const COLUMNS: [&str; 4] = [TIME_NS, TIME_S, VOLTAGE_V, CURRENT_A];
pub(crate) const TIME_NS: &str = "time_ns";
pub(crate) const TIME_S: &str = "time_s";
pub(crate) const VOLTAGE_V: &str = "voltage_V";
pub(crate) const CURRENT_A: &str = "current_A";
pub(crate) const POWER_W: &str = "power_W";

/// How to read a file. By default all rails that the names of the columns show are added up, and nothing is
/// repaired.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ReadOptions {
    /// Rails to add up, by name; all of them if empty.
    pub rails: Vec<String>,
    /// The column of times, by name or by number from 1; by default found by its name.
    pub time: Option<String>,
    /// The column of voltages, likewise.
    pub voltage: Option<String>,
    /// The column of currents, likewise.
    pub current: Option<String>,
    /// A column of powers in place of voltage and current, likewise.
    pub power: Option<String>,
    /// Voltage by specification, V, in place of a measured one.
    pub fixed_voltage_v: Option<f64>,
    /// Samples per second, in place of the rate in the file and of its times, Hz.
    pub rate_hz: Option<f64>,
    /// Left edge of the first sample of a file without times, s.
    pub start_s: Option<f64>,
    /// Delimiter between the fields of a text; by default guessed from its first line.
    pub delimiter: Option<u8>,
    /// Whether the first line of a text holds names; by default it does unless all its fields are numbers.
    pub header: Option<bool>,
    /// Whether to repair non-finite values, unsorted rows and missing samples.
    pub repair: bool,
}

impl ReadOptions {
    /// Whether columns are chosen by hand, so that their names need no meaning.
    fn by_hand(&self) -> bool {
        self.voltage.is_some() || self.current.is_some() || self.power.is_some()
    }
}
