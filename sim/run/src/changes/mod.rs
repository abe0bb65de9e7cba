//! Changes of single values in the input files of a run: `--set gpu.pipeline.tile_px=8`.
//!
//! A change edits the text of the file, and the changed text goes through the same parser and checks as a file.

mod edit;

use std::path::Path;

use activity::spec::{self, SpecError, suggestion};
use power_model::{EnergyTable, EnergyTableError, Platform, PlatformError};
use workloads::{LoadError, Scene};

use crate::gpu::{GpuError, GpuSpec};
use crate::options::Change;

/// An input file in which values can be changed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum InputFile {
    /// The GPU.
    Gpu,
    /// The platform.
    Platform,
    /// The energy table.
    Table,
    /// A scene in RON.
    Scene,
}

impl InputFile {
    /// All files.
    pub const ALL: [Self; 4] = [Self::Gpu, Self::Platform, Self::Table, Self::Scene];

    /// First name of paths into the file.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Gpu => "gpu",
            Self::Platform => "platform",
            Self::Table => "table",
            Self::Scene => "scene",
        }
    }

    /// File in the results folder that holds the changed text.
    pub const fn result(self) -> &'static str {
        match self {
            Self::Gpu => "inputs/gpu.ron",
            Self::Platform => "inputs/platform.ron",
            Self::Table => "inputs/table.ron",
            Self::Scene => "inputs/scene.ron",
        }
    }

    /// The path that is most like `path`, or the first names that there are.
    pub fn suggestion(path: &str) -> String {
        let (first, rest) = path.split_once('.').unwrap_or((path, ""));
        let names: Vec<&str> = Self::ALL.map(Self::name).into_iter().chain(["workload"]).collect();
        suggestion(first, &names).replace("`?", &format!(".{rest}`?"))
    }

    /// The file that `path` leads into, such as that of `gpu.core_hz`; `None` for other settings.
    pub fn of(path: &str) -> Option<Self> {
        let (first, _) = path.split_once('.')?;
        Self::ALL.into_iter().find(|file| file.name() == first)
    }
}

/// Why a change cannot be made.
#[derive(Debug, thiserror::Error)]
pub enum ChangeError {
    /// The path leads into no file.
    #[error("--set {path}: it names none of gpu, platform, table and scene; {suggestion}")]
    File {
        /// The path.
        path: String,
        /// The nearest names.
        suggestion: String,
    },
    /// The file cannot be read.
    #[error(transparent)]
    Read(#[from] SpecError),
    /// The path is unknown, or the value is invalid, alone or beside others.
    #[error("--set {set}: {message}")]
    Refused {
        /// The changes.
        set: String,
        /// What is wrong, and what to do.
        message: String,
    },
}

/// Text of an input file with changes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ChangedFile {
    /// Which file.
    pub file: InputFile,
    /// The text. Files that it names are given by whole paths, so it can be used from any folder.
    pub text: String,
}

/// Changes of the input files of a run, and the changed texts.
pub(crate) struct Changes<'a> {
    changes: &'a [Change],
    /// Texts of the files that were changed so far.
    pub files: Vec<ChangedFile>,
}

impl<'a> Changes<'a> {
    /// Changes to be made.
    ///
    /// # Errors
    /// [`ChangeError::File`] if one leads into no file.
    pub fn new(changes: &'a [Change]) -> Result<Self, ChangeError> {
        match changes.iter().find(|change| InputFile::of(&change.path).is_none()) {
            Some(Change { path, .. }) => {
                Err(ChangeError::File { path: path.clone(), suggestion: InputFile::suggestion(path) })
            }
            None => Ok(Self { changes, files: Vec::new() }),
        }
    }

    /// The changes of `file`, joined for messages; `None` if there are none.
    pub fn of(&self, file: InputFile) -> Option<String> {
        let found: Vec<String> = self.inside(file).map(Change::to_string).collect();
        (!found.is_empty()).then(|| found.join(", "))
    }

    fn inside(&self, file: InputFile) -> impl Iterator<Item = &'a Change> {
        self.changes.iter().filter(move |change| InputFile::of(&change.path) == Some(file))
    }

    /// Changes `text` of `file`, which was read at `origin`, and parses it.
    fn apply<T>(
        &mut self,
        file: InputFile,
        (text, origin): (&str, &Path),
        parse: impl Fn(&str) -> Result<T, String>,
    ) -> Result<T, ChangeError> {
        let mut changed = text.to_owned();
        for change in self.inside(file) {
            changed = with(&changed, change)?;
        }
        let value = parse(&changed).map_err(|message| self.blamed(file, text, message, &parse))?;
        let head = format!("// {}, changed by --set {}", origin.display(), self.of(file).unwrap_or_default());
        // A comment ends with its line, and a byte order mark is one at the start alone.
        let (head, body) = (head.replace(['\n', '\r'], " "), changed.trim_start_matches('\u{feff}'));
        let text = format!("{head}\n{}", with_whole_paths(body, origin));
        self.files.push(ChangedFile { file, text });
        Ok(value)
    }

    /// The error of a refused text. It names one change if that alone is refused for the same reason, otherwise all.
    fn blamed<T>(
        &self,
        file: InputFile,
        text: &str,
        message: String,
        parse: &dyn Fn(&str) -> Result<T, String>,
    ) -> ChangeError {
        let alone = |change: &&Change| {
            with(text, change).is_ok_and(|text| parse(&text).err().as_ref() == Some(&message))
        };
        let one = self.inside(file).find(alone).map(Change::to_string);
        ChangeError::Refused { set: one.or_else(|| self.of(file)).unwrap_or_default(), message }
    }
}

/// `text` with one change.
fn with(text: &str, change: &Change) -> Result<String, ChangeError> {
    let path: Vec<&str> = change.path.split('.').skip(1).collect();
    edit::set(text, &path, &change.value)
        .map_err(|message| ChangeError::Refused { set: change.to_string(), message })
}

/// The text with whole paths in place of file names relative to the file at `origin`.
fn with_whole_paths(text: &str, origin: &Path) -> String {
    let folder = std::path::absolute(origin).ok().and_then(|path| path.parent().map(Path::to_path_buf));
    let Some(folder) = folder else { return text.to_owned() };
    edit::replace_strings(text, &["file", "end", "table", "platform", "energy", "made_for"], &|name| {
        let is_relative = Path::new(name).extension().is_some() && Path::new(name).is_relative();
        is_relative.then(|| folder.join(name).display().to_string())
    })
}

/// Message of a syntax error without its place in the changed text, which the user does not have.
fn without_place(error: SpecError) -> String {
    match error {
        SpecError::Parse { message, .. } => message,
        error => error.to_string(),
    }
}

/// Message of an error without the name of the file.
fn without_name(error: &impl std::fmt::Display, file: &Path) -> String {
    let text = error.to_string();
    text.strip_prefix(&format!("{}: ", file.display())).unwrap_or(&text).to_owned()
}

impl Changes<'_> {
    /// The input `name` with its changes, of a `.ron` file or built in; `None` if it has none, and for
    /// unknown names. `in_words` is the message of an error without the name of the file.
    fn input<T, E>(
        &mut self,
        (file, name): (InputFile, &Path),
        builtin: impl FnOnce(&str) -> Option<&'static str>,
        parse: impl Fn(&str, &str) -> Result<T, E>,
        in_words: impl Fn(E) -> String,
    ) -> Result<Option<T>, ChangeError> {
        let text = match self.of(file) {
            None => None,
            Some(_) if is_ron(name) => Some(spec::read(name)?),
            Some(_) => builtin(&name.to_string_lossy()).map(str::to_owned),
        };
        let Some(text) = text else { return Ok(None) };
        let shown = name.display().to_string();
        self.apply(file, (&text, name), |text| parse(text, &shown).map_err(&in_words)).map(Some)
    }

    /// The GPU of a name or file with its changes; `None` if it has none.
    ///
    /// # Errors
    /// If the file cannot be read, or not be changed so.
    pub fn gpu(&mut self, name: &Path) -> Result<Option<GpuSpec>, ChangeError> {
        let in_words = |error| match error {
            GpuError::Spec(error) => without_place(error),
            GpuError::Value { message, .. } => message,
            error => without_name(&error, name),
        };
        let gpu = self.input((InputFile::Gpu, name), GpuSpec::builtin_text, GpuSpec::parse, in_words)?;
        Ok(gpu.map(|mut gpu| {
            gpu.name_power_files_beside(name);
            gpu
        }))
    }

    /// The platform of a name or file with its changes; `None` if it has none.
    ///
    /// # Errors
    /// As [`Self::gpu`].
    pub fn platform(&mut self, name: &Path) -> Result<Option<Platform>, ChangeError> {
        let in_words = |error| match error {
            PlatformError::Spec(error) => without_place(error),
            error => without_name(&error, name),
        };
        let platform =
            self.input((InputFile::Platform, name), Platform::builtin_text, Platform::parse, in_words)?;
        Ok(platform.map(|mut platform| {
            platform.name_gpu_beside(name);
            platform
        }))
    }

    /// The energy table of a name or file with its changes; `None` if it has none.
    ///
    /// # Errors
    /// As [`Self::gpu`].
    pub fn table(&mut self, name: &Path) -> Result<Option<EnergyTable>, ChangeError> {
        let in_words = |error| match error {
            EnergyTableError::Spec(error) => without_place(error),
            error => without_name(&error, name),
        };
        self.input((InputFile::Table, name), EnergyTable::builtin_text, EnergyTable::parse, in_words)
    }

    /// The scene in a RON file with its changes; `None` if it has none.
    ///
    /// # Errors
    /// As [`Self::gpu`], and if it is no RON file.
    pub fn scene(&mut self, name: &Path) -> Result<Option<Scene>, ChangeError> {
        let Some(set) = self.of(InputFile::Scene) else { return Ok(None) };
        if !is_ron(name) {
            let message = format!(
                "`{}` is not a scene in a .ron file: change a scene by --size, --samples, --lens and the like, a workload by \
                 its options (--set name=value)",
                name.display()
            );
            return Err(ChangeError::Refused { set, message });
        }
        let text = spec::read(name)?;
        let parse = |text: &str| {
            workloads::load_text(text, name).map_err(|error| match error {
                LoadError::Spec(error) => without_place(error),
                LoadError::Description { place, message, .. } => format!("{place}: {message}"),
                error => without_name(&error, name),
            })
        };
        self.apply(InputFile::Scene, (&text, name), parse).map(Some)
    }
}

fn is_ron(name: &Path) -> bool {
    name.extension().is_some_and(|ending| ending == "ron")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn change(path: &str, value: &str) -> Change {
        Change { path: path.to_owned(), value: value.to_owned() }
    }

    #[test]
    fn a_changed_text_is_read_as_a_file() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("gpu.ron");
        let text = include_str!("../../gpus/mobile.ron").replace("\"iphone_4s\"", "\"own.ron\"");
        std::fs::write(&file, format!("\u{feff}{text}")).unwrap();
        let list = [change("gpu.doc", "two\nlines"), change("gpu.pipeline.tile_px", "4")];
        let mut changes = Changes::new(&list).unwrap();
        let gpu = changes.gpu(&file).unwrap().unwrap();
        assert_eq!((gpu.pipeline.tile_px, &*gpu.doc), (4, "two\nlines"));
        let [ChangedFile { file: InputFile::Gpu, text }] = &changes.files[..] else { panic!() };
        let elsewhere = GpuSpec::parse(text, "elsewhere.ron").unwrap();
        assert_eq!(elsewhere, gpu);
        let platform = folder.path().join("own.ron").display().to_string();
        assert_eq!(gpu.power.map(|power| power.platform), Some(platform));
    }

    #[test]
    fn an_error_names_the_change_that_is_wrong() {
        let list = [change("gpu.core_hz", "2e8"), change("gpu.pipeline.coarse_tile_px", "12")];
        let mut changes = Changes::new(&list).unwrap();
        let error = changes.gpu(Path::new("reference")).unwrap_err().to_string();
        assert!(error.starts_with("--set gpu.pipeline.coarse_tile_px=12: "), "{error}");
        assert!(changes.files.is_empty());
    }
}
