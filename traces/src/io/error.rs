//! Errors of reading and of writing.

use crate::trace::TraceError;
use std::error::Error;
use std::path::{Path, PathBuf};
use thiserror::Error;

/// Why a trace could not be read. Rows are rows of data, counted from 1 (a CSV header is not counted).
#[derive(Debug, Error)]
pub enum ReadError {
    /// The file could not be opened or read.
    #[error("{path}: cannot read it: {source}; check the path", path = path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// The error of the system.
        source: std::io::Error,
    },
    /// The file is cut off, damaged, or not of its format.
    #[error("{path}: not a whole {format} file ({reason}): it is cut off or damaged; copy or export it again", path = path.display())]
    Damaged {
        /// The file.
        path: PathBuf,
        /// The format, as in `Parquet`.
        format: &'static str,
        /// The error of the reader.
        reason: String,
    },
    /// A format that is not read.
    #[error("{path}: this is {found}, which is not read: {remedy}", path = path.display())]
    Format {
        /// The file.
        path: PathBuf,
        /// The format found.
        found: &'static str,
        /// The remedy.
        remedy: String,
    },
    /// Input that cannot be repaired.
    #[error("{path}: {reason}; cut that part out by hand", path = path.display())]
    Repair {
        /// The file.
        path: PathBuf,
        /// Why.
        reason: String,
    },
    /// A row is damaged or cut off.
    #[error("{path}: row {row}: {reason}: the file is cut off or damaged; fix or drop the row", path = path.display())]
    Row {
        /// The file.
        path: PathBuf,
        /// The row.
        row: u64,
        /// The error.
        reason: String,
    },
    /// The file has fewer or more rows than it says.
    #[error("{path}: {found} rows, but its description says {stated}: the file is cut off or was edited; copy or export it again", path = path.display())]
    Rows {
        /// The file.
        path: PathBuf,
        /// Rows found.
        found: u64,
        /// Rows stated.
        stated: u64,
    },
    /// The recorder lost the end, and no row shows it.
    #[error("{path}: the recorder lost {lost} samples after the last row: cut the recording there and take lost_at_end out of its description, or have them filled with --repair", path = path.display())]
    LostEnd {
        /// The file.
        path: PathBuf,
        /// How many samples.
        lost: u64,
    },
    /// A requested column, rate or start contradicts the file.
    #[error("{path}: {reason}", path = path.display())]
    Conflict {
        /// The file.
        path: PathBuf,
        /// The contradiction, and what to do.
        reason: String,
    },
    /// A unit beside a column's name that does not go with it.
    #[error("{path}: column {column} has the unit {unit} in its metadata, which contradicts that it holds {of}, or the unit in its name: fix one of them", path = path.display())]
    Unit {
        /// The file.
        path: PathBuf,
        /// The column.
        column: String,
        /// The unit.
        unit: String,
        /// The quantity that the column is read as.
        of: &'static str,
    },
    /// A unit beside a column's name that is not known.
    #[error("{path}: column {column} has the unit {unit} in its metadata, which is not known: write s, V, A or W there, or m, u, k with them", path = path.display())]
    UnitUnknown {
        /// The file.
        path: PathBuf,
        /// The column.
        column: String,
        /// The unit.
        unit: String,
    },
    /// More fields than columns in most rows.
    #[error("{path}: more than half of the first {rows} rows have more fields than there are columns: most likely numbers with a decimal comma, which are not read; export them with a point", path = path.display())]
    Surplus {
        /// The file.
        path: PathBuf,
        /// How many rows were looked at.
        rows: u64,
    },
    /// A number with a decimal comma, which might as well be two.
    #[error("{path}: row {row}: {column} is {value:?}: numbers with a decimal comma are not read; export them with a point", path = path.display())]
    DecimalComma {
        /// The file.
        path: PathBuf,
        /// The row.
        row: u64,
        /// The column.
        column: String,
        /// The value found.
        value: String,
    },
    /// A folder where a file has to be.
    #[error("{path}: is a folder: name a file in it", path = path.display())]
    Folder {
        /// The folder.
        path: PathBuf,
    },
    /// A column is missing.
    #[error("{path}: no column {column} (found: {found}): rename or add it", path = path.display())]
    MissingColumn {
        /// The file.
        path: PathBuf,
        /// The column.
        column: String,
        /// The names found.
        found: String,
    },
    /// Two columns have the same name but for case.
    #[error("{path}: column {column} occurs twice (letter case does not count): drop or rename one", path = path.display())]
    DuplicateColumn {
        /// The file.
        path: PathBuf,
        /// The column.
        column: String,
    },
    /// A column is compressed in a way that is not read.
    #[error("{path}: column {column} is compressed with {codec}, which is not read: write it with Zstandard or Snappy", path = path.display())]
    Compression {
        /// The file.
        path: PathBuf,
        /// The column.
        column: String,
        /// The compression.
        codec: String,
    },
    /// A column has a type that cannot be used.
    #[error("{path}: column {column} is {found}, it must be {must}", path = path.display())]
    ColumnType {
        /// The file.
        path: PathBuf,
        /// The column.
        column: String,
        /// Type of the column.
        found: String,
        /// The types that can be read.
        must: &'static str,
    },
    /// The first row under the names holds none of the values: units, most likely.
    #[error("{path}: row 1 holds words, no values: if these are units, take the row out and see that columns are in s, V, A or W", path = path.display())]
    Words {
        /// The file.
        path: PathBuf,
    },
    /// A value is missing, not a number, or not finite.
    #[error("{path}: row {row}: {column} is {value}, not a finite number: fix it, cut it out, or have it filled with --repair", path = path.display())]
    Value {
        /// The file.
        path: PathBuf,
        /// The row.
        row: u64,
        /// The column.
        column: String,
        /// The value found.
        value: String,
    },
    /// A date where seconds have to be.
    #[error("{path}: row {row}: {column} is {value:?}: dates are not read; write times in seconds, for example since the first row, or leave them out and give --rate", path = path.display())]
    Date {
        /// The file.
        path: PathBuf,
        /// The row.
        row: u64,
        /// The column.
        column: String,
        /// The value found.
        value: String,
    },
    /// A time stamp is not later than the one before it.
    #[error(
        "{path}: row {row}: time {time_s} s is not after {before_s} s: sort the rows and drop repeats, or give --rate if \
         times are rounded more coarsely than samples follow each other",
        path = path.display()
    )]
    Unsorted {
        /// The file.
        path: PathBuf,
        /// The row.
        row: u64,
        /// Time of the row, s.
        time_s: f64,
        /// The time of the row before, s.
        before_s: f64,
    },
    /// A time stamp is not where an even rate puts it.
    #[error(
        "{path}: row {row}: time {time_s} s is {off_periods:.2} sample periods off an even rate of {rate_hz} Hz \
         (missing samples or a wrong rate): cut the trace there or resample it", path = path.display()
    )]
    Uneven {
        /// The file.
        path: PathBuf,
        /// The row.
        row: u64,
        /// Time of the row, s.
        time_s: f64,
        /// How far it is off, in sample periods.
        off_periods: f64,
        /// The rate it was compared with, Hz.
        rate_hz: f64,
    },
    /// Signals that do not make up rows.
    #[error(
        "{path}: {one}, but {other}: record them at one rate, with the same first and last sample, or read one alone (its power, or its current with a voltage by \
         specification)", path = path.display()
    )]
    Signals {
        /// The file.
        path: PathBuf,
        /// A signal: samples, first one, rate.
        one: String,
        /// Another.
        other: String,
    },
    /// There is no row.
    #[error("{path}: no samples: give a trace with at least one", path = path.display())]
    Empty {
        /// The file.
        path: PathBuf,
    },
    /// The sample rate is unknown.
    #[error("{path}: a single row and no stated rate: the sample rate is unknown; give --rate, or state rate_hz in the description", path = path.display())]
    NoRate {
        /// The file.
        path: PathBuf,
    },
    /// The JSON description cannot be used.
    #[error("{path}: the JSON description: {reason}: fix or leave out the description", path = path.display())]
    Description {
        /// The file.
        path: PathBuf,
        /// The error.
        reason: String,
    },
    /// The file is no longer what it was a moment ago.
    #[error("{path}: changed while it was read: wait until it is written, or copy it", path = path.display())]
    Changed {
        /// The file.
        path: PathBuf,
    },
    /// The content is no valid trace.
    #[error("{path}: {source}", path = path.display())]
    Trace {
        /// The file.
        path: PathBuf,
        /// The error.
        source: TraceError,
    },
}

impl ReadError {
    pub(super) fn io(path: &Path, source: std::io::Error) -> Self {
        Self::Io { path: path.to_owned(), source }
    }

    pub(super) fn trace(path: &Path, source: TraceError) -> Self {
        match source {
            TraceError::Empty => Self::Empty { path: path.to_owned() },
            TraceError::NotFinite { row, channel, value } => Self::Value {
                path: path.to_owned(),
                row: row as u64,
                column: channel.to_owned(),
                value: value.to_string(),
            },
            source => Self::Trace { path: path.to_owned(), source },
        }
    }
}

/// Why a file could not be written.
#[derive(Debug, Error)]
pub enum WriteError {
    /// The file system refused.
    #[error("{path}: cannot be written: {source}; name a file in a folder that is there and may be written to", path = path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// The error of the system.
        source: std::io::Error,
    },
    /// A path that names no file.
    #[error("{path}: is not a file that can be replaced; name a file", path = path.display())]
    NoName {
        /// The path.
        path: PathBuf,
    },
    /// A name that stands for no format.
    #[error("{path}: its ending is not {endings}", path = path.display())]
    Ending {
        /// The path.
        path: PathBuf,
        /// The endings of the formats that are written.
        endings: String,
    },
    /// Encoding or writing failed.
    #[error("cannot write the trace: {0}")]
    Encode(String),
    /// A rate that a JLS file cannot say.
    #[error(
        "a JLS file holds whole rates from 1 Hz on and {rate_hz} Hz is none to 1 in 1000: write Parquet or CSV, or sample it anew"
    )]
    JlsRate {
        /// The rate, Hz.
        rate_hz: f64,
    },
    /// A time that a JLS file cannot say.
    #[error(
        "a JLS file reaches 8.5e9 s to either side of 2018 and the trace {time_s} s from 1970: write Parquet or CSV"
    )]
    JlsTime {
        /// The time, s from 1970.
        time_s: f64,
    },
    /// A mark is not a finite time.
    #[error("mark {index} is at {time_s} s: a mark must be at a finite time")]
    Mark {
        /// Which mark, from 0.
        index: usize,
        /// Time of the mark, s.
        time_s: f64,
    },
    /// The trace to be written cannot be made.
    #[error(transparent)]
    Source(Box<dyn Error + Send + Sync>),
    /// The samples to be written could not be read.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// Something else failed while a file was written.
    #[error("{path}: {source}", path = path.display())]
    Content {
        /// The file.
        path: PathBuf,
        /// The error.
        source: Box<dyn Error + Send + Sync>,
    },
}
