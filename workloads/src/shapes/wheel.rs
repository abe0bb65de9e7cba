//! Things that like to spin: gears and propellers.

use glam::{DVec2, Vec3};

use super::{Builder, around, vec3};
use crate::scene::Mesh;

/// A gear about the z axis: `teeth` (at least 3) teeth that reach to `radius`, `thickness` along z, with a
/// round hole of a quarter of the radius.
pub fn gear(teeth: u32, radius: f64, thickness: f64, material: usize) -> Mesh {
    let teeth = teeth.clamp(3, 1024);
    // Eight points to a tooth: two on the root, two up the flank, two on the tip, two down.
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

/// A propeller about the z axis: `blades` (1 to 64) twisted blades that reach to `radius`, on a small hub.
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
                // A twisted quad is not flat: two triangles, each with its own normal.
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

/// Cuts along a blade.
const STATIONS: u32 = 12;

/// The four corners of a blade at `part` of its length, counter-clockwise seen from the tip.
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
