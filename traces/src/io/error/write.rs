//! What can go wrong as a file is written.

use super::ReadError;
use std::error::Error;
use std::path::PathBuf;
use thiserror::Error;

/// Why a file could not be written.
#[derive(Debug, Error)]
pub enum WriteError {
    /// The file system refused.
    #[error("{path}: cannot be written: {source}; name a file in a folder that is there and may be written to", path = path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
    /// A path that names no file.
    #[error("{path}: is no file that could be written over; name a file", path = path.display())]
    NoName {
        /// The path.
        path: PathBuf,
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
        /// Its time, s.
        time_s: f64,
    },
    /// What is to be written cannot be made.
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
        /// What failed.
        source: Box<dyn Error + Send + Sync>,
    },
}
