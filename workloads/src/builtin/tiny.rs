//! The test scene: motion, lens and texture in a handful of triangles.

use std::sync::Arc;

use glam::{DVec3, Vec3};

use super::checker;
use crate::error::LoadError;
use crate::material::Material;
use crate::scene::{Graph, Local, Node, Parts, Rig, Scene, SceneCamera, Settings, Spin, Trs, View, tan_half};
use crate::shapes;

pub(super) fn scene() -> Result<Scene, LoadError> {
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
    graph.hang(shapes::plane(8.0, 2, 4.0, floor), ground);
    let mut thrown = Node::new("thrown box", None, at(-1.0, 0.9, 0.2));
    thrown.motion.velocity = DVec3::new(18.0, 0.0, 0.0);
    let thrown = graph.push_node(thrown);
    graph.hang(shapes::cuboid(Vec3::splat(0.7), red), thrown);
    let mut turning = Node::new("turning box", None, at(0.7, 0.6, -1.5));
    turning.motion.spin = Spin::new(DVec3::new(0.3, 1.0, 0.1), 4.0);
    let turning = graph.push_node(turning);
    graph.hang(shapes::cuboid(Vec3::new(1.2, 0.8, 0.5), teal), turning);
}
