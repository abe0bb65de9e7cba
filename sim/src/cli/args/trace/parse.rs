//! Parsers of values with two parts.

use crate::cli::quantity::{milliseconds, time};

/// Two values separated by `between`; `form` describes them in errors.
fn two(
    text: &str,
    between: &str,
    form: &str,
    value: fn(&str) -> Result<f64, String>,
) -> Result<(f64, f64), String> {
    let (a, b) = text.split_once(between).ok_or_else(|| format!("`{text}` is not of the form {form}"))?;
    let value =
        |part: &str| value(part).map_err(|error| format!("`{text}` is not of the form {form}: {error}"));
    Ok((value(a)?, value(b)?))
}

/// Times before and after a mark, s.
pub(super) fn window(text: &str) -> Result<(f64, f64), String> {
    two(text, ",", "PRE,POST in milliseconds or with units, for example 1,4 or 500us,4ms", milliseconds)
}

/// A segment of a trace, s.
pub(super) fn segment(text: &str) -> Result<(f64, f64), String> {
    let (a, b) =
        two(text, "..", "A..B in seconds or with units, for example 0.1..0.4 or 100ms..400ms", time)?;
    if a < b {
        Ok((a, b))
    } else {
        Err(format!("`{text}` ends before it begins; the earlier time comes first"))
    }
}

/// A stamp and its time in the trace, s.
pub(super) fn anchor(text: &str) -> Result<(f64, f64), String> {
    two(text, "=", "STAMP=TIME in seconds or with units, for example 0.5=2.513", time)
}

/// The name of a pass and when it begins after the start of its frame, s.
pub(super) fn pass(text: &str) -> Result<(String, f64), String> {
    let form = "NAME=MS, for example light=4.2 or light=4200us";
    let (name, begins) = text.split_once('=').ok_or_else(|| format!("`{text}` is not of the form {form}"))?;
    let begins_s =
        milliseconds(begins).map_err(|error| format!("`{text}` is not of the form {form}: {error}"))?;
    Ok((name.to_owned(), begins_s))
}
