//! Files of times: marks of frames, or stamps of another clock.

use crate::units::{PhysicalQuantity, TIME_WORDS, UnitError, scale};
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
        /// Text of the line that has no time.
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
        let unit = scale(names[index], PhysicalQuantity::Time);
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

#[cfg(test)]
mod tests {
    use super::*;

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
}
