//! Files of collision detection: which of them make a case, and what it holds.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use super::components;
use crate::error::LoadError;
use crate::import::Format;
use crate::visibility::{Kind, MovingMesh, load_mts, moving};

/// What a case can be loaded from, for messages.
const KNOWN: &str = ".mts, and .ply, .obj or .off two by two (each also gzipped)";

/// Objects that may collide, and where they came from.
#[derive(Clone, Debug)]
pub struct CollisionCase {
    /// The name of the file without its ending.
    pub id: String,
    /// An object each.
    pub objects: Vec<MovingMesh>,
    /// How far a coordinate may be from that of the file.
    pub uncertainty: f64,
}

/// The files of a case, not read yet.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CaseFiles {
    /// The name of the first file without its ending.
    pub id: String,
    start: PathBuf,
    content: Content,
}

/// What the files of a case hold.
#[derive(Clone, Debug, PartialEq, Eq)]
enum Content {
    /// All of it in one.
    Objects,
    /// A mesh at time 0 in the first, and at time 1 in another.
    Ends(Format, PathBuf, Format),
}

impl CaseFiles {
    /// Which of `files` go together: an `.mts` alone, PLY, OBJ and OFF files two by two. Of a file that cannot be read its name says what it is.
    ///
    /// # Errors
    /// [`LoadError::is_usage`] for folders, files of no known kind or without a partner, and cases of one id; else a file that cannot be
    /// read and whose name says nothing.
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

    /// Reads them. The parts of a mesh that hang together are its objects; coordinates of PLY, OBJ and OFF files were
    /// most likely rounded to f32 when they were written, and how far off that may be is given with them.
    ///
    /// # Errors
    /// What is broken, and where.
    pub fn load(&self) -> Result<CollisionCase, LoadError> {
        let id = self.id.clone();
        let Content::Ends(opening, end, closing) = &self.content else {
            return Ok(CollisionCase { id, objects: load_mts(&self.start)?, uncertainty: 0.0 });
        };
        let mesh = moving((&self.start, *opening), (end, *closing))?;
        let largest = mesh.open.iter().chain(&mesh.close).map(|p| p.abs().max_element()).fold(0.0, f64::max);
        // Below the smallest normal number what is rounded away is no share of the number.
        let uncertainty = (largest * f64::from(f32::EPSILON)).max(f64::from(f32::from_bits(1)));
        Ok(CollisionCase { id, objects: components(&mesh), uncertainty })
    }

    /// The first of them.
    pub fn start(&self) -> &Path {
        &self.start
    }
}

/// Loads cases of collision detection: an `.mts` each with its objects, or two PLY, OBJ or OFF files as the two instants of a mesh.
///
/// # Errors
/// As [`CaseFiles::of`] and [`CaseFiles::load`], at the first file.
pub fn load_cases(files: &[impl AsRef<Path>]) -> Result<Vec<CollisionCase>, LoadError> {
    CaseFiles::of(files)?.iter().map(CaseFiles::load).collect()
}

/// Loads the objects of one `.mts` file.
///
/// # Errors
/// [`LoadError::is_usage`] for any other kind of file; else what is broken, and where.
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

/// The name of a file without `.mts`, `.mts.gz` and the like.
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

/// Rows of two cases could not be told apart.
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
