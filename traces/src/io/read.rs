//! Reading a whole file.

use super::columns::RowBatch;
use super::recording::Recording;
use super::repair::{Columns, Repair, repair_rows};
use super::rows::Rows;
use super::samples::TraceReader;
use super::time_base::Stamps;
use super::{ReadError, ReadOptions, time_base};
use crate::trace::Trace;
use std::path::Path;

/// Rows read at once.
const PIECE_ROWS: usize = 1 << 18;

/// A trace and its repairs.
#[derive(Clone, Debug, PartialEq)]
pub struct Loaded {
    /// The trace.
    pub trace: Trace,
    /// The repairs; always empty without [`ReadOptions::repair`].
    pub repairs: Vec<Repair>,
}

/// Reads a trace in any of the [`FORMATS`](super::FORMATS) that are read; the first bytes of the file decide which.
///
/// # Errors
/// [`ReadError`] names the file, the row and what to do.
pub fn read(path: &Path, options: &ReadOptions) -> Result<Loaded, ReadError> {
    load(Rows::open(path, options)?)
}

/// Opens a trace of any length: as a [`Recording`], or in memory where it has to be repaired, as repairs
/// depend on all of it. Also returns the repairs.
///
/// # Errors
/// As [`read`].
pub fn open(path: &Path, options: &ReadOptions) -> Result<(Box<dyn TraceReader>, Vec<Repair>), ReadError> {
    match Recording::open(path, options) {
        Ok(recording) => {
            let repairs = recording.repairs().to_vec();
            Ok((Box::new(recording), repairs))
        }
        Err(_) if options.repair => {
            let Loaded { trace, repairs } = read(path, options)?;
            Ok((Box::new(trace), repairs))
        }
        Err(error) => Err(error),
    }
}

/// Reads a CSV file, and its description if there is one at
/// [`csv::description_path`](super::csv::description_path) or
/// [`csv::sidecar_path`](super::csv::sidecar_path).
///
/// Columns are found by name without regard to case, in any order among others; `time_s` may be missing if
/// the description states the rate. Without a description the rate is that of the time stamps.
///
/// # Errors
/// [`ReadError`] names the file, the row and what to do.
pub fn read_csv(path: &Path) -> Result<Trace, ReadError> {
    Ok(load(Rows::open_as(super::csv::open_rows, path, &ReadOptions::default())?)?.trace)
}

/// Reads a trace from columns found by name without regard to case: `voltage_V` and `current_A` (f32 or f64)
/// and `time_ns` (i64) or `time_s` (f32 or f64); the times may be missing if the description states the rate.
///
/// # Errors
/// [`ReadError`] names the file, the row and what to do.
pub fn read_parquet(path: &Path) -> Result<Trace, ReadError> {
    Ok(load(Rows::open_as(super::parquet::open_rows, path, &ReadOptions::default())?)?.trace)
}

fn load(mut rows: Rows) -> Result<Loaded, ReadError> {
    let path = rows.path().to_owned();
    let mut columns = gather(&mut rows)?;
    let read = columns.voltage_v.len();
    if read == 0 {
        return Err(ReadError::Empty { path });
    }
    rows.description.check_rows(&path, read as u64)?;
    let mut repairs: Vec<Repair> = rows.repair().into_iter().collect();
    let mut description = std::mem::take(&mut rows.description);
    if rows.repairs_input() {
        repairs.extend(repair_rows(&path, &rows.channel_names(), &mut columns, &mut description)?);
    }
    let Columns { stamps, voltage_v, current_a } = columns;
    let grid = time_base::grid(&path, &stamps, &description)?;
    if !rows.repairs_input() {
        description.check_end(&path)?;
    }
    rows.check_finite(&voltage_v, &current_a, 0)?;
    let trace = Trace::new(voltage_v, current_a, grid.rate_hz, grid.start_s, description.metadata)
        .map_err(|error| ReadError::trace(&path, error))?;
    Ok(Loaded { trace, repairs })
}

fn gather(rows: &mut Rows) -> Result<Columns, ReadError> {
    let mut all = Columns { stamps: Stamps::Absent, voltage_v: Vec::new(), current_a: Vec::new() };
    let mut batch = RowBatch::default();
    while rows.append(PIECE_ROWS, &mut batch, &mut all.voltage_v, &mut all.current_a)? > 0 {
        match (&mut all.stamps, &batch.stamps) {
            (Stamps::Nanoseconds(all), Stamps::Nanoseconds(more)) => all.extend_from_slice(more),
            (Stamps::Seconds(all), Stamps::Seconds(more)) => all.extend_from_slice(more),
            (all, more) => *all = more.clone(),
        }
    }
    Ok(all)
}
