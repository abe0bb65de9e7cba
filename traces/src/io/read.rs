//! A whole file into memory.

use super::repair::{Repair, mend};
use super::rows::{Chunk, Rows};
use super::timing::{self, Stamps};
use super::{ReadError, ReadOptions};
use crate::trace::Trace;
use std::path::Path;

/// Rows read at once.
const PIECE: usize = 1 << 18;

/// A trace and what was mended in it.
#[derive(Clone, Debug, PartialEq)]
pub struct Loaded {
    /// The trace.
    pub trace: Trace,
    /// What was mended; always empty unless [`ReadOptions::repair`] asked for it.
    pub repairs: Vec<Repair>,
}

/// All rows of a file as they stand in it.
pub(super) struct Columns {
    pub stamps: Stamps,
    pub voltage_v: Vec<f32>,
    pub current_a: Vec<f32>,
}

/// Reads a trace from Parquet, JLS, CSV or TSV (the latter also with gzip), told apart by their first bytes.
///
/// # Errors
/// [`ReadError`] names the file, the row and how to mend it.
pub fn read(path: &Path, options: &ReadOptions) -> Result<Loaded, ReadError> {
    load(Rows::open(path, options)?)
}

pub(super) fn load(mut rows: Rows) -> Result<Loaded, ReadError> {
    let path = rows.path().to_owned();
    let mut columns = gather(&mut rows)?;
    let read = columns.voltage_v.len();
    if read == 0 {
        return Err(ReadError::Empty { path });
    }
    rows.header.check_rows(&path, read as u64)?;
    let mut repairs: Vec<Repair> = rows.repair().into_iter().collect();
    let mut header = std::mem::take(&mut rows.header);
    if rows.mends() {
        repairs.extend(mend(&path, &mut columns, &mut header)?);
    }
    let Columns { stamps, voltage_v, current_a } = columns;
    let grid = timing::grid(&path, &stamps, &header)?;
    if !rows.mends() {
        header.check_end(&path)?;
    }
    let trace = Trace::new(voltage_v, current_a, grid.rate_hz, grid.start_s, header.metadata)
        .map_err(|error| ReadError::trace(&path, error))?;
    Ok(Loaded { trace, repairs })
}

fn gather(rows: &mut Rows) -> Result<Columns, ReadError> {
    let mut all = Columns { stamps: Stamps::Absent, voltage_v: Vec::new(), current_a: Vec::new() };
    let mut chunk = Chunk::default();
    while rows.append(PIECE, &mut chunk, &mut all.voltage_v, &mut all.current_a)? > 0 {
        match (&mut all.stamps, &chunk.stamps) {
            (Stamps::Nanoseconds(all), Stamps::Nanoseconds(more)) => all.extend_from_slice(more),
            (Stamps::Seconds(all), Stamps::Seconds(more)) => all.extend_from_slice(more),
            (all, more) => *all = more.clone(),
        }
    }
    Ok(all)
}
