//! Spheres and tori.

use glam::{Vec2, Vec3};

use super::{Builder, around, vec3};
use crate::scene::Mesh;

/// A sphere of `radius` with `segments` around its equator (at least 3) and half as many from pole to pole.
pub fn sphere(radius: f64, segments: u32, material: usize) -> Mesh {
    let columns = segments.clamp(3, 4096);
    let rows = (columns / 2).max(2);
    let mut builder = Builder::default();
    for row in 0..=rows {
        let v = f64::from(row) / f64::from(rows);
        // At the poles the sine of half a turn is not quite zero, and the ring has to be a point.
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
    // Texture rows run downwards, so the grid runs from the north pole and has to be turned over.
    turn_over(&mut builder);
    // At a pole one of a quad's two triangles has no area.
    let positions = builder.positions.clone();
    let has_area = |t: &[u32; 3]| {
        let [a, b, c] = t.map(|v| positions[v as usize]);
        (b - a).cross(c - a) != Vec3::ZERO
    };
    builder.triangles.retain(has_area);
    builder.mesh("sphere", material)
}

/// A torus about the y axis: a tube of radius `tube` along a circle of radius `ring`, `segments` (at least 3)
/// along the circle and half as many around the tube.
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
            // Four tiles along the circle keep texels about square.
            let uv = Vec2::new(4.0 * u as f32, v as f32);
            builder.vertex(vec3(reach * cos, tube * lift, reach * sin), vec3(out * cos, lift, out * sin), uv);
        }
    }
    builder.grid(columns, rows);
    turn_over(&mut builder);
    builder.mesh("torus", material)
}

fn turn_over(builder: &mut Builder) {
    builder.triangles.iter_mut().for_each(|t| t.swap(1, 2));
}
