//! Interchange: CSV with the header `time_s,voltage_V,current_A`, no comment lines, and a JSON file beside it.

use super::header::{self, Header};
use super::timing::{self, Stamps};
use super::{ReadError, WriteError, atomic};
use crate::trace::Trace;
use ::csv::{ByteRecord, Reader, ReaderBuilder};
use std::fs::{self, File};
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

const TIME: &str = "time_s";
const CHANNELS: [&str; 2] = ["voltage_V", "current_A"];

/// Writes the samples. Times are whole nanoseconds written as seconds; values have the digits that read back as the same
/// number in f32 and in f64 alike, so that whoever integrates them in f64 finds the joules found here. About 50 bytes a
/// sample.
///
/// # Errors
/// [`WriteError::Encode`] if the writer fails.
pub fn write<W: Write>(trace: &Trace, out: W) -> Result<(), WriteError> {
    let mut out = BufWriter::with_capacity(1 << 16, out);
    write_rows(trace, &mut out).map_err(|error| WriteError::Encode(error.to_string()))
}

fn write_rows(trace: &Trace, out: &mut impl Write) -> std::io::Result<()> {
    writeln!(out, "{TIME},{},{}", CHANNELS[0], CHANNELS[1])?;
    for (index, (voltage, current)) in trace.voltage_v().iter().zip(trace.current_a()).enumerate() {
        let time_ns = trace.time_ns(index);
        let (sign, time_ns) = (if time_ns < 0 { "-" } else { "" }, time_ns.unsigned_abs());
        let (seconds, mut fraction, mut digits) = (time_ns / 1_000_000_000, time_ns % 1_000_000_000, 9);
        while digits > 1 && fraction % 10 == 0 {
            fraction /= 10;
            digits -= 1;
        }
        let (voltage, current) = (f64::from(*voltage), f64::from(*current));
        writeln!(out, "{sign}{seconds}.{fraction:0digits$},{voltage},{current}")?;
    }
    out.flush()
}

/// Writes the JSON description: exact rate and start, number of samples, units, and the trace's metadata.
///
/// # Errors
/// [`WriteError`] if a mark is not finite or the writer fails.
pub fn write_sidecar<W: Write>(trace: &Trace, mut out: W) -> Result<(), WriteError> {
    let json = header::to_json(trace, true)?;
    writeln!(out, "{json}").and_then(|()| out.flush()).map_err(|error| WriteError::Encode(error.to_string()))
}

/// Where the description of a CSV file lies: the same name ending in `.json`.
pub fn sidecar_path(path: &Path) -> PathBuf {
    path.with_extension("json")
}

/// Writes the CSV file and, beside it, its description; each whole or not at all.
///
/// # Errors
/// [`WriteError`] names the file.
pub fn save(trace: &Trace, path: &Path) -> Result<(), WriteError> {
    atomic::write_file(path, |out| write(trace, out))?;
    atomic::write_file(&sidecar_path(path), |out| write_sidecar(trace, out))
}

/// Reads a CSV file, and its description if there is a [`sidecar_path`].
///
/// Columns are found by name without regard to case, in any order among others; `time_s` may be missing if the
/// description states the rate. Without a description the rate is that of the time stamps.
///
/// # Errors
/// [`ReadError`] names the file, the row and how to mend it.
pub fn read(path: &Path) -> Result<Trace, ReadError> {
    let sidecar = sidecar_path(path);
    let header = match fs::read_to_string(&sidecar) {
        Ok(json) => header::from_json(&sidecar, &json)?,
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => Header::default(),
        Err(error) => return Err(ReadError::io(&sidecar, error)),
    };
    let file = File::open(path).map_err(|error| ReadError::io(path, error))?;
    let mut reader =
        ReaderBuilder::new().flexible(true).trim(::csv::Trim::All).buffer_capacity(1 << 16).from_reader(file);
    let columns = Columns::find(path, &mut reader)?;
    if columns.time.is_none() && header.rate_hz.is_none() {
        return Err(columns.missing(path, TIME));
    }
    let (times, channels) = columns.read_rows(path, &mut reader)?;
    let rows = channels[0].len();
    if rows == 0 {
        return Err(ReadError::Empty { path: path.to_owned() });
    }
    header.check_rows(path, rows as u64)?;
    let stamps = if columns.time.is_some() { Stamps::Seconds(times) } else { Stamps::Absent };
    let grid = timing::grid(path, &stamps, &header)?;
    let [voltage_v, current_a] = channels;
    Trace::new(voltage_v, current_a, grid.rate_hz, grid.start_s, header.metadata)
        .map_err(|error| ReadError::trace(path, error))
}

/// Which fields hold what.
struct Columns {
    time: Option<usize>,
    channels: [usize; 2],
    names: String,
    count: usize,
}

impl Columns {
    fn find(path: &Path, reader: &mut Reader<File>) -> Result<Self, ReadError> {
        let names = reader.byte_headers().map_err(|error| damaged(path, &error))?;
        let names: Vec<String> =
            names.iter().map(|name| String::from_utf8_lossy(name).into_owned()).collect();
        let find = |column: &'static str| {
            let mut hits = names
                .iter()
                .enumerate()
                .filter(|(_, name)| name.trim_start_matches('\u{feff}').eq_ignore_ascii_case(column));
            let hit = hits.next().map(|(index, _)| index);
            if hits.next().is_some() {
                Err(ReadError::DuplicateColumn { path: path.to_owned(), column })
            } else {
                Ok(hit)
            }
        };
        let listed = if names.is_empty() {
            "none".to_owned()
        } else {
            names.iter().take(20).cloned().collect::<Vec<_>>().join(", ")
        };
        let mut columns = Self { time: find(TIME)?, channels: [0; 2], names: listed, count: names.len() };
        for (field, column) in CHANNELS.into_iter().enumerate() {
            columns.channels[field] = find(column)?.ok_or_else(|| columns.missing(path, column))?;
        }
        Ok(columns)
    }

    fn missing(&self, path: &Path, column: &'static str) -> ReadError {
        ReadError::MissingColumn { path: path.to_owned(), column, found: self.names.clone() }
    }

    fn read_rows(
        &self,
        path: &Path,
        reader: &mut Reader<File>,
    ) -> Result<(Vec<f64>, [Vec<f32>; 2]), ReadError> {
        let (mut times, mut channels) = (Vec::new(), [Vec::new(), Vec::new()]);
        let mut record = ByteRecord::new();
        for row in 1.. {
            if !reader.read_byte_record(&mut record).map_err(|error| damaged(path, &error))? {
                break;
            }
            if record.len() != self.count {
                let reason = format!("{} fields instead of {}", record.len(), self.count);
                return Err(ReadError::Row { path: path.to_owned(), row, reason });
            }
            if let Some(time) = self.time {
                times.push(number(path, row, TIME, &record[time])?);
            }
            for (field, channel) in channels.iter_mut().enumerate() {
                // Parsed as f32 at once: two roundings, decimal to f64 to f32, can differ from one.
                channel.push(number(path, row, CHANNELS[field], &record[self.channels[field]])?);
            }
        }
        Ok((times, channels))
    }
}

/// A finite number, or the error that names its place.
fn number<T: std::str::FromStr + Finite>(
    path: &Path,
    row: u64,
    column: &'static str,
    field: &[u8],
) -> Result<T, ReadError> {
    let text = std::str::from_utf8(field).ok();
    text.and_then(|text| text.parse().ok()).filter(T::finite).ok_or_else(|| {
        let shown: String = String::from_utf8_lossy(field).chars().take(40).collect();
        let value = if shown.is_empty() { "empty".to_owned() } else { format!("{shown:?}") };
        ReadError::Value { path: path.to_owned(), row, column, value }
    })
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

fn damaged(path: &Path, error: &::csv::Error) -> ReadError {
    ReadError::Damaged { path: path.to_owned(), format: "CSV", reason: error.to_string() }
}
