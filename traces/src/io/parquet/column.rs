//! Reading one column.
//!
//! Units that other programs put into the metadata of fields. Arrow keeps them in a schema of its own among
//! the metadata of a Parquet file (`ARROW:schema`: Base64 of an IPC message, which is a FlatBuffer;
//! Schema.fbs and Message.fbs of Apache Arrow).

use super::{PagedFile, damaged, open};
use crate::io::ReadError;
use crate::io::columns::Picked;
use crate::io::time_base::{NO_TIME_NS, Stamps};
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use parquet::basic::{ConvertedType, LogicalType, TimeUnit, Type as Physical};
use parquet::column::reader::{ColumnReader, ColumnReaderImpl};
use parquet::data_type::DataType;
use parquet::errors::ParquetError;
use parquet::file::reader::FileReader;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Values decoded at once. No length that a file states is allocated on trust.
const BATCH_VALUES: usize = 1 << 16;

/// Types of values that are read.
const NUMBERS: &str = "FLOAT, DOUBLE, or whole numbers with a sign: write it as one of these";

/// One column, over all row groups.
pub(super) struct Column {
    pub path: PathBuf,
    // Of its own, as clones of a file share its position.
    file: PagedFile,
    name: String,
    index: usize,
    /// 1 if values may be missing.
    max_definition: i16,
    group: usize,
    reader: Option<ColumnReader>,
    /// Rows before the ones to come.
    row: u64,
    levels: Vec<i16>,
    /// Unit of a whole number, ns.
    tick_ns: i64,
    scale: f64,
    /// Whether missing values are repaired later; until then a placeholder stands for them.
    repair: bool,
}

impl Column {
    pub fn open(path: &Path, picked: &Picked, repair: bool) -> Result<Self, ReadError> {
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
            repair,
        })
    }

    fn damaged(&self, error: &ParquetError) -> ReadError {
        damaged(&self.path, error.to_string())
    }

    /// Opens the reader of the current row group; `false` at the end.
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

    pub fn skip(&mut self, mut rows: u64) -> Result<(), ReadError> {
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
                Some(ColumnReader::Int32ColumnReader(reader)) => reader.skip_records(count),
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
    pub fn values(&mut self, limit: usize, into: &mut Vec<f32>) -> Result<usize, ReadError> {
        let (mut doubles, mut long, mut short) = (Vec::<f64>::new(), Vec::<i64>::new(), Vec::<i32>::new());
        let from = into.len();
        if !self.is_number() {
            return Err(self.wrong_type(NUMBERS));
        }
        while into.len() - from < limit && self.open_group()? {
            let want = (limit - (into.len() - from)).min(BATCH_VALUES);
            let mut places = Places { max: self.max_definition, levels: &mut self.levels, fill: self.repair };
            let got = match &mut self.reader {
                Some(ColumnReader::FloatColumnReader(reader)) => {
                    batch(reader, want, &mut places, f32::NAN, into)
                }
                Some(ColumnReader::DoubleColumnReader(reader)) => {
                    doubles.clear();
                    let got = batch(reader, want, &mut places, f64::NAN, &mut doubles);
                    into.extend(doubles.iter().map(|&value| value as f32));
                    got
                }
                Some(ColumnReader::Int64ColumnReader(reader)) => {
                    long.clear();
                    let got = batch(reader, want, &mut places, i64::MIN, &mut long);
                    into.extend(
                        long.iter().map(|&value| if value == i64::MIN { f32::NAN } else { value as f32 }),
                    );
                    got
                }
                Some(ColumnReader::Int32ColumnReader(reader)) => {
                    short.clear();
                    let got = batch(reader, want, &mut places, i32::MIN, &mut short);
                    into.extend(
                        short.iter().map(|&value| if value == i32::MIN { f32::NAN } else { value as f32 }),
                    );
                    got
                }
                _ => return Err(self.wrong_type(NUMBERS)),
            };
            self.account(got)?;
        }
        Ok(into.len() - from)
    }

    pub fn times(&mut self, limit: usize, stamps: &mut Stamps) -> Result<usize, ReadError> {
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
            let want = (limit - ns.len().max(s.len())).min(BATCH_VALUES);
            let scale = self.scale;
            let mut places = Places { max: self.max_definition, levels: &mut self.levels, fill: self.repair };
            let got = match &mut self.reader {
                Some(ColumnReader::Int64ColumnReader(reader)) => {
                    batch(reader, want, &mut places, NO_TIME_NS, &mut ns)
                }
                Some(ColumnReader::DoubleColumnReader(reader)) => {
                    batch(reader, want, &mut places, f64::NAN, &mut s)
                }
                Some(ColumnReader::FloatColumnReader(reader)) => {
                    floats.clear();
                    let got = batch(reader, want, &mut places, f32::NAN, &mut floats);
                    s.extend(floats.iter().map(|&value| f64::from(value)));
                    got
                }
                _ => return Err(self.wrong_type("DOUBLE or FLOAT")),
            };
            let rows = self.account(got)?;
            if self.tick_ns > 1 {
                let times = ns[from..].iter_mut().filter(|time| **time != NO_TIME_NS);
                times.for_each(|time| *time = time.saturating_mul(self.tick_ns));
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

    /// Whether whole numbers, if it has these, are just that: not times, decimals or without a sign.
    fn is_number(&self) -> bool {
        let described = self.file.metadata().file_metadata().schema_descr().column(self.index);
        let logical = match described.logical_type_ref() {
            None => true,
            Some(LogicalType::Integer(integer)) => integer.is_signed,
            Some(_) => false,
        };
        let converted = described.converted_type();
        let signed =
            [ConvertedType::INT_8, ConvertedType::INT_16, ConvertedType::INT_32, ConvertedType::INT_64];
        let is_whole = [Physical::INT32, Physical::INT64].contains(&described.physical_type());
        !is_whole || logical && (converted == ConvertedType::NONE || signed.contains(&converted))
    }

    fn physical(&self) -> Physical {
        self.file.metadata().file_metadata().schema_descr().column(self.index).physical_type()
    }

    fn wrong_type(&self, must: &'static str) -> ReadError {
        let found = self.physical().to_string();
        ReadError::ColumnType { path: self.path.clone(), column: self.name.clone(), found, must }
    }
}

/// Which records have a value.
struct Places<'a> {
    /// The level of those that have one.
    max: i16,
    levels: &'a mut Vec<i16>,
    /// Whether the others get a placeholder.
    fill: bool,
}

/// Appends up to `want` values; how many records there were, and how many of them had a value or got `none`.
fn batch<D: DataType>(
    reader: &mut ColumnReaderImpl<D>,
    want: usize,
    places: &mut Places<'_>,
    none: D::T,
    into: &mut Vec<D::T>,
) -> Result<(usize, usize), ParquetError> {
    let from = into.len();
    places.levels.clear();
    let definitions = (places.max > 0).then_some(&mut *places.levels);
    let (records, values, _) = reader.read_records(want, definitions, None, into)?;
    if values == records || !places.fill {
        return Ok((records, values));
    }
    into.resize(from + records, none.clone());
    places.spread(&mut into[from..], values, &none);
    Ok((records, records))
}

impl Places<'_> {
    /// Moves the `count` values at the front to their places, and puts `none` into the others.
    fn spread<T: Clone>(&self, values: &mut [T], mut count: usize, none: &T) {
        for (place, level) in self.levels.iter().enumerate().rev() {
            if *level == self.max {
                count -= 1;
                values.swap(place, count);
            } else {
                values[place] = none.clone();
            }
        }
    }
}

/// Keys of units; letter case does not count.
const KEYS: [&str; 2] = ["unit", "units"];
/// Fields of the tables `Message`, `Schema`, `Field` and `KeyValue`.
const HEADER: usize = 2;
const FIELDS: usize = 1;
const METADATA: usize = 6;
const NAME: usize = 0;
const KEY: usize = 0;
const VALUE: usize = 1;

fn is_key(text: &str) -> bool {
    KEYS.iter().any(|key| key.eq_ignore_ascii_case(text))
}

/// The unit of each field that has one, by its name. What cannot be read has none.
pub(super) fn units(schema: &str) -> BTreeMap<String, String> {
    let bytes = STANDARD.decode(schema).unwrap_or_default();
    read(&bytes).unwrap_or_default()
}

fn read(bytes: &[u8]) -> Option<BTreeMap<String, String>> {
    let flat = Flat { bytes };
    // The length of the message stands before it, since Arrow 0.15 after four bytes of ones.
    let begin = if flat.u32(0)? == u32::MAX { 8 } else { 4 };
    let schema = flat.table(flat.follow(begin)?, HEADER)?;
    let mut units = BTreeMap::new();
    for field in flat.tables(schema, FIELDS)? {
        let Some(name) = flat.text(field, NAME) else { continue };
        let pairs = flat.tables(field, METADATA).unwrap_or_default();
        let unit = |pair: &&usize| flat.text(**pair, KEY).is_some_and(is_key);
        if let Some(unit) = pairs.iter().find(unit).and_then(|pair| flat.text(*pair, VALUE)) {
            units.insert(name.to_owned(), unit.trim().to_owned());
        }
    }
    Some(units)
}

/// A FlatBuffer; every place is checked.
struct Flat<'a> {
    bytes: &'a [u8],
}

impl<'a> Flat<'a> {
    fn u32(&self, at: usize) -> Option<u32> {
        self.bytes.get(at..)?.first_chunk().map(|bytes| u32::from_le_bytes(*bytes))
    }

    fn u16(&self, at: usize) -> Option<u16> {
        self.bytes.get(at..)?.first_chunk().map(|bytes| u16::from_le_bytes(*bytes))
    }

    /// The target of an offset.
    fn follow(&self, at: usize) -> Option<usize> {
        at.checked_add(self.u32(at)? as usize)
    }

    /// The place of a table's field; `None` if it is absent.
    fn field(&self, table: usize, field: usize) -> Option<usize> {
        let back = i64::from(self.u32(table)?.cast_signed());
        let layout = usize::try_from(i64::try_from(table).ok()? - back).ok()?;
        let entry = 4 + 2 * field;
        if entry >= usize::from(self.u16(layout)?) {
            return None;
        }
        let offset = usize::from(self.u16(layout + entry)?);
        (offset > 0).then_some(table + offset)
    }

    fn table(&self, table: usize, field: usize) -> Option<usize> {
        self.follow(self.field(table, field)?)
    }

    /// The tables in a list.
    fn tables(&self, table: usize, field: usize) -> Option<Vec<usize>> {
        let list = self.table(table, field)?;
        let count = self.u32(list)? as usize;
        // Each takes four bytes, so a false number is not believed.
        (count <= self.bytes.len() / 4).then_some(())?;
        (0..count).map(|index| self.follow(list + 4 + 4 * index)).collect()
    }

    fn text(&self, table: usize, field: usize) -> Option<&'a str> {
        let at = self.table(table, field)?;
        let bytes = self.bytes.get(at + 4..)?.get(..self.u32(at)? as usize)?;
        str::from_utf8(bytes).ok()
    }
}
