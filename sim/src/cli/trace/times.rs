//! Files of marks and stamps.

use std::fs;
use std::io::ErrorKind;
use std::path::Path;

use super::failure::wrong;
use super::units::{Quantity, scale};
use crate::cli::Failure;

/// Names of columns of times, without their units, the likeliest first.
const TIMES: [&str; 6] = ["start", "time", "mark", "stamp", "timestamp", "t"];

/// A column of times.
struct Column {
    index: usize,
    /// Columns of the table.
    of: usize,
    /// What to multiply by for s.
    scale: f64,
}

/// Times from a file, s: a number in each line, or the column of times of a table with a header, by the unit in its name.
pub(super) fn times(path: &Path) -> Result<Vec<f64>, Failure> {
    let text = fs::read_to_string(path).map_err(|error| unread(path, &error))?;
    let mut column = Column { index: 0, of: 1, scale: 1.0 };
    let mut times = Vec::new();
    let lines = text.trim_start_matches('\u{feff}').lines().enumerate();
    for (nth, (index, line)) in lines.filter(|(_, line)| !line.trim().is_empty()).enumerate() {
        let fields: Vec<&str> = line.split([',', '\t', ';']).map(str::trim).collect();
        if nth == 0 && is_header(&fields) {
            column = Column::named(path, &fields)?;
            continue;
        }
        times.push(
            column.time_s(&fields).map_err(|reason| {
                wrong(format!("{}: line {}: `{line}` {reason}", path.display(), index + 1))
            })?,
        );
    }
    let none =
        || Failure { message: format!("{}: holds no time: give one in each line", path.display()), code: 1 };
    if times.is_empty() { Err(none()) } else { Ok(times) }
}

/// Whether there is no number among the fields of a first line, nor in the first what seems meant for one: `1.5s`.
fn is_header(fields: &[&str]) -> bool {
    let begins = fields[0].trim_start_matches(['+', '-', '.']).starts_with(|c: char| c.is_ascii_digit());
    !begins && fields.iter().all(|field| field.parse::<f64>().is_err())
}

/// What is not there was asked for wrongly; what cannot be read failed.
fn unread(path: &Path, error: &std::io::Error) -> Failure {
    let code = if error.kind() == ErrorKind::NotFound { 2 } else { 1 };
    let message = match error.kind() {
        ErrorKind::IsADirectory => format!("{}: is a folder: name a file in it", path.display()),
        _ => format!("{}: cannot be read: {error}", path.display()),
    };
    Failure { message, code }
}

impl Column {
    /// The column of times of a table; a single one may be called anything.
    fn named(path: &Path, names: &[&str]) -> Result<Self, Failure> {
        let named = |time: &&str| names.iter().position(|name| word(name) == *time);
        let only = (names.len() == 1).then_some(0);
        let index = TIMES.iter().find_map(named).or(only).ok_or_else(|| {
            let (found, times) = (names.join(", "), TIMES.join(", "));
            wrong(format!(
                "{}: none of its columns ({found}) is called {times}, also with a unit, as in start_ms: rename one",
                path.display()
            ))
        })?;
        let unit = scale(names[index], Quantity::Time);
        let unit = unit.map_err(|reason| wrong(format!("{}: {reason}: rename it", path.display())))?;
        Ok(Self { index, of: names.len(), scale: unit.unwrap_or(1.0) })
    }

    /// The time of a row, s; what is wrong, to be put after the row. A row of other length is refused: its fields may be
    /// halves of a number with a decimal comma.
    fn time_s(&self, fields: &[&str]) -> Result<f64, String> {
        if fields.len() != self.of {
            return Err(match self.of {
                1 => format!(
                    "has {} fields: put the names of columns into the first line, or leave a number alone in each, \
                     with a decimal point",
                    fields.len()
                ),
                of => format!("has {} fields, the first line {of}: mend it", fields.len()),
            });
        }
        let number = fields[self.index].parse::<f64>().ok().filter(|time| time.is_finite());
        number.map(|time| time * self.scale).ok_or_else(|| "holds no time; mend it".to_owned())
    }
}

/// The first word of a name, in small letters: the others are its unit.
fn word(name: &str) -> String {
    let name = name.to_ascii_lowercase();
    name.split(|c: char| !c.is_alphanumeric()).find(|word| !word.is_empty()).unwrap_or_default().to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<Vec<f64>, String> {
        let file = tempfile::NamedTempFile::new().unwrap();
        fs::write(file.path(), text).unwrap();
        times(file.path()).map_err(|failure| failure.message)
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
            ("1.5s\n2.5\n", "line 1: `1.5s` holds no time"),
            ("1.5.0\n2.5\n", "line 1: `1.5.0` holds no time"),
            ("-.5s\n2.5\n", "line 1: `-.5s` holds no time"),
            ("1.5s,a\n2.5,b\n", "line 1: `1.5s,a` has 2 fields"),
            ("time_s\nx\n", "line 2: `x` holds no time"),
        ] {
            let message = read(text).unwrap_err();
            assert!(message.contains(says), "{text}: {message}");
        }
    }
}
