//! Rows of CSV and TSV.

use super::Chunk;
use super::lines::LineLimit;
use crate::io::columns::{Layout, Picked, layout};
use crate::io::csv::{delimiter, description_paths};
use crate::io::header::{self, Header};
use crate::io::timing::Stamps;
use crate::io::{ReadError, ReadOptions, Repair};
use ::csv::{ByteRecord, Reader, ReaderBuilder};
use flate2::read::MultiGzDecoder;
use std::fs::{self, File};
use std::io::{BufRead, BufReader, Read};
use std::path::{Path, PathBuf};

/// Rows by which it is judged whether fields are halves of numbers.
const JUDGED: u64 = 1000;

type Text = Box<dyn Read + Send>;

/// A text being read.
pub(super) struct CsvRows {
    path: PathBuf,
    reader: Reader<Text>,
    record: ByteRecord,
    names: Vec<String>,
    row: u64,
    /// Whether the first record is in `record` already: it was looked at for names and had none.
    held: bool,
    /// Rows with more or fewer fields than there are names: the first, its time if it has one, and how many.
    uneven: Option<(u64, Option<f64>, u64)>,
    /// How many of the first rows have something in a field for which there is no name.
    surplus: u64,
}

fn damaged(path: &Path, error: &::csv::Error) -> ReadError {
    ReadError::Damaged { path: path.to_owned(), format: "CSV", reason: error.to_string() }
}

/// The description beside a text, where there is one.
fn description(path: &Path) -> Result<Header, ReadError> {
    for sidecar in description_paths(path) {
        match fs::read_to_string(&sidecar) {
            Ok(json) => return header::from_json(&sidecar, &json),
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => {}
            Err(error) => return Err(ReadError::io(&sidecar, error)),
        }
    }
    Ok(Header::default())
}

impl CsvRows {
    pub fn open(path: &Path, options: &ReadOptions, gzip: bool) -> Result<(Self, Layout, Header), ReadError> {
        let header = description(path)?;
        let file = File::open(path).map_err(|error| ReadError::io(path, error))?;
        let text: Text =
            if gzip { Box::new(MultiGzDecoder::new(BufReader::new(file))) } else { Box::new(file) };
        let mut text = BufReader::with_capacity(1 << 16, Box::new(LineLimit::new(text)) as Text);
        let guessed = delimiter(text.fill_buf().map_err(|error| ReadError::io(path, error))?);
        let mut reader = ReaderBuilder::new()
            .flexible(true)
            .has_headers(false)
            .delimiter(options.delimiter.unwrap_or(guessed))
            .trim(::csv::Trim::All)
            .buffer_capacity(1 << 16)
            .from_reader(Box::new(text) as Text);
        let mut record = ByteRecord::new();
        let any = reader.read_byte_record(&mut record).map_err(|error| damaged(path, &error))?;
        if !any {
            return Err(ReadError::Empty { path: path.to_owned() });
        }
        let numbers = record.iter().all(|field| number::<f64>(field).is_some());
        let held = !options.header.unwrap_or(!numbers);
        let names: Vec<String> = if held {
            unnamed(record.len())
        } else {
            record
                .iter()
                .map(|name| String::from_utf8_lossy(name).trim_start_matches('\u{feff}').to_owned())
                .collect()
        };
        let layout = layout(path, &names, options)?;
        let path = path.to_owned();
        Ok((Self { path, reader, record, names, row: 0, held, uneven: None, surplus: 0 }, layout, header))
    }

    pub fn names(&self) -> &[String] {
        &self.names
    }

    /// What was mended in the rows so far, by a description with rate and start where they have no times.
    pub fn repair(&self, header: &Header) -> Option<Repair> {
        let (row, time_s, count) = self.uneven?;
        let time_s = time_s.unwrap_or_else(|| header.time_s(row as usize - 1));
        let message = format!(
            "{count} rows have more or fewer fields than there are columns, the first of them row {row} ({time_s} s); \
             surplus fields were dropped"
        );
        Some(Repair { code: "uneven-rows", row, time_s, count, message })
    }

    /// Moves to the next row; whether there was one.
    fn advance(&mut self) -> Result<bool, ReadError> {
        if !std::mem::take(&mut self.held)
            && !self.reader.read_byte_record(&mut self.record).map_err(|error| damaged(&self.path, &error))?
        {
            self.judge(self.row < JUDGED)?;
            return Ok(false);
        }
        self.row += 1;
        let beyond =
            |record: &ByteRecord| record.iter().skip(self.names.len()).any(|field| !field.is_empty());
        self.surplus += u64::from(self.row <= JUDGED && beyond(&self.record));
        self.judge(self.row == JUDGED)?;
        Ok(true)
    }

    /// Refuses what most likely are numbers with decimal commas: dropping what is beyond the columns would leave wrong ones.
    fn judge(&self, now: bool) -> Result<(), ReadError> {
        if now && 2 * self.surplus > self.row {
            return Err(ReadError::Surplus { path: self.path.clone(), rows: self.row });
        }
        Ok(())
    }

    pub fn skip(&mut self, rows: u64) -> Result<(), ReadError> {
        for _ in 0..rows {
            if !self.advance()? {
                break;
            }
        }
        Ok(())
    }

    pub fn next(
        &mut self,
        layout: &Layout,
        limit: usize,
        repair: bool,
        chunk: &mut Chunk,
    ) -> Result<usize, ReadError> {
        let mut times = match std::mem::replace(&mut chunk.stamps, Stamps::Absent) {
            Stamps::Seconds(times) => times,
            _ => Vec::new(),
        };
        times.clear();
        let mut rows = 0;
        while rows < limit && self.advance()? {
            if self.record.len() != self.names.len() && !repair {
                let reason = format!("{} fields instead of {}", self.record.len(), self.names.len());
                return Err(ReadError::Row { path: self.path.clone(), row: self.row, reason });
            }
            if self.row == 1 && self.record.iter().all(is_word) {
                return Err(ReadError::Words { path: self.path.clone() });
            }
            if let Some(time) = &layout.time {
                times.push(self.field::<f64>(time, repair, f64::NAN)? * time.scale);
            }
            if self.record.len() != self.names.len() {
                let time_s = times.last().copied().filter(|time_s| time_s.is_finite());
                self.uneven.get_or_insert((self.row, time_s, 0)).2 += 1;
            }
            for (column, values) in layout.values.iter().zip(&mut chunk.values) {
                // Parsed as f32 at once: two roundings, decimal to f64 to f32, can differ from one.
                values.push(self.field::<f32>(column, repair, f32::NAN)?);
            }
            rows += 1;
        }
        if layout.time.is_some() {
            chunk.stamps = Stamps::Seconds(times);
        }
        Ok(rows)
    }

    /// A finite number; if it is to be mended later, what stands for none; else the error that names its place.
    fn field<T: std::str::FromStr + Finite>(
        &self,
        column: &Picked,
        repair: bool,
        none: T,
    ) -> Result<T, ReadError> {
        let field = self.record.get(column.index).unwrap_or_default();
        match number(field) {
            Some(value) => Ok(value),
            None if has_decimal_comma(field) => Err(ReadError::DecimalComma {
                path: self.path.clone(),
                row: self.row,
                column: column.name.clone(),
                value: String::from_utf8_lossy(field).chars().take(40).collect(),
            }),
            None if repair => Ok(none),
            None => {
                let shown: String = String::from_utf8_lossy(field).chars().take(40).collect();
                let value = match number::<f64>(field) {
                    Some(_) => format!("{shown:?}, which is beyond 3.4e38"),
                    None if shown.is_empty() => "empty".to_owned(),
                    None => format!("{shown:?}"),
                };
                Err(ReadError::Value {
                    path: self.path.clone(),
                    row: self.row,
                    column: column.name.clone(),
                    value,
                })
            }
        }
    }
}

/// Names for columns that have none: time, voltage, current; two columns are voltage and current.
fn unnamed(columns: usize) -> Vec<String> {
    let usual: &[&str] =
        if columns == 2 { &["voltage_V", "current_A"] } else { &["time_s", "voltage_V", "current_A"] };
    (0..columns)
        .map(|i| usual.get(i).map_or_else(|| format!("column {}", i + 1), |name| (*name).to_owned()))
        .collect()
}

/// Whether there is something in a field that is no number, not even one that is not finite.
fn is_word(field: &[u8]) -> bool {
    !field.is_empty()
        && !has_decimal_comma(field)
        && std::str::from_utf8(field).is_ok_and(|text| text.parse::<f64>().is_err())
}

/// Whether a field would be a number if its only comma were a point.
fn has_decimal_comma(field: &[u8]) -> bool {
    let text = std::str::from_utf8(field).unwrap_or_default();
    text.matches(',').count() == 1 && number::<f64>(text.replace(',', ".").as_bytes()).is_some()
}

fn number<T: std::str::FromStr + Finite>(field: &[u8]) -> Option<T> {
    std::str::from_utf8(field).ok().and_then(|text| text.parse().ok()).filter(T::finite)
}

trait Finite {
    fn finite(&self) -> bool;
}

impl Finite for f32 {
    fn finite(&self) -> bool {
        self.is_finite()
    }
}

impl Finite for f64 {
    fn finite(&self) -> bool {
        self.is_finite()
    }
}
