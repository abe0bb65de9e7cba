//! Writing the native format.

use crate::io::description::KEYS;
use crate::io::samples::{TraceChunk, TraceHeader, TraceReader, TraceWriter};
use crate::io::{CURRENT_A, TIME_NS, VOLTAGE_V, WriteError, atomic, description};
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
    let json = description::to_json(&header, false)?;
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
