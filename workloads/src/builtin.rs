//! The built-in scenes, made of the solids of [`shapes`](crate::shapes).

use std::sync::Arc;

use glam::{DQuat, DVec3, Vec3};

use crate::error::LoadError;
use crate::material::Material;
use crate::scene::{
    Frustum, Graph, Local, Mesh, Motion, Node, Parts, Rig, Scene, SceneCamera, SceneSettings, Spin, Trs,
    rotation, tan_half,
};
use crate::shapes::{checker, cuboid, gear, plane, propeller, sphere, torus};

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

fn tiny() -> Result<Scene, LoadError> {
    let mut parts = Parts::new("tiny");
    fill(&mut parts.graph);
    parts.camera = SceneCamera {
        rig: Rig::look_at(DVec3::new(0.0, 1.6, 4.0), DVec3::new(0.0, 0.6, 0.0)),
        view: Some(Frustum::Perspective { tan_half_height: tan_half(45.0) }),
        near: None,
    };
    parts.settings = SceneSettings {
        width: 64,
        height: 48,
        samples: 4,
        frames: 0..4,
        lens_radius: 0.08,
        ..SceneSettings::default()
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
    parts.settings = SceneSettings { frames: 0..36, lens_radius: 0.11, ..SceneSettings::default() };
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
