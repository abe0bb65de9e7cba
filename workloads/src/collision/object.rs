//! Moving objects made of triangles, and the files that contain them.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use glam::DVec3;

use super::{Bounds, Ends, times_inside};
use crate::error::LoadError;
use crate::import::Format;
use crate::visibility::{InputKind, MovingMesh, load_mts, moving};

/// An object: triangles, each with linear motion from time 0 to time 1.
#[derive(Clone, Debug)]
pub struct Object {
    pub(super) triangles: Vec<Ends>,
    /// Swept box of each triangle.
    pub(super) boxes: Vec<Bounds>,
    /// Swept box of the object.
    pub(super) bounds: Bounds,
    /// Largest error of a coordinate.
    pub(super) uncertainty: f64,
}

/// Largest accepted coordinate. Products of three stay finite.
const MAX_COORDINATE: f64 = 1e60;

impl Object {
    /// Takes the triangles of a mesh, whose coordinates may be off by up to `uncertainty`. `None` if a
    /// coordinate is NaN or beyond 1e60.
    pub fn new(mesh: &MovingMesh, uncertainty: f64) -> Option<Self> {
        let corner = |end: &[DVec3], vertex: u32| end[vertex as usize].to_array();
        let ends = |corners: &[u32; 3]| [&mesh.open, &mesh.close].map(|end| corners.map(|v| corner(end, v)));
        Self::from_ends(mesh.triangles.iter().map(ends).collect(), uncertainty)
    }

    /// Takes triangles by their corners at both times; as [`new`](Self::new).
    pub fn from_ends(triangles: Vec<Ends>, uncertainty: f64) -> Option<Self> {
        let fits = |at: &f64| at.abs() <= MAX_COORDINATE;
        // Allows for rounding in differences of a coordinate and its uncertainty.
        let uncertainty = 1.001 * uncertainty;
        if !triangles.as_flattened().as_flattened().as_flattened().iter().all(fits) {
            return None;
        }
        Some(Self::with_boxes(triangles, uncertainty))
    }

    /// Mean translation of the corners from time 0 to time 1, from up to 64 triangles.
    pub(super) fn translation(&self) -> [f64; 3] {
        const SAMPLED_TRIANGLES: usize = 64;
        let sampled = self.triangles.iter().step_by(self.triangles.len().div_ceil(SAMPLED_TRIANGLES).max(1));
        let count = (3 * sampled.len()).max(1) as f64;
        [0, 1, 2].map(|axis| {
            let translation =
                |[open, close]: &Ends| (0..3).map(|k| close[k][axis] - open[k][axis]).sum::<f64>();
            sampled.clone().map(translation).sum::<f64>() / count
        })
    }

    /// The triangles of `list` in a frame of reference that is translated by `translation` from time 0 to
    /// time 1.
    pub(super) fn in_frame(&self, list: &[u32], translation: [f64; 3]) -> Self {
        let seen =
            |[open, close]: &Ends| [*open, close.map(|p| [0, 1, 2].map(|axis| p[axis] - translation[axis]))];
        let triangles: Vec<Ends> = list.iter().map(|&n| seen(&self.triangles[n as usize])).collect();
        let coordinates = triangles.as_flattened().as_flattened().as_flattened();
        let largest =
            coordinates.iter().chain(&translation).fold(0.0, |largest: f64, at| largest.max(at.abs()));
        // A difference has an error of half an ulp.
        Self::with_boxes(triangles, self.uncertainty + f64::EPSILON * largest)
    }

    /// The object scaled by `factor`, a power of two.
    pub(super) fn scaled(&self, factor: f64) -> Self {
        let scaled = |ends: &Ends| ends.map(|end| end.map(|p| p.map(|at| at * factor)));
        Self::with_boxes(self.triangles.iter().map(scaled).collect(), self.uncertainty * factor)
    }

    /// Largest absolute coordinate of the swept box.
    pub(super) fn largest(&self) -> f64 {
        self.bounds.space.as_flattened().iter().fold(0.0, |largest, at| largest.max(at.abs()))
    }

    /// Computes the swept boxes.
    fn with_boxes(triangles: Vec<Ends>, uncertainty: f64) -> Self {
        let swept = |ends: &Ends| Bounds::of(ends.as_flattened().iter().copied()).inflated(uncertainty);
        let boxes: Vec<Bounds> = triangles.iter().map(swept).collect();
        let bounds =
            boxes.iter().fold(Bounds { time: [0.0, 1.0], ..Bounds::NOTHING }, |all, one| all.hull(one));
        Self { triangles, boxes, bounds, uncertainty }
    }

    /// The object with its uncertainty raised by the share `relative` of its largest coordinate.
    #[must_use]
    pub fn loosened(&self, relative: f64) -> Self {
        let coordinates = self.triangles.as_flattened().as_flattened().as_flattened();
        let largest = coordinates.iter().fold(0.0, |largest: f64, at| largest.max(at.abs()));
        Self::with_boxes(self.triangles.clone(), self.uncertainty + relative * largest)
    }

    /// Number of triangles.
    pub fn len(&self) -> usize {
        self.triangles.len()
    }

    /// Whether the object has no triangles.
    pub fn is_empty(&self) -> bool {
        self.triangles.is_empty()
    }

    /// Times at which a triangle may be inside a box of space and time.
    pub(super) fn times_inside(&self, triangle: u32, within: &Bounds) -> Option<[f64; 2]> {
        let triangle = triangle as usize;
        times_inside(&self.triangles[triangle], &self.boxes[triangle], within, self.uncertainty)
    }

    /// Swept box.
    pub fn bounds(&self) -> &Bounds {
        &self.bounds
    }
}

/// Connected components of a mesh, by shared vertices, in the order of their first triangles.
pub fn components(mesh: &MovingMesh) -> Vec<MovingMesh> {
    let mut parents: Vec<u32> = (0..mesh.open.len() as u32).collect();
    for [a, b, c] in &mesh.triangles {
        let root = find(&mut parents, *a);
        for vertex in [*b, *c] {
            let other = find(&mut parents, vertex);
            parents[other as usize] = root;
        }
    }
    let mut parts: Vec<MovingMesh> = Vec::new();
    let mut part_of = vec![usize::MAX; parents.len()];
    for corners in &mesh.triangles {
        let root = find(&mut parents, corners[0]) as usize;
        if part_of[root] == usize::MAX {
            part_of[root] = parts.len();
            parts.push(MovingMesh {
                open: mesh.open.clone(),
                close: mesh.close.clone(),
                triangles: Vec::new(),
            });
        }
        parts[part_of[root]].triangles.push(*corners);
    }
    parts
}

/// Root of a vertex in the union-find forest, with path halving.
fn find(parents: &mut [u32], mut vertex: u32) -> u32 {
    while parents[vertex as usize] != vertex {
        parents[vertex as usize] = parents[parents[vertex as usize] as usize];
        vertex = parents[vertex as usize];
    }
    vertex
}

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
                InputKind::Mts => Content::Objects,
                InputKind::Surface(format) => {
                    let other = files.next().ok_or_else(|| no_partner(file))?;
                    let InputKind::Surface(closing) = kind(other)? else { return Err(no_partner(file)) };
                    Content::Ends(format, other.to_owned(), closing)
                }
                InputKind::M5d => return Err(no_partner(file)),
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
        Ok(InputKind::Mts) => load_mts(file),
        Ok(_) | Err(LoadError::Kind { .. }) => {
            let message = format!(
                "{} is not an .mts file; for two .ply, .obj or .off files use `quintile ccd`",
                file.display()
            );
            Err(LoadError::Setting { setting: "file", message })
        }
        Err(error) => Err(error),
    }
}

fn kind(path: &Path) -> Result<InputKind, LoadError> {
    match InputKind::of(path) {
        Err(LoadError::Kind { file, .. }) => Err(LoadError::Kind { file, known: KNOWN }),
        Err(error) if !error.is_usage() => InputKind::named(path).ok_or(error),
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
        "{first} and {second} are both called `{}`, so their rows would be identical: give one of them another name",
        one.id
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn triangles_that_share_a_vertex_are_one_component() {
        let points = vec![DVec3::ZERO; 9];
        let triangles = vec![[0, 1, 2], [3, 4, 5], [2, 6, 7], [8, 8, 5]];
        let mesh = MovingMesh { open: points.clone(), close: points, triangles };
        let parts: Vec<_> = components(&mesh).into_iter().map(|part| part.triangles).collect();
        assert_eq!(parts, [vec![[0, 1, 2], [2, 6, 7]], vec![[3, 4, 5], [8, 8, 5]]]);
    }

    #[test]
    fn nan_and_large_coordinates_are_refused() {
        let mut ends = [[[0.0; 3]; 3]; 2];
        assert!(Object::from_ends(vec![ends], 0.0).is_some());
        for bad in [f64::NAN, f64::INFINITY, -2e60] {
            ends[1][2][1] = bad;
            assert!(Object::from_ends(vec![ends], 0.0).is_none());
        }
    }
}
