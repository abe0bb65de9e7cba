//! Writing.

use crate::io::header::{self, KEYS};
use crate::io::{WriteError, atomic};
use crate::trace::Trace;
use parquet::basic::{Compression, Encoding, Repetition, Type as Physical};
use parquet::data_type::{DataType, FloatType, Int64Type};
use parquet::errors::ParquetError;
use parquet::file::metadata::KeyValue;
use parquet::file::properties::{EnabledStatistics, WriterProperties};
use parquet::file::writer::{SerializedFileWriter, SerializedRowGroupWriter};
use parquet::schema::types::{ColumnPath, Type};
use std::io::Write;
use std::path::Path;
use std::sync::Arc;

/// Rows per row group: 20 s at 50 kHz; bounds the memory of readers that take one at a time.
const GROUP_ROWS: usize = 1 << 20;
/// The columns, in order.
const FIELDS: [(&str, Physical); 3] =
    [("time_ns", Physical::INT64), ("voltage_V", Physical::FLOAT), ("current_A", Physical::FLOAT)];

/// Writes a trace. The same trace gives the same bytes.
///
/// Times are delta encoded, values a dictionary of the device's codes (byte planes where there are too many), both
/// compressed with Snappy, which needs no C.
///
/// # Errors
/// [`WriteError`] if a mark is not finite or the writer fails.
pub fn write<W: Write + Send>(trace: &Trace, out: W) -> Result<(), WriteError> {
    let json = header::to_json(trace, false)?;
    write_file(trace, json, out).map_err(|error| WriteError::Encode(error.to_string()))
}

/// Writes a file, whole or not at all.
///
/// # Errors
/// [`WriteError`] names the file.
pub fn save(trace: &Trace, path: &Path) -> Result<(), WriteError> {
    atomic::write_file(path, |out| write(trace, out))
}

/// Without a description, as others write: rate and number of rows are then not stated.
#[cfg(test)]
pub(crate) fn bare(trace: &Trace, path: &Path) -> Result<(), WriteError> {
    let encode = |error: ParquetError| WriteError::Encode(error.to_string());
    atomic::write_file(path, |out| write_file(trace, "{}".to_owned(), out).map_err(encode))
}

fn write_file<W: Write + Send>(trace: &Trace, json: String, out: W) -> Result<(), ParquetError> {
    let mut writer = SerializedFileWriter::new(out, Arc::new(schema()?), Arc::new(properties(json)))?;
    for start in (0..trace.samples()).step_by(GROUP_ROWS) {
        let rows: Vec<usize> = trace.kept(start..trace.samples().min(start + GROUP_ROWS)).collect();
        if rows.is_empty() {
            continue;
        }
        let of = |channel: &[f32]| -> Vec<f32> { rows.iter().map(|&row| channel[row]).collect() };
        let mut group = writer.next_row_group()?;
        let times_ns: Vec<i64> = rows.iter().map(|&row| trace.time_ns(row)).collect();
        write_column::<Int64Type, W>(&mut group, &times_ns)?;
        write_column::<FloatType, W>(&mut group, &of(trace.voltage_v()))?;
        write_column::<FloatType, W>(&mut group, &of(trace.current_a()))?;
        group.close()?;
    }
    writer.close()?;
    Ok(())
}

fn write_column<T: DataType, W: Write + Send>(
    group: &mut SerializedRowGroupWriter<'_, W>,
    values: &[T::T],
) -> Result<(), ParquetError> {
    let mut column =
        group.next_column()?.ok_or_else(|| ParquetError::General("no column left".to_owned()))?;
    column.typed::<T>().write_batch(values, None, None)?;
    column.close()
}

fn schema() -> Result<Type, ParquetError> {
    let field = |(name, physical): (&str, Physical)| {
        Type::primitive_type_builder(name, physical)
            .with_repetition(Repetition::REQUIRED)
            .build()
            .map(Arc::new)
    };
    let fields = FIELDS.into_iter().map(field).collect::<Result<Vec<_>, _>>()?;
    Type::group_type_builder("trace").with_fields(fields).build()
}

fn properties(json: String) -> WriterProperties {
    let time = ColumnPath::from(FIELDS[0].0);
    WriterProperties::builder()
        // Fixed, so that the bytes do not change with the version of the library.
        .set_created_by("quintile traces".to_owned())
        .set_compression(Compression::SNAPPY)
        .set_encoding(Encoding::BYTE_STREAM_SPLIT)
        .set_column_dictionary_enabled(time.clone(), false)
        .set_column_encoding(time, Encoding::DELTA_BINARY_PACKED)
        .set_statistics_enabled(EnabledStatistics::Chunk)
        .set_max_row_group_row_count(Some(GROUP_ROWS))
        .set_key_value_metadata(Some(vec![KeyValue::new(KEYS[0].to_owned(), json)]))
        .build()
}
