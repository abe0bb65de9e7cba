//! Reading.

use crate::io::read::load;
use crate::io::{ReadError, ReadOptions, Rows};
use crate::trace::Trace;
use std::path::Path;

/// Reads a trace from columns found by name without regard to case: `voltage_V` and `current_A` (f32 or f64) and
/// `time_ns` (i64) or `time_s` (f32 or f64); the times may be missing if the description states the rate.
///
/// # Errors
/// [`ReadError`] names the file, the row and how to mend it.
pub fn read(path: &Path) -> Result<Trace, ReadError> {
    Ok(load(Rows::parquet(path, &ReadOptions::default())?)?.trace)
}
