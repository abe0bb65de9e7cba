//! The native format: Parquet with the columns `time_ns`, `voltage_V` and `current_A`, and one JSON text
//! under the key `trace` in the file's metadata. It is read column by column, in parallel.

mod column;
mod pages;

use std::collections::BTreeMap;
use std::fs::File;
use std::io::Write;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use parquet::basic::{Compression, Encoding, LogicalType, Repetition, Type as Physical};
use parquet::data_type::{DataType, FloatType, Int64Type};
use parquet::errors::ParquetError;
use parquet::file::metadata::KeyValue;
use parquet::file::properties::{EnabledStatistics, WriterProperties};
use parquet::file::reader::FileReader;
use parquet::file::writer::{SerializedFileWriter, SerializedRowGroupWriter};
use parquet::schema::types::{ColumnPath, Type};
use rayon::prelude::*;

use super::columns::{Layout, Opened, RowBatch, RowSource, layout};
use super::recording;
use super::rows::Rows;
use super::samples::{Description, KEYS, TraceChunk, TraceHeader, TraceReader, TraceWriter, to_json};
use super::{CURRENT_A, ReadError, ReadOptions, TIME_NS, VOLTAGE_V, WriteError, atomic};
use crate::trace::Trace;
use column::Column;
use pages::first_page;

pub(crate) use pages::PagedFile;

/// A Parquet file being read.
struct ParquetRows {
    path: PathBuf,
    time: Option<Column>,
    values: Vec<Column>,
    names: Vec<String>,
    rows: u64,
}

fn damaged(path: &Path, reason: String) -> ReadError {
    ReadError::Damaged { path: path.to_owned(), format: "Parquet", reason }
}

fn open(path: &Path) -> Result<PagedFile, ReadError> {
    let file = File::open(path).map_err(|error| ReadError::io(path, error))?;
    PagedFile::new(path, file).map_err(|error| damaged(path, error.to_string()))
}

/// Reads a trace from columns found by name without regard to case: `voltage_V` and `current_A` (f32 or f64)
/// and `time_ns` (i64) or `time_s` (f32 or f64); the times may be missing if the description states the rate.
///
/// # Errors
/// [`ReadError`] names the file, the row and what to do.
pub fn read(path: &Path) -> Result<Trace, ReadError> {
    Ok(recording::load(Rows::open_as(open_rows, path, &ReadOptions::default())?)?.trace)
}

/// Opens a file.
pub(super) fn open_rows(path: &Path, options: &ReadOptions) -> Result<Opened, ReadError> {
    let (rows, layout, description) = guarded(path, || ParquetRows::open(path, options))?;
    Ok(Opened { rows: Box::new(rows), layout, description, time: TIME_NS })
}

/// Result of a step of the decoder, which panics on some damaged files.
fn guarded<T>(path: &Path, step: impl FnOnce() -> Result<T, ReadError>) -> Result<T, ReadError> {
    let panicked = |_| Err(damaged(path, "its decoder gave up".to_owned()));
    catch_unwind(AssertUnwindSafe(step)).unwrap_or_else(panicked)
}

impl ParquetRows {
    fn open(path: &Path, options: &ReadOptions) -> Result<(Self, Layout, Description), ReadError> {
        let file = open(path)?;
        let size_bytes = std::fs::metadata(path).map_err(|error| ReadError::io(path, error))?.len();
        let schema = file.metadata().file_metadata().schema_descr();
        let names: Vec<String> = schema.columns().iter().map(|column| column.path().string()).collect();
        let header = description(path, &file)?;
        let mut layout = layout(path, &names, options)?;
        layout.with_units(path, &field_units(&file))?;
        let is_stamp = |column: usize| {
            matches!(schema.column(column).logical_type_ref(), Some(LogicalType::Timestamp(_)))
        };
        if let Some(time) = layout.time.as_mut() {
            time.has_unit |= is_stamp(time.index);
        }
        check_chunks(path, &file, size_bytes, &layout)?;
        let rows = file.metadata().row_groups().iter().map(|group| group.num_rows().max(0) as u64).sum();
        let column = |picked| Column::open(path, picked, options.repair);
        let time = layout.time.as_ref().map(column).transpose()?;
        let values = layout.values.iter().map(column).collect::<Result<_, _>>()?;
        Ok((Self { path: path.to_owned(), time, values, names, rows }, layout, header))
    }

    fn read(&mut self, limit: usize, batch: &mut RowBatch) -> Result<usize, ReadError> {
        let Self { path, time, values, .. } = self;
        let RowBatch { stamps, values: lists } = batch;
        let (stamped, read) = rayon::join(
            || time.as_mut().map_or(Ok(None), |column| column.times(limit, stamps).map(Some)),
            || {
                let each = values.par_iter_mut().zip(lists);
                each.map(|(column, list)| column.values(limit, list)).collect::<Vec<_>>()
            },
        );
        let read = read.into_iter().collect::<Result<Vec<usize>, _>>()?;
        let rows = read.first().copied().unwrap_or(0);
        if read.iter().chain(&stamped?).any(|&count| count != rows) {
            return Err(damaged(path, "its columns differ in length".to_owned()));
        }
        Ok(rows)
    }
}

impl RowSource for ParquetRows {
    fn names(&self) -> &[String] {
        &self.names
    }

    fn count(&self) -> Option<u64> {
        Some(self.rows)
    }

    fn skip(&mut self, rows: u64) -> Result<(), ReadError> {
        let Self { path, time, values, .. } = self;
        guarded(path, || time.iter_mut().chain(values).try_for_each(|column| column.skip(rows)))
    }

    fn next(&mut self, _: &Layout, limit: usize, batch: &mut RowBatch) -> Result<usize, ReadError> {
        let path = self.path.clone();
        guarded(&path, || self.read(limit, batch))
    }
}

/// The units of fields, by their names.
pub(crate) fn field_units(file: &PagedFile) -> BTreeMap<String, String> {
    let pairs = file.metadata().file_metadata().key_value_metadata().map_or(&[][..], Vec::as_slice);
    let schema = pairs.iter().find(|pair| pair.key == "ARROW:schema").and_then(|pair| pair.value.as_deref());
    schema.map_or_else(BTreeMap::new, column::units)
}

fn description(path: &Path, file: &PagedFile) -> Result<Description, ReadError> {
    let pairs = file.metadata().file_metadata().key_value_metadata().map_or(&[][..], Vec::as_slice);
    let json = KEYS
        .iter()
        .find_map(|key| pairs.iter().find(|pair| pair.key == *key).and_then(|pair| pair.value.as_deref()));
    json.map_or(Ok(Description::default()), |json| Description::from_json(path, json))
}

/// Checks the places of the columns that are read against the size of the file, before the decoder trusts
/// them.
fn check_chunks(path: &Path, file: &PagedFile, size_bytes: u64, layout: &Layout) -> Result<(), ReadError> {
    let read: Vec<usize> = layout.time.iter().chain(&layout.values).map(|picked| picked.index).collect();
    for group in file.metadata().row_groups() {
        for chunk in read.iter().filter_map(|&index| group.columns().get(index)) {
            if !PagedFile::unpacks(chunk.compression()) {
                let (column, codec) = (chunk.column_path().string(), chunk.compression().to_string());
                let codec = codec.split('(').next().unwrap_or_default().to_owned();
                return Err(ReadError::Compression { path: path.to_owned(), column, codec });
            }
            let range =
                u64::try_from(first_page(chunk)).ok().zip(u64::try_from(chunk.compressed_size()).ok());
            let end = range.and_then(|(start, length)| start.checked_add(length));
            if end.is_none_or(|end| end > size_bytes)
                || chunk.num_values() < 0
                || group.num_rows() != chunk.num_values()
            {
                let reason = format!("column {} is not where the file says", chunk.column_path().string());
                return Err(damaged(path, reason));
            }
        }
    }
    Ok(())
}

/// Rows per row group: 20 s at 50 kHz; bounds the memory of readers that take one at a time, and ours.
const GROUP_ROWS: u64 = 1 << 20;
/// The columns, in order.
const FIELDS: [(&str, Physical); 3] =
    [(TIME_NS, Physical::INT64), (VOLTAGE_V, Physical::FLOAT), (CURRENT_A, Physical::FLOAT)];

/// Writes a trace, one row group after the other. The same trace gives the same bytes, whatever pieces it
/// comes in.
///
/// Times are delta encoded, values a dictionary of the device's codes (byte planes where there are too many),
/// both compressed with Snappy, which needs no C.
///
/// # Errors
/// [`WriteError`] if a mark is not finite, the writer fails, or the samples cannot be read.
pub fn write<W: Write + Send>(trace: &dyn TraceReader, out: W) -> Result<(), WriteError> {
    let header = trace.header();
    let json = to_json(&header, false)?;
    write_described(trace, header, json, out)
}

/// Writes a file, whole or not at all.
///
/// # Errors
/// [`WriteError`] names the file.
pub fn save(trace: &dyn TraceReader, path: &Path) -> Result<(), WriteError> {
    atomic::write_trace(path, |out| write(trace, out))
}

/// Without a description, as others write: rate and number of rows are then not stated.
#[cfg(test)]
pub(crate) fn bare(trace: &dyn TraceReader, path: &Path) -> Result<(), WriteError> {
    atomic::write_trace(path, |out| write_described(trace, trace.header(), "{}".to_owned(), out))
}

fn write_described<W: Write + Send>(
    trace: &dyn TraceReader,
    header: TraceHeader,
    json: String,
    out: W,
) -> Result<(), WriteError> {
    let mut writer = Writer::new(header, json, out).map_err(encode)?;
    trace.read_into(&mut writer)?;
    writer.finish().map_err(encode)
}

fn encode(error: ParquetError) -> WriteError {
    WriteError::Encode(error.to_string())
}

/// A file being written: the rows of one group are held until it is full.
struct Writer<W: Write + Send> {
    file: SerializedFileWriter<W>,
    header: TraceHeader,
    /// Number of the current group, by the numbers of its samples: groups that were lost whole are not
    /// written.
    group: u64,
    times_ns: Vec<i64>,
    voltage_v: Vec<f32>,
    current_a: Vec<f32>,
}

impl<W: Write + Send> TraceWriter for Writer<W> {
    fn write(&mut self, chunk: &TraceChunk<'_>) -> Result<(), WriteError> {
        let mut rest = *chunk;
        while !rest.is_empty() && !rest.lost {
            let group = rest.first / GROUP_ROWS;
            if group != self.group {
                self.write_group().map_err(encode)?;
                self.group = group;
            }
            let room = ((group + 1) * GROUP_ROWS - rest.first) as usize;
            let now = rest.part(0, rest.len().min(room));
            self.times_ns
                .extend((now.first..now.first + now.len() as u64).map(|row| self.header.time_ns(row)));
            self.voltage_v.extend_from_slice(now.voltage_v);
            self.current_a.extend_from_slice(now.current_a);
            rest = rest.part(now.len(), rest.len());
        }
        Ok(())
    }
}

impl<W: Write + Send> Writer<W> {
    fn new(header: TraceHeader, json: String, out: W) -> Result<Self, ParquetError> {
        let file = SerializedFileWriter::new(out, Arc::new(schema()?), Arc::new(properties(json)))?;
        let (times_ns, voltage_v, current_a) = Default::default();
        Ok(Self { file, header, group: 0, times_ns, voltage_v, current_a })
    }

    fn write_group(&mut self) -> Result<(), ParquetError> {
        if self.times_ns.is_empty() {
            return Ok(());
        }
        let mut group = self.file.next_row_group()?;
        write_column::<Int64Type, W>(&mut group, &self.times_ns)?;
        write_column::<FloatType, W>(&mut group, &self.voltage_v)?;
        write_column::<FloatType, W>(&mut group, &self.current_a)?;
        group.close()?;
        self.times_ns.clear();
        self.voltage_v.clear();
        self.current_a.clear();
        Ok(())
    }

    fn finish(mut self) -> Result<(), ParquetError> {
        self.write_group()?;
        self.file.close().map(|_| ())
    }
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
        .set_max_row_group_row_count(Some(GROUP_ROWS as usize))
        .set_key_value_metadata(Some(vec![KeyValue::new(KEYS[0].to_owned(), json)]))
        .build()
}
