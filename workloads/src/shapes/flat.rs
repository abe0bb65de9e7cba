//! Boxes and planes.

use glam::{Vec2, Vec3};

use super::Builder;
use crate::scene::Mesh;

/// A box with the given edge lengths along x, y and z.
pub fn cuboid(size: Vec3, material: usize) -> Mesh {
    let half = size * 0.5;
    let mut builder = Builder::default();
    for axis in [[Vec3::X, Vec3::Y, Vec3::Z], [Vec3::Y, Vec3::Z, Vec3::X], [Vec3::Z, Vec3::X, Vec3::Y]] {
        for side in [1.0, -1.0] {
            let (out, u, v) = (axis[0] * side, axis[1] * side, axis[2]);
            builder.face(&[out - u - v, out + u - v, out + u + v, out - u + v].map(|corner| corner * half));
        }
    }
    builder.mesh("box", material)
}

/// A square in the xz plane looking up, with edges of length `size`, in `cells` x `cells` quads; its texture
/// repeats `tiles` times along each edge. It is open.
pub fn plane(size: f64, cells: u32, tiles: f64, material: usize) -> Mesh {
    let cells = cells.clamp(1, 2048);
    let mut builder = Builder::default();
    for row in 0..=cells {
        for column in 0..=cells {
            let [u, v] = [column, row].map(|i| f64::from(i) / f64::from(cells));
            let place = super::vec3((u - 0.5) * size, 0.0, (v - 0.5) * size);
            builder.vertex(place, Vec3::Y, Vec2::new((u * tiles) as f32, (v * tiles) as f32));
        }
    }
    builder.grid(cells, cells);
    builder.triangles.iter_mut().for_each(|t| t.swap(1, 2));
    builder.mesh("plane", material)
}
