//! OBJ files: positions, colours, normals, texture coordinates, polygons and materials.

mod materials;

use std::borrow::Cow;
use std::collections::{BTreeMap, HashMap};
use std::io::BufRead;
use std::path::Path;

use glam::{DVec3, Vec2, Vec3};
use warnings::{Code, Warning};

use crate::error::{LoadError, Source};
use crate::import::reader::{self, MAX_ELEMENTS, Soup};

/// Reads the OBJ file at `path`, gzipped or not, with the materials it names.
pub(super) fn read(path: &Path) -> Result<Soup, LoadError> {
    let found = statements(path)?;
    let mut soup = geometry(&found);
    let lines = found.dropped.iter().map(|line| format!("{}, line {line}", path.display()));
    let what = "not drawn: only faces are";
    soup.warnings.extend(Warning::about_all(
        Code::PrimitiveDropped,
        "point, line or curve element",
        what,
        lines,
    ));
    if !found.materials.is_empty() {
        materials::dress(&mut soup, &found, path)?;
    }
    Ok(soup)
}

/// Triangles without materials.
pub(super) fn surface(path: &Path) -> Result<Soup, LoadError> {
    statements(path).map(|found| geometry(&found))
}

/// Corners with equal numbers are one vertex, in the order in which faces use them.
fn geometry(found: &Statements) -> Soup {
    let mut numbers: HashMap<FaceCorner, u32> = HashMap::new();
    let mut corners = Vec::new();
    let mut number = |corner: FaceCorner| {
        *numbers.entry(corner).or_insert_with(|| {
            corners.push(corner);
            corners.len() as u32 - 1
        })
    };
    let triangles = found.faces.iter().map(|face| face.corners.map(&mut number)).collect();
    let colors = found.linear_colors();
    let of_position = |corner: &FaceCorner| corner.position as usize;
    let mut soup = Soup {
        positions: corners.iter().map(|corner| found.positions[of_position(corner)]).collect(),
        triangles,
        ..Soup::default()
    };
    if !colors.is_empty() {
        soup.colors = corners.iter().map(|corner| colors[of_position(corner)]).collect();
    }
    // If any vertex has no normal, all normals are computed from the faces.
    let normals = corners.iter().map(|corner| corner.normal.map(|normal| found.normals[normal as usize]));
    soup.normals = normals.collect::<Option<_>>().unwrap_or_default();
    if corners.iter().any(|corner| corner.uv.is_some()) {
        // OBJ counts v upwards from the last row.
        let flipped = |uv: u32| Vec2::new(found.uvs[uv as usize].x, 1.0 - found.uvs[uv as usize].y);
        soup.uvs = corners.iter().map(|corner| corner.uv.map_or(Vec2::ZERO, flipped)).collect();
    }
    soup
}

/// A corner of a face: its position, texture coordinate and normal by number, from zero on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct FaceCorner {
    pub position: u32,
    pub uv: Option<u32>,
    pub normal: Option<u32>,
}

/// A triangle of a face.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Face {
    /// The line of the file that its face is on, from one on.
    pub line: usize,
    pub corners: [FaceCorner; 3],
    /// The material by its place in [`Statements::materials`]; `None` before any is named.
    pub material: Option<u32>,
}

/// Statements of a file. All indices of corners are checked.
#[derive(Clone, Debug, Default)]
pub(crate) struct Statements {
    pub positions: Vec<DVec3>,
    /// Colours as shown on a screen; the list is empty, or has one or none for each position.
    pub colors: Vec<Option<[f32; 3]>>,
    /// As the file counts them, `v` upwards.
    pub uvs: Vec<Vec2>,
    pub normals: Vec<Vec3>,
    /// Triangles, faces with more corners as fans.
    pub faces: Vec<Face>,
    /// Names of the materials that are used, in the order in which they are first named.
    pub materials: Vec<String>,
    /// Files of materials.
    pub libraries: Vec<String>,
    /// Lines of the file with points, lines, curves and curved surfaces, which are not drawn.
    pub dropped: Vec<usize>,
}

/// Reads the statements of the OBJ file at `path`, gzipped or not. Statements about other things than
/// surfaces are skipped.
pub(crate) fn statements(path: &Path) -> Result<Statements, LoadError> {
    let mut reading = Reading::default();
    for (line, words) in lines(path)? {
        let words = words?;
        reading.line = line;
        reading.statement(&words).map_err(|what| broken(path, line, &what))?;
    }
    let statements = reading.statements;
    statements.check().map_err(|(line, what)| broken(path, line, &what))?;
    Ok(statements)
}

/// The lines of a text file with their numbers from one on, without comments; a backslash at the end of a
/// line joins the next one to it.
fn lines(path: &Path) -> Result<impl Iterator<Item = (usize, Result<String, LoadError>)> + '_, LoadError> {
    let mut input = reader::open(path)?;
    let mut line = 0;
    Ok(std::iter::from_fn(move || {
        let (mut text, mut first) = (String::new(), None);
        loop {
            let mut bytes = Vec::new();
            match input.read_until(b'\n', &mut bytes) {
                Err(error) => return Some((line, Err(reader::damaged(path, &error)))),
                Ok(0) => return first.map(|first| (first, Ok(text))),
                Ok(_) => line += 1,
            }
            let first = *first.get_or_insert(line);
            let decoded: Cow<'_, str> = String::from_utf8_lossy(&bytes);
            let part = without_comment(&decoded).trim_end();
            match part.strip_suffix('\\') {
                Some(part) => {
                    text.push_str(part);
                    text.push(' ');
                }
                None => {
                    text.push_str(part);
                    return Some((first, Ok(text)));
                }
            }
        }
    }))
}

/// The text before a comment. A comment begins a word, because names may contain `#`.
fn without_comment(line: &str) -> &str {
    let begins =
        |(at, _): &(usize, &str)| *at == 0 || line[..*at].ends_with(|c: char| c.is_ascii_whitespace());
    line.match_indices('#').find(begins).map_or(line, |(at, _)| &line[..at])
}

fn broken(path: &Path, line: usize, what: &str) -> LoadError {
    Source { path }.broken(format!("line {line}"), format!("{what}; fix the file"))
}

#[derive(Default)]
struct Reading {
    statements: Statements,
    line: usize,
    material: Option<u32>,
    numbers: BTreeMap<String, u32>,
}

impl Reading {
    fn statement(&mut self, line: &str) -> Result<(), String> {
        let line = line.trim_start();
        let (word, rest) = line.split_once(|c: char| c.is_ascii_whitespace()).unwrap_or((line, ""));
        let found = &mut self.statements;
        match word {
            "v" => self.vertex(rest)?,
            "vt" => {
                let values = numbers::<f32>(rest, 1)?;
                found.uvs.push(Vec2::new(values[0], values.get(1).copied().unwrap_or_default()));
            }
            "vn" => found.normals.push(Vec3::from_slice(&numbers::<f32>(rest, 3)?[..3])),
            "f" => self.face(rest)?,
            "usemtl" => self.use_material(rest.trim()),
            "mtllib" => found.libraries.push(rest.trim().to_owned()),
            "p" | "l" | "curv" | "curv2" | "surf" => found.dropped.push(self.line),
            _ => {}
        }
        let found = &self.statements;
        let counts = [
            found.positions.len(),
            found.uvs.len(),
            found.normals.len(),
            found.faces.len(),
            found.dropped.len(),
        ];
        if counts.iter().all(|count| *count <= MAX_ELEMENTS) {
            Ok(())
        } else {
            Err(format!("more than {MAX_ELEMENTS} of a kind"))
        }
    }

    /// `x y z`, then a weight, or a colour; weights belong to curves and divide the position.
    fn vertex(&mut self, rest: &str) -> Result<(), String> {
        let values = numbers::<f64>(rest, 3)?;
        let found = &mut self.statements;
        let place = DVec3::new(values[0], values[1], values[2]);
        let (place, color) = match values[3..] {
            [] => (place, None),
            [0.0] => return Err("the weight of a vertex is 0".to_owned()),
            [weight] => (place / weight, None),
            [red, green, blue] | [_, red, green, blue] => (place, Some([red, green, blue].map(|c| c as f32))),
            _ => {
                return Err(format!("a vertex of {} numbers instead of 3, or 6 with a colour", values.len()));
            }
        };
        if color.is_some() {
            found.colors.resize(found.positions.len(), None);
        }
        if color.is_some() || !found.colors.is_empty() {
            found.colors.push(color);
        }
        found.positions.push(place);
        Ok(())
    }

    fn face(&mut self, rest: &str) -> Result<(), String> {
        let corners = rest.split_ascii_whitespace().map(|word| self.corner(word));
        let corners = corners.collect::<Result<Vec<_>, _>>()?;
        // Two corners are an edge, which is not drawn.
        if (1..3).contains(&corners.len()) {
            self.statements.dropped.push(self.line);
        }
        let fan = corners.windows(2).skip(1);
        let face = |pair: &[FaceCorner]| Face {
            line: self.line,
            corners: [corners[0], pair[0], pair[1]],
            material: self.material,
        };
        self.statements.faces.extend(fan.map(face));
        Ok(())
    }

    /// `position/uv/normal`, the latter two or the last left out or empty.
    fn corner(&self, word: &str) -> Result<FaceCorner, String> {
        let found = &self.statements;
        let mut parts = word.split('/');
        let mut next = |count: usize| match parts.next() {
            None | Some("") => Ok(None),
            Some(text) => number(text, count).map(Some).ok_or_else(|| format!("`{word}` is not a corner")),
        };
        let position = next(found.positions.len())?.ok_or_else(|| format!("`{word}` is not a corner"))?;
        Ok(FaceCorner { position, uv: next(found.uvs.len())?, normal: next(found.normals.len())? })
    }

    fn use_material(&mut self, name: &str) {
        if let Some(&known) = self.numbers.get(name) {
            self.material = Some(known);
            return;
        }
        let number = self.statements.materials.len() as u32;
        self.statements.materials.push(name.to_owned());
        self.numbers.insert(name.to_owned(), number);
        self.material = Some(number);
    }
}

/// The number of an element from zero on; the file counts from one, or back from the last of `count` where it
/// is below zero.
fn number(text: &str, count: usize) -> Option<u32> {
    let number: i64 = text.parse().ok()?;
    let from_zero = if number < 0 { i64::try_from(count).ok()?.checked_add(number)? } else { number - 1 };
    u32::try_from(from_zero).ok()
}

/// The numbers of a line, at least `least`, all finite.
fn numbers<T: std::str::FromStr + Into<f64> + Copy>(text: &str, least: usize) -> Result<Vec<T>, String> {
    let number = |word: &str| {
        let number: Result<T, String> = word.parse().map_err(|_| format!("`{word}` is not a number"));
        let number = number?;
        let value: f64 = number.into();
        if value.is_finite() {
            Ok(number)
        } else {
            Err(format!("a coordinate that is NaN or infinite (`{word}`)"))
        }
    };
    let found: Vec<T> = text.split_ascii_whitespace().map(number).collect::<Result<_, _>>()?;
    if found.len() < least { Err(format!("{} numbers instead of {least}", found.len())) } else { Ok(found) }
}

impl Statements {
    /// Checks the indices of faces at the end, because faces may precede their vertices.
    fn check(&self) -> Result<(), (usize, String)> {
        let within = |what: &str, number: Option<u32>, count: usize| match number {
            Some(number) if number as usize >= count => {
                Err(format!("a face uses {what} {}, but there are only {count}", u64::from(number) + 1))
            }
            _ => Ok(()),
        };
        for face in &self.faces {
            for corner in face.corners {
                within("vertex", Some(corner.position), self.positions.len())
                    .and_then(|()| within("texture coordinate", corner.uv, self.uvs.len()))
                    .and_then(|()| within("normal", corner.normal, self.normals.len()))
                    .map_err(|what| (face.line, what))?;
            }
        }
        Ok(())
    }

    /// Colours as linear RGB, white where a position has none. Where any channel is above 1 they count from 0 to 255.
    pub fn linear_colors(&self) -> Vec<Vec3> {
        let bytes = self.colors.iter().flatten().flatten().any(|channel| *channel > 1.0);
        let scale = if bytes { 1.0 / 255.0 } else { 1.0 };
        let linear = |color: [f32; 3]| reader::linear(color.map(|channel| channel * scale));
        self.colors.iter().map(|color| color.map_or(Vec3::ONE, linear)).collect()
    }
}

#[cfg(test)]
mod tests {
    use glam::{DVec3, Vec3};

    use super::*;

    fn soup(text: &str) -> Soup {
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), text).unwrap();
        read(file.path()).unwrap()
    }

    #[test]
    fn equal_corners_are_one_vertex() {
        let text = "v 0 0 0 1 0 0\nv 1 0 0 1 1 1\nv 0 1 0 0 0 1\nvt 0 0\nvt 1 0.25\nvn 0 0 1\n\
                    f 1/1/1 2/2/1 3/1/1\nf 3/1/1 2/1/1 1/1/1\n";
        let soup = soup(text);
        assert_eq!(soup.triangles, [[0, 1, 2], [2, 3, 0]]);
        assert_eq!(soup.positions, [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::X]);
        assert_eq!((soup.uvs[1], soup.uvs[3]), (Vec2::new(1.0, 0.75), Vec2::new(0.0, 1.0)));
        assert_eq!((soup.colors[0], soup.colors[2]), (Vec3::X, Vec3::Z));
        assert_eq!(soup.normals, [Vec3::Z; 4]);
        assert!(soup.looks.materials.is_empty() && soup.warnings.is_empty());
    }

    #[test]
    fn points_and_lines_are_reported_on_one_line() {
        let warnings = soup("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nl 1 2\np 1\np 2\n").warnings;
        let [dropped] = &warnings[..] else { panic!("{warnings:?}") };
        let text = dropped.to_string();
        assert!(text.starts_with("[primitive-dropped] 3 point, line or curve elements not drawn"), "{text}");
        assert!(text.contains("line 5, and 2 more"), "{text}");
    }

    #[test]
    fn one_corner_without_a_normal_makes_all_of_them() {
        let soup = soup("v 0 0 0\nv 1 0 0\nv 0 1 0\nvn 0 0 1\nf 1//1 2//1 3//1\nf 1 3//1 2//1\n");
        assert!(soup.normals.is_empty() && soup.uvs.is_empty() && soup.colors.is_empty());
    }

    fn statements_of(text: &str) -> Result<Statements, String> {
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), text).unwrap();
        statements(file.path()).map_err(|error| error.to_string())
    }

    #[test]
    fn faces_are_as_the_file_has_them() {
        let text = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n# f 9 9 9\nvt 0 0\nvn 0 0 1\nf 1/1/1 2//1 3/1 4 # four\nf -1 -2 \\\n-3\nl 1 2\nf 1 2\n";
        let found = statements_of(text).unwrap();
        let faces: Vec<_> =
            found.faces.iter().map(|face| (face.line, face.corners.map(|corner| corner.position))).collect();
        assert_eq!(found.positions.len(), 4);
        assert_eq!(faces, [(8, [0, 1, 2]), (8, [0, 2, 3]), (9, [3, 2, 1])]);
        let first = found.faces[0].corners;
        assert_eq!((first[0].uv, first[0].normal), (Some(0), Some(0)));
        assert_eq!((first[1].uv, first[1].normal), (None, Some(0)));
        assert_eq!((first[2].uv, first[2].normal), (Some(0), None));
        assert_eq!(found.dropped, [11, 12]);
    }

    #[test]
    fn positions_keep_the_precision_of_the_text_and_colours_their_vertex() {
        let found = statements_of("v 4000000.015625 0 0\nv 1 2 3 255 0 0\nv 2 4 6 2\n").unwrap();
        assert_eq!(found.positions[0].x, 4_000_000.015_625);
        assert_eq!(found.positions[2], DVec3::new(1.0, 2.0, 3.0));
        assert_eq!(found.linear_colors(), [Vec3::ONE, Vec3::X, Vec3::ONE]);
        assert!(statements_of("v 0 0 0\n").unwrap().colors.is_empty());
    }

    #[test]
    fn materials_are_numbered_as_they_are_first_named() {
        let found = statements_of(
            "mtllib a #1.mtl # two\nmtllib a#1.mtl\nv 0 0 0\nf 1 1 1\nusemtl red\nf 1 1 1\nusemtl  a b \nusemtl red\nf 1 1 1\n",
        );
        let found = found.unwrap();
        assert_eq!(
            found.faces.iter().map(|face| face.material).collect::<Vec<_>>(),
            [None, Some(0), Some(0)]
        );
        assert_eq!(
            (found.materials, found.libraries),
            (vec!["red".into(), "a b".into()], vec!["a".into(), "a#1.mtl".into()])
        );
    }

    #[test]
    fn broken_lines_are_named() {
        let cases = [
            ("v 0 0\n", "line 1: 2 numbers instead of 3"),
            ("v 0 0 nan\n", "line 1: a coordinate that is NaN or infinite (`nan`)"),
            ("v 0 0 1e999\n", "line 1: a coordinate that is NaN or infinite (`1e999`)"),
            ("\nv 0 0 x\n", "line 2: `x` is not a number"),
            ("v 1 2 3 0\n", "line 1: the weight of a vertex is 0"),
            ("v 1 2 3 4 5\n", "line 1: a vertex of 5 numbers"),
            ("v 0 0 0\nf 1 1 9\n", "line 2: a face uses vertex 9, but there are only 1"),
            ("v 0 0 0\nf 1/1 1 1\n", "line 2: a face uses texture coordinate 1, but there are only 0"),
            ("v 0 0 0\nf 1//3 1 1\n", "line 2: a face uses normal 3, but there are only 0"),
            ("v 0 0 0\nf 0 1 1\n", "line 2: `0` is not a corner"),
            ("v 0 0 0\nf -2 1 1\n", "line 2: `-2` is not a corner"),
            ("f 1/9223372036854775808 1 1\n", "line 1: `"),
            ("f 99999999999 1 1\n", "line 1: `"),
            ("v 0 0 0\nf /1/1 1 1\n", "line 2: `"),
        ];
        for (text, expected) in cases {
            let error = statements_of(text).unwrap_err();
            assert!(error.contains(expected) && error.contains("fix the file"), "{text:?}: {error}");
        }
    }
}
