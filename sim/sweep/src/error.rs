//! Errors of a sweep, and the line of a sweep file where a field or an entry of a list stands.

use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use activity::spec::SpecError;
use output::OutputError;
use run::RunError;
use traces::io::WriteError;

/// Why a sweep cannot be planned, run or merged.
#[derive(Debug, thiserror::Error)]
pub enum SweepError {
    /// The sweep file cannot be read or parsed.
    #[error(transparent)]
    Spec(#[from] SpecError),
    /// A part of the sweep file is invalid.
    #[error("{file}: {place}: {message}")]
    Value {
        /// The sweep file.
        file: String,
        /// The part.
        place: String,
        /// What is wrong, and what to do.
        message: String,
    },
    /// No point can run with a setting: it is unknown, or its value is invalid.
    #[error("{file}: {message}")]
    Setting {
        /// The sweep file.
        file: String,
        /// What is wrong, and what to do.
        message: String,
    },
    /// A shard is wrong, or its variables are.
    #[error("{0}")]
    Shard(String),
    /// The folder holds another sweep.
    #[error("{folder} holds the sweep `{holds}`, and this is `{name}`: give another --out, or remove that folder", folder = .folder.display())]
    OtherSweep {
        /// The folder.
        folder: PathBuf,
        /// Sweep in it.
        holds: String,
        /// Sweep to be run.
        name: String,
    },
    /// The folder has no plan, or a damaged one.
    #[error("{path}: {message}", path = .path.display())]
    Plan {
        /// The file.
        path: PathBuf,
        /// What is wrong, and what to do.
        message: String,
    },
    /// A folder or file cannot be used.
    #[error("{path}: {source}; {remedy}", path = .path.display(), remedy = remedy(.source))]
    Folder {
        /// The folder or file.
        path: PathBuf,
        /// Error of the operating system.
        source: std::io::Error,
    },
    /// A result cannot be written.
    #[error("{0}{remedy}", remedy = kept(.0))]
    Write(#[from] WriteError),
    /// A file of the user has the name of a result.
    #[error("{path}: {why}; move or rename it, then call this again", path = .path.display())]
    InTheWay {
        /// The file.
        path: PathBuf,
        /// Why it is not an earlier result.
        why: String,
    },
    /// Another process writes results into the folder.
    #[error("{folder}: another quintile{process} writes results there; wait until it is done", folder = .folder.display())]
    Busy {
        /// The folder.
        folder: PathBuf,
        /// ` (process 123 on node7)`, or empty if it is unknown.
        process: String,
    },
    /// Results are complete, but cannot be moved into place.
    #[error(transparent)]
    Publish(OutputError),
    /// Points are not finished.
    #[error(
        "{folder}: {missing} of {points} points are not finished: call `quintile sweep run` again, or give --partial{damaged}",
        folder = .folder.display()
    )]
    Unfinished {
        /// The folder.
        folder: PathBuf,
        /// Points without a result.
        missing: usize,
        /// All points.
        points: usize,
        /// What is wrong with a damaged file; empty if none is.
        damaged: String,
    },
    /// Jobs cannot be submitted.
    #[error("{0}")]
    Slurm(String),
    /// An input file cannot be read.
    #[error(transparent)]
    Input(RunError),
}

impl SweepError {
    /// Whether the request is at fault, or an input that it names (exit code 2), rather than what came while
    /// it ran (exit code 1).
    pub fn is_usage(&self) -> bool {
        match self {
            Self::Folder { source, .. } => source.kind() == ErrorKind::NotADirectory,
            Self::Spec(_)
            | Self::Input(_)
            | Self::Value { .. }
            | Self::Setting { .. }
            | Self::Shard(_)
            | Self::OtherSweep { .. }
            | Self::InTheWay { .. }
            | Self::Busy { .. }
            | Self::Plan { .. } => true,
            Self::Write(_) | Self::Publish(_) | Self::Unfinished { .. } | Self::Slurm(_) => false,
        }
    }

    /// A wrong part of the sweep in the `text` of `file`, made of the place and what is wrong there.
    pub(crate) fn at(text: &str, file: &str) -> impl Fn((String, String)) -> Self {
        move |(place, message)| Self::Value { file: placed(text, file, &place), place, message }
    }

    /// Error of the operating system at `path`.
    pub(crate) fn folder(path: &Path) -> impl FnOnce(std::io::Error) -> Self {
        |source| Self::Folder { path: path.to_owned(), source }
    }
}

impl From<OutputError> for SweepError {
    fn from(error: OutputError) -> Self {
        match error {
            OutputError::InTheWay { path, why, .. } => Self::InTheWay { path, why },
            OutputError::Busy { path: folder, process } => Self::Busy { folder, process },
            OutputError::Folder { path, source } | OutputError::Read { path, source } => {
                Self::Folder { path, source }
            }
            OutputError::Write { path, source } => WriteError::Content { path, source }.into(),
            error @ (OutputError::Publish { .. } | OutputError::Unclaimed { .. }) => Self::Publish(error),
        }
    }
}

/// Whether no call can write there.
fn is_closed(error: &std::io::Error) -> bool {
    matches!(error.kind(), ErrorKind::ReadOnlyFilesystem | ErrorKind::PermissionDenied)
}

/// What to do about a folder or file that cannot be used.
fn remedy(error: &std::io::Error) -> &'static str {
    match error.kind() {
        ErrorKind::StorageFull => "make room on the disk",
        _ if is_closed(error) => "give a folder that you may read and write",
        _ => "check that it is a folder that you may read and write",
    }
}

/// End of a message about a result that cannot be written: going on helps unless the folder is closed.
fn kept(error: &WriteError) -> &'static str {
    match error {
        WriteError::Io { source, .. } if is_closed(source) => "",
        _ => "; what is finished is kept: call it again to continue",
    }
}

/// `file` with the line of `place` in its RON `text`; `file` alone if it is not found. A place is a field of
/// the sweep, such as `points`, or an entry of its list, such as `axes[2]`.
pub(crate) fn placed(text: &str, file: &str, place: &str) -> String {
    match line_of(text, place) {
        Some(line) => format!("{file}:{line}"),
        None => file.to_owned(),
    }
}

fn line_of(text: &str, place: &str) -> Option<usize> {
    let (field, entry) = match place.split_once('[') {
        Some((field, rest)) => (field, Some(rest.strip_suffix(']')?.parse::<usize>().ok()?)),
        None => (place, None),
    };
    let bare = without_texts(text);
    let at = field_at(&bare, field)?;
    let at = match entry {
        Some(entry) => entry_at(&bare, at, entry)?,
        None => at,
    };
    Some(1 + text[..at].matches('\n').count())
}

/// Depth of brackets at each letter, itself excluded.
fn depths(text: &str) -> impl Iterator<Item = (usize, char, usize)> + '_ {
    let mut depth = 0_usize;
    text.char_indices().map(move |(at, letter)| {
        let here = depth;
        match letter {
            '(' | '[' | '{' => depth += 1,
            ')' | ']' | '}' => depth = depth.saturating_sub(1),
            _ => {}
        }
        (at, letter, here)
    })
}

fn field_at(bare: &str, field: &str) -> Option<usize> {
    let is_name = |letter: char| letter.is_alphanumeric() || letter == '_';
    let is_field = |at: usize| {
        let rest = bare[at..].strip_prefix(field).is_some_and(|rest| rest.trim_start().starts_with(':'));
        rest && !bare[..at].ends_with(is_name)
    };
    depths(bare).find(|&(at, _, depth)| depth == 1 && is_field(at)).map(|(at, ..)| at)
}

/// The entry of the list that follows `from`.
fn entry_at(bare: &str, from: usize, entry: usize) -> Option<usize> {
    let first = from + bare[from..].find('[')? + 1;
    let commas = depths(&bare[first..]).filter(|&(_, letter, depth)| letter == ',' && depth == 0);
    let start = match entry {
        0 => first,
        _ => first + commas.map(|(at, ..)| at).nth(entry - 1)? + 1,
    };
    Some(start + bare[start..].find(|letter: char| !letter.is_whitespace())?)
}

/// The text with blanks in place of comments and of what is in quotes, as long as before.
fn without_texts(text: &str) -> String {
    let mut bare = String::with_capacity(text.len());
    let blank = |bare: &mut String, part: &str| {
        part.chars().for_each(|letter| match letter {
            '\n' => bare.push('\n'),
            letter => bare.extend(std::iter::repeat_n(' ', letter.len_utf8())),
        });
    };
    let mut rest = text;
    while let Some(letter) = rest.chars().next() {
        let length = if rest.starts_with("//") {
            rest.find('\n').unwrap_or(rest.len())
        } else if rest.starts_with("/*") {
            rest.find("*/").map_or(rest.len(), |end| end + 2)
        } else if letter == '"' {
            bare.push('"');
            rest = &rest[1..];
            end_of_text(rest)
        } else {
            bare.push(letter);
            rest = &rest[letter.len_utf8()..];
            continue;
        };
        blank(&mut bare, &rest[..length]);
        rest = &rest[length..];
    }
    bare
}

/// Length of a text in quotes with the closing one.
fn end_of_text(rest: &str) -> usize {
    let mut is_escaped = false;
    let end = rest.char_indices().find(|&(_, letter)| {
        let ends = letter == '"' && !is_escaped;
        is_escaped = letter == '\\' && !is_escaped;
        ends
    });
    end.map_or(rest.len(), |(at, _)| at + 1)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const TEXT: &str = r#"( // axes: [
    name: "axes: [\", 1", doc: "é",
    axes: [
        Values(path: "a", values: [1, 2]), /* Values(), */ Values(
            path: "b", values: [3]),

        Linked(settings: {"c": [1], "axes": [2]}),
    ],
    constraints: ["a, b < 1",
        "b > 2"],
)"#;

    #[test]
    fn places_have_lines() {
        for (place, line) in [
            ("name", Some(2)),
            ("axes", Some(3)),
            ("axes[0]", Some(4)),
            ("axes[1]", Some(4)),
            ("axes[2]", Some(7)),
            ("constraints[0]", Some(9)),
            ("constraints[1]", Some(10)),
            ("points", None),
            ("axes[x]", None),
        ] {
            assert_eq!(line_of(TEXT, place), line, "{place}");
        }
        assert_eq!(placed(TEXT, "a.ron", "axes[2]"), "a.ron:7");
        assert_eq!(placed("", "a.ron", "axes[2]"), "a.ron");
    }

    proptest! {
        #[test]
        fn any_text_has_places_or_none(text in "[\\[\\](){}\"/*:, a\\\\é\n]{0,80}") {
            let bare = without_texts(&text);
            prop_assert_eq!(bare.len(), text.len());
            prop_assert!(line_of(&text, "a[2]").is_none_or(|line| line <= 1 + text.matches('\n').count()));
        }
    }
}
