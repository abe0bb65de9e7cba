//! Reading of spec files (scenes, GPUs, platforms, energy tables) in RON.
//!
//! Every error has the form `file:line:column: what is wrong, how to fix it`. An unknown field or variant is
//! reported with the nearest known name.
//! Numbers of a spec are integers with a range in their type ([`Bounded`]).

use std::fmt;
use std::path::Path;

use ron::error::{Error, SpannedError};
use ron::extensions::Extensions;
use serde::Deserialize;
use serde::de::DeserializeOwned;

use crate::inputs;

/// Why a spec file cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum SpecError {
    /// The file could not be read.
    #[error("{path}: cannot read it: {source}; check the path, and that it is a text file in UTF-8")]
    Read {
        /// Path as given.
        path: String,
        /// Error of the operating system.
        source: std::io::Error,
    },
    /// The text is not a valid spec.
    #[error("{path}:{line}:{column}: {message}")]
    Parse {
        /// Path as given.
        path: String,
        /// Line, from 1.
        line: usize,
        /// Column, from 1.
        column: usize,
        /// Error and remedy.
        message: String,
    },
}

/// Read and parse the RON file at `path`.
///
/// # Errors
/// [`SpecError`] if the file cannot be read or does not describe a `T`.
pub fn load<T: DeserializeOwned>(path: &Path) -> Result<T, SpecError> {
    parse(&read(path)?, &path.display().to_string())
}

/// Text of the spec file at `path`.
///
/// # Errors
/// [`SpecError::Read`] if it cannot be read.
pub fn read(path: &Path) -> Result<String, SpecError> {
    inputs::read_to_string(path)
        .map_err(|source| SpecError::Read { path: path.display().to_string(), source })
}

/// Line and column (from 1) of a field's value in RON `text`; `None` if the field is missing. `field` is a
/// path from the outside in, such as `pipeline.memory.l2`. It serves checks of several fields together, which
/// run after parsing.
pub fn position_of(text: &str, field: &str) -> Option<(usize, usize)> {
    let plain = without_comments(text);
    let mut at = 0;
    for name in field.split('.') {
        at += value_of(&plain[at..], name)?;
    }
    let before = &text[..at];
    let line_start = before.rfind('\n').map_or(0, |newline| newline + 1);
    Some((1 + before.matches('\n').count(), 1 + text[line_start..at].chars().count()))
}

/// Byte offset of the value of the first field called `name`.
fn value_of(text: &str, name: &str) -> Option<usize> {
    let is_word = |c: char| c.is_alphanumeric() || c == '_';
    text.match_indices(name).find_map(|(at, _)| {
        let rest = &text[at + name.len()..];
        let colon = rest.trim_start().starts_with(':') && !text[..at].ends_with(is_word);
        let after = at + name.len() + rest.find(':')? + 1;
        colon.then(|| after + text[after..].len() - text[after..].trim_start().len())
    })
}

/// The text with every `//` comment overwritten by spaces; byte offsets stay the same.
fn without_comments(text: &str) -> String {
    let line = |line: &str| match line.find("//") {
        Some(at) => format!("{}{}", &line[..at], " ".repeat(line.len() - at)),
        None => line.to_owned(),
    };
    text.split('\n').map(line).collect::<Vec<_>>().join("\n")
}

/// Parse RON `text`; `name` is the file name in messages.
///
/// # Errors
/// [`SpecError::Parse`] with line and column.
pub fn parse<T: DeserializeOwned>(text: &str, name: &str) -> Result<T, SpecError> {
    let options = ron::Options::default()
        .with_default_extension(Extensions::IMPLICIT_SOME)
        .with_default_extension(Extensions::UNWRAP_VARIANT_NEWTYPES);
    // Some editors begin a file with a byte order mark.
    let text = text.trim_start_matches('\u{feff}');
    options.from_str(text).map_err(|error| describe(&error, text, name))
}

fn describe(error: &SpannedError, text: &str, name: &str) -> SpecError {
    let at = error.span.start;
    if matches!(error.code, Error::Eof) || ends_early(text, at.line, at.col) {
        let (line, column) = end_of(text);
        let message = "the file ends early: add what is missing, closing brackets included, or get it again";
        return SpecError::Parse { path: name.to_owned(), line, column, message: message.to_owned() };
    }
    let field = field_of_value(text, at.line, at.col);
    SpecError::Parse {
        path: name.to_owned(),
        line: at.line,
        column: at.col,
        message: message(&error.code, field.as_deref(), word_at(text, at.line, at.col)),
    }
}

/// The place just after the last character of the text, comments left out.
fn end_of(text: &str) -> (usize, usize) {
    let plain = without_comments(text);
    let end = plain.trim_end();
    let last = end.rfind('\n').map_or(0, |newline| newline + 1);
    (1 + end.matches('\n').count(), 1 + end[last..].chars().count())
}

/// Whether an error at a position is that nothing follows.
fn ends_early(text: &str, line: usize, column: usize) -> bool {
    let plain = without_comments(text);
    let end = plain.trim_end();
    let rest = plain.lines().skip(line.saturating_sub(1));
    let mut after = rest.enumerate().map(|(nth, text)| match nth {
        0 => text.chars().skip(column.saturating_sub(1)).collect(),
        _ => text.to_owned(),
    });
    let is_end = after.all(|text: String| text.trim().is_empty());
    let balance = |open: char, close: char| end.matches(open).count() > end.matches(close).count();
    let is_open = end.is_empty() || balance('(', ')') || balance('[', ']') || balance('{', '}');
    is_end && is_open
}

/// Name of the field whose value is at or just before a position: the word before the last colon of the line
/// up to there. `None` if the line has no colon.
fn field_of_value(text: &str, line: usize, column: usize) -> Option<String> {
    let line = text.lines().nth(line.checked_sub(1)?)?;
    let before: String = line.chars().take(column.saturating_sub(1)).collect();
    // The position may be after the comma that ends the value.
    let before = before.trim_end().trim_end_matches(',');
    let (name, value) = before.rsplit_once(':')?;
    let name = name.trim_end().trim_end_matches('"');
    let name = name.rsplit(|c: char| !c.is_alphanumeric() && c != '_').next().unwrap_or_default();
    let is_value = !value.contains(',') || value.contains('(') || value.contains('[');
    (is_value && !name.is_empty()).then(|| name.to_owned())
}

/// The word or number at a position, or next to it, for messages.
fn word_at(text: &str, line: usize, column: usize) -> &str {
    let line = text.lines().nth(line.saturating_sub(1)).unwrap_or_default();
    let at = line.char_indices().nth(column.saturating_sub(1)).map_or(line.len(), |(at, _)| at);
    let is_separator = |c: char| c.is_whitespace() || ",:()[]{}".contains(c);
    let after_separator = line[..at].ends_with(is_separator) || at == 0;
    let spaces = line[at..].len() - line[at..].trim_start().len();
    let at = if after_separator { at + spaces } else { at };
    let before = line[..at].rsplit(is_separator).next().map_or(0, str::len);
    let after = line[at..].split(is_separator).next().map_or(0, str::len);
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
        // An integer followed by more, as in 1.5.
        Error::ExpectedComma
        | Error::ExpectedStructLikeEnd
        | Error::ExpectedArrayEnd
        | Error::ExpectedMapEnd
            if word.parse::<i64>().is_err() && word.parse::<f64>().is_ok() =>
        {
            not_whole()
        }
        Error::InvalidIdentifier(_) | Error::SuggestRawIdentifier(_) => {
            let expected = match word.parse::<f64>() {
                Ok(_) => "is a number, and a name is expected; the built-in files show what is written there",
                Err(_) => "is not a field name; write fields as `name: value`",
            };
            of_field(format!("`{word}` {expected}"))
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
    // `shaded_quads` is `quads_shaded`.
    let words = |name: &str| {
        let mut words: Vec<String> = name.split('_').map(str::to_owned).collect();
        words.sort();
        words
    };
    if let Some(name) = known.iter().find(|name| words(name) == words(found)) {
        return format!("did you mean `{name}`?");
    }
    let nearest = known.iter().map(|name| (strsim::damerau_levenshtein(found, name), *name)).min();
    // An edit of half of a short word is no typing error: `foo` does not suggest `look`.
    let is_typing_error = |distance: usize, name: &str| {
        distance <= 1 + found.len() / 3 && 2 * distance < found.len().max(name.len())
    };
    match nearest {
        Some((distance, name)) if is_typing_error(distance, name) => format!("did you mean `{name}`?"),
        Some(_) => format!("known: {}", known.join(", ")),
        None => "none is known".to_owned(),
    }
}

/// An integer from `MIN` to `MAX`, both included. Deserializing a number outside the range is an error, so
/// the message has the line and column of the file.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Deserialize)]
#[serde(try_from = "i64")]
pub struct Bounded<const MIN: u32, const MAX: u32>(u32);

/// An integer outside its range.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{value} is out of range; it has to be {least} to {most}")]
pub struct OutOfBounds {
    /// The value given.
    pub value: i64,
    /// Smallest allowed value.
    pub least: u32,
    /// Largest allowed value.
    pub most: u32,
}

impl<const MIN: u32, const MAX: u32> Bounded<MIN, MAX> {
    /// Smallest value.
    pub const MIN: Self = Self(MIN);
    /// Largest value.
    pub const MAX: Self = Self(MAX);

    /// Check `value` against the range.
    ///
    /// # Errors
    /// [`OutOfBounds`] with the range.
    pub const fn new(value: u32) -> Result<Self, OutOfBounds> {
        if MIN <= value && value <= MAX {
            Ok(Self(value))
        } else {
            Err(OutOfBounds { value: value as i64, least: MIN, most: MAX })
        }
    }

    /// The value.
    pub const fn get(self) -> u32 {
        self.0
    }
}

impl<const MIN: u32, const MAX: u32> TryFrom<u32> for Bounded<MIN, MAX> {
    type Error = OutOfBounds;
    fn try_from(value: u32) -> Result<Self, OutOfBounds> {
        Self::new(value)
    }
}

impl<const MIN: u32, const MAX: u32> TryFrom<i64> for Bounded<MIN, MAX> {
    type Error = OutOfBounds;
    fn try_from(value: i64) -> Result<Self, OutOfBounds> {
        let out = OutOfBounds { value, least: MIN, most: MAX };
        u32::try_from(value).map_err(|_| out).and_then(Self::new)
    }
}

impl<const MIN: u32, const MAX: u32> fmt::Debug for Bounded<MIN, MAX> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

macro_rules! widens_to {
    ($($wide:ty)*) => {$(
        impl<const MIN: u32, const MAX: u32> From<Bounded<MIN, MAX>> for $wide {
            fn from(number: Bounded<MIN, MAX>) -> $wide {
                number.0.into()
            }
        }
    )*};
}

widens_to! { u32 u64 f64 }

#[cfg(test)]
mod tests {
    use serde::Deserialize;

    use super::*;

    #[derive(Debug, Deserialize)]
    #[serde(deny_unknown_fields)]
    struct Gpu {
        #[allow(dead_code)]
        tile_size: u32,
        #[allow(dead_code)]
        clock_hz: f64,
    }

    #[test]
    fn an_unknown_field_is_reported_with_line_and_suggestion() {
        let error = parse::<Gpu>("(\n  clock_hz: 1e9,\n  tile_sise: 8,\n)", "gpu.ron").unwrap_err();
        let text = error.to_string();
        assert!(text.starts_with("gpu.ron:3:"), "{text}");
        assert!(text.contains("unknown field `tile_sise`, did you mean `tile_size`?"), "{text}");
    }

    #[test]
    fn an_unrelated_name_lists_the_known_ones() {
        let error = parse::<Gpu>("(wibble: 1)", "gpu.ron").unwrap_err();
        assert!(error.to_string().contains("known: tile_size, clock_hz"), "{error}");
        assert_eq!(
            suggestion("shaded_quads", &["shader_ops", "quads_shaded"]),
            "did you mean `quads_shaded`?"
        );
        assert_eq!(suggestion("foo", &["look", "seconds"]), "known: look, seconds");
    }

    #[test]
    fn a_number_in_place_of_a_name_is_reported_as_a_number() {
        #[derive(Debug, Deserialize)]
        enum Level {
            #[allow(dead_code)]
            Assumed(f64),
        }
        let error = parse::<Level>("0.80", "level.ron").unwrap_err().to_string();
        assert!(error.contains("`0.80` is a number, and a name is expected"), "{error}");
    }

    #[test]
    fn a_text_that_is_cut_between_words_ends_early() {
        let whole = "(\n  tile_size: 8, // a comment\n  clock_hz: 1e9,\n)";
        for length in [0, 1, 14, 17, 25, 30, 47] {
            let error = parse::<Gpu>(&whole[..length], "gpu.ron").unwrap_err().to_string();
            assert!(error.contains("the file ends early: add what is missing"), "{length}: {error}");
        }
        let error = parse::<Gpu>("(tile_size: 8, clock_hz: x)", "gpu.ron").unwrap_err().to_string();
        assert!(!error.contains("ends early"), "{error}");
    }

    #[test]
    fn a_missing_field_is_reported_by_name() {
        let error = parse::<Gpu>("(tile_size: 8)", "gpu.ron").unwrap_err();
        assert!(error.to_string().contains("missing field `clock_hz`"), "{error}");
    }

    #[test]
    fn the_position_of_a_field_is_that_of_its_value() {
        let text = "(\n  // memory: none\n  core: (cache: (ways: 1)),\n  memory: (\n    l2: (ways: 8), cache: 4),\n)";
        assert_eq!(position_of(text, "memory.l2.ways"), Some((5, 16)));
        assert_eq!(position_of(text, "memory.cache"), Some((5, 27)));
        assert_eq!(position_of(text, "core.cache"), Some((3, 17)));
        assert_eq!([position_of(text, "way"), position_of(text, "memory.l3")], [None, None]);
    }

    #[test]
    fn a_missing_file_is_an_error_not_a_panic() {
        let error = load::<Gpu>(Path::new("/nonexistent/gpu.ron")).unwrap_err();
        assert!(error.to_string().contains("/nonexistent/gpu.ron"), "{error}");
    }

    type Queue = Bounded<1, 65_536>;

    #[test]
    fn values_out_of_range_are_refused() {
        assert_eq!([Queue::new(1), Queue::new(65_536)], [Ok(Queue::MIN), Ok(Queue::MAX)]);
        for value in [0, 65_537, u32::MAX] {
            assert_eq!(
                Queue::new(value).unwrap_err().to_string(),
                format!("{value} is out of range; it has to be 1 to 65536")
            );
        }
    }

    #[test]
    fn an_error_in_a_file_names_line_and_field() {
        #[derive(Debug, Deserialize)]
        struct Unit {
            #[allow(dead_code)]
            queue: Queue,
            #[allow(dead_code)]
            next: f64,
        }
        let message = |text: &str| parse::<Unit>(text, "gpu.ron").unwrap_err().to_string();
        for (value, says) in [
            ("4294967295", "`queue`: 4294967295 is out of range; it has to be 1 to 65536"),
            ("18446744073709551616", "`queue`: `18446744073709551616` is too large"),
            ("-1", "`queue`: -1 is out of range; it has to be 1 to 65536"),
            ("0", "`queue`: 0 is out of range"),
            ("1.5", "`queue`: `1.5` is not a whole number"),
            ("nan", "`queue`: `nan` is not a whole number"),
        ] {
            let text = message(&format!("(\n  // how long: it may be\n  queue: {value},\n  next: 1,\n)"));
            assert!(text.starts_with("gpu.ron:3:") && text.contains(says), "{text}");
        }
        // Multi-byte characters before, inside and after the value.
        let text = message("(\u{a0}queue:\u{a0}\u{fc}\u{a0}, next: 1)");
        assert!(text.starts_with("gpu.ron:1:"), "{text}");
        let text = message("(queue: 1, next: nan)");
        assert!(text.contains("`next`: `nan` is not a number"), "{text}");
    }
}
