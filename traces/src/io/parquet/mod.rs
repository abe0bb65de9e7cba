//! The native format: Parquet with the columns `time_ns`, `voltage_V` and `current_A`, and one JSON text
//! under the key `trace` in the file's metadata. It is read column by column, in parallel.

mod arrow_schema;
mod column;
mod pages;
mod write;

use super::columns::{Layout, RowBatch, layout};
use super::description::{Description, KEYS};
use super::source::{Opened, RowSource};
use super::{ReadError, ReadOptions, TIME_NS};
use column::Column;
pub(crate) use pages::PagedFile;
use pages::first_page;
use parquet::file::reader::FileReader;
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::fs::File;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
#[cfg(test)]
pub(crate) use write::bare;
pub use write::{save, write};

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
    schema.map_or_else(BTreeMap::new, arrow_schema::units)
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
