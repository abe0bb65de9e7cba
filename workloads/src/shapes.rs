//! Procedural solids and surfaces. Unless stated otherwise they are closed, counter-clockwise seen from
//! outside, centred at the origin, and have normals and texture coordinates.
//! The built-in scenes are made of them.

use std::sync::Arc;

use glam::{DQuat, DVec2, DVec3, Vec2, Vec3};
use pipeline::{Texture, Wrap};

use crate::error::LoadError;
use crate::material::Material;
use crate::scene::{
    Frustum, Graph, Local, Mesh, Motion, Node, Normals, Parts, Rig, Scene, SceneCamera, Settings, Spin, Trs,
    rotation, tan_half,
};

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

type Maker = fn() -> Result<Scene, LoadError>;

const SCENES: [(&str, &str, Maker); 2] = [
    (
        "default",
        "gears, tori, spheres and propellers over a tiled floor: fast motion and deep defocus, 1280x720, 36 frames",
        scene,
    ),
    ("tiny", "a handful of moving, defocused, textured triangles for tests, 64x48, 4 frames", tiny),
];

/// Names of the built-in scenes, each with a description in a line.
pub fn builtin_names() -> impl Iterator<Item = (&'static str, &'static str)> {
    SCENES.iter().map(|(name, description, _)| (*name, *description))
}

/// The built-in scene with a name, if it exists.
///
/// # Errors
/// None are expected: the scenes are tested.
pub fn builtin(name: &str) -> Option<Result<Scene, LoadError>> {
    SCENES.iter().find(|(known, ..)| *known == name).map(|(.., make)| make())
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

fn tiny() -> Result<Scene, LoadError> {
    let mut parts = Parts::new("tiny");
    fill(&mut parts.graph);
    parts.camera = SceneCamera {
        rig: Rig::look_at(DVec3::new(0.0, 1.6, 4.0), DVec3::new(0.0, 0.6, 0.0)),
        view: Some(Frustum::Perspective { tan_half_height: tan_half(45.0) }),
        near: None,
    };
    parts.settings = Settings {
        width: 64,
        height: 48,
        samples: 4,
        frames: 0..4,
        lens_radius: 0.08,
        ..Settings::default()
    };
    Scene::new(parts)
}

fn fill(graph: &mut Graph) {
    let mut floor = Material::colored("tiles", Vec3::ONE);
    floor.texture = checker(16, [[220, 210, 190], [70, 90, 120]]).map(Arc::new);
    let floor = graph.push_material(floor);
    let red = graph.push_material(Material::colored("red", Vec3::new(0.75, 0.10, 0.06)));
    let teal = graph.push_material(Material::colored("teal", Vec3::new(0.05, 0.45, 0.42)));
    let at = |x: f64, y: f64, z: f64| Local::Trs(Trs { translation: DVec3::new(x, y, z), ..Trs::default() });

    let ground = graph.push_node(Node::new("floor", None, at(0.0, 0.0, 0.0)));
    graph.attach(plane(8.0, 2, 4.0, floor), ground);
    let mut thrown = Node::new("thrown box", None, at(-1.0, 0.9, 0.2));
    thrown.motion.velocity = DVec3::new(18.0, 0.0, 0.0);
    let thrown = graph.push_node(thrown);
    graph.attach(cuboid(Vec3::splat(0.7), red), thrown);
    let mut turning = Node::new("turning box", None, at(0.7, 0.6, -1.5));
    turning.motion.spin = Spin::new(DVec3::new(0.3, 1.0, 0.1), 4.0);
    let turning = graph.push_node(turning);
    graph.attach(cuboid(Vec3::new(1.2, 0.8, 0.5), teal), turning);
}

/// Material indices by name.
struct Palette {
    tiles: usize,
    steel: usize,
    brass: usize,
    red: usize,
    blue: usize,
    green: usize,
    cream: usize,
    stripes: usize,
}

fn scene() -> Result<Scene, LoadError> {
    let mut parts = Parts::new("default");
    let palette = palette(&mut parts.graph);
    floor(&mut parts.graph, &palette);
    gears(&mut parts.graph, &palette);
    turning_propeller(&mut parts.graph, &palette);
    in_flight(&mut parts.graph, &palette);
    foreground(&mut parts.graph, &palette);
    background(&mut parts.graph, &palette);
    parts.camera = SceneCamera {
        rig: Rig::look_at(DVec3::new(0.6, 2.3, 8.2), DVec3::new(0.0, 1.15, 0.0)),
        view: Some(Frustum::Perspective { tan_half_height: tan_half(38.0) }),
        near: None,
    };
    parts.background = Vec3::new(0.50, 0.62, 0.76);
    parts.settings = Settings { frames: 0..36, lens_radius: 0.11, ..Settings::default() };
    Scene::new(parts)
}

fn palette(graph: &mut Graph) -> Palette {
    let mut plain =
        |name: &str, r: f32, g: f32, b: f32| graph.push_material(Material::colored(name, Vec3::new(r, g, b)));
    let [steel, brass] = [plain("steel", 0.42, 0.46, 0.50), plain("brass", 0.72, 0.47, 0.12)];
    let [red, blue] = [plain("red", 0.70, 0.08, 0.05), plain("blue", 0.06, 0.20, 0.62)];
    let [green, cream] = [plain("green", 0.08, 0.42, 0.16), plain("cream", 0.80, 0.72, 0.55)];
    let mut textured = |name: &str, colors: [[u8; 3]; 2]| {
        let texture = checker(256, colors).map(Arc::new);
        graph.push_material(Material { texture, ..Material::colored(name, Vec3::ONE) })
    };
    let tiles = textured("tiles", [[226, 218, 200], [98, 116, 138]]);
    let stripes = textured("ball", [[240, 232, 214], [214, 72, 44]]);
    Palette { tiles, steel, brass, red, blue, green, cream, stripes }
}

fn place(graph: &mut Graph, name: &str, mesh: Mesh, at: [f64; 3], turn: DQuat, motion: Motion) {
    let trs = Trs { translation: DVec3::from_array(at), rotation: turn, ..Trs::default() };
    let node = graph.push_node(Node { motion, ..Node::new(name, None, Local::Trs(trs)) });
    graph.attach(Mesh { name: name.to_owned(), ..mesh }, node);
}

fn spin(axis: DVec3, rate_hz: f64) -> Motion {
    Motion { spin: Spin::new(axis, rate_hz), ..Motion::default() }
}

fn upright() -> DQuat {
    rotation(DVec3::X, 0.25)
}

fn floor(graph: &mut Graph, palette: &Palette) {
    let mesh = plane(60.0, 40, 30.0, palette.tiles);
    place(graph, "floor", mesh, [0.0, 0.0, -14.0], DQuat::IDENTITY, Motion::default());
}

/// Two engaged gears with 24 and 16 teeth, so their rates have the ratio -2 to 3.
fn gears(graph: &mut Graph, palette: &Palette) {
    let large = gear(24, 1.2, 0.35, palette.brass);
    place(graph, "large gear", large, [-1.15, 1.3, 0.0], DQuat::IDENTITY, spin(DVec3::Z, 2.0));
    let small = gear(16, 0.8, 0.35, palette.steel);
    let turn = rotation(DVec3::Z, 0.5 / 16.0);
    place(graph, "small gear", small, [0.66, 1.3, 0.0], turn, spin(DVec3::Z, -3.0));
}

fn turning_propeller(graph: &mut Graph, palette: &Palette) {
    let blades = propeller(4, 0.95, palette.red);
    let turn = rotation(DVec3::Y, 0.06);
    place(graph, "propeller", blades, [2.45, 1.5, -0.3], turn, spin(DVec3::Z, 7.0));
    let mast = cuboid(Vec3::new(0.12, 1.45, 0.12), palette.steel);
    place(graph, "mast", mast, [2.40, 0.725, -0.45], DQuat::IDENTITY, Motion::default());
}

/// A ball that crosses the image, and tumbling rings.
fn in_flight(graph: &mut Graph, palette: &Palette) {
    let ball = sphere(0.42, 48, palette.stripes);
    let flight = Motion { velocity: DVec3::new(13.0, 0.0, 0.0), spin: Spin::new(DVec3::Z, -4.9) };
    place(graph, "ball", ball, [-4.2, 0.45, 1.3], DQuat::IDENTITY, flight);
    let ring = torus(0.62, 0.17, 56, palette.green);
    place(graph, "tumbling ring", ring, [-3.1, 2.5, -0.8], upright(), spin(DVec3::new(1.0, 0.4, 0.2), 2.5));
    let ring = torus(0.45, 0.13, 56, palette.blue);
    place(graph, "spinning ring", ring, [1.5, 2.75, -0.6], upright(), spin(DVec3::Z.cross(DVec3::X), 1.2));
}

/// Objects near the camera and far out of focus. They have few triangles: each is tested over all of its
/// blur, so small triangles cost the most.
fn foreground(graph: &mut Graph, palette: &Palette) {
    let ring = torus(0.40, 0.12, 24, palette.blue);
    place(graph, "near ring", ring, [-1.15, 1.45, 5.3], rotation(DVec3::X, 0.20), Motion::default());
    let ball = sphere(0.26, 20, palette.red);
    place(graph, "near ball", ball, [1.65, 1.35, 5.2], DQuat::IDENTITY, Motion::default());
    let block = cuboid(Vec3::splat(0.55), palette.cream);
    place(graph, "near block", block, [1.9, 0.28, 3.6], rotation(DVec3::Y, 0.09), Motion::default());
}

/// Rows of balls and rings, out of focus with distance.
fn background(graph: &mut Graph, palette: &Palette) {
    let colors = [palette.blue, palette.cream, palette.green, palette.brass, palette.red];
    for row in 0..3_u32 {
        for column in 0..5_u32 {
            let color = colors[((row * 2 + column) % 5) as usize];
            let across = (f64::from(column) - 2.0) * (3.0 + 0.9 * f64::from(row));
            let back = -5.0 - 5.0 * f64::from(row);
            if (row + column) % 2 == 0 {
                let mesh = sphere(0.8, 24, color);
                place(graph, "far ball", mesh, [across, 0.8, back], DQuat::IDENTITY, Motion::default());
            } else {
                let mesh = torus(0.75, 0.25, 24, color);
                place(graph, "far ring", mesh, [across, 1.0, back], upright(), Motion::default());
            }
        }
    }
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
