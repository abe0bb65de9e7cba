//! Solids and surfaces made by code. All are closed unless said otherwise, counter-clockwise seen from outside,
//! centred at the origin, with normals and texture coordinates.

mod flat;
mod round;
mod wheel;

use glam::{Vec2, Vec3};

pub use flat::{cuboid, plane};
pub use round::{sphere, torus};
pub use wheel::{gear, propeller};

use crate::scene::{Mesh, Normals};

/// Vertices and triangles being put together.
#[derive(Clone, Debug, Default)]
struct Builder {
    positions: Vec<Vec3>,
    normals: Vec<Vec3>,
    uvs: Vec<Vec2>,
    triangles: Vec<[u32; 3]>,
}

impl Builder {
    fn vertex(&mut self, position: Vec3, normal: Vec3, uv: Vec2) -> u32 {
        self.positions.push(position);
        self.normals.push(normal);
        self.uvs.push(uv);
        (self.positions.len() - 1) as u32
    }

    /// A flat polygon, convex and counter-clockwise seen from outside.
    fn face(&mut self, corners: &[Vec3]) {
        let [a, b, c, ..] = corners else { return };
        let normal = (*b - *a).cross(*c - *a);
        let normal = normal * (1.0 / normal.dot(normal).sqrt().max(f32::MIN_POSITIVE));
        let first = self.positions.len() as u32;
        for (index, corner) in corners.iter().enumerate() {
            let around = [Vec2::ZERO, Vec2::X, Vec2::ONE, Vec2::Y];
            self.vertex(*corner, normal, around[index % 4]);
        }
        let last = corners.len() as u32 - 1;
        self.triangles.extend((1..last).map(|i| [first, first + i, first + i + 1]));
    }

    /// A closed grid of `columns` x `rows` quads over vertices given row by row, `columns + 1` in each.
    fn grid(&mut self, columns: u32, rows: u32) {
        let at = |row: u32, column: u32| row * (columns + 1) + column;
        for row in 0..rows {
            for column in 0..columns {
                let [a, b] = [at(row, column), at(row, column + 1)];
                let [c, d] = [at(row + 1, column), at(row + 1, column + 1)];
                self.triangles.push([a, b, d]);
                self.triangles.push([a, d, c]);
            }
        }
    }

    fn mesh(self, name: &str, material: usize) -> Mesh {
        Mesh {
            name: name.to_owned(),
            positions: self.positions,
            normals: Normals::Given(self.normals),
            uvs: self.uvs.into(),
            colors: [].into(),
            triangles: self.triangles.into(),
            material,
            targets: Vec::new(),
            weights: Vec::new(),
            influences: None,
        }
    }
}

/// Sine and cosine of `turns` whole turns, through `libm`.
fn around(turns: f64) -> (f64, f64) {
    let angle = turns * std::f64::consts::TAU;
    (libm::sin(angle), libm::cos(angle))
}

fn vec3(x: f64, y: f64, z: f64) -> Vec3 {
    Vec3::new(x as f32, y as f32, z as f32)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn volume(mesh: &Mesh) -> f64 {
        let corner = |v: u32| mesh.positions[v as usize].as_dvec3();
        mesh.triangles.iter().map(|t| corner(t[0]).dot(corner(t[1]).cross(corner(t[2]))) / 6.0).sum()
    }

    #[test]
    fn solids_have_their_volumes_so_they_are_closed_and_face_outward() {
        let pi = std::f64::consts::PI;
        let near = |found: f64, expected: f64, part: f64| {
            assert!((found - expected).abs() < part * expected, "{found} against {expected}");
        };
        near(volume(&cuboid(Vec3::new(1.0, 2.0, 3.0), 0)), 6.0, 1e-6);
        near(volume(&sphere(1.0, 64, 0)), 4.0 / 3.0 * pi, 0.005);
        near(volume(&torus(2.0, 0.5, 64, 0)), 2.0 * pi * pi * 2.0 * 0.25, 0.01);
        assert!(volume(&gear(12, 1.0, 0.2, 0)) > 0.4);
        assert!(volume(&propeller(3, 1.0, 0)) > 0.005);
    }

    #[test]
    fn normals_point_out_of_the_faces_that_meet_there() {
        for mesh in [sphere(1.0, 16, 0), torus(2.0, 0.5, 16, 0), gear(8, 1.0, 0.2, 0), propeller(3, 1.0, 0)] {
            let Normals::Given(normals) = &mesh.normals else { panic!("no normals") };
            for t in mesh.triangles.iter() {
                let [a, b, c] = t.map(|v| mesh.positions[v as usize]);
                let face = (b - a).cross(c - a);
                for v in t {
                    assert!(face.dot(normals[*v as usize]) >= 0.0, "{}", mesh.name);
                }
            }
        }
    }
}
