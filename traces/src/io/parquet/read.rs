//! Reading.

use super::column::{Column, append, damaged, read_groups};
use crate::io::ReadError;
use crate::io::header::{self, Header, KEYS};
use crate::io::timing::{self, Stamps};
use crate::trace::Trace;
use parquet::basic::{Compression, Type as Physical};
use parquet::column::reader::ColumnReader;
use parquet::file::reader::{FileReader, SerializedFileReader};
use std::fs::File;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

/// Reads a trace from columns found by name without regard to case: `voltage_V` and `current_A` (f32 or f64) and
/// `time_ns` (i64) or `time_s` (f32 or f64); the times may be missing if the description states the rate.
///
/// # Errors
/// [`ReadError`] names the file, the row and how to mend it.
pub fn read(path: &Path) -> Result<Trace, ReadError> {
    let file = File::open(path).map_err(|error| ReadError::io(path, error))?;
    let size_bytes = file.metadata().map_err(|error| ReadError::io(path, error))?.len();
    // The decoder panics on some damaged files (found by changing single bytes); what its checks miss must not get out.
    let decoded = catch_unwind(AssertUnwindSafe(|| {
        let file = SerializedFileReader::new(file).map_err(|error| damaged(path, &error))?;
        check_chunks(path, &file, size_bytes)?;
        read_columns(path, &file)
    }));
    decoded.unwrap_or_else(|_| Err(refused(path, "its decoder gave up".to_owned())))
}

fn read_columns(path: &Path, file: &SerializedFileReader<File>) -> Result<Trace, ReadError> {
    let header = description(path, file)?;
    let voltage = find(path, file, "voltage_V")?.ok_or_else(|| missing(path, file, "voltage_V"))?;
    let current = find(path, file, "current_A")?.ok_or_else(|| missing(path, file, "current_A"))?;
    let stamps = read_stamps(path, file, &header)?;
    let voltage_v = read_channel(path, file, voltage)?;
    let current_a = read_channel(path, file, current)?;
    let lengths =
        [voltage_v.len(), current_a.len(), stamps.as_ref().map_or(voltage_v.len(), |stamps| stamps.1)];
    if lengths.iter().any(|&length| length != voltage_v.len()) {
        let reason = format!("its columns have {lengths:?} values");
        return Err(refused(path, reason));
    }
    if voltage_v.is_empty() {
        return Err(ReadError::Empty { path: path.to_owned() });
    }
    header.check_rows(path, voltage_v.len() as u64)?;
    let stamps = stamps.map_or(Stamps::Absent, |stamps| stamps.0);
    let grid = timing::grid(path, &stamps, &header)?;
    Trace::new(voltage_v, current_a, grid.rate_hz, grid.start_s, header.metadata)
        .map_err(|error| ReadError::trace(path, error))
}

/// Holds what the file says of its parts against its size, before the decoder trusts it.
fn check_chunks(path: &Path, file: &SerializedFileReader<File>, size_bytes: u64) -> Result<(), ReadError> {
    for group in file.metadata().row_groups() {
        for chunk in group.columns() {
            if !matches!(chunk.compression(), Compression::UNCOMPRESSED | Compression::SNAPPY) {
                let (column, codec) = (chunk.column_path().string(), chunk.compression().to_string());
                let codec = codec.split('(').next().unwrap_or_default().to_owned();
                return Err(ReadError::Compression { path: path.to_owned(), column, codec });
            }
            let start = chunk
                .dictionary_page_offset()
                .map_or(chunk.data_page_offset(), |page| page.min(chunk.data_page_offset()));
            let range = u64::try_from(start).ok().zip(u64::try_from(chunk.compressed_size()).ok());
            let end = range.and_then(|(start, length)| start.checked_add(length));
            if end.is_none_or(|end| end > size_bytes)
                || chunk.num_values() < 0
                || group.num_rows() != chunk.num_values()
            {
                let reason = format!("column {} is not where the file says", chunk.column_path().string());
                return Err(refused(path, reason));
            }
        }
    }
    Ok(())
}

fn refused(path: &Path, reason: String) -> ReadError {
    ReadError::Damaged { path: path.to_owned(), format: "Parquet", reason }
}

fn description(path: &Path, file: &SerializedFileReader<File>) -> Result<Header, ReadError> {
    let pairs = file.metadata().file_metadata().key_value_metadata().map_or(&[][..], Vec::as_slice);
    let json = KEYS
        .iter()
        .find_map(|key| pairs.iter().find(|pair| pair.key == *key).and_then(|pair| pair.value.as_deref()));
    json.map_or(Ok(Header::default()), |json| header::from_json(path, json))
}

fn find(
    path: &Path,
    file: &SerializedFileReader<File>,
    name: &'static str,
) -> Result<Option<Column>, ReadError> {
    let schema = file.metadata().file_metadata().schema_descr();
    let mut hits = schema
        .columns()
        .iter()
        .enumerate()
        .filter(|(_, column)| column.path().string().eq_ignore_ascii_case(name));
    let Some((index, column)) = hits.next() else { return Ok(None) };
    if hits.next().is_some() {
        return Err(ReadError::DuplicateColumn { path: path.to_owned(), column: name });
    }
    if column.max_rep_level() > 0 {
        let found = "a list".to_owned();
        return Err(ReadError::ColumnType {
            path: path.to_owned(),
            column: name,
            found,
            must: "one number per row",
        });
    }
    Ok(Some(Column { name, index, max_definition: column.max_def_level() }))
}

fn missing(path: &Path, file: &SerializedFileReader<File>, column: &'static str) -> ReadError {
    let names = file.metadata().file_metadata().schema_descr().columns().iter().take(20);
    let found = names.map(|column| column.path().string()).collect::<Vec<_>>().join(", ");
    ReadError::MissingColumn { path: path.to_owned(), column, found }
}

/// The time stamps and how many they are; `None` where there are none and none are needed.
fn read_stamps(
    path: &Path,
    file: &SerializedFileReader<File>,
    header: &Header,
) -> Result<Option<(Stamps, usize)>, ReadError> {
    if let Some(column) = find(path, file, "time_ns")? {
        let mut times = Vec::new();
        read_groups(path, file, column, |reader| match reader {
            ColumnReader::Int64ColumnReader(reader) => append(path, column, reader, &mut times, |time| *time),
            _ => Err(wrong_type(path, file, column, "INT64")),
        })?;
        let count = times.len();
        return Ok(Some((Stamps::Nanoseconds(times), count)));
    }
    if let Some(column) = find(path, file, "time_s")? {
        let mut times = Vec::new();
        read_groups(path, file, column, |reader| match reader {
            ColumnReader::DoubleColumnReader(reader) => {
                append(path, column, reader, &mut times, |time| *time)
            }
            ColumnReader::FloatColumnReader(reader) => {
                append(path, column, reader, &mut times, |time| f64::from(*time))
            }
            _ => Err(wrong_type(path, file, column, "DOUBLE or FLOAT")),
        })?;
        let count = times.len();
        return Ok(Some((Stamps::Seconds(times), count)));
    }
    if header.rate_hz.is_some() { Ok(None) } else { Err(missing(path, file, "time_ns")) }
}

fn read_channel(
    path: &Path,
    file: &SerializedFileReader<File>,
    column: Column,
) -> Result<Vec<f32>, ReadError> {
    let mut values = Vec::new();
    read_groups(path, file, column, |reader| match reader {
        ColumnReader::FloatColumnReader(reader) => append(path, column, reader, &mut values, |value| *value),
        ColumnReader::DoubleColumnReader(reader) => {
            append(path, column, reader, &mut values, |value| *value as f32)
        }
        _ => Err(wrong_type(path, file, column, "FLOAT or DOUBLE")),
    })?;
    Ok(values)
}

fn wrong_type(
    path: &Path,
    file: &SerializedFileReader<File>,
    column: Column,
    must: &'static str,
) -> ReadError {
    let columns = file.metadata().file_metadata().schema_descr();
    let physical: Physical = columns.column(column.index).physical_type();
    ReadError::ColumnType { path: path.to_owned(), column: column.name, found: physical.to_string(), must }
}
