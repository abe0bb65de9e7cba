//! The faces of an OBJ file as it has them: a loader that gives each vertex one normal numbers vertices anew.

use std::io::BufRead;
use std::path::Path;

use super::reader;
use crate::error::LoadError;

/// A triangle of a face.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Face {
    /// The line of the file that its face is on, from one on.
    pub line: usize,
    /// The numbers of its vertices, from one on.
    pub corners: [i64; 3],
}

/// The number of vertices of the OBJ file at `path`, used or not, and its triangles, faces with more corners as fans. Tells nothing of what
/// is no face as it should be.
pub(crate) fn faces(path: &Path) -> Result<(usize, Vec<Face>), LoadError> {
    let (mut faces, mut vertices) = (Vec::new(), 0);
    for (line, text) in (1..).zip(reader::open(path)?.split(b'\n')) {
        let text = text.map_err(|error| reader::damaged(path, &error))?;
        let text = String::from_utf8_lossy(&text);
        let mut words = text.split_ascii_whitespace();
        match words.next() {
            Some("v") => vertices += 1,
            Some("f") => {
                let corners: Vec<i64> = words.filter_map(|word| number(word, vertices)).collect();
                let fan = corners.windows(2).skip(1);
                faces.extend(fan.map(|pair| Face { line, corners: [corners[0], pair[0], pair[1]] }));
            }
            _ => {}
        }
    }
    Ok((vertices as usize, faces))
}

/// The number of a corner's position; those below zero count back from the last one.
fn number(corner: &str, vertices: i64) -> Option<i64> {
    let number: i64 = corner.split('/').next()?.parse().ok()?;
    Some(if number < 0 { vertices + 1 + number } else { number })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn faces_are_as_the_file_has_them() {
        let file = tempfile::NamedTempFile::new().unwrap();
        let text = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n# f 9 9 9\nf 1/1/1 2//1 3/1 4\nvn 0 0 1\nf -1 -2 -3\nl 1 2\n";
        std::fs::write(file.path(), text).unwrap();
        let (vertices, found) = faces(file.path()).unwrap();
        let found: Vec<_> = found.iter().map(|face| (face.line, face.corners)).collect();
        assert_eq!(vertices, 4);
        assert_eq!(found, [(6, [1, 2, 3]), (6, [1, 3, 4]), (8, [4, 3, 2])]);
    }
}
