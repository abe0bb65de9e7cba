//! Errors of reading.

use crate::format::SAMPLE_TYPES;
use std::io;
use thiserror::Error;

/// Why a JLS file could not be read.
#[derive(Debug, Error)]
pub enum ReadError {
    /// The file could not be opened or read.
    #[error("cannot read the file: {0}")]
    Io(#[from] io::Error),
    /// The file is of a newer version of the format.
    #[error(
        "a JLS recording of a newer version, which is not read: export it with pyjls or the Joulescope UI"
    )]
    NewerVersion,
    /// The file is cut off, damaged, or not a JLS file.
    #[error("not a whole JLS file: {0}")]
    Damaged(String),
    /// The samples of a signal are of a type that is not read.
    #[error("signal {signal} is {found}, it must be {SAMPLE_TYPES}")]
    SampleType {
        /// The signal.
        signal: String,
        /// The type of its samples.
        found: String,
    },
    /// Samples are missing within a signal.
    #[error("signal {signal}: after {samples} samples the numbers of samples jump by {jump}")]
    Gap {
        /// The signal.
        signal: String,
        /// Samples before the gap.
        samples: u64,
        /// How many samples are missing; negative where numbers repeat.
        jump: i128,
        /// Samples per second.
        rate_hz: u32,
    },
}

impl ReadError {
    /// An error at a place in the file.
    pub(crate) fn damaged(at: u64, reason: &str) -> Self {
        Self::Damaged(format!("byte {at}: {reason}"))
    }
}
