//! Meshes with linear vertex motion, and their construction from two surface files.

use std::path::Path;

use glam::DVec3;

use crate::error::{LoadError, Source};
use crate::import::{Face, Format, Surface, statements, surface};

/// A mesh at both ends of the shutter (or of a simulation step), in the precision of its file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MovingMesh {
    /// Vertices at time 0, shutter open.
    pub open: Vec<DVec3>,
    /// Vertices at time 1, shutter close.
    pub close: Vec<DVec3>,
    /// Vertex indices of each triangle, all in range.
    pub triangles: Vec<[u32; 3]>,
}

impl MovingMesh {
    /// Positions of every triangle corner at both ends.
    pub(super) fn corners(&self) -> impl Iterator<Item = [DVec3; 2]> {
        self.triangles
            .as_flattened()
            .iter()
            .map(|&vertex| [&self.open, &self.close].map(|end| end[vertex as usize]))
    }
}

/// Remedy for incompatible files.
const REMEDY: &str = "both ends of the shutter need equal topology: export both from the same mesh";

/// A file and its format.
pub(super) type File<'a> = (&'a Path, Format);

/// The still mesh of one file.
pub(super) fn still((path, format): File<'_>) -> Result<MovingMesh, LoadError> {
    let Surface { positions, triangles } = surface(path, format)?;
    Ok(MovingMesh { close: positions.clone(), open: positions, triangles })
}

/// The mesh of one file, which must have triangles.
fn with_triangles((path, format): File<'_>) -> Result<Surface, LoadError> {
    let mesh = surface(path, format)?;
    if mesh.triangles.is_empty() {
        let message = "it has none, so there is nothing that could move; export it with its faces";
        return Err(Source { path }.broken("triangles", message));
    }
    Ok(mesh)
}

/// The mesh of one file at shutter open and of the other at shutter close.
pub(crate) fn moving(start: File<'_>, end: File<'_>) -> Result<MovingMesh, LoadError> {
    let [open, close] = [with_triangles(start)?, with_triangles(end)?];
    let pair = Pair { paths: [start.0, end.0], open: &open, close: &close };
    let close = match (start.1, end.1) {
        (Format::Ply, Format::Ply) | (Format::Off, Format::Off) => pair.by_index()?,
        both => {
            let close = pair.by_corner()?;
            if both == (Format::Obj, Format::Obj) {
                pair.same_faces()?;
            }
            close
        }
    };
    Ok(MovingMesh { open: open.positions, close, triangles: open.triangles })
}

/// Two meshes to be matched.
struct Pair<'a> {
    paths: [&'a Path; 2],
    open: &'a Surface,
    close: &'a Surface,
}

impl Pair<'_> {
    /// End positions of the first mesh's vertices, if both files use the same indices.
    fn by_index(&self) -> Result<Vec<DVec3>, LoadError> {
        self.same_count("triangles", self.open.triangles.len(), self.close.triangles.len())?;
        self.same_count("vertices", self.open.positions.len(), self.close.positions.len())?;
        let both = self.open.triangles.iter().zip(self.close.triangles.iter());
        match both.enumerate().find(|(_, (from, to))| from != to) {
            None => Ok(self.close.positions.clone()),
            Some((triangle, (from, to))) => {
                let start = self.paths[0].display();
                let message = format!("its corners are {to:?}, those in {start} are {from:?}; {REMEDY}");
                Err(self.wrong(format!("triangle {triangle}"), message))
            }
        }
    }

    /// Checks that two OBJ files have the same number of positions and the same faces; triangles may match by
    /// chance.
    fn same_faces(&self) -> Result<(), LoadError> {
        let [open, close] = [statements(self.paths[0])?, statements(self.paths[1])?];
        self.same_count("vertices", open.positions.len(), close.positions.len())?;
        // One-based, as in the file.
        let numbers = |face: &Face| face.corners.map(|corner| corner.position + 1);
        match open.faces.iter().zip(&close.faces).find(|(from, to)| numbers(from) != numbers(to)) {
            None => Ok(()),
            Some((from, to)) => {
                let message = format!(
                    "it joins vertices {:?}, but line {} of {} joins {:?}; {REMEDY}",
                    numbers(to),
                    from.line,
                    self.paths[0].display(),
                    numbers(from)
                );
                Err(self.wrong(format!("line {}", to.line), message))
            }
        }
    }

    /// End positions of the first mesh's vertices, matched by triangle corners. Vertex indices of OBJ files
    /// do not match: importers split vertices with different normals, and the normals change with the motion.
    fn by_corner(&self) -> Result<Vec<DVec3>, LoadError> {
        self.same_count("triangles", self.open.triangles.len(), self.close.triangles.len())?;
        self.matched([self.close, self.open], 1)?;
        self.matched([self.open, self.close], 0)
    }

    /// Position in `to` of each vertex of `from`, which must be unique; `which` of the paths is that of
    /// `from`.
    fn matched(&self, [from, to]: [&Surface; 2], which: usize) -> Result<Vec<DVec3>, LoadError> {
        let mut places: Vec<Option<DVec3>> = vec![None; from.positions.len()];
        let corners = from.triangles.as_flattened().iter().zip(to.triangles.as_flattened());
        for (corner, (vertex, goal)) in corners.enumerate() {
            let place = to.positions[*goal as usize];
            let known = places[*vertex as usize].get_or_insert(place);
            if *known != place {
                let message = format!(
                    "one vertex of {} is at {known} and at {place} of {}; {REMEDY}",
                    self.paths[which].display(),
                    self.paths[1 - which].display()
                );
                return Err(self.wrong(format!("triangle {}", corner / 3), message));
            }
        }
        // Unused vertices stay in place.
        Ok(places.iter().zip(&from.positions).map(|(place, own)| place.unwrap_or(*own)).collect())
    }

    fn same_count(&self, what: &str, open: usize, close: usize) -> Result<(), LoadError> {
        if open == close {
            return Ok(());
        }
        let message = format!("it has {close} {what}, but {} has {open}; {REMEDY}", self.paths[0].display());
        Err(self.wrong(what, message))
    }

    fn wrong(&self, place: impl Into<String>, message: String) -> LoadError {
        Source { path: self.paths[1] }.broken(place, message)
    }
}
