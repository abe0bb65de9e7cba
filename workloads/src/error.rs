//! Why a scene could not be loaded.

use std::io;
use std::path::Path;

use activity::spec::SpecError;

/// Why a scene could not be loaded or changed.
///
/// [`LoadError::is_usage`] tells what the caller asked wrongly (exit code 2) from files that are broken or
/// cannot be read (exit code 1).
#[derive(Debug, thiserror::Error)]
pub enum LoadError {
    /// Neither a built-in scene nor a file of a known kind.
    #[error("no scene called `{name}`; {known}")]
    Unknown {
        /// What was asked for.
        name: String,
        /// What there is, with a suggestion where one is near.
        known: String,
    },
    /// A file that is there, but of a kind that cannot be used for what was asked.
    #[error("{file}: it cannot be told what kind of file this is; known here: {known}")]
    Kind {
        /// The file.
        file: String,
        /// What there could be instead.
        known: &'static str,
    },
    /// A path that cannot be a scene: a folder, a file of another format, or one whose ending says nothing.
    #[error("{file}: {message}")]
    Format {
        /// The path.
        file: String,
        /// What it is, and what to do.
        message: String,
    },
    /// A setting, from a command line or a scene file, that makes no sense.
    #[error("{setting}: {message}")]
    Setting {
        /// Which setting.
        setting: &'static str,
        /// What is wrong and how to mend it.
        message: String,
    },
    /// A RON scene that cannot be read or parsed.
    #[error(transparent)]
    Spec(#[from] SpecError),
    /// A RON scene that parses but makes no sense.
    #[error("{file}: {place}: {message}")]
    Description {
        /// The scene file.
        file: String,
        /// Which part of it.
        place: String,
        /// What is wrong and how to mend it.
        message: String,
    },
    /// A file that cannot be read at all.
    #[error("{file}: cannot read it: {source}; {}", mend(.source))]
    Read {
        /// The file.
        file: String,
        /// What the system said.
        source: io::Error,
    },
    /// A file whose contents are broken or not supported.
    #[error("{file}: {place}: {message}")]
    Broken {
        /// The file.
        file: String,
        /// Where in it: a chunk, a primitive, an accessor, a line.
        place: String,
        /// What is wrong and how to mend it.
        message: String,
    },
}

/// What to do about a file that cannot be read.
fn mend(error: &io::Error) -> &'static str {
    match error.kind() {
        io::ErrorKind::NotFound | io::ErrorKind::NotADirectory => "check the path",
        io::ErrorKind::IsADirectory => {
            "it is a folder: give the path of a .ron, .gltf, .glb, .obj, .ply, .off or .stl file in it"
        }
        io::ErrorKind::PermissionDenied => "give yourself the right to read it",
        _ => "check the path and what it leads to",
    }
}

impl LoadError {
    /// Whether the mistake is the caller's (an unknown scene name or kind of file, a bad setting, a bad RON scene): exit code
    /// 2. The others (files that are missing, unreadable, truncated, corrupt or not supported) are exit
    /// code 1. A RON file that cannot be read counts as unreadable.
    pub fn is_usage(&self) -> bool {
        match self {
            Self::Unknown { .. }
            | Self::Kind { .. }
            | Self::Format { .. }
            | Self::Setting { .. }
            | Self::Description { .. } => true,
            Self::Spec(error) => matches!(error, SpecError::Parse { .. }),
            Self::Read { .. } | Self::Broken { .. } => false,
        }
    }
}

impl LoadError {
    /// The same error of a scene that may have a name of its own, told of the file it came from.
    pub(crate) fn in_file(self, path: &str) -> Self {
        match self {
            Self::Broken { place, message, .. } => Self::Broken { file: path.to_owned(), place, message },
            error => error,
        }
    }
}

/// A file being read, for errors about it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Source<'a> {
    pub path: &'a Path,
}

impl Source<'_> {
    pub fn broken(self, place: impl Into<String>, message: impl Into<String>) -> LoadError {
        let file = self.path.display().to_string();
        LoadError::Broken { file, place: place.into(), message: message.into() }
    }

    pub fn unreadable(self, source: io::Error) -> LoadError {
        LoadError::Read { file: self.path.display().to_string(), source }
    }

    pub fn read(self) -> Result<Vec<u8>, LoadError> {
        activity::inputs::read(self.path).map_err(|error| self.unreadable(error))
    }
}
