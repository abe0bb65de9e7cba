//! Errors of loading scenes.

use std::io;
use std::path::Path;

use activity::spec::SpecError;

/// Reason why a scene could not be loaded or changed.
///
/// [`LoadError::is_usage`] distinguishes mistakes of the caller from broken or unreadable files.
#[derive(Debug, thiserror::Error)]
pub enum LoadError {
    /// Neither a built-in scene nor a file of a known format.
    #[error("no scene called `{name}`; {known}")]
    Unknown {
        /// The requested name.
        name: String,
        /// Known names, with a suggestion if one is similar.
        known: String,
    },
    /// A file of a format that is not accepted here.
    #[error("{file}: unrecognized kind of file; known: {known}")]
    Kind {
        /// The file.
        file: String,
        /// Accepted formats.
        known: &'static str,
    },
    /// A path that is not a scene: a folder, another format, or an unknown extension.
    #[error("{file}: {message}")]
    Format {
        /// The path.
        file: String,
        /// Error and remedy.
        message: String,
    },
    /// An invalid setting, from a command line or a scene file.
    #[error("{setting}: {message}")]
    Setting {
        /// The setting.
        setting: &'static str,
        /// Error and remedy.
        message: String,
    },
    /// An invalid option of a workload.
    #[error("{option}: {message}")]
    Option {
        /// The option as it was given, such as `--set bins=8`.
        option: String,
        /// Error and remedy.
        message: String,
    },
    /// A RON scene that cannot be read or parsed.
    #[error(transparent)]
    Spec(#[from] SpecError),
    /// A RON scene with invalid content.
    #[error("{file}: {place}: {message}")]
    Description {
        /// The scene file.
        file: String,
        /// The invalid part.
        place: String,
        /// Error and remedy.
        message: String,
    },
    /// A file that cannot be read.
    #[error("{file}: cannot read it: {source}; {}", remedy(.source))]
    Read {
        /// The file.
        file: String,
        /// Error of the operating system.
        source: io::Error,
    },
    /// A file with broken or unsupported content.
    #[error("{file}: {place}: {message}")]
    Broken {
        /// The file.
        file: String,
        /// Place in the file: a chunk, a primitive, an accessor, a line.
        place: String,
        /// Error and remedy.
        message: String,
    },
}

/// Remedy for a file that cannot be read.
fn remedy(error: &io::Error) -> &'static str {
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
    /// Whether the caller made a mistake: an unknown scene or format, an invalid setting or RON scene. Others
    /// are files that are missing, unreadable, truncated, corrupt or not supported.
    pub fn is_usage(&self) -> bool {
        match self {
            Self::Unknown { .. }
            | Self::Kind { .. }
            | Self::Format { .. }
            | Self::Setting { .. }
            | Self::Option { .. }
            | Self::Description { .. } => true,
            Self::Spec(error) => matches!(error, SpecError::Parse { .. }),
            Self::Read { .. } | Self::Broken { .. } => false,
        }
    }
}

impl LoadError {
    /// The error with the path of the file instead of the scene's name.
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
