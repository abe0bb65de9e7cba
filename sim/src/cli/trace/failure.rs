//! Errors of the library as failures of the command, with exit codes: 2 for wrong arguments, 1 for the rest.

use traces::frames::MarkError;
use traces::io::{ReadError, WriteError};
use traces::stream::StreamError;
use traces::times::TimesError;

use crate::cli::Failure;

impl From<ReadError> for Failure {
    fn from(error: ReadError) -> Self {
        let wrong = matches!(
            error,
            ReadError::MissingColumn { .. } | ReadError::Format { .. } | ReadError::Conflict { .. }
        ) || matches!(&error, ReadError::Io { source, .. } if source.kind() == std::io::ErrorKind::NotFound);
        Self { message: error.to_string(), code: if wrong { 2 } else { 1 } }
    }
}

impl From<MarkError> for Failure {
    fn from(error: MarkError) -> Self {
        Self { message: error.to_string(), code: 2 }
    }
}

impl From<TimesError> for Failure {
    fn from(error: TimesError) -> Self {
        let failed =
            matches!(error, TimesError::Io { .. } | TimesError::Folder { .. } | TimesError::Empty { .. });
        Self { message: error.to_string(), code: if failed { 1 } else { 2 } }
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

/// Wrong arguments.
pub(super) fn wrong(message: impl Into<String>) -> Failure {
    Failure { message: message.into(), code: 2 }
}
