//! Rows of Parquet: each column by a reader of its own, all of them at once.

use super::Chunk;
use super::PackedFile;
use crate::io::columns::{Layout, layout};
use crate::io::header::{self, Header, KEYS};
use crate::io::timing::Stamps;
use crate::io::{ReadError, ReadOptions};
use parquet::basic::{LogicalType, TimeUnit, Type as Physical};
use parquet::column::reader::{ColumnReader, ColumnReaderImpl};
use parquet::data_type::DataType;
use parquet::errors::ParquetError;
use parquet::file::reader::FileReader;
use rayon::prelude::*;
use std::fs::File;
use std::path::{Path, PathBuf};

/// Values decoded at once. What a file claims about its length is never allocated on trust.
const BATCH: usize = 1 << 16;

/// A Parquet file being read.
pub(super) struct ParquetRows {
    time: Option<Column>,
    values: Vec<Column>,
    names: Vec<String>,
    rows: u64,
}

/// One column, over all row groups.
struct Column {
    path: PathBuf,
    // Of its own, as clones of a file share its position.
    file: PackedFile,
    name: String,
    index: usize,
    /// 1 if values may be missing.
    max_definition: i16,
    group: usize,
    reader: Option<ColumnReader>,
    /// Rows before the ones to come.
    row: u64,
    levels: Vec<i16>,
    /// What a whole number counts, ns.
    tick_ns: i64,
    scale: f64,
}

fn damaged(path: &Path, reason: String) -> ReadError {
    ReadError::Damaged { path: path.to_owned(), format: "Parquet", reason }
}

fn open(path: &Path) -> Result<PackedFile, ReadError> {
    File::open(path).map_err(|error| ReadError::io(path, error))?;
    PackedFile::open(path).map_err(|error| damaged(path, error.to_string()))
}

impl ParquetRows {
    pub fn open(path: &Path, options: &ReadOptions) -> Result<(Self, Layout, Header), ReadError> {
        let file = open(path)?;
        let size_bytes = std::fs::metadata(path).map_err(|error| ReadError::io(path, error))?.len();
        let schema = file.metadata().file_metadata().schema_descr();
        let names: Vec<String> = schema.columns().iter().map(|column| column.path().string()).collect();
        let header = description(path, &file)?;
        let layout = layout(path, &names, options)?;
        check_chunks(path, &file, size_bytes, &layout)?;
        let rows = file.metadata().row_groups().iter().map(|group| group.num_rows().max(0) as u64).sum();
        let column = |picked| Column::open(path, picked);
        let time = layout.time.as_ref().map(column).transpose()?;
        let values = layout.values.iter().map(column).collect::<Result<_, _>>()?;
        Ok((Self { time, values, names, rows }, layout, header))
    }

    pub fn names(&self) -> &[String] {
        &self.names
    }

    pub fn count(&self) -> u64 {
        self.rows
    }

    pub fn skip(&mut self, rows: u64) -> Result<(), ReadError> {
        self.time.iter_mut().chain(&mut self.values).try_for_each(|column| column.skip(rows))
    }

    pub fn next(&mut self, limit: usize, chunk: &mut Chunk) -> Result<usize, ReadError> {
        let Self { time, values, .. } = self;
        let Chunk { stamps, values: lists } = chunk;
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
            let path = values.first().map_or(PathBuf::new(), |column| column.path.clone());
            return Err(damaged(&path, "its columns differ in length".to_owned()));
        }
        Ok(rows)
    }
}

fn description(path: &Path, file: &PackedFile) -> Result<Header, ReadError> {
    let pairs = file.metadata().file_metadata().key_value_metadata().map_or(&[][..], Vec::as_slice);
    let json = KEYS
        .iter()
        .find_map(|key| pairs.iter().find(|pair| pair.key == *key).and_then(|pair| pair.value.as_deref()));
    json.map_or(Ok(Header::default()), |json| header::from_json(path, json))
}

/// Holds what the file says of the parts that are read against its size, before the decoder trusts it.
fn check_chunks(path: &Path, file: &PackedFile, size_bytes: u64, layout: &Layout) -> Result<(), ReadError> {
    let read: Vec<usize> = layout.time.iter().chain(&layout.values).map(|picked| picked.index).collect();
    for group in file.metadata().row_groups() {
        for chunk in read.iter().filter_map(|&index| group.columns().get(index)) {
            if !PackedFile::unpacks(chunk.compression()) {
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
                return Err(damaged(path, reason));
            }
        }
    }
    Ok(())
}

impl Column {
    fn open(path: &Path, picked: &crate::io::columns::Picked) -> Result<Self, ReadError> {
        let file = open(path)?;
        let described = file.metadata().file_metadata().schema_descr().column(picked.index);
        if described.max_rep_level() > 0 {
            return Err(ReadError::ColumnType {
                path: path.to_owned(),
                column: picked.name.clone(),
                found: "a list".to_owned(),
                must: "one number per row",
            });
        }
        let tick_ns = match described.logical_type_ref() {
            Some(LogicalType::Timestamp(time)) => match time.unit {
                TimeUnit::MILLIS => 1_000_000,
                TimeUnit::MICROS => 1_000,
                _ => 1,
            },
            _ => libm::round(picked.scale * 1e9) as i64,
        };
        let tick_ns = if picked.scale == 1.0 && tick_ns == 1_000_000_000 { 0 } else { tick_ns };
        Ok(Self {
            path: path.to_owned(),
            name: picked.name.clone(),
            index: picked.index,
            max_definition: described.max_def_level(),
            file,
            group: 0,
            reader: None,
            row: 0,
            levels: Vec::new(),
            tick_ns,
            scale: picked.scale,
        })
    }

    fn damaged(&self, error: &ParquetError) -> ReadError {
        damaged(&self.path, error.to_string())
    }

    /// The reader of the row group at hand; `false` at the end.
    fn open_group(&mut self) -> Result<bool, ReadError> {
        while self.reader.is_none() && self.group < self.file.num_row_groups() {
            let reader = self.reader_of(self.group);
            self.reader = Some(reader.map_err(|error| self.damaged(&error))?);
            self.group += 1;
        }
        Ok(self.reader.is_some())
    }

    fn reader_of(&self, group: usize) -> Result<ColumnReader, ParquetError> {
        self.file.get_row_group(group)?.get_column_reader(self.index)
    }

    fn skip(&mut self, mut rows: u64) -> Result<(), ReadError> {
        while rows > 0 {
            if self.reader.is_none() {
                let Some(group) = self.file.metadata().row_groups().get(self.group) else { break };
                let whole = group.num_rows().max(0) as u64;
                if whole <= rows {
                    (self.group, self.row, rows) = (self.group + 1, self.row + whole, rows - whole);
                    continue;
                }
                self.open_group()?;
            }
            let count = usize::try_from(rows).unwrap_or(usize::MAX);
            let skipped = match &mut self.reader {
                Some(ColumnReader::FloatColumnReader(reader)) => reader.skip_records(count),
                Some(ColumnReader::DoubleColumnReader(reader)) => reader.skip_records(count),
                Some(ColumnReader::Int64ColumnReader(reader)) => reader.skip_records(count),
                _ => return Err(self.wrong_type("a number")),
            }
            .map_err(|error| self.damaged(&error))? as u64;
            (self.row, rows) = (self.row + skipped, rows - skipped.min(rows));
            if skipped == 0 {
                self.reader = None;
            }
        }
        Ok(())
    }

    /// Appends up to `limit` values; how many there were.
    fn values(&mut self, limit: usize, into: &mut Vec<f32>) -> Result<usize, ReadError> {
        let mut doubles: Vec<f64> = Vec::new();
        let from = into.len();
        while into.len() - from < limit && self.open_group()? {
            let want = (limit - (into.len() - from)).min(BATCH);
            let (max, levels) = (self.max_definition, &mut self.levels);
            let got = match &mut self.reader {
                Some(ColumnReader::FloatColumnReader(reader)) => batch(reader, want, max, levels, into),
                Some(ColumnReader::DoubleColumnReader(reader)) => {
                    doubles.clear();
                    let got = batch(reader, want, max, levels, &mut doubles);
                    into.extend(doubles.iter().map(|&value| value as f32));
                    got
                }
                _ => return Err(self.wrong_type("FLOAT or DOUBLE")),
            };
            self.account(got)?;
        }
        Ok(into.len() - from)
    }

    fn times(&mut self, limit: usize, stamps: &mut Stamps) -> Result<usize, ReadError> {
        let whole = self.physical() == Physical::INT64;
        if whole && self.tick_ns == 0 {
            return Err(self.wrong_type("DOUBLE or FLOAT, or INT64 by the name time_ns"));
        }
        if !whole && self.tick_ns == 1 {
            return Err(self.wrong_type("INT64"));
        }
        let (mut ns, mut s, mut floats) = match std::mem::replace(stamps, Stamps::Absent) {
            Stamps::Nanoseconds(ns) => (ns, Vec::new(), Vec::<f32>::new()),
            Stamps::Seconds(s) => (Vec::new(), s, Vec::new()),
            Stamps::Absent => Default::default(),
        };
        ns.clear();
        s.clear();
        while ns.len().max(s.len()) < limit && self.open_group()? {
            let from = ns.len();
            let want = (limit - ns.len().max(s.len())).min(BATCH);
            let (max, levels, scale) = (self.max_definition, &mut self.levels, self.scale);
            let got = match &mut self.reader {
                Some(ColumnReader::Int64ColumnReader(reader)) => batch(reader, want, max, levels, &mut ns),
                Some(ColumnReader::DoubleColumnReader(reader)) => batch(reader, want, max, levels, &mut s),
                Some(ColumnReader::FloatColumnReader(reader)) => {
                    floats.clear();
                    let got = batch(reader, want, max, levels, &mut floats);
                    s.extend(floats.iter().map(|&value| f64::from(value)));
                    got
                }
                _ => return Err(self.wrong_type("DOUBLE or FLOAT")),
            };
            let rows = self.account(got)?;
            if self.tick_ns > 1 {
                ns[from..].iter_mut().for_each(|time| *time = time.saturating_mul(self.tick_ns));
            }
            if scale != 1.0 && rows > 0 && !whole {
                let from = s.len() - rows;
                s[from..].iter_mut().for_each(|time| *time *= scale);
            }
        }
        let rows = ns.len().max(s.len());
        *stamps = if whole { Stamps::Nanoseconds(ns) } else { Stamps::Seconds(s) };
        Ok(rows)
    }

    /// Counts a batch, and closes the row group when it has no more. A missing value is an error.
    fn account(&mut self, got: Result<(usize, usize), ParquetError>) -> Result<usize, ReadError> {
        let (records, values) = got.map_err(|error| self.damaged(&error))?;
        if values != records {
            let missing = self.levels.iter().position(|&level| level < self.max_definition).unwrap_or(0);
            return Err(ReadError::Value {
                path: self.path.clone(),
                row: self.row + missing as u64 + 1,
                column: self.name.clone(),
                value: "missing".to_owned(),
            });
        }
        self.row += records as u64;
        if records == 0 {
            self.reader = None;
        }
        Ok(records)
    }

    fn physical(&self) -> Physical {
        self.file.metadata().file_metadata().schema_descr().column(self.index).physical_type()
    }

    fn wrong_type(&self, must: &'static str) -> ReadError {
        let found = self.physical().to_string();
        ReadError::ColumnType { path: self.path.clone(), column: self.name.clone(), found, must }
    }
}

/// Appends up to `want` values; how many records there were, and how many of them had a value.
fn batch<D: DataType>(
    reader: &mut ColumnReaderImpl<D>,
    want: usize,
    max_definition: i16,
    levels: &mut Vec<i16>,
    into: &mut Vec<D::T>,
) -> Result<(usize, usize), ParquetError> {
    levels.clear();
    let definitions = (max_definition > 0).then_some(levels);
    let (records, values, _) = reader.read_records(want, definitions, None, into)?;
    Ok((records, values))
}
