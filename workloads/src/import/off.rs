//! OFF files in ASCII: vertices, perhaps with normals, colours or texture coordinates, and polygons.
//!
//! The format is that of Geomview's manual (geomview.org, "OFF: Object File Format").

use std::io::BufRead;
use std::path::Path;

use glam::{DVec3, Vec2};

use super::super::import;
use super::reader;
use super::reader::{MAX_ELEMENTS, Soup, linear};
use crate::error::{LoadError, Source};

/// What to do about kinds of OFF files that are not read.
const CONVERT: &str = "convert it to PLY or to an OFF file in ASCII with three coordinates";

/// Reads the OFF file at `path`, gzipped or not.
pub(super) fn read(path: &Path) -> Result<Soup, LoadError> {
    let mut words = Words { input: reader::open(path)?, path, line: 0, left: Vec::new() };
    let (layout, [vertices, faces]) = words.header()?;
    let mut soup = Soup::default();
    for _ in 0..vertices {
        let place = words.take("a vertex")?;
        layout.vertex(&place, &mut soup).map_err(|what| words.broken(&what))?;
    }
    let mut colored = false;
    for _ in 0..faces {
        let face = words.take("a face")?;
        colored |= face_of(&face, vertices, &mut soup).map_err(|what| words.broken(&what))?;
    }
    soup.warnings.extend(colored.then(|| import::face_colors(path)));
    Ok(soup)
}

/// Components of each vertex, in this order.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Layout {
    normals: bool,
    colors: bool,
    uvs: bool,
}

impl Layout {
    /// By the first word of the file: `OFF` with `ST`, `C` and `N` before it.
    fn of(word: &str) -> Option<Self> {
        let before = word.strip_suffix("OFF")?;
        let (before, uvs) = before.strip_prefix("ST").map_or((before, false), |rest| (rest, true));
        let (before, colors) = before.strip_prefix('C').map_or((before, false), |rest| (rest, true));
        let (before, normals) = before.strip_prefix('N').map_or((before, false), |rest| (rest, true));
        before.is_empty().then_some(Self { normals, colors, uvs })
    }

    fn vertex(self, words: &[String], soup: &mut Soup) -> Result<(), String> {
        let numbers = words.iter().map(|word| number(word)).collect::<Result<Vec<f64>, _>>()?;
        let uvs = if self.uvs { 2 } else { 0 };
        let least = 3 + if self.normals { 3 } else { 0 } + if self.colors { 3 } else { 0 } + uvs;
        if numbers.len() < least {
            return Err(format!("a vertex of {} numbers instead of {least}", numbers.len()));
        }
        soup.positions.push(DVec3::from_slice(&numbers[..3]));
        let mut at = 3;
        if self.normals {
            soup.normals.push(DVec3::from_slice(&numbers[3..6]).as_vec3());
            at = 6;
        }
        if self.colors {
            // Integers count to 255, others to 1; what is left before texture coordinates is alpha.
            let whole = words[at..at + 3].iter().all(|word| !word.contains(['.', 'e', 'E']));
            let channel = |i: usize| (numbers[at + i] / if whole { 255.0 } else { 1.0 }) as f32;
            soup.colors.push(linear([0, 1, 2].map(channel)));
        }
        if self.uvs {
            let [u, v] = [2, 1].map(|back| numbers[numbers.len() - back] as f32);
            soup.uvs.push(Vec2::new(u, 1.0 - v));
        }
        Ok(())
    }
}

/// Adds a face, a number of corners and then these; says whether it has a colour.
fn face_of(words: &[String], vertices: usize, soup: &mut Soup) -> Result<bool, String> {
    let index = |word: &String| word.parse::<u32>().map_err(|_| format!("`{word}` is not a whole number"));
    let count = words.first().map_or(Ok(0), index)? as usize;
    let corners = words.get(1..=count).filter(|_| count > 0);
    let corners = corners
        .ok_or_else(|| format!("a face of {count} corners, {} follow", words.len().saturating_sub(1)))?;
    let corners = corners.iter().map(index).collect::<Result<Vec<_>, _>>()?;
    if let Some(vertex) = corners.iter().find(|vertex| **vertex as usize >= vertices) {
        return Err(format!("a face uses vertex {vertex}, but there are only {vertices}, counted from 0"));
    }
    soup.polygon(&corners);
    Ok(words.len() > count + 1)
}

fn number(word: &str) -> Result<f64, String> {
    let number: f64 = word.parse().map_err(|_| format!("`{word}` is not a number"))?;
    if number.is_finite() {
        Ok(number)
    } else {
        Err(format!("a coordinate that is NaN or infinite (`{word}`)"))
    }
}

/// The lines of the file that hold anything, word by word.
struct Words<'a> {
    input: Box<dyn BufRead>,
    path: &'a Path,
    line: usize,
    /// What is left of the line that the header ends on.
    left: Vec<String>,
}

impl Words<'_> {
    fn broken(&self, what: &str) -> LoadError {
        Source { path: self.path }.broken(format!("line {}", self.line), format!("{what}; fix the file"))
    }

    /// The words of the next line that has any; comments begin with `#`.
    fn next(&mut self) -> Result<Option<Vec<String>>, LoadError> {
        if !self.left.is_empty() {
            return Ok(Some(std::mem::take(&mut self.left)));
        }
        loop {
            let mut bytes = Vec::new();
            let read = self.input.read_until(b'\n', &mut bytes);
            if read.map_err(|error| reader::damaged(self.path, &error))? == 0 {
                return Ok(None);
            }
            self.line += 1;
            let text = String::from_utf8_lossy(&bytes);
            let text = text.split('#').next().unwrap_or_default();
            let words: Vec<String> = text.split_whitespace().map(str::to_owned).collect();
            if !words.is_empty() {
                return Ok(Some(words));
            }
        }
    }

    fn take(&mut self, what: &str) -> Result<Vec<String>, LoadError> {
        let next = self.next()?;
        next.ok_or_else(|| self.broken(&format!("the file ends before {what}: it may be truncated")))
    }

    /// Components of vertices, and the numbers of vertices and faces.
    fn header(&mut self) -> Result<(Layout, [usize; 2]), LoadError> {
        let mut words = self.take("its header")?;
        // Some files have no space between the name and the first number.
        let end = words[0].find("OFF").map_or(0, |at| at + 3);
        let (name, glued) = words[0].split_at(end);
        let layout = Layout::of(name);
        let layout = layout.ok_or_else(|| {
            let known = words[0].ends_with("OFF");
            let what = if known { "this kind of OFF file is not read" } else { "not an OFF file" };
            self.broken(&format!("`{}`: {what}; {CONVERT}", words[0]))
        })?;
        if words.get(1).is_some_and(|word| word == "BINARY") {
            return Err(self.broken(&format!("binary OFF files are not read; {CONVERT}")));
        }
        let glued = (!glued.is_empty()).then(|| glued.to_owned());
        self.left = glued.into_iter().chain(words.drain(1..)).collect();
        let counts = self.take("the number of vertices")?;
        let count = |index: usize| {
            let found = counts.get(index).and_then(|word| word.parse().ok());
            found.filter(|count| *count <= MAX_ELEMENTS)
        };
        match [count(0), count(1)] {
            [Some(vertices), Some(faces)] => Ok((layout, [vertices, faces])),
            _ => Err(self.broken(&format!(
                "`{}` is not the numbers of vertices and faces, each up to {MAX_ELEMENTS}",
                counts.join(" ")
            ))),
        }
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;

    fn parse(text: &str) -> Result<Soup, String> {
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), text).unwrap();
        read(file.path()).map_err(|error| error.to_string())
    }

    #[test]
    fn polygons_become_fans_whatever_the_header_looks_like() {
        let body = "0 0 0\n1 0 0 # a corner\n\n1 1 0\n0 1 0\n4 0 1 2 3\n3 0 2 3\n";
        for header in ["OFF\n4 2 0\n", "OFF 4 2 0\n", "OFF4 2 0\n", "# made by hand\nOFF\n\n4 2 5\n"] {
            let soup = parse(&format!("{header}{body}")).unwrap();
            assert_eq!(soup.triangles, [[0, 1, 2], [0, 2, 3], [0, 2, 3]], "{header}");
            assert_eq!(soup.positions[2], DVec3::new(1.0, 1.0, 0.0));
            assert!(soup.warnings.is_empty());
        }
    }

    #[test]
    fn vertices_may_have_normals_colours_and_texture_coordinates() {
        let soup = parse(
            "STCNOFF\n3 1 0\n0 0 0 0 0 1 255 0 0 255 0.5 0.25\n1 0 0 0 0 1 0 255 0 0 0\n0 1 0 0 0 1 0 0 255 1 1\n3 0 1 2\n",
        );
        let soup = soup.unwrap();
        assert_eq!(soup.normals, [Vec3::Z; 3]);
        assert_eq!(soup.colors, [Vec3::X, Vec3::Y, Vec3::Z]);
        assert_eq!(soup.uvs[0], Vec2::new(0.5, 0.75));
        let soup = parse("COFF\n1 0 0\n4000000.125 0 0 0.5 1.0 1.0 1.0\n").unwrap();
        assert_eq!(soup.positions[0].x, 4_000_000.125);
        assert!((soup.colors[0].x - 0.214).abs() < 1e-3);
    }

    #[test]
    fn colours_of_faces_are_reported() {
        let soup = parse("OFF\n3 2 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2 255 0 0\n3 0 2 1\n").unwrap();
        assert_eq!((soup.triangles.len(), soup.warnings.len()), (2, 1));
        assert_eq!(soup.warnings[0].code, "face-colors-ignored");
    }

    #[test]
    fn broken_files_are_errors_with_a_line() {
        let cases = [
            ("", "line 0: the file ends before its header"),
            ("PLY\n", "line 1: `PLY`: not an OFF file"),
            ("4OFF\n1 0 0\n", "line 1: `4OFF`: this kind of OFF file is not read; convert it"),
            ("OFF BINARY\n", "line 1: binary OFF files are not read"),
            ("OFF\n4294967295 1 0\n", "line 2: `4294967295 1 0` is not the numbers"),
            ("OFF\n-1 1 0\n", "line 2: `-1 1 0` is not the numbers"),
            ("OFF\n100000000 1 0\n0 0 0\n", "line 3: the file ends before a vertex"),
            ("OFF\n1 1 0\n0 0\n", "line 3: a vertex of 2 numbers instead of 3"),
            ("OFF\n1 1 0\n0 nan 0\n", "line 3: a coordinate that is NaN"),
            ("OFF\n1 1 0\n0 0 0\n3 0 0 1\n", "line 4: a face uses vertex 1, but there are only 1"),
            ("OFF\n1 1 0\n0 0 0\n4294967295 0 0 0\n", "line 4: a face of 4294967295 corners, 3 follow"),
            ("OFF\n1 1 0\n0 0 0\n3 0 x 0\n", "line 4: `x` is not a whole number"),
            ("OFF\n1 2 0\n0 0 0\n3 0 0 0\n", "line 4: the file ends before a face"),
        ];
        for (text, expected) in cases {
            let error = parse(text).unwrap_err();
            assert!(error.contains(expected), "{text:?}: {error}");
        }
    }
}
