//! The default scene: bars, a gate and boxes that move over a floor.

use glam::{DVec3, Vec3};

use crate::error::LoadError;
use crate::material::Material;
use crate::scene::{
    Graph, Local, Motion, Node, Parts, Rig, Scene, SceneCamera, Settings, Spin, Trs, View, tan_half,
};
use crate::shapes;

/// Makes the scene. It has contact shadows under boxes, a penumbra that widens along a leaning post, and
/// moving shadows.
///
/// # Errors
/// None are expected: the scene is tested.
pub fn stage() -> Result<Scene, LoadError> {
    let mut parts = Parts::new("soft shadows");
    fill(&mut parts.graph);
    parts.camera = SceneCamera {
        rig: Rig::look_at(DVec3::new(-0.8, 3.4, 5.6), DVec3::new(0.0, 0.35, 0.0)),
        view: Some(View::Perspective { tan_half_height: tan_half(40.0) }),
        near: None,
    };
    parts.background = Vec3::new(0.32, 0.40, 0.52);
    parts.settings =
        Settings { width: 320, height: 180, samples: 64, frames: 0..4, shutter: 0.5, ..Settings::default() };
    Scene::new(parts)
}

fn fill(graph: &mut Graph) {
    let mut colour =
        |name: &str, r: f32, g: f32, b: f32| graph.push_material(Material::colored(name, Vec3::new(r, g, b)));
    let [floor, red] = [colour("floor", 0.72, 0.70, 0.66), colour("red", 0.72, 0.16, 0.10)];
    let [blue, green] = [colour("blue", 0.16, 0.28, 0.66), colour("green", 0.20, 0.50, 0.24)];
    let mut put = |mesh, at: [f64; 3], motion: Motion| {
        let trs = Trs { translation: DVec3::from_array(at), ..Trs::default() };
        let node = graph.push_node(Node { motion, ..Node::new("body", None, Local::Trs(trs)) });
        graph.hang(mesh, node);
    };
    let still = Motion::default;
    let moves = |x: f64, y: f64, z: f64| Motion { velocity: DVec3::new(x, y, z), spin: None };
    let spins = |rate_hz| Motion { spin: Spin::new(DVec3::Y, rate_hz), ..Motion::default() };
    put(shapes::plane(12.0, 1, 1.0, floor), [0.0; 3], still());
    put(shapes::cuboid(Vec3::new(0.5, 0.5, 0.5), red), [-1.4, 0.25, 0.6], still());
    put(shapes::cuboid(Vec3::new(0.12, 1.6, 0.12), green), [0.9, 0.8, -0.9], still());
    put(shapes::cuboid(Vec3::new(1.7, 0.10, 0.16), blue), [-0.3, 1.0, -0.4], spins(5.0));
    put(shapes::cuboid(Vec3::splat(0.4), red), [0.3, 0.9, 1.0], moves(60.0, 0.0, 0.0));
}
