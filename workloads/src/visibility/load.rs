//! Any of the files that hold a moving mesh.

use std::path::Path;

use super::mesh::MovingMesh;
use super::scene::{Subject, VisibilityScene};
use super::{m5d, mts, pair};
use crate::error::LoadError;
use crate::import::{Format, reader};
use crate::scene::CameraSpec;

/// What can be loaded, for messages.
const KNOWN: &str = ".m5d, .mts, and .ply, .obj, .off or .stl, alone or as a pair (each also gzipped)";

/// Kinds of files that hold a mesh or half of one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    M5d,
    Mts,
    Surface(Format),
}

impl Kind {
    /// What the file at `path` begins as or, where that says nothing, what its name ends in.
    pub fn of(path: &Path) -> Result<Self, LoadError> {
        let head = reader::head::<8>(path)?;
        // An empty one is of no known kind.
        if !head.is_empty() && path.metadata().is_ok_and(|data| !data.is_file()) {
            return Err(no_file(path));
        }
        let begins = |magic: &[u8]| head.starts_with(magic);
        if begins(m5d::MAGIC) {
            return Ok(Self::M5d);
        }
        if begins(mts::MAGIC) {
            return Ok(Self::Mts);
        }
        if begins(b"ply\n") || begins(b"ply\r") {
            return Ok(Self::Surface(Format::Ply));
        }
        let named = Self::named(path);
        named.ok_or_else(|| LoadError::Kind { file: path.display().to_string(), known: KNOWN })
    }

    /// What its name ends in.
    pub fn named(path: &Path) -> Option<Self> {
        let name = path.file_name()?.to_string_lossy().to_ascii_lowercase();
        let bare = name.strip_suffix(".gz").unwrap_or(&name);
        match (bare.rsplit_once('.')?.1, Format::of(path)) {
            ("m5d", _) => Some(Self::M5d),
            ("mts", _) => Some(Self::Mts),
            (_, Some(format)) if format.is_surface() => Some(Self::Surface(format)),
            _ => None,
        }
    }
}

/// Loads the moving mesh in `files`: an `.m5d` or `.mts`, a PLY, OBJ, OFF or STL file that stays still, or two of them as the two
/// ends of the shutter. `camera` is what [`CameraSpec::flag`] takes; without it an `.m5d` is seen by its own and the others
/// by one that is fitted to them.
///
/// # Errors
/// [`LoadError`]: [`LoadError::is_usage`] for files that do not go together or are of no known kind and for mistakes in
/// the camera; else what is broken, and where.
pub fn load(files: &[impl AsRef<Path>], camera: Option<&str>) -> Result<VisibilityScene, LoadError> {
    let spec = camera.map(described).transpose()?;
    let files: Vec<&Path> = files.iter().map(AsRef::as_ref).collect();
    let kinds = files.iter().map(|path| Kind::of(path)).collect::<Result<Vec<_>, _>>()?;
    let (path, objects) = match (&files[..], &kinds[..]) {
        ([file], [Kind::M5d]) => match &spec {
            None => return m5d::load(file),
            Some(_) => (*file, vec![m5d::world(&m5d::load(file)?)]),
        },
        ([file], [Kind::Mts]) => (*file, mts::load_mts(file)?),
        ([file], [Kind::Surface(format)]) => (*file, vec![pair::still((file, *format))?]),
        ([start, end], [Kind::Surface(one), Kind::Surface(other)]) => {
            (*start, vec![pair::moving((start, *one), (end, *other))?])
        }
        _ => return Err(wrong_number(&files, &kinds)),
    };
    VisibilityScene::seen(Subject { path, objects }, &spec.unwrap_or_default())
}

/// The camera that `text` describes, for a moving mesh.
fn described(text: &str) -> Result<CameraSpec, LoadError> {
    let (spec, file) = CameraSpec::flag(text)?;
    spec.check_for_meshes().map_err(|wrong| CameraSpec::wrong(&file, wrong))?;
    Ok(spec)
}

/// Loads a mesh that stays still from a PLY, OBJ, OFF or STL file.
///
/// # Errors
/// As [`load`].
pub fn load_surface(path: &Path) -> Result<MovingMesh, LoadError> {
    match Kind::of(path)? {
        Kind::Surface(format) => pair::still((path, format)),
        _ => Err(LoadError::Kind {
            file: path.display().to_string(),
            known: ".ply, .obj, .off and .stl (also gzipped)",
        }),
    }
}

/// What was read to tell the kind would be missing from the contents.
fn no_file(path: &Path) -> LoadError {
    let message =
        format!("{} is a pipe or a device, and it is read twice: write it to a file first", path.display());
    LoadError::Setting { setting: "files", message }
}

fn wrong_number(files: &[&Path], kinds: &[Kind]) -> LoadError {
    let whole = files.iter().zip(kinds).find(|(_, kind)| !matches!(kind, Kind::Surface(_)));
    let message = match whole {
        Some((file, _)) if files.len() > 1 => {
            format!("{} holds both ends of the shutter: give it alone", file.display())
        }
        _ => format!(
            "{} were given: give one, or two PLY, OBJ, OFF or STL files as the ends of the shutter",
            files.len()
        ),
    };
    LoadError::Setting { setting: "files", message }
}
