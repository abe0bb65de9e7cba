//! Reading spec files (scenes, GPUs, platforms, energy tables) written in RON.
//!
//! Every mistake is reported as `file:line:column: what is wrong, how to mend it`; an unknown field or
//! variant comes with the nearest known name.

use std::path::Path;

use ron::error::{Error, SpannedError};
use ron::extensions::Extensions;
use serde::de::DeserializeOwned;

use crate::inputs;

/// Why a spec file could not be used.
#[derive(Debug, thiserror::Error)]
pub enum SpecError {
    /// The file could not be read.
    #[error("{path}: cannot read it: {source}; check the path, and that it is a text file in UTF-8")]
    Read {
        /// The file as it was named.
        path: String,
        /// What the system said.
        source: std::io::Error,
    },
    /// The text is not a valid spec.
    #[error("{path}:{line}:{column}: {message}")]
    Parse {
        /// The file as it was named.
        path: String,
        /// Line, from 1.
        line: usize,
        /// Column, from 1.
        column: usize,
        /// What is wrong and how to mend it.
        message: String,
    },
}

/// Reads and parses the RON file at `path`.
///
/// # Errors
/// [`SpecError`] when the file cannot be read or its text does not describe a `T`.
pub fn load<T: DeserializeOwned>(path: &Path) -> Result<T, SpecError> {
    parse(&read(path)?, &path.display().to_string())
}

/// The text of the spec file at `path`.
///
/// # Errors
/// [`SpecError::Read`] when it cannot be read.
pub fn read(path: &Path) -> Result<String, SpecError> {
    inputs::read_to_string(path)
        .map_err(|source| SpecError::Read { path: path.display().to_string(), source })
}

/// Where the value of a field stands in RON `text`, as line and column from 1; `field` names it from the outside in, such as
/// `pipeline.memory.l2`. Nothing where the text has no such field. For values that are wrong only beside others, which is
/// known only after the text is parsed.
pub fn place_of(text: &str, field: &str) -> Option<(usize, usize)> {
    let plain = without_comments(text);
    let mut at = 0;
    for name in field.split('.') {
        at += value_of(&plain[at..], name)?;
    }
    let before = &text[..at];
    let line_start = before.rfind('\n').map_or(0, |newline| newline + 1);
    Some((1 + before.matches('\n').count(), 1 + text[line_start..at].chars().count()))
}

/// Where the value of the first field called `name` begins.
fn value_of(text: &str, name: &str) -> Option<usize> {
    let is_word = |c: char| c.is_alphanumeric() || c == '_';
    text.match_indices(name).find_map(|(at, _)| {
        let rest = &text[at + name.len()..];
        let colon = rest.trim_start().starts_with(':') && !text[..at].ends_with(is_word);
        let after = at + name.len() + rest.find(':')? + 1;
        colon.then(|| after + text[after..].len() - text[after..].trim_start().len())
    })
}

/// The same text with spaces in place of `//` comments, byte for byte.
fn without_comments(text: &str) -> String {
    let line = |line: &str| match line.find("//") {
        Some(at) => format!("{}{}", &line[..at], " ".repeat(line.len() - at)),
        None => line.to_owned(),
    };
    text.split('\n').map(line).collect::<Vec<_>>().join("\n")
}

/// Parses RON `text`; `name` stands for the file in messages.
///
/// # Errors
/// [`SpecError::Parse`] with the place of the mistake.
pub fn parse<T: DeserializeOwned>(text: &str, name: &str) -> Result<T, SpecError> {
    let options = ron::Options::default()
        .with_default_extension(Extensions::IMPLICIT_SOME)
        .with_default_extension(Extensions::UNWRAP_VARIANT_NEWTYPES);
    // Some editors begin a file with a byte order mark.
    let text = text.trim_start_matches('\u{feff}');
    options.from_str(text).map_err(|error| describe(&error, text, name))
}

fn describe(error: &SpannedError, text: &str, name: &str) -> SpecError {
    let place = error.span.start;
    let field = field_of_value(text, place.line, place.col);
    SpecError::Parse {
        path: name.to_owned(),
        line: place.line,
        column: place.col,
        message: message(&error.code, field.as_deref(), word_at(text, place.line, place.col)),
    }
}

/// The name of the field whose value is at or just before a place: what stands before the last colon of its line up to there.
/// Nothing where the line has none.
fn field_of_value(text: &str, line: usize, column: usize) -> Option<String> {
    let line = text.lines().nth(line.checked_sub(1)?)?;
    let before: String = line.chars().take(column.saturating_sub(1)).collect();
    // A place behind the comma that ends the value.
    let before = before.trim_end().trim_end_matches(',');
    let (name, value) = before.rsplit_once(':')?;
    let name = name.trim_end().trim_end_matches('"');
    let name = name.rsplit(|c: char| !c.is_alphanumeric() && c != '_').next().unwrap_or_default();
    let is_value = !value.contains(',') || value.contains('(') || value.contains('[');
    (is_value && !name.is_empty()).then(|| name.to_owned())
}

/// The word or number that a place is in, just behind, or before but for spaces, for messages.
fn word_at(text: &str, line: usize, column: usize) -> &str {
    let line = text.lines().nth(line.saturating_sub(1)).unwrap_or_default();
    let at = line.char_indices().nth(column.saturating_sub(1)).map_or(line.len(), |(at, _)| at);
    let ends = |c: char| c.is_whitespace() || ",:()[]{}".contains(c);
    let apart = line[..at].ends_with(ends) || at == 0;
    let at = if apart { at + line[at..].len() - line[at..].trim_start().len() } else { at };
    let [before, after] = [line[..at].rsplit(ends).next(), line[at..].split(ends).next()];
    let [before, after] = [before, after].map(|part| part.map_or(0, str::len));
    &line[at - before..at + after]
}

fn message(code: &Error, field: Option<&str>, word: &str) -> String {
    let of_field = |message: String| match field {
        Some(field) if !message.contains(&format!("`{field}`")) => format!("`{field}`: {message}"),
        _ => message,
    };
    let not_whole = || of_field(format!("`{word}` is not a whole number; write one such as 16"));
    match code {
        Error::NoSuchStructField { expected, found, .. } => {
            format!("unknown field `{found}`, {}", suggestion(found, expected))
        }
        Error::NoSuchEnumVariant { expected, found, .. } => {
            format!("unknown variant `{found}`, {}", suggestion(found, expected))
        }
        Error::MissingStructField { field, .. } => format!("missing field `{field}`: add it"),
        Error::ExpectedFloat => of_field(format!("`{word}` is not a number; write one such as 0.5 or 400e6")),
        Error::ExpectedInteger | Error::InvalidIntegerDigit { .. } => not_whole(),
        // A whole number was read and something follows it, as in 1.5.
        Error::ExpectedComma
        | Error::ExpectedStructLikeEnd
        | Error::ExpectedArrayEnd
        | Error::ExpectedMapEnd
            if word.parse::<i64>().is_err() && word.parse::<f64>().is_ok() =>
        {
            not_whole()
        }
        Error::InvalidIdentifier(_) | Error::SuggestRawIdentifier(_) => {
            of_field(format!("`{word}` is no name of a field; write fields as `name: value`"))
        }
        Error::IntegerOutOfBounds if word.starts_with('-') => {
            of_field(format!("`{word}` is below 0; write 0 or more"))
        }
        Error::IntegerOutOfBounds => of_field(format!("`{word}` is too large; write a smaller number")),
        other => of_field(other.to_string()),
    }
}

/// "did you mean `x`?" for the nearest of `known`, or the whole list where none is near.
pub fn suggestion(found: &str, known: &[&str]) -> String {
    let nearest = known.iter().map(|name| (strsim::damerau_levenshtein(found, name), *name)).min();
    // Half of a short word is no slip of the hand: `foo` is not `look`.
    let slip = |distance: usize, name: &str| {
        distance <= 1 + found.len() / 3 && 2 * distance < found.len().max(name.len())
    };
    match nearest {
        Some((distance, name)) if slip(distance, name) => format!("did you mean `{name}`?"),
        Some(_) => format!("known here: {}", known.join(", ")),
        None => "none is known here".to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde::Deserialize;

    #[derive(Debug, Deserialize)]
    #[serde(deny_unknown_fields)]
    struct Gpu {
        #[allow(dead_code)]
        tile_size: u32,
        #[allow(dead_code)]
        clock_hz: f64,
    }

    #[test]
    fn an_unknown_field_names_its_place_and_its_neighbour() {
        let error = parse::<Gpu>("(\n  clock_hz: 1e9,\n  tile_sise: 8,\n)", "gpu.ron").unwrap_err();
        let text = error.to_string();
        assert!(text.starts_with("gpu.ron:3:"), "{text}");
        assert!(text.contains("unknown field `tile_sise`, did you mean `tile_size`?"), "{text}");
    }

    #[test]
    fn a_far_name_lists_the_known_ones() {
        let error = parse::<Gpu>("(wibble: 1)", "gpu.ron").unwrap_err();
        assert!(error.to_string().contains("known here: tile_size, clock_hz"), "{error}");
        assert_eq!(suggestion("foo", &["look", "seconds"]), "known here: look, seconds");
    }

    #[test]
    fn a_missing_field_is_named() {
        let error = parse::<Gpu>("(tile_size: 8)", "gpu.ron").unwrap_err();
        assert!(error.to_string().contains("missing field `clock_hz`"), "{error}");
    }

    #[test]
    fn the_place_of_a_field_is_that_of_its_value() {
        let text = "(\n  // memory: none\n  core: (cache: (ways: 1)),\n  memory: (\n    l2: (ways: 8), cache: 4),\n)";
        assert_eq!(place_of(text, "memory.l2.ways"), Some((5, 16)));
        assert_eq!(place_of(text, "memory.cache"), Some((5, 27)));
        assert_eq!(place_of(text, "core.cache"), Some((3, 17)));
        assert_eq!([place_of(text, "way"), place_of(text, "memory.l3")], [None, None]);
    }

    #[test]
    fn a_missing_file_is_an_error_not_a_panic() {
        let error = load::<Gpu>(Path::new("/nonexistent/gpu.ron")).unwrap_err();
        assert!(error.to_string().contains("/nonexistent/gpu.ron"), "{error}");
    }
}
