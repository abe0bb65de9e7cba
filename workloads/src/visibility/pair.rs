//! Two files that hold a surface each as the two ends of the shutter.

use std::path::Path;

use glam::DVec3;

use super::mesh::MovingMesh;
use crate::error::{LoadError, Source};
use crate::import::{Face, Format, Surface, statements, surface};

/// What to do about files that do not go together.
const MEND: &str = "both ends of the shutter need equal topology: export both from the same mesh";

/// A file and its format.
pub(super) type File<'a> = (&'a Path, Format);

/// The mesh of one file, at rest.
pub(super) fn still((path, format): File<'_>) -> Result<MovingMesh, LoadError> {
    let Surface { positions, triangles } = surface(path, format)?;
    Ok(MovingMesh { close: positions.clone(), open: positions, triangles })
}

/// The mesh of one file, which has to have triangles.
fn whole((path, format): File<'_>) -> Result<Surface, LoadError> {
    let mesh = surface(path, format)?;
    if mesh.triangles.is_empty() {
        let message = "it has none, so there is nothing that could move; export it with its faces";
        return Err(Source { path }.broken("triangles", message));
    }
    Ok(mesh)
}

/// The mesh that is in one file when the shutter opens and in the other when it closes.
pub(crate) fn moving(start: File<'_>, end: File<'_>) -> Result<MovingMesh, LoadError> {
    let [open, close] = [whole(start)?, whole(end)?];
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

/// Two meshes being matched.
struct Pair<'a> {
    paths: [&'a Path; 2],
    open: &'a Surface,
    close: &'a Surface,
}

impl Pair<'_> {
    /// Where the vertices of the first mesh go, when both files number them alike.
    fn by_index(&self) -> Result<Vec<DVec3>, LoadError> {
        self.same_count("triangles", self.open.triangles.len(), self.close.triangles.len())?;
        self.same_count("vertices", self.open.positions.len(), self.close.positions.len())?;
        let both = self.open.triangles.iter().zip(self.close.triangles.iter());
        match both.enumerate().find(|(_, (from, to))| from != to) {
            None => Ok(self.close.positions.clone()),
            Some((triangle, (from, to))) => {
                let start = self.paths[0].display();
                let message = format!("its corners are {to:?}, those in {start} are {from:?}; {MEND}");
                Err(self.wrong(format!("triangle {triangle}"), message))
            }
        }
    }

    /// Whether two OBJ files have as many positions and their faces name the same: triangles may match by chance where they do not.
    fn same_faces(&self) -> Result<(), LoadError> {
        let [open, close] = [statements(self.paths[0])?, statements(self.paths[1])?];
        self.same_count("vertices", open.positions.len(), close.positions.len())?;
        // Counted from one on, as in the file.
        let numbers = |face: &Face| face.corners.map(|corner| corner.position + 1);
        match open.faces.iter().zip(&close.faces).find(|(from, to)| numbers(from) != numbers(to)) {
            None => Ok(()),
            Some((from, to)) => {
                let message = format!(
                    "it joins vertices {:?}, but line {} of {} joins {:?}; {MEND}",
                    numbers(to),
                    from.line,
                    self.paths[0].display(),
                    numbers(from)
                );
                Err(self.wrong(format!("line {}", to.line), message))
            }
        }
    }

    /// Where the vertices of the first mesh go, found by the corners of the triangles. The numbers of vertices in OBJ
    /// files say nothing: one is split where its normals differ, and that changes as a mesh moves.
    fn by_corner(&self) -> Result<Vec<DVec3>, LoadError> {
        self.same_count("triangles", self.open.triangles.len(), self.close.triangles.len())?;
        self.matched([self.close, self.open], 1)?;
        self.matched([self.open, self.close], 0)
    }

    /// The place in `to` of each vertex of `from`, which has to be one place; `which` of the paths is that of `from`.
    fn matched(&self, [from, to]: [&Surface; 2], which: usize) -> Result<Vec<DVec3>, LoadError> {
        let mut places: Vec<Option<DVec3>> = vec![None; from.positions.len()];
        let corners = from.triangles.as_flattened().iter().zip(to.triangles.as_flattened());
        for (corner, (vertex, goal)) in corners.enumerate() {
            let place = to.positions[*goal as usize];
            let known = places[*vertex as usize].get_or_insert(place);
            if *known != place {
                let message = format!(
                    "one vertex of {} is at {known} and at {place} of {}; {MEND}",
                    self.paths[which].display(),
                    self.paths[1 - which].display()
                );
                return Err(self.wrong(format!("triangle {}", corner / 3), message));
            }
        }
        // A vertex that no triangle uses stays.
        Ok(places.iter().zip(&from.positions).map(|(place, own)| place.unwrap_or(*own)).collect())
    }

    fn same_count(&self, what: &str, open: usize, close: usize) -> Result<(), LoadError> {
        if open == close {
            return Ok(());
        }
        let message = format!("it has {close} {what}, but {} has {open}; {MEND}", self.paths[0].display());
        Err(self.wrong(what, message))
    }

    fn wrong(&self, place: impl Into<String>, message: String) -> LoadError {
        Source { path: self.paths[1] }.broken(place, message)
    }
}
