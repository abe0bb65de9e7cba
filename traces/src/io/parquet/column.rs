//! One column, over all row groups.

use crate::io::ReadError;
use parquet::column::reader::{ColumnReader, ColumnReaderImpl};
use parquet::data_type::DataType;
use parquet::errors::ParquetError;
use parquet::file::reader::{FileReader, SerializedFileReader};
use std::fs::File;
use std::path::Path;

/// Values decoded at once. What a file claims about its length is never allocated on trust.
const BATCH: usize = 1 << 16;

/// A column that was found by name.
#[derive(Clone, Copy)]
pub(super) struct Column {
    pub name: &'static str,
    pub index: usize,
    /// 1 if values may be missing.
    pub max_definition: i16,
}

/// Reads all values of a column; `take` receives each row group's reader and appends to what it collects.
pub(super) fn read_groups(
    path: &Path,
    file: &SerializedFileReader<File>,
    column: Column,
    mut take: impl FnMut(ColumnReader) -> Result<(), ReadError>,
) -> Result<(), ReadError> {
    for group in 0..file.num_row_groups() {
        let reader = file.get_row_group(group).and_then(|group| group.get_column_reader(column.index));
        take(reader.map_err(|error| damaged(path, &error))?)?;
    }
    Ok(())
}

/// Appends one row group's values, each turned by `convert`.
pub(super) fn append<D: DataType, T>(
    path: &Path,
    column: Column,
    mut reader: ColumnReaderImpl<D>,
    into: &mut Vec<T>,
    convert: impl Fn(&D::T) -> T,
) -> Result<(), ReadError> {
    let (mut values, mut levels) = (Vec::new(), Vec::new());
    loop {
        values.clear();
        levels.clear();
        let definitions = (column.max_definition > 0).then_some(&mut levels);
        let (records, _, _) = reader
            .read_records(BATCH, definitions, None, &mut values)
            .map_err(|error| damaged(path, &error))?;
        if let Some(missing) = levels.iter().position(|&level| level < column.max_definition) {
            let row = (into.len() + missing) as u64 + 1;
            return Err(ReadError::Value {
                path: path.to_owned(),
                row,
                column: column.name,
                value: "missing".to_owned(),
            });
        }
        into.extend(values.iter().map(&convert));
        if records == 0 {
            return Ok(());
        }
    }
}

pub(super) fn damaged(path: &Path, error: &ParquetError) -> ReadError {
    ReadError::Damaged { path: path.to_owned(), format: "Parquet", reason: error.to_string() }
}
