//! STL files, binary or ASCII: triangles without shared vertices, flat.

use std::collections::HashMap;
use std::path::Path;

use glam::DVec3;

use super::super::import;
use super::reader;
use super::reader::Soup;
use crate::error::{LoadError, Source};

/// Bytes before the triangles of a binary file: a comment and the number of triangles.
const HEADER: usize = 84;

/// Bytes of a triangle: its normal, three corners and an attribute.
const TRIANGLE: usize = 50;

/// Reads the STL file at `path`, gzipped or not. Normals are those of the corners, whatever the file says.
pub(super) fn read(path: &Path) -> Result<Soup, LoadError> {
    let bytes = reader::contents(path)?;
    let source = Source { path };
    let mut welded = Welded::default();
    if is_ascii(&bytes) {
        ascii(&bytes, &mut welded)
            .map_err(|(line, what)| source.broken(format!("line {line}"), format!("{what}; fix the file")))?;
    } else {
        binary(&bytes, &mut welded).map_err(|(place, what)| source.broken(place, what))?;
    }
    let mut soup = Soup { flat: true, ..welded.soup };
    if !is_ascii(&bytes) {
        soup.warn_if_rounded(path);
        // Materialise Magics writes the colour of the part, and those of triangles, behind this word.
        let colored = bytes[..HEADER - 4].windows(6).any(|word| word == b"COLOR=");
        soup.warnings.extend(colored.then(|| import::face_colors(path)));
    }
    Ok(soup)
}

/// The triangles a binary file says it has; nothing where it is too short to say.
fn announced(bytes: &[u8]) -> Option<usize> {
    let count = bytes.get(HEADER - 4..HEADER)?.try_into().ok()?;
    Some(u32::from_le_bytes(count) as usize)
}

/// Binary files may begin with `solid`, too: one of the length that it announces is binary.
fn is_ascii(bytes: &[u8]) -> bool {
    let fits = announced(bytes).is_some_and(|count| bytes.len() as u64 == (HEADER + TRIANGLE * count) as u64);
    !fits && bytes.trim_ascii_start().get(..5).is_some_and(|word| word.eq_ignore_ascii_case(b"solid"))
}

fn binary(bytes: &[u8], welded: &mut Welded) -> Result<(), (String, String)> {
    let count = announced(bytes).ok_or_else(|| {
        let what =
            format!("an STL file has {HEADER} bytes at least, this one has {}: get it again", bytes.len());
        ("header".to_owned(), what)
    })?;
    let body = &bytes[HEADER..];
    if body.len() / TRIANGLE < count {
        let what = format!(
            "it announces {count} triangles and holds {}: it is truncated or not an STL file; get it again",
            body.len() / TRIANGLE
        );
        return Err(("header".to_owned(), what));
    }
    for (number, triangle) in body.chunks_exact(TRIANGLE).take(count).enumerate() {
        let coordinate = |index: usize| {
            let at = 12 + 4 * index;
            f64::from(f32::from_le_bytes([
                triangle[at],
                triangle[at + 1],
                triangle[at + 2],
                triangle[at + 3],
            ]))
        };
        let corner = |index: usize| DVec3::from_array([0, 1, 2].map(|axis| coordinate(3 * index + axis)));
        let corners = [0, 1, 2].map(corner);
        if !corners.iter().all(|corner| corner.is_finite()) {
            let what = "a coordinate that is NaN or infinite; fix the file".to_owned();
            return Err((format!("triangle {number}"), what));
        }
        welded.triangle(corners);
    }
    Ok(())
}

/// Only the corners count: `vertex` with its numbers, three to a triangle.
fn ascii(bytes: &[u8], welded: &mut Welded) -> Result<(), (usize, String)> {
    let (mut corners, mut last) = (Vec::with_capacity(3), 0);
    let mut ended = false;
    // Old Macintosh programs end lines with a carriage return alone.
    let end_of_line = if bytes.contains(&b'\n') { b'\n' } else { b'\r' };
    for (line, text) in (1..).zip(bytes.split(|byte| *byte == end_of_line)) {
        let text = String::from_utf8_lossy(text);
        let mut words = text.split_ascii_whitespace();
        let word = words.next().unwrap_or_default().to_ascii_lowercase();
        last = if word.is_empty() { last } else { line };
        match word.as_str() {
            "vertex" => corners.push(position(words).map_err(|what| (line, what))?),
            "endfacet" | "endloop" if corners.len() == 3 => {
                welded.triangle([corners[0], corners[1], corners[2]]);
                corners.clear();
            }
            "endfacet" if corners.is_empty() => {}
            "endloop" | "endfacet" => {
                return Err((line, format!("a facet of {} corners instead of 3", corners.len())));
            }
            "endsolid" => ended = true,
            "solid" => ended = false,
            "" | "facet" | "outer" | "color" => {}
            _ => return Err((line, format!("`{word}`, which ASCII STL files do not have"))),
        }
    }
    if ended { Ok(()) } else { Err((last, "the file ends before `endsolid`: it is truncated".to_owned())) }
}

fn position<'a>(words: impl Iterator<Item = &'a str>) -> Result<DVec3, String> {
    let number = |word: &'a str| word.parse().map_err(|_| format!("`{word}` is not a number"));
    let numbers: Vec<f64> = words.map(number).collect::<Result<_, _>>()?;
    match numbers[..] {
        [x, y, z] if numbers.iter().all(|number| number.is_finite()) => Ok(DVec3::new(x, y, z)),
        [_, _, _] => Err("a coordinate that is NaN or infinite".to_owned()),
        _ => Err(format!("a vertex of {} numbers instead of 3", numbers.len())),
    }
}

/// Triangles whose corners at one place are one vertex.
#[derive(Default)]
struct Welded {
    soup: Soup,
    places: HashMap<[u64; 3], u32>,
}

impl Welded {
    fn triangle(&mut self, corners: [DVec3; 3]) {
        let corners = corners.map(|corner| {
            // Zeros of both signs are one place.
            let place = (corner + DVec3::ZERO).to_array().map(f64::to_bits);
            *self.places.entry(place).or_insert_with(|| {
                self.soup.positions.push(corner);
                self.soup.positions.len() as u32 - 1
            })
        });
        self.soup.triangles.push(corners);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(bytes: &[u8]) -> Result<Soup, String> {
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), bytes).unwrap();
        read(file.path()).map_err(|error| error.to_string())
    }

    const SQUARE: [[f32; 9]; 2] =
        [[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 1.0, 0.0], [0.0, -0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 1.0, 0.0]];

    fn in_binary(header: &[u8], count: u32, triangles: &[[f32; 9]]) -> Vec<u8> {
        let mut bytes = header.to_vec();
        bytes.resize(80, b' ');
        bytes.extend(count.to_le_bytes());
        for triangle in triangles {
            bytes.extend([0; 12]);
            bytes.extend(triangle.iter().flat_map(|value| value.to_le_bytes()));
            bytes.extend([0; 2]);
        }
        bytes
    }

    fn in_ascii() -> String {
        let facet = |t: &[f32; 9]| {
            let corner = |c: &[f32]| format!("  vertex {} {} {}\n", c[0], c[1], c[2]);
            let corners: String = t.chunks(3).map(corner).collect();
            format!("facet normal 0 0 1\n outer loop\n{corners} endloop\nendfacet\n")
        };
        format!("solid a b\n{}endsolid a b\n", SQUARE.iter().map(facet).collect::<String>())
    }

    #[test]
    fn both_kinds_give_the_same_triangles_over_shared_vertices() {
        let texts = [
            in_ascii(),
            in_ascii().to_uppercase(),
            in_ascii().replace('\n', "\r\n"),
            in_ascii().replace('\n', "\r"),
        ];
        let binaries =
            [&b"made by hand"[..], b"solid, and yet binary"].map(|header| in_binary(header, 2, &SQUARE));
        for bytes in texts.iter().map(|text| text.as_bytes()).chain(binaries.iter().map(|bytes| &bytes[..])) {
            let soup = parse(bytes).unwrap();
            assert_eq!(soup.triangles, [[0, 1, 2], [0, 2, 3]]);
            assert_eq!(soup.positions, [DVec3::ZERO, DVec3::X, DVec3::new(1.0, 1.0, 0.0), DVec3::Y]);
            assert!(soup.flat && soup.warnings.is_empty());
        }
    }

    #[test]
    fn colours_are_reported_and_bytes_behind_the_last_triangle_are_not_read() {
        let mut bytes = in_binary(b"COLOR=\x10\x20\x30\xff", 1, &SQUARE[..1]);
        bytes.extend(b"more");
        let soup = parse(&bytes).unwrap();
        assert_eq!((soup.triangles.len(), soup.warnings.len()), (1, 1));
        assert_eq!(soup.warnings[0].code, "face-colors-ignored");
    }

    #[test]
    fn broken_files_are_errors() {
        let mut nan = SQUARE;
        nan[1][4] = f32::NAN;
        let truncated = in_ascii().replace("endsolid a b\n", "");
        let cases = [
            (b"".to_vec(), "header: an STL file has 84 bytes at least, this one has 0"),
            (in_binary(b"", u32::MAX, &SQUARE), "header: it announces 4294967295 triangles and holds 2"),
            (in_binary(b"", 2, &nan), "triangle 1: a coordinate that is NaN"),
            (truncated.into_bytes(), "line 15: the file ends before `endsolid`"),
            (in_ascii().replace("vertex 1 0 0\n", "").into_bytes(), "line 6: a facet of 2 corners"),
            (
                in_ascii().replacen("1 1 0", "1 1e999 0", 1).into_bytes(),
                "line 6: a coordinate that is NaN or infinite",
            ),
            (in_ascii().replacen("1 1 0", "1 1", 1).into_bytes(), "line 6: a vertex of 2 numbers"),
            (in_ascii().replacen("1 1 0", "1 x 0", 1).into_bytes(), "line 6: `x` is not a number"),
            (in_ascii().replacen("facet normal", "faucet", 1).into_bytes(), "line 2: `faucet`"),
        ];
        for (bytes, expected) in cases {
            let error = parse(&bytes).unwrap_err();
            assert!(error.contains(expected), "{expected}: {error}");
        }
    }
}
