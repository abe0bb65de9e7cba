//! Files of marks and stamps.

use std::fs;
use std::path::Path;

use super::input::wrong;
use crate::cli::Failure;

/// Names of columns of times.
const TIMES: [&str; 4] = ["start_s", "time_s", "mark_s", "stamp_s"];

/// Times from a file: a number in each line, or the first of the columns [`TIMES`] that a table has.
pub(super) fn times(path: &Path) -> Result<Vec<f64>, Failure> {
    let text = fs::read_to_string(path)
        .map_err(|error| wrong(format!("{}: cannot be read: {error}", path.display())))?;
    let mut column = 0;
    let mut times = Vec::new();
    for (index, line) in text.lines().enumerate().filter(|(_, line)| !line.trim().is_empty()) {
        let fields: Vec<&str> =
            line.trim_start_matches('\u{feff}').split([',', '\t', ';']).map(str::trim).collect();
        match fields.get(column).and_then(|field| field.parse::<f64>().ok()).filter(|time| time.is_finite()) {
            Some(time) => times.push(time),
            None if times.is_empty() && index == 0 => column = time_column(path, &fields)?,
            None => {
                let message = format!(
                    "{}: line {}: `{line}` holds no time in seconds; mend it",
                    path.display(),
                    index + 1
                );
                return Err(wrong(message));
            }
        }
    }
    if times.is_empty() { Err(wrong(format!("{}: holds no time", path.display()))) } else { Ok(times) }
}

/// Where times stand in a table; a single column may be called anything.
fn time_column(path: &Path, names: &[&str]) -> Result<usize, Failure> {
    let named = |time: &&str| names.iter().position(|name| name.eq_ignore_ascii_case(time));
    let only = (names.len() == 1).then_some(0);
    TIMES.iter().find_map(named).or(only).ok_or_else(|| {
        let (found, times) = (names.join(", "), TIMES.join(", "));
        wrong(format!("{}: none of its columns ({found}) is called {times}: rename one", path.display()))
    })
}
