//! Built-in scenes.

mod showcase;

use std::sync::Arc;

use glam::{DVec3, Vec3};
use pipeline::{Texture, Wrap};

use crate::error::LoadError;
use crate::material::Material;
use crate::scene::{Graph, Local, Node, Parts, Rig, Scene, SceneCamera, Settings, Spin, Trs, View, tan_half};
use crate::shapes;

type Maker = fn() -> Result<Scene, LoadError>;

const SCENES: [(&str, &str, Maker); 2] = [
    (
        "default",
        "gears, tori, spheres and propellers over a tiled floor: fast motion and deep defocus, 1280x720, 36 frames",
        showcase::scene,
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
        view: Some(View::Perspective { tan_half_height: tan_half(45.0) }),
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
    graph.attach(shapes::plane(8.0, 2, 4.0, floor), ground);
    let mut thrown = Node::new("thrown box", None, at(-1.0, 0.9, 0.2));
    thrown.motion.velocity = DVec3::new(18.0, 0.0, 0.0);
    let thrown = graph.push_node(thrown);
    graph.attach(shapes::cuboid(Vec3::splat(0.7), red), thrown);
    let mut turning = Node::new("turning box", None, at(0.7, 0.6, -1.5));
    turning.motion.spin = Spin::new(DVec3::new(0.3, 1.0, 0.1), 4.0);
    let turning = graph.push_node(turning);
    graph.attach(shapes::cuboid(Vec3::new(1.2, 0.8, 0.5), teal), turning);
}
