//! Interchange: CSV with the header `time_s,voltage_V,current_A`, no comment lines, and a JSON file beside
//! it. CSV and TSV of other programs are read, too.

use std::fs::{self, File};
use std::io::{self, BufRead, BufReader, BufWriter, Read, Write};
use std::path::{Path, PathBuf};

use ::csv::{ByteRecord, Reader, ReaderBuilder};
use flate2::Compression;
use flate2::read::MultiGzDecoder;
use flate2::write::GzEncoder;
use rayon::prelude::*;

use super::columns::{Layout, Opened, Picked, RowBatch, RowSource, layout, layout_of_unnamed, numbered};
use super::recording;
use super::rows::Rows;
use super::samples::{Description, TraceChunk, TraceHeader, TraceReader, TraceWriter, to_json};
use super::time_base::Stamps;
use super::{CURRENT_A, ReadError, ReadOptions, Repair, RepairKind, TIME_S, VOLTAGE_V, WriteError, atomic};
use crate::trace::Trace;

/// Another place of the description of a CSV file: the same name ending in `.json`.
pub fn sidecar_path(path: &Path) -> PathBuf {
    path.with_extension("json")
}

/// The place where [`save_as`] writes the description of a file: its whole name and `.json`, which no other
/// file shares.
pub fn description_path(path: &Path) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push(".json");
    name.into()
}

/// The places of a description, in the order in which they are tried: [`description_path`], then
/// [`sidecar_path`], also without `.gz`.
fn description_paths(path: &Path) -> impl Iterator<Item = PathBuf> {
    let inner = path.with_extension("");
    let unpacked = inner.extension().is_some().then(|| sidecar_path(&inner));
    [description_path(path), sidecar_path(path)].into_iter().chain(unpacked)
}

/// Begins a line that is skipped.
const COMMENT: u8 = b'#';

/// The delimiter of a text, by its first line that is no comment: a tab or a semicolon if it has any, else a comma.
pub(crate) fn delimiter(text: &[u8]) -> u8 {
    let mut lines = text.split(|&byte| byte == b'\n');
    let line = lines.find(|line| line.first() != Some(&COMMENT)).unwrap_or_default();
    [b'\t', b';'].into_iter().find(|byte| line.contains(byte)).unwrap_or(b',')
}

/// Typical size of a row, in bytes.
pub const ROW_BYTES: u64 = 50;
/// Rows that a thread formats at once.
const TASK_ROWS: usize = 1 << 12;
/// Rows whose text is held at once.
const HELD_ROWS: usize = 1 << 18;

/// Writes the samples. Times are whole nanoseconds written as seconds; values have the digits that read back
/// as the same number in f32 and in f64, so that an integral in f64 gives the same joules as here. A sample
/// takes about [`ROW_BYTES`].
///
/// # Errors
/// [`WriteError::Encode`] if the writer fails, [`WriteError::Read`] if the samples cannot be read.
pub fn write<W: Write + Send>(trace: &dyn TraceReader, out: W) -> Result<(), WriteError> {
    write_with(trace, out, b',')
}

/// As [`write()`], with something else than a comma between the fields: a tab for TSV.
///
/// # Errors
/// As [`write()`].
fn write_with<W: Write + Send>(trace: &dyn TraceReader, out: W, delimiter: u8) -> Result<(), WriteError> {
    let out = BufWriter::with_capacity(1 << 16, out);
    let mut writer = Writer { out, header: trace.header(), delimiter: char::from(delimiter) };
    writer.head().map_err(encode)?;
    trace.read_into(&mut writer)?;
    writer.out.flush().map_err(encode)
}

fn encode(error: impl std::fmt::Display) -> WriteError {
    WriteError::Encode(error.to_string())
}

/// A text being written.
struct Writer<W: Write + Send> {
    out: BufWriter<W>,
    header: TraceHeader,
    delimiter: char,
}

impl<W: Write + Send> TraceWriter for Writer<W> {
    fn write(&mut self, chunk: &TraceChunk<'_>) -> Result<(), WriteError> {
        if chunk.lost {
            return Ok(());
        }
        for from in (0..chunk.len()).step_by(HELD_ROWS) {
            let held = chunk.part(from, chunk.len().min(from + HELD_ROWS));
            for text in self.texts(&held) {
                self.out.write_all(&text).map_err(encode)?;
            }
        }
        Ok(())
    }
}

impl<W: Write + Send> Writer<W> {
    fn head(&mut self) -> io::Result<()> {
        let c = self.delimiter;
        writeln!(self.out, "{TIME_S}{c}{VOLTAGE_V}{c}{CURRENT_A}")
    }

    /// The text of rows, formatted in parallel.
    fn texts(&self, held: &TraceChunk<'_>) -> Vec<Vec<u8>> {
        let (header, delimiter) = (&self.header, self.delimiter);
        let tasks = (0..held.len().div_ceil(TASK_ROWS)).into_par_iter();
        let part = |task: usize| held.part(task * TASK_ROWS, held.len().min((task + 1) * TASK_ROWS));
        tasks.map(|task| text(header, &part(task), delimiter)).collect()
    }
}

/// The text of some rows.
fn text(header: &TraceHeader, rows: &TraceChunk<'_>, c: char) -> Vec<u8> {
    let mut out = Vec::with_capacity(rows.len() * 56);
    for (index, (voltage, current)) in rows.voltage_v.iter().zip(rows.current_a).enumerate() {
        let time_ns = header.time_ns(rows.first + index as u64);
        let (sign, time_ns) = (if time_ns < 0 { "-" } else { "" }, time_ns.unsigned_abs());
        let (seconds, mut fraction, mut digits) = (time_ns / 1_000_000_000, time_ns % 1_000_000_000, 9);
        while digits > 1 && fraction % 10 == 0 {
            fraction /= 10;
            digits -= 1;
        }
        // Writing to memory does not fail.
        let _ = write!(out, "{sign}{seconds}.{fraction:0digits$}");
        for value in [voltage, current] {
            let _ = write!(out, "{c}");
            push_decimal(&mut out, f64::from(*value));
        }
        out.push(b'\n');
    }
    out
}

/// Writes the JSON description: exact rate and start, number of samples, units, and the trace's metadata.
///
/// # Errors
/// [`WriteError`] if a mark is not finite or the writer fails.
pub fn write_sidecar<W: Write>(trace: &dyn TraceReader, mut out: W) -> Result<(), WriteError> {
    let json = to_json(&trace.header(), true)?;
    writeln!(out, "{json}").and_then(|()| out.flush()).map_err(encode)
}

/// Writes the CSV file and, beside it, its description; each whole or not at all.
///
/// # Errors
/// [`WriteError`] names the file.
pub fn save(trace: &dyn TraceReader, path: &Path) -> Result<(), WriteError> {
    save_as(trace, path, b',', false)
}

/// As [`save`], with another delimiter and optionally compressed with gzip.
///
/// # Errors
/// [`WriteError`] names the file.
pub fn save_as(trace: &dyn TraceReader, path: &Path, delimiter: u8, gzip: bool) -> Result<(), WriteError> {
    atomic::write_trace(path, |out| {
        if !gzip {
            return write_with(trace, out, delimiter);
        }
        let mut packed = GzEncoder::new(out, Compression::default());
        write_with(trace, &mut packed, delimiter)?;
        packed.finish().map(|_| ()).map_err(encode)
    })?;
    atomic::write_trace(&description_path(path), |out| write_sidecar(trace, out))
}

/// Rows that are checked for decimal commas, which cut numbers in two.
const CHECKED_ROWS: u64 = 1000;

type Text = Box<dyn Read + Send>;

/// A text being read.
struct CsvRows {
    path: PathBuf,
    /// Whether fields that are not numbers are repaired later.
    repair: bool,
    reader: Reader<Text>,
    record: ByteRecord,
    names: Vec<String>,
    row: u64,
    /// Whether the first record, which has no names, is in `record` already.
    held: bool,
    /// Rows with more or fewer fields than there are names: the first, its time if it has one, and how many.
    uneven: Option<(u64, Option<f64>, u64)>,
    /// How many of the first rows have something in a field without a name.
    surplus: u64,
}

fn damaged(path: &Path, error: &::csv::Error) -> ReadError {
    ReadError::Damaged { path: path.to_owned(), format: "CSV", reason: error.to_string() }
}

/// The description beside a file, where there is one.
pub(super) fn description(path: &Path) -> Result<Description, ReadError> {
    for sidecar in description_paths(path) {
        match fs::read_to_string(&sidecar) {
            Ok(json) => return Description::from_json(&sidecar, &json),
            Err(error) if error.kind() == io::ErrorKind::NotFound => {}
            Err(error) => return Err(ReadError::io(&sidecar, error)),
        }
    }
    Ok(Description::default())
}

/// Reads a CSV file, and its description if there is one at [`description_path`] or [`sidecar_path`].
///
/// Columns are found by name without regard to case, in any order among others; `time_s` may be missing if
/// the description states the rate. Without a description the rate is that of the time stamps.
///
/// # Errors
/// [`ReadError`] names the file, the row and what to do.
pub fn read(path: &Path) -> Result<Trace, ReadError> {
    Ok(recording::load(Rows::open_as(open_rows, path, &ReadOptions::default())?)?.trace)
}

/// Opens a text.
pub(super) fn open_rows(path: &Path, options: &ReadOptions) -> Result<Opened, ReadError> {
    let file = File::open(path).map_err(|error| ReadError::io(path, error))?;
    open_text(path, options, Box::new(file))
}

/// Opens a text that is compressed with gzip.
pub(super) fn open_gzip_rows(path: &Path, options: &ReadOptions) -> Result<Opened, ReadError> {
    let file = File::open(path).map_err(|error| ReadError::io(path, error))?;
    open_text(path, options, Box::new(MultiGzDecoder::new(BufReader::new(file))))
}

fn open_text(path: &Path, options: &ReadOptions, text: Text) -> Result<Opened, ReadError> {
    let description = description(path)?;
    let (rows, layout) = CsvRows::open(path, options, text)?;
    Ok(Opened { rows: Box::new(rows), layout, description, time: TIME_S })
}

impl CsvRows {
    fn open(path: &Path, options: &ReadOptions, text: Text) -> Result<(Self, Layout), ReadError> {
        let mut text = BufReader::with_capacity(1 << 16, Box::new(LineLimit::new(text)) as Text);
        let guessed = delimiter(text.fill_buf().map_err(|error| ReadError::io(path, error))?);
        let mut reader = ReaderBuilder::new()
            .flexible(true)
            .has_headers(false)
            .delimiter(options.delimiter.unwrap_or(guessed))
            .trim(::csv::Trim::All)
            .comment(Some(COMMENT))
            .buffer_capacity(1 << 16)
            .from_reader(Box::new(text) as Text);
        let mut record = ByteRecord::new();
        let any = reader.read_byte_record(&mut record).map_err(|error| damaged(path, &error))?;
        if !any {
            return Err(ReadError::Empty { path: path.to_owned() });
        }
        let numbers = record.iter().all(|field| number::<f64>(field).is_some());
        let held = !options.header.unwrap_or(!numbers);
        let name = |name: &[u8]| String::from_utf8_lossy(name).trim_start_matches('\u{feff}').to_owned();
        let names = if held { numbered(record.len()) } else { record.iter().map(name).collect() };
        let layout = match held {
            true => layout_of_unnamed(path, names.len(), options)?,
            false => layout(path, &names, options)?,
        };
        let (path, repair) = (path.to_owned(), options.repair);
        Ok((Self { path, repair, reader, record, names, row: 0, held, uneven: None, surplus: 0 }, layout))
    }

    /// Moves to the next row; whether there was one.
    fn advance(&mut self) -> Result<bool, ReadError> {
        if !std::mem::take(&mut self.held)
            && !self.reader.read_byte_record(&mut self.record).map_err(|error| damaged(&self.path, &error))?
        {
            self.check_surplus(self.row < CHECKED_ROWS)?;
            return Ok(false);
        }
        self.row += 1;
        let beyond =
            |record: &ByteRecord| record.iter().skip(self.names.len()).any(|field| !field.is_empty());
        self.surplus += u64::from(self.row <= CHECKED_ROWS && beyond(&self.record));
        self.check_surplus(self.row == CHECKED_ROWS)?;
        Ok(true)
    }

    /// Refuses numbers that most likely have decimal commas: without the surplus fields they would be wrong.
    fn check_surplus(&self, now: bool) -> Result<(), ReadError> {
        if now && 2 * self.surplus > self.row {
            return Err(ReadError::Surplus { path: self.path.clone(), rows: self.row });
        }
        Ok(())
    }

    /// A finite number; otherwise the placeholder `none` if it is repaired later, or the error that names its
    /// place.
    fn field<T: std::str::FromStr + Finite>(&self, column: &Picked, none: T) -> Result<T, ReadError> {
        let field = self.record.get(column.index).unwrap_or_default();
        match number(field) {
            Some(value) => Ok(value),
            None if has_decimal_comma(field) => Err(ReadError::DecimalComma {
                path: self.path.clone(),
                row: self.row,
                column: column.name.clone(),
                value: shown(field),
            }),
            None if self.repair => Ok(none),
            None => {
                let shown = shown(field);
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

impl RowSource for CsvRows {
    fn names(&self) -> &[String] {
        &self.names
    }

    fn skip(&mut self, rows: u64) -> Result<(), ReadError> {
        for _ in 0..rows {
            if !self.advance()? {
                break;
            }
        }
        Ok(())
    }

    fn next(&mut self, layout: &Layout, limit: usize, batch: &mut RowBatch) -> Result<usize, ReadError> {
        let mut times = match std::mem::replace(&mut batch.stamps, Stamps::Absent) {
            Stamps::Seconds(times) => times,
            _ => Vec::new(),
        };
        times.clear();
        let mut rows = 0;
        while rows < limit && self.advance()? {
            if self.record.len() != self.names.len() && !self.repair {
                let reason = format!("{} fields instead of {}", self.record.len(), self.names.len());
                return Err(ReadError::Row { path: self.path.clone(), row: self.row, reason });
            }
            let time = layout.time.as_ref();
            if let Some((column, field)) = time.and_then(|time| Some((time, self.record.get(time.index)?)))
                && is_date(field)
            {
                return Err(ReadError::Date {
                    path: self.path.clone(),
                    row: self.row,
                    column: column.name.clone(),
                    value: shown(field),
                });
            }
            if self.row == 1 && self.record.iter().all(is_word) {
                return Err(ReadError::Words { path: self.path.clone() });
            }
            if let Some(time) = &layout.time {
                times.push(self.field::<f64>(time, f64::NAN)? * time.scale);
            }
            if self.record.len() != self.names.len() {
                let time_s = times.last().copied().filter(|time_s| time_s.is_finite());
                self.uneven.get_or_insert((self.row, time_s, 0)).2 += 1;
            }
            for (column, values) in layout.values.iter().zip(&mut batch.values) {
                // Parsed as f32 at once: two roundings, decimal to f64 to f32, can differ from one.
                values.push(self.field::<f32>(column, f32::NAN)?);
            }
            rows += 1;
        }
        if layout.time.is_some() {
            batch.stamps = Stamps::Seconds(times);
        }
        Ok(rows)
    }

    /// The repair of the rows so far; without times, by the rate and start of the description.
    fn repair(&self, header: &Description) -> Option<Repair> {
        let (row, time_s, count) = self.uneven?;
        let time_s = time_s.unwrap_or_else(|| header.time_s(row as usize - 1));
        let message = format!(
            "{count} rows have more or fewer fields than there are columns, the first of them row {row} ({time_s} s); \
             surplus fields were dropped"
        );
        Some(Repair { code: RepairKind::UnevenRows, row, time_s, count, message })
    }
}

/// The begin of a field, for messages.
fn shown(field: &[u8]) -> String {
    String::from_utf8_lossy(field).chars().take(40).collect()
}

/// Whether a field is a date or a time of day: figures in at least three parts between `-`, `/` or `:`, such
/// as `2026-01-31` and `12:00:00.5`.
fn is_date(field: &[u8]) -> bool {
    let text = std::str::from_utf8(field).unwrap_or_default();
    let figures = |part: &str| part.starts_with(|c: char| c.is_ascii_digit());
    let mut parts = text.split(['-', '/', ':']);
    number::<f64>(field).is_none() && parts.clone().count() > 2 && parts.all(figures)
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

/// Longest line that is read, in bytes.
const MAX_LINE_BYTES: usize = 1 << 20;

/// Fails at a line longer than [`MAX_LINE_BYTES`], so that a file without line ends is not read into memory
/// whole.
struct LineLimit<R> {
    inner: R,
    since_end: usize,
}

impl<R> LineLimit<R> {
    pub fn new(inner: R) -> Self {
        Self { inner, since_end: 0 }
    }
}

impl<R: Read> Read for LineLimit<R> {
    fn read(&mut self, into: &mut [u8]) -> io::Result<usize> {
        let read = self.inner.read(into)?;
        self.since_end = match into[..read].iter().rposition(|&byte| byte == b'\n') {
            Some(last) => read - last - 1,
            None => self.since_end + read,
        };
        if self.since_end > MAX_LINE_BYTES {
            return Err(io::Error::other("a line is longer than 1 MiB"));
        }
        Ok(read)
    }
}

/// Appends a number as [`f64`]'s `Display` writes it: the shortest decimal that reads back the same, without
/// an exponent.
pub(crate) fn push_decimal(out: &mut Vec<u8>, value: f64) {
    let mut buffer = zmij::Buffer::new();
    let text = buffer.format(value);
    // An exponent has four characters at most.
    let exponent = text.bytes().rev().take(5).any(|byte| byte == b'e');
    if value.is_finite() && !exponent {
        out.extend_from_slice(text.strip_suffix(".0").unwrap_or(text).as_bytes());
    } else {
        out.extend_from_slice(value.to_string().as_bytes());
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn pushed(value: f64) -> String {
        let mut out = Vec::new();
        push_decimal(&mut out, value);
        String::from_utf8(out).unwrap()
    }

    #[test]
    fn dates_are_refused_with_the_remedy_and_numbers_are_none() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("t.csv");
        for stamp in ["2026-01-01T00:00:00.000000Z", "2026/01/01 00:00:00.001", "12:00:00.5"] {
            for power in ["1.5", "1.5 W"] {
                fs::write(&path, format!("time,power_W\n{stamp},{power}\n")).unwrap();
                let message = read(&path).unwrap_err().to_string();
                assert!(message.contains("dates are not read; write times in seconds"), "{message}");
            }
        }
        for other in ["1e-5", "-1e-5", "1-2", "a-b-c", "", "2026", "--"] {
            assert!(!is_date(other.as_bytes()), "{other}");
        }
    }

    #[test]
    fn ends_of_the_range_and_what_is_no_number_are_as_displayed() {
        for value in
            [0.0, -0.0, 1.0, -7.0, 1e15, 1e16, 1e300, 1e-5, 1.5e-6, f64::MAX, f64::MIN_POSITIVE, 5e-324]
        {
            assert_eq!(pushed(value), value.to_string());
        }
        for value in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            assert_eq!(pushed(value), value.to_string());
        }
    }

    proptest! {
        #[test]
        fn property_any_number_is_as_displayed(bits: u64, count in -1_000_000_i64..1_000_000, places in 0_i32..9) {
            prop_assert_eq!(pushed(f64::from_bits(bits)), f64::from_bits(bits).to_string());
            let short = count as f64 / 10_f64.powi(places);
            prop_assert_eq!(pushed(short), short.to_string());
        }
    }
}
