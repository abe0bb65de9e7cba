//! Reading spec files (scenes, GPUs, platforms, energy tables) written in RON.
//!
//! Every mistake is reported as `file:line:column: what is wrong, how to mend it`; an unknown field or
//! variant comes with the nearest known name.

use std::path::Path;

use ron::error::{Error, SpannedError};
use ron::extensions::Extensions;
use serde::de::DeserializeOwned;

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
    let name = path.display().to_string();
    let text =
        std::fs::read_to_string(path).map_err(|source| SpecError::Read { path: name.clone(), source })?;
    parse(&text, &name)
}

/// Parses RON `text`; `name` stands for the file in messages.
///
/// # Errors
/// [`SpecError::Parse`] with the place of the mistake.
pub fn parse<T: DeserializeOwned>(text: &str, name: &str) -> Result<T, SpecError> {
    let options = ron::Options::default()
        .with_default_extension(Extensions::IMPLICIT_SOME)
        .with_default_extension(Extensions::UNWRAP_VARIANT_NEWTYPES);
    options.from_str(text).map_err(|error| describe(&error, name))
}

fn describe(error: &SpannedError, name: &str) -> SpecError {
    let place = error.span.start;
    SpecError::Parse {
        path: name.to_owned(),
        line: place.line,
        column: place.col,
        message: message(&error.code),
    }
}

fn message(code: &Error) -> String {
    match code {
        Error::NoSuchStructField { expected, found, .. } => {
            format!("unknown field `{found}`, {}", suggestion(found, expected))
        }
        Error::NoSuchEnumVariant { expected, found, .. } => {
            format!("unknown variant `{found}`, {}", suggestion(found, expected))
        }
        Error::MissingStructField { field, .. } => format!("missing field `{field}`: add it"),
        other => other.to_string(),
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
    fn a_missing_file_is_an_error_not_a_panic() {
        let error = load::<Gpu>(Path::new("/nonexistent/gpu.ron")).unwrap_err();
        assert!(error.to_string().contains("/nonexistent/gpu.ron"), "{error}");
    }
}
