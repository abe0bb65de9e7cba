//! Errors of traces as failures of the command: what was asked wrongly, and what failed.

use traces::frames::MarkError;
use traces::io::{ReadError, WriteError};
use traces::stream::StreamError;

use crate::cli::Failure;

impl From<ReadError> for Failure {
    fn from(error: ReadError) -> Self {
        let asked = matches!(
            error,
            ReadError::MissingColumn { .. } | ReadError::Format { .. } | ReadError::Conflict { .. }
        ) || matches!(&error, ReadError::Io { source, .. } if source.kind() == std::io::ErrorKind::NotFound);
        Self { message: error.to_string(), code: if asked { 2 } else { 1 } }
    }
}

impl From<MarkError> for Failure {
    fn from(error: MarkError) -> Self {
        Self { message: error.to_string(), code: 2 }
    }
}

impl From<StreamError> for Failure {
    fn from(error: StreamError) -> Self {
        match error {
            StreamError::Read(error) => error.into(),
            StreamError::Mark(error) => error.into(),
        }
    }
}

impl From<WriteError> for Failure {
    fn from(error: WriteError) -> Self {
        match error {
            WriteError::Read(error) => error.into(),
            WriteError::Source(error) => wrong(error.to_string()),
            error => Self { message: error.to_string(), code: 1 },
        }
    }
}

/// A mistake of the caller.
pub(super) fn wrong(message: impl Into<String>) -> Failure {
    Failure { message: message.into(), code: 2 }
}
