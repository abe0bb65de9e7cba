//! Input files of collision detection.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use super::components;
use crate::error::LoadError;
use crate::import::Format;
use crate::visibility::{Kind, MovingMesh, load_mts, moving};

/// Accepted files, for messages.
const KNOWN: &str = ".mts, and .ply, .obj or .off two by two (each also gzipped)";

/// A case: objects that may collide.
#[derive(Clone, Debug)]
pub struct CollisionCase {
    /// File name without its extension.
    pub id: String,
    /// The objects.
    pub objects: Vec<MovingMesh>,
    /// Largest error of a coordinate compared with the file.
    pub uncertainty: f64,
}

/// Files of a case, before reading.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CaseFiles {
    /// Name of the first file without its extension.
    pub id: String,
    start: PathBuf,
    content: Content,
}

/// Content of the files of a case.
#[derive(Clone, Debug, PartialEq, Eq)]
enum Content {
    /// All objects, in one file.
    Objects,
    /// A mesh at time 0 in the first file, and at time 1 in another.
    Ends(Format, PathBuf, Format),
}

impl CaseFiles {
    /// Groups `files` into cases: an `.mts` file alone, PLY, OBJ and OFF files in pairs. If a file cannot be
    /// read, its name decides the format.
    ///
    /// # Errors
    /// [`LoadError::is_usage`] for folders, unknown formats, files without a partner, and duplicate ids; else
    /// a file that cannot be read and whose name gives no format.
    pub fn of(files: &[impl AsRef<Path>]) -> Result<Vec<Self>, LoadError> {
        let mut files = files.iter().map(AsRef::as_ref);
        if let Some(folder) = files.clone().find(|path| path.is_dir()) {
            return Err(refused(format!(
                "{} is a folder: give the .mts, .ply, .obj or .off files in it",
                folder.display()
            )));
        }
        let (mut cases, mut places) = (Vec::<Self>::new(), BTreeMap::new());
        while let Some(file) = files.next() {
            let content = match kind(file)? {
                Kind::Mts => Content::Objects,
                Kind::Surface(format) => {
                    let other = files.next().ok_or_else(|| no_partner(file))?;
                    let Kind::Surface(closing) = kind(other)? else { return Err(no_partner(file)) };
                    Content::Ends(format, other.to_owned(), closing)
                }
                Kind::M5d => return Err(no_partner(file)),
            };
            let case = Self { id: stem(file), start: file.to_owned(), content };
            if let Some(known) = places.insert(case.id.clone(), cases.len()) {
                return Err(same_id(&cases[known], &case));
            }
            cases.push(case);
        }
        Ok(cases)
    }

    /// Reads the case. The connected components of a mesh are its objects. Coordinates of PLY, OBJ and OFF
    /// files were probably rounded to f32; the uncertainty allows for that.
    ///
    /// # Errors
    /// Invalid content, with its place in the file.
    pub fn load(&self) -> Result<CollisionCase, LoadError> {
        let id = self.id.clone();
        let Content::Ends(opening, end, closing) = &self.content else {
            return Ok(CollisionCase { id, objects: load_mts(&self.start)?, uncertainty: 0.0 });
        };
        let mesh = moving((&self.start, *opening), (end, *closing))?;
        let largest = mesh.open.iter().chain(&mesh.close).map(|p| p.abs().max_element()).fold(0.0, f64::max);
        // For subnormal numbers, the rounding error is absolute.
        let uncertainty = (largest * f64::from(f32::EPSILON)).max(f64::from(f32::from_bits(1)));
        Ok(CollisionCase { id, objects: components(&mesh), uncertainty })
    }

    /// The first file.
    pub fn start(&self) -> &Path {
        &self.start
    }
}

/// Loads cases: an `.mts` file each with its objects, or two PLY, OBJ or OFF files with a mesh at both times.
///
/// # Errors
/// As [`CaseFiles::of`] and [`CaseFiles::load`], at the first file.
pub fn load_cases(files: &[impl AsRef<Path>]) -> Result<Vec<CollisionCase>, LoadError> {
    CaseFiles::of(files)?.iter().map(CaseFiles::load).collect()
}

/// Loads the objects of one `.mts` file.
///
/// # Errors
/// [`LoadError::is_usage`] for any other format; else invalid content, with its place in the file.
pub(crate) fn load_objects(file: &Path) -> Result<Vec<MovingMesh>, LoadError> {
    match kind(file) {
        Ok(Kind::Mts) => load_mts(file),
        Ok(_) | Err(LoadError::Kind { .. }) => {
            let message = format!(
                "{} is no .mts file, and one of those is taken here; `quintile ccd` takes .ply, .obj and .off files, too, two by two",
                file.display()
            );
            Err(LoadError::Setting { setting: "file", message })
        }
        Err(error) => Err(error),
    }
}

fn kind(path: &Path) -> Result<Kind, LoadError> {
    match Kind::of(path) {
        Err(LoadError::Kind { file, .. }) => Err(LoadError::Kind { file, known: KNOWN }),
        Err(error) if !error.is_usage() => Kind::named(path).ok_or(error),
        found => found,
    }
}

/// File name without `.mts`, `.mts.gz` and similar extensions.
fn stem(path: &Path) -> String {
    let name = path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
    let bare = name.strip_suffix(".gz").unwrap_or(&name);
    bare.rsplit_once('.').map_or(bare, |(stem, _)| stem).to_owned()
}

fn refused(message: String) -> LoadError {
    LoadError::Setting { setting: "files", message }
}

fn no_partner(file: &Path) -> LoadError {
    refused(format!(
        "{}: give .mts files, or .ply, .obj and .off files two by two: the mesh at time 0 and at time 1",
        file.display()
    ))
}

/// Error for two cases whose rows would have the same id.
fn same_id(one: &CaseFiles, other: &CaseFiles) -> LoadError {
    let [first, second] = [one, other].map(|case| case.start.display());
    if one.start == other.start {
        return refused(format!("{first} begins two cases called `{}`: give it once", one.id));
    }
    refused(format!(
        "{first} and {second} are both called `{}`, so their rows could not be told apart: give one of them another name",
        one.id
    ))
}
