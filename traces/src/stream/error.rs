//! What can go wrong.

use crate::frames::MarkError;
use crate::io::ReadError;
use thiserror::Error;

/// Why a file could not be analysed.
#[derive(Debug, Error)]
pub enum StreamError {
    /// The file.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// The marks.
    #[error(transparent)]
    Mark(#[from] MarkError),
}
