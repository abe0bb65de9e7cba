//! Rows of an open file: the interface that the reader of a format implements.

use super::columns::{Layout, RowBatch};
use super::description::Description;
use super::{ReadError, ReadOptions, Repair};
use std::path::Path;

/// Reader of the rows of a file, in order.
pub(super) trait RowSource: Send {
    /// Names of all columns.
    fn names(&self) -> &[String];

    /// Number of rows, in formats that state it.
    fn count(&self) -> Option<u64> {
        None
    }

    /// Skips rows, up to the end.
    fn skip(&mut self, rows: u64) -> Result<(), ReadError>;

    /// Appends up to `limit` rows to the values of `batch`, as they are in the file; the stamps are those of these rows alone.
    /// Returns the number of rows, 0 at the end.
    fn next(&mut self, layout: &Layout, limit: usize, batch: &mut RowBatch) -> Result<usize, ReadError>;

    /// The repair made when the file was opened and in the rows read since.
    fn repair(&self, _: &Description) -> Option<Repair> {
        None
    }
}

/// A file that was opened.
pub(super) struct Opened {
    pub rows: Box<dyn RowSource>,
    pub layout: Layout,
    pub description: Description,
    /// The column of times that files of this format usually have, for messages.
    pub time: &'static str,
}

/// Opener of files of a format.
pub(super) type Open = fn(&Path, &ReadOptions) -> Result<Opened, ReadError>;
