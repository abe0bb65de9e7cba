//! OBJ files: positions, colours, normals, texture coordinates, polygons and materials.

mod materials;
mod mtl;
mod statements;

use std::collections::HashMap;
use std::path::Path;

use glam::Vec2;
use warnings::{Code, Warning};

use super::soup::Soup;
use crate::error::LoadError;
use statements::{Corner, Statements};
pub(crate) use statements::{Face, statements};

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

/// The triangles alone; `materials` are not read.
pub(super) fn surface(path: &Path) -> Result<Soup, LoadError> {
    statements(path).map(|found| geometry(&found))
}

/// Corners with equal numbers are one vertex, in the order in which faces use them.
fn geometry(found: &Statements) -> Soup {
    let mut numbers: HashMap<Corner, u32> = HashMap::new();
    let mut corners = Vec::new();
    let mut number = |corner: Corner| {
        *numbers.entry(corner).or_insert_with(|| {
            corners.push(corner);
            corners.len() as u32 - 1
        })
    };
    let triangles = found.faces.iter().map(|face| face.corners.map(&mut number)).collect();
    let colors = found.linear_colors();
    let of_position = |corner: &Corner| corner.position as usize;
    let mut soup = Soup {
        positions: corners.iter().map(|corner| found.positions[of_position(corner)]).collect(),
        triangles,
        ..Soup::default()
    };
    if !colors.is_empty() {
        soup.colors = corners.iter().map(|corner| colors[of_position(corner)]).collect();
    }
    // A vertex without a normal among those that have one is rarely meant: all are made from the faces then.
    let normals = corners.iter().map(|corner| corner.normal.map(|normal| found.normals[normal as usize]));
    soup.normals = normals.collect::<Option<_>>().unwrap_or_default();
    if corners.iter().any(|corner| corner.uv.is_some()) {
        // OBJ counts v upwards from the last row.
        let flipped = |uv: u32| Vec2::new(found.uvs[uv as usize].x, 1.0 - found.uvs[uv as usize].y);
        soup.uvs = corners.iter().map(|corner| corner.uv.map_or(Vec2::ZERO, flipped)).collect();
    }
    soup
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{DVec3, Vec3};

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
}
