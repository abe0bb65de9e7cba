//! Files of small moving meshes.

use std::io::Write;

use flate2::{Compression, write::GzEncoder};

/// An ASCII PLY file.
pub fn ply(points: &[[f32; 3]], triangles: &[[u32; 3]]) -> String {
    let mut text = format!(
        "ply\nformat ascii 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\n\
         element face {}\nproperty list uchar int vertex_indices\nend_header\n",
        points.len(),
        triangles.len()
    );
    points.iter().for_each(|[x, y, z]| text += &format!("{x} {y} {z}\n"));
    triangles.iter().for_each(|[a, b, c]| text += &format!("3 {a} {b} {c}\n"));
    text
}

/// An OBJ file.
pub fn obj(points: &[[f32; 3]], triangles: &[[u32; 3]]) -> String {
    let mut text = String::new();
    points.iter().for_each(|[x, y, z]| text += &format!("v {x} {y} {z}\n"));
    triangles.iter().for_each(|[a, b, c]| text += &format!("f {} {} {}\n", a + 1, b + 1, c + 1));
    text
}

/// An `.mts` file of one object in f64.
pub fn mts(open: &[[f32; 3]], close: &[[f32; 3]], triangles: &[[u32; 3]]) -> Vec<u8> {
    let mut data = b"MTS1".to_vec();
    let words = [8, 1, 0, open.len() as u32, triangles.len() as u32];
    words.iter().for_each(|word| data.extend(word.to_le_bytes()));
    let numbers = open.iter().chain(close).flatten();
    numbers.for_each(|number| data.extend(f64::from(*number).to_le_bytes()));
    triangles.iter().flatten().for_each(|index| data.extend(index.to_le_bytes()));
    data
}

/// An `.m5d` file of one triangle.
pub fn m5d() -> Vec<u8> {
    let mut data = b"M5DSCN1\0".to_vec();
    [1_u32, 0, 64, 48, 4, 0].iter().for_each(|word| data.extend(word.to_le_bytes()));
    data.extend(7_u64.to_le_bytes());
    [60.0_f64, 0.577, 0.25, 8.0, 0.1].iter().for_each(|number| data.extend(number.to_le_bytes()));
    (0..18).for_each(|corner| data.extend((corner as f32).to_le_bytes()));
    data
}

pub fn gzip(data: impl AsRef<[u8]>) -> Vec<u8> {
    let mut zip = GzEncoder::new(Vec::new(), Compression::fast());
    zip.write_all(data.as_ref()).unwrap();
    zip.finish().unwrap()
}
