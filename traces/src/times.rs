//! Files of times: marks of frames, or stamps of another clock; and the time base of a file of samples,
//! before all of them have been read.

use crate::io::{ReadError, ReadOptions, RowBatch, Rows, Stamps, all_apart, grid, rate_to_last_row_hz};
use crate::units::{Quantity, TIME_WORDS, UnitError, scale};
use std::fs;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use thiserror::Error;

/// Why a file of times cannot be used.
#[derive(Debug, Error)]
pub enum TimesError {
    /// A folder where a file has to be.
    #[error("{path}: is a folder: name a file in it", path = path.display())]
    Folder {
        /// The folder.
        path: PathBuf,
    },
    /// The file could not be read.
    #[error("{path}: cannot read it: {source}; check the path", path = path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// The error of the system.
        source: std::io::Error,
    },
    /// The file has no times.
    #[error("{path}: no times: write one in each line", path = path.display())]
    Empty {
        /// The file.
        path: PathBuf,
    },
    /// No column of the table has times.
    #[error(
        "{path}: none of its columns ({found}) is called {times}, also with a unit, as in start_ms: rename one",
        path = path.display(), times = TIME_WORDS.join(", ")
    )]
    Column {
        /// The file.
        path: PathBuf,
        /// The names of its columns.
        found: String,
    },
    /// The unit in the name of the column is not of times.
    #[error("{path}: {source}: rename it", path = path.display())]
    Unit {
        /// The file.
        path: PathBuf,
        /// The error of the unit.
        source: UnitError,
    },
    /// A line without a time.
    #[error("{path}: line {line}: `{text}` {reason}", path = path.display())]
    Line {
        /// The file.
        path: PathBuf,
        /// The line, from 1.
        line: usize,
        /// Its text.
        text: String,
        /// The error.
        reason: String,
    },
}

/// A column of times.
struct Column {
    index: usize,
    /// Number of columns of the table.
    columns: usize,
    /// Factor to s.
    scale: f64,
}

/// Reads times, s: a number in each line, or the column of times of a table with a header, by the unit in its
/// name.
///
/// # Errors
/// [`TimesError`] names the file, and the line where one is wrong.
pub fn read_times(path: &Path) -> Result<Vec<f64>, TimesError> {
    let text = fs::read_to_string(path).map_err(|error| unreadable(path, error))?;
    let mut column = Column { index: 0, columns: 1, scale: 1.0 };
    let mut times = Vec::new();
    let lines = text.trim_start_matches('\u{feff}').lines().enumerate();
    for (nth, (index, line)) in lines.filter(|(_, line)| !line.trim().is_empty()).enumerate() {
        let fields: Vec<&str> = line.split([',', '\t', ';']).map(str::trim).collect();
        if nth == 0 && is_header(&fields) {
            column = Column::named(path, &fields)?;
            continue;
        }
        times.push(column.time_s(&fields).map_err(|reason| {
            let (path, text) = (path.to_owned(), line.to_owned());
            TimesError::Line { path, line: index + 1, text, reason }
        })?);
    }
    if times.is_empty() { Err(TimesError::Empty { path: path.to_owned() }) } else { Ok(times) }
}

/// Whether no field of a first line is a number, nor the first one meant for a number: `1.5s`.
fn is_header(fields: &[&str]) -> bool {
    let begins = fields[0].trim_start_matches(['+', '-', '.']).starts_with(|c: char| c.is_ascii_digit());
    !begins && fields.iter().all(|field| field.parse::<f64>().is_err())
}

fn unreadable(path: &Path, source: std::io::Error) -> TimesError {
    let path = path.to_owned();
    match source.kind() {
        ErrorKind::IsADirectory => TimesError::Folder { path },
        _ => TimesError::Io { path, source },
    }
}

impl Column {
    /// The column of times of a table; a single one may have any name.
    fn named(path: &Path, names: &[&str]) -> Result<Self, TimesError> {
        let named = |time: &&str| names.iter().position(|name| first_word(name) == *time);
        let only = (names.len() == 1).then_some(0);
        let index = TIME_WORDS.iter().find_map(named).or(only).ok_or_else(|| {
            let found = names.join(", ");
            TimesError::Column { path: path.to_owned(), found }
        })?;
        let unit = scale(names[index], Quantity::Time);
        let unit = unit.map_err(|source| TimesError::Unit { path: path.to_owned(), source })?;
        Ok(Self { index, columns: names.len(), scale: unit.unwrap_or(1.0) })
    }

    /// The time of a row, s, or what is wrong, to be written after the row. A row of another length is
    /// refused: its fields may be halves of a number with a decimal comma.
    fn time_s(&self, fields: &[&str]) -> Result<f64, String> {
        if fields.len() != self.columns {
            return Err(match self.columns {
                1 => format!(
                    "has {} fields: put the names of columns into the first line, or leave a number alone in each, \
                     with a decimal point",
                    fields.len()
                ),
                columns => format!("has {} fields, the first line {columns}: fix it", fields.len()),
            });
        }
        let number = fields[self.index].parse::<f64>().ok().filter(|time| time.is_finite());
        number
            .map(|time| time * self.scale)
            .ok_or_else(|| "is not a time: write seconds, such as 2.513".to_owned())
    }
}

/// The first word of a name, in small letters: the others are its unit.
fn first_word(name: &str) -> String {
    let name = name.to_ascii_lowercase();
    name.split(|c: char| !c.is_alphanumeric()).find(|word| !word.is_empty()).unwrap_or_default().to_owned()
}

/// Rows from which the rate is first estimated.
const FIRST_ROWS: usize = 1001;
/// Largest distance of a stamp from its place, in sample periods.
const MAX_OFFSET_PERIODS: f64 = 0.25;
/// Evenly spaced samples in time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Clock {
    /// Left edge of the first sample, s.
    pub start_s: f64,
    /// Samples per second.
    pub rate_hz: f64,
    /// How many there are; `None` where the file does not say before it is read.
    pub samples: Option<u64>,
}

impl Clock {
    /// Position of a time in samples, fractional.
    pub fn position(&self, time_s: f64) -> f64 {
        (time_s - self.start_s) * self.rate_hz
    }

    /// Left edge of a sample, s.
    pub fn time_s(&self, position: f64) -> f64 {
        self.start_s + position / self.rate_hz
    }

    /// Refuses stamps that are not in their places; `first` is the row of the first of them, from 0.
    pub(crate) fn check(&self, path: &Path, stamps: &Stamps, first: u64) -> Result<(), ReadError> {
        if let Stamps::Nanoseconds(times) = stamps
            && let [a, b, ..] = times[..]
        {
            // Equal steps and both ends in place: so is all between.
            if all_apart(times, b.wrapping_sub(a))
                && self.off(stamps, 0, first).abs() <= MAX_OFFSET_PERIODS
                && self.off(stamps, times.len() - 1, first).abs() <= MAX_OFFSET_PERIODS
            {
                return Ok(());
            }
        }
        match (0..stamps.len())
            .map(|row| (row, self.off(stamps, row, first)))
            .find(|(_, off)| off.is_nan() || off.abs() > MAX_OFFSET_PERIODS)
        {
            Some((row, off_periods)) => Err(ReadError::Uneven {
                path: path.to_owned(),
                row: first + row as u64 + 1,
                time_s: stamps.time_s(row),
                off_periods,
                rate_hz: self.rate_hz,
            }),
            None => Ok(()),
        }
    }

    fn off(&self, stamps: &Stamps, row: usize, first: u64) -> f64 {
        self.position(stamps.time_s(row)) - (first + row as u64) as f64
    }
}

/// Start, rate and number of a file's samples, from its description, its first rows and its last one.
///
/// # Errors
/// [`ReadError`] if it cannot be read or its first rows are not even.
pub fn clock(path: &Path, options: &ReadOptions) -> Result<Clock, ReadError> {
    let mut rows = Rows::open(path, options)?;
    let samples = rows.count();
    let mut batch = RowBatch::default();
    if rows.next(FIRST_ROWS, &mut batch)? == 0 {
        return Err(ReadError::Empty { path: path.to_owned() });
    }
    let stated = rows.description.rate_hz.is_some();
    let first = grid(path, &batch.stamps, &rows.description)?;
    let mut clock = Clock { start_s: first.start_s, rate_hz: first.rate_hz, samples };
    let Some(last) = samples.filter(|&n| !stated && n > FIRST_ROWS as u64).map(|n| n - 1) else {
        return Ok(clock);
    };
    let first_rows = std::mem::take(&mut batch);
    let mut rows = Rows::open(path, options)?;
    rows.skip(last)?;
    if rows.next(1, &mut batch)? == 1 {
        let span_s = batch.stamps.time_s(0) - first_rows.stamps.time_s(0);
        clock.rate_hz = rate_to_last_row_hz(&first_rows.stamps, clock.rate_hz, last, span_s);
    }
    Ok(clock)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::io::parquet;
    use crate::trace::{Metadata, Trace};

    fn read(text: &str) -> Result<Vec<f64>, String> {
        let file = tempfile::NamedTempFile::new().unwrap();
        fs::write(file.path(), text).unwrap();
        read_times(file.path()).map_err(|error| error.to_string())
    }

    #[test]
    fn times_are_taken_by_the_name_and_unit_of_their_column() {
        for text in [
            "0.5\n\n1.5\n",
            "start_ms\n500\n1500\n",
            "\u{feff}t [us]\n500000\n1500000\n",
            "frame,time_s\n7,0.5\n8,1.5\n",
            "time_s;start_ms\n9;500\n9;1500\n",
            "Start\tlabel\n0.5\ta\n1.5\tb\n",
            "anything\n0.5\n1.5\n",
        ] {
            assert_eq!(read(text), Ok(vec![0.5, 1.5]), "{text}");
        }
    }

    #[test]
    fn what_may_mean_another_number_is_refused_with_its_line() {
        for (text, says) in [
            ("0.5\n1,5\n", "line 2: `1,5` has 2 fields"),
            ("0,5\n", "line 1: `0,5` has 2 fields"),
            ("7,0.5\n8,1.5\n", "line 1: `7,0.5` has 2 fields"),
            ("start_s;label\n1,5;a\n", "line 2: `1,5;a` has 3 fields, the first line 2"),
            ("frame,energy\n1,2\n", "(frame, energy) is called start, time"),
            ("start_mJ\n1\n", "holds no times"),
            ("1.5s\n2.5\n", "line 1: `1.5s` is not a time"),
            ("1.5.0\n2.5\n", "line 1: `1.5.0` is not a time"),
            ("-.5s\n2.5\n", "line 1: `-.5s` is not a time"),
            ("1.5s,a\n2.5,b\n", "line 1: `1.5s,a` has 2 fields"),
            ("time_s\nx\n", "line 2: `x` is not a time"),
        ] {
            let message = read(text).unwrap_err();
            assert!(message.contains(says), "{text}: {message}");
        }
    }

    /// The clock of a file of some rows of which some are lost.
    fn clock_of(
        samples: usize,
        rate_hz: f64,
        lost: Option<core::ops::Range<usize>>,
    ) -> (Clock, Result<(), ReadError>) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("t.parquet");
        let trace =
            Trace::new(vec![1.0; samples], vec![1.0; samples], rate_hz, 0.0, Metadata::default()).unwrap();
        // Without a description, which would state the rate.
        let rows = trace.without(lost);
        let json = parquet::bare(&rows, &path);
        json.unwrap();
        let clock = clock(&path, &ReadOptions::default()).unwrap();
        let mut rows = Rows::open(&path, &ReadOptions::default()).unwrap();
        let mut batch = RowBatch::default();
        rows.next(samples, &mut batch).unwrap();
        (clock, clock.check(&path, &batch.stamps, 0))
    }

    #[test]
    fn a_rate_that_nanoseconds_round_is_that_of_the_whole_but_a_gap_changes_none() {
        for rate_hz in [44_117.65, 1e6 / 3.0, 3e5 / 7.0] {
            let (clock, even) = clock_of(30_000, rate_hz, None);
            assert!((clock.rate_hz / rate_hz - 1.0).abs() < 0.05 / 3e4 && even.is_ok(), "{clock:?} {even:?}");
        }
        for lost in [5000..5001, 5000..5100, 20_000..29_000] {
            let (clock, result) = clock_of(30_000, 1e4, Some(lost.clone()));
            assert_eq!(clock.rate_hz, 1e4);
            let message = result.unwrap_err().to_string();
            let says = format!("row {}: time", lost.start + 1);
            assert!(message.contains(&says), "{message}");
        }
    }
}
