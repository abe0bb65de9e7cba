//! Small tables of text and numbers, from CSV, TSV or Parquet.

use crate::io::{PagedFile, field_units};
use parquet::file::reader::FileReader;
use parquet::record::Field;
use std::collections::BTreeMap;
use std::fs::File;
use std::io::Read;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use thiserror::Error;

/// Largest table, in bytes.
const MAX_BYTES: u64 = 1 << 28;

/// Why a table cannot be used.
#[derive(Debug, Error)]
pub enum TableReadError {
    /// The file is missing, unreadable, or not a table.
    #[error("{path}: cannot read it: {reason}", path = path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// Why.
        reason: String,
    },
    /// A column.
    #[error("{path}: no column {column} (found: {found})", path = path.display())]
    Column {
        /// The file.
        path: PathBuf,
        /// The column.
        column: String,
        /// The names found.
        found: String,
    },
    /// A value.
    #[error("{path}: row {row}: {column} is {value:?}, not a finite number", path = path.display())]
    Value {
        /// The file.
        path: PathBuf,
        /// The row, from 1.
        row: usize,
        /// The column.
        column: String,
        /// The value found.
        value: String,
    },
}

/// A table in memory.
#[derive(Clone, Debug, PartialEq)]
pub struct InputTable {
    path: PathBuf,
    names: Vec<String>,
    rows: Vec<Vec<String>>,
    /// Units that stand beside names, in the metadata of fields.
    units: BTreeMap<String, String>,
}

impl InputTable {
    /// Reads a table with a header: Parquet by its first bytes, else a text with commas, semicolons or tabs.
    ///
    /// # Errors
    /// [`TableReadError::File`] if it cannot be read.
    pub fn read(path: &Path) -> Result<Self, TableReadError> {
        let refuse = |reason: String| TableReadError::File { path: path.to_owned(), reason };
        let file = File::open(path).map_err(|error| refuse(format!("{error}; check the path")))?;
        let there = file.metadata().map_err(|error| refuse(error.to_string()))?;
        if there.is_dir() {
            return Err(refuse("it is a folder; name a file in it".to_owned()));
        }
        if there.len() > MAX_BYTES {
            return Err(refuse("a table of settings has to be smaller than 256 MiB".to_owned()));
        }
        let mut bytes = Vec::new();
        (&file).read_to_end(&mut bytes).map_err(|error| refuse(error.to_string()))?;
        if bytes.iter().all(u8::is_ascii_whitespace) {
            return Err(refuse("it is empty; give a row for each setting".to_owned()));
        }
        let (names, rows, units) = if bytes.starts_with(b"PAR1") {
            let read = catch_unwind(AssertUnwindSafe(|| from_parquet(path)));
            read.unwrap_or_else(|_| Err("it is damaged".to_owned())).map_err(refuse)?
        } else {
            from_text(&bytes).map_err(refuse)?
        };
        Ok(Self { path: path.to_owned(), names, rows, units })
    }

    /// The file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Number of rows.
    pub fn rows(&self) -> usize {
        self.rows.len()
    }

    /// The unit that a file has beside a column's name (letter case does not count).
    pub fn unit(&self, column: &str) -> Option<&str> {
        let found = self.units.iter().find(|(name, _)| name.eq_ignore_ascii_case(column));
        found.map(|(_, unit)| unit.as_str())
    }

    /// A column as text.
    ///
    /// # Errors
    /// [`TableReadError::Column`] if there is none of that name (letter case does not count).
    pub fn texts(&self, column: &str) -> Result<Vec<String>, TableReadError> {
        let found = self.names.iter().position(|name| name.eq_ignore_ascii_case(column));
        let index = found.ok_or_else(|| TableReadError::Column {
            path: self.path.clone(),
            column: column.to_owned(),
            found: self.names.iter().take(20).cloned().collect::<Vec<_>>().join(", "),
        })?;
        Ok(self.rows.iter().map(|row| row.get(index).cloned().unwrap_or_default()).collect())
    }

    /// A column as finite numbers.
    ///
    /// # Errors
    /// [`TableReadError`] if there is none of that name, or a value is no number.
    pub fn numbers(&self, column: &str) -> Result<Vec<f64>, TableReadError> {
        let number = |(row, text): (usize, String)| {
            text.trim().parse::<f64>().ok().filter(|value| value.is_finite()).ok_or_else(|| {
                TableReadError::Value {
                    path: self.path.clone(),
                    row: row + 1,
                    column: column.to_owned(),
                    value: text,
                }
            })
        };
        self.texts(column)?.into_iter().enumerate().map(number).collect()
    }
}

type Content = (Vec<String>, Vec<Vec<String>>, BTreeMap<String, String>);

fn from_text(bytes: &[u8]) -> Result<Content, String> {
    let mut reader = csv::ReaderBuilder::new()
        .flexible(true)
        .trim(csv::Trim::All)
        .delimiter(crate::io::csv::delimiter(bytes))
        .from_reader(bytes);
    let text =
        |record: &csv::ByteRecord| record.iter().map(|f| String::from_utf8_lossy(f).into_owned()).collect();
    let names = text(reader.byte_headers().map_err(|error| error.to_string())?);
    let rows = reader.byte_records().map(|record| record.map(|record| text(&record)));
    Ok((names, rows.collect::<Result<_, _>>().map_err(|error| error.to_string())?, BTreeMap::new()))
}

fn from_parquet(path: &Path) -> Result<Content, String> {
    let reason = |error: parquet::errors::ParquetError| error.to_string();
    let file = File::open(path).map_err(|error| error.to_string())?;
    let file = PagedFile::new(path, file).map_err(reason)?;
    check_packing(&file)?;
    // Columns of columns count as one, as they do in a row.
    let names = file.metadata().file_metadata().schema().get_fields();
    let names = names.iter().map(|field| field.name().to_owned()).collect();
    let mut rows = Vec::new();
    for row in file.get_row_iter(None).map_err(reason)? {
        let row = row.map_err(reason)?;
        let text = |field: &Field| match field {
            Field::Str(text) => text.clone(),
            Field::Null => String::new(),
            other => other.to_string(),
        };
        rows.push(row.get_column_iter().map(|(_, field)| text(field)).collect());
    }
    Ok((names, rows, field_units(&file)))
}

/// Refuses columns that cannot be unpacked, with what to do.
fn check_packing(file: &PagedFile) -> Result<(), String> {
    let chunks = file.metadata().row_groups().iter().flat_map(|group| group.columns());
    let mut packed = chunks.filter(|chunk| !PagedFile::unpacks(chunk.compression()));
    packed.next().map_or(Ok(()), |chunk| {
        let (column, codec) = (chunk.column_path().string(), chunk.compression().to_string());
        let codec = codec.split('(').next().unwrap_or_default();
        Err(format!(
            "column {column} is compressed with {codec}, which is not read: write it with Zstandard or Snappy"
        ))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_by_name_and_errors_with_their_place() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.csv");
        std::fs::write(&path, "Algorithm;time_ms\nVB;1.5\nTF;x\n").unwrap();
        let table = InputTable::read(&path).unwrap();
        assert_eq!(table.texts("algorithm").unwrap(), ["VB", "TF"]);
        assert!(table.numbers("time_ms").unwrap_err().to_string().contains("row 2: time_ms is \"x\""));
        assert!(
            table
                .numbers("energy")
                .unwrap_err()
                .to_string()
                .contains("no column energy (found: Algorithm, time_ms)")
        );
    }

    #[test]
    fn columns_of_columns_count_as_one_and_texts_keep_their_quotes() {
        use parquet::data_type::{ByteArray, ByteArrayType, DoubleType};
        use parquet::file::properties::WriterProperties;
        use parquet::file::writer::SerializedFileWriter;
        use parquet::schema::parser::parse_message_type;
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.parquet");
        let schema = "message t { required group at { required double x; required double y; } \
                      required binary name (UTF8); required double time_ms; }";
        let schema = std::sync::Arc::new(parse_message_type(schema).unwrap());
        let file = File::create(&path).unwrap();
        let mut writer =
            SerializedFileWriter::new(file, schema, WriterProperties::builder().build().into()).unwrap();
        let mut group = writer.next_row_group().unwrap();
        for value in [Some(1.0), Some(2.0), None, Some(3.5)] {
            let mut column = group.next_column().unwrap().unwrap();
            match value {
                Some(value) => column.typed::<DoubleType>().write_batch(&[value], None, None).unwrap(),
                None => {
                    let name = [ByteArray::from("\"VB\"")];
                    column.typed::<ByteArrayType>().write_batch(&name, None, None).unwrap()
                }
            };
            column.close().unwrap();
        }
        group.close().unwrap();
        writer.close().unwrap();
        let table = InputTable::read(&path).unwrap();
        assert_eq!(table.numbers("time_ms").unwrap(), [3.5]);
        assert_eq!(table.texts("name").unwrap(), ["\"VB\""]);
    }
}
