//! Procedural solids and surfaces. Unless stated otherwise they are closed, counter-clockwise seen from
//! outside, centred at the origin, and have normals and texture coordinates. [`checker`] is a texture for them.

use glam::{DVec2, Vec2, Vec3};
use pipeline::{Texture, Wrap};

use crate::scene::{Mesh, Normals};

/// A mesh under construction.
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

    /// Adds a flat convex polygon, counter-clockwise seen from outside.
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

    /// Adds a grid of `columns` x `rows` quads over vertices given row by row, `columns + 1` per row.
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

/// Sine and cosine of `turns` full turns, computed with `libm`.
fn around(turns: f64) -> (f64, f64) {
    let angle = turns * std::f64::consts::TAU;
    (libm::sin(angle), libm::cos(angle))
}

fn vec3(x: f64, y: f64, z: f64) -> Vec3 {
    Vec3::new(x as f32, y as f32, z as f32)
}

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

/// An open square in the xz plane facing up, with edges of length `size`, in `cells` x `cells` quads. Its
/// texture repeats `tiles` times along each edge.
pub fn plane(size: f64, cells: u32, tiles: f64, material: usize) -> Mesh {
    let cells = cells.clamp(1, 2048);
    let mut builder = Builder::default();
    for row in 0..=cells {
        for column in 0..=cells {
            let [u, v] = [column, row].map(|i| f64::from(i) / f64::from(cells));
            let place = vec3((u - 0.5) * size, 0.0, (v - 0.5) * size);
            builder.vertex(place, Vec3::Y, Vec2::new((u * tiles) as f32, (v * tiles) as f32));
        }
    }
    builder.grid(cells, cells);
    builder.triangles.iter_mut().for_each(|t| t.swap(1, 2));
    builder.mesh("plane", material)
}

/// A sphere of `radius`, with `segments` (at least 3) around its equator and half as many from pole to pole.
pub fn sphere(radius: f64, segments: u32, material: usize) -> Mesh {
    let columns = segments.clamp(3, 4096);
    let rows = (columns / 2).max(2);
    let mut builder = Builder::default();
    for row in 0..=rows {
        let v = f64::from(row) / f64::from(rows);
        // The sine of half a turn is not exactly zero, but the ring at a pole must be a point.
        let (ring, height) = if row == 0 || row == rows { (0.0, around(v / 2.0).1) } else { around(v / 2.0) };
        for column in 0..=columns {
            let u = f64::from(column) / f64::from(columns);
            let (sin, cos) = around(u);
            let normal = [-cos * ring, height, sin * ring];
            let uv = Vec2::new(u as f32, v as f32);
            let place = normal.map(|axis| axis * radius);
            builder.vertex(vec3(place[0], place[1], place[2]), vec3(normal[0], normal[1], normal[2]), uv);
        }
    }
    builder.grid(columns, rows);
    // Texture rows run downwards, so the grid starts at the north pole and must be flipped.
    flip(&mut builder);
    // At a pole, one triangle of each quad has no area.
    let positions = builder.positions.clone();
    let has_area = |t: &[u32; 3]| {
        let [a, b, c] = t.map(|v| positions[v as usize]);
        (b - a).cross(c - a) != Vec3::ZERO
    };
    builder.triangles.retain(has_area);
    builder.mesh("sphere", material)
}

/// A torus around the y axis: a tube of radius `tube` along a circle of radius `ring`, with `segments` (at
/// least 3) along the circle and half as many around the tube.
pub fn torus(ring: f64, tube: f64, segments: u32, material: usize) -> Mesh {
    let columns = segments.clamp(3, 4096);
    let rows = (columns / 2).max(3);
    let mut builder = Builder::default();
    for row in 0..=rows {
        let v = f64::from(row) / f64::from(rows);
        let (lift, out) = around(v);
        for column in 0..=columns {
            let u = f64::from(column) / f64::from(columns);
            let (sin, cos) = around(u);
            let reach = ring + tube * out;
            // Four repeats along the circle keep texels roughly square.
            let uv = Vec2::new(4.0 * u as f32, v as f32);
            builder.vertex(vec3(reach * cos, tube * lift, reach * sin), vec3(out * cos, lift, out * sin), uv);
        }
    }
    builder.grid(columns, rows);
    flip(&mut builder);
    builder.mesh("torus", material)
}

fn flip(builder: &mut Builder) {
    builder.triangles.iter_mut().for_each(|t| t.swap(1, 2));
}

/// A gear around the z axis with `teeth` (at least 3) teeth, outer `radius`, `thickness` along z, and a round
/// hole of a quarter of the radius.
pub fn gear(teeth: u32, radius: f64, thickness: f64, material: usize) -> Mesh {
    let teeth = teeth.clamp(3, 1024);
    // Eight points per tooth: two on the root, two up the flank, two on the tip, two down.
    let outline = |step: u32| {
        let tooth = [0.82, 0.82, 0.84, 0.96, 1.0, 1.0, 0.96, 0.84];
        let phase = [0.0, 0.25, 0.30, 0.42, 0.47, 0.78, 0.83, 0.95];
        let (turn, part) = (step / 8, (step % 8) as usize);
        let (sin, cos) = around((f64::from(turn) + phase[part]) / f64::from(teeth));
        (DVec2::new(cos, sin), radius * tooth[part])
    };
    let (hole, half) = (0.25 * radius, 0.5 * thickness);
    let steps = teeth * 8;
    let mut builder = Builder::default();
    for step in 0..steps {
        let ends = [outline(step), outline((step + 1) % steps)];
        let rim = |end: usize, z: f64| vec3(ends[end].0.x * ends[end].1, ends[end].0.y * ends[end].1, z);
        let bore = |end: usize, z: f64| vec3(ends[end].0.x * hole, ends[end].0.y * hole, z);
        builder.face(&[rim(0, half), rim(1, half), bore(1, half), bore(0, half)]);
        builder.face(&[rim(1, -half), rim(0, -half), bore(0, -half), bore(1, -half)]);
        builder.face(&[rim(0, -half), rim(1, -half), rim(1, half), rim(0, half)]);
        builder.face(&[bore(1, -half), bore(0, -half), bore(0, half), bore(1, half)]);
    }
    builder.mesh("gear", material)
}

/// A propeller around the z axis with `blades` (1 to 64) twisted blades up to `radius`, on a small hub.
pub fn propeller(blades: u32, radius: f64, material: usize) -> Mesh {
    let blades = blades.clamp(1, 64);
    let mut builder = Builder::default();
    for blade in 0..blades {
        let turn = f64::from(blade) / f64::from(blades);
        let (sin, cos) = around(turn);
        let place = |p: [f64; 3]| vec3(cos * p[0] - sin * p[1], sin * p[0] + cos * p[1], p[2]);
        for step in 0..STATIONS {
            let [from, to] = [step, step + 1].map(|s| section(radius, f64::from(s) / f64::from(STATIONS)));
            for corner in 0..4 {
                let next = (corner + 1) % 4;
                let quad = [from[corner], from[next], to[next], to[corner]].map(place);
                // A twisted quad is not flat: two triangles with their own normals.
                builder.face(&[quad[0], quad[1], quad[2]]);
                builder.face(&[quad[0], quad[2], quad[3]]);
            }
        }
        let [root, tip] = [section(radius, 0.0), section(radius, 1.0)].map(|section| section.map(place));
        builder.face(&[root[3], root[2], root[1], root[0]]);
        builder.face(&tip);
    }
    hub(&mut builder, 0.12 * radius);
    builder.mesh("propeller", material)
}

/// Sections along a blade.
const STATIONS: u32 = 12;

/// Corners of a blade section at `part` of its length, counter-clockwise seen from the tip.
fn section(radius: f64, part: f64) -> [[f64; 3]; 4] {
    let along = radius * (0.08 + 0.92 * part);
    let chord = radius * (0.09 + 0.10 * libm::sin(std::f64::consts::PI * (0.15 + 0.8 * part)));
    let thick = radius * (0.030 - 0.018 * part);
    let (sin, cos) = around(0.16 - 0.10 * part);
    let corner = |c: f64, t: f64| [along, c * cos - t * sin, c * sin + t * cos];
    [corner(-chord, -thick), corner(chord, -thick), corner(chord, thick), corner(-chord, thick)]
}

fn hub(builder: &mut Builder, radius: f64) {
    const SIDES: u32 = 16;
    let nose = 1.6 * radius;
    for side in 0..SIDES {
        let [from, to] = [side, side + 1].map(|s| around(f64::from(s) / f64::from(SIDES)));
        let ring = |(sin, cos): (f64, f64), z: f64| vec3(radius * cos, radius * sin, z);
        let (front, back) = (0.6 * radius, -0.8 * radius);
        builder.face(&[ring(from, back), ring(to, back), ring(to, front), ring(from, front)]);
        builder.face(&[ring(from, front), ring(to, front), vec3(0.0, 0.0, nose)]);
        builder.face(&[ring(to, back), ring(from, back), Vec3::new(0.0, 0.0, back as f32)]);
    }
}

/// A repeating checkerboard of 2 x 2 fields in two sRGB colours, `side` texels (2 to 4096) along each edge. A
/// darker joint around each field makes blur visible.
pub fn checker(side: u32, colors: [[u8; 3]; 2]) -> Option<Texture> {
    let side = side.clamp(2, 4096) / 2 * 2;
    let (field, joint) = (side / 2, side / 64);
    let texel = |x: u32, y: u32| {
        let color = colors[((x / field + y / field) % 2) as usize];
        let edge = |at: u32| at % field < joint || at % field >= field - joint;
        let shade = if joint > 0 && (edge(x) || edge(y)) { 3 } else { 4 };
        let [r, g, b] = color.map(|channel| (u16::from(channel) * shade / 4) as u8);
        [r, g, b, 255]
    };
    let texels = (0..side).flat_map(|y| (0..side).map(move |x| texel(x, y))).collect();
    Texture::from_srgb8(side, side, texels, [Wrap::Repeat; 2]).ok()
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
