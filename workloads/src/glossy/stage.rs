//! The test scene: posts that stand on the receiver, and a bar above it.

use glam::{DVec3, Vec3};

use super::receiver::Receiver;
use crate::error::LoadError;
use crate::material::Material;
use crate::scene::{Graph, Local, Node, Parts, Rig, Scene, SceneCamera, Settings, Trs, View, tan_half};
use crate::shapes;

/// Makes the scene without its receiver; `below` mirrors it vertically, for refraction. Materials are unlit,
/// so that every triangle has a constant colour.
///
/// # Errors
/// None are expected: the scene is tested.
pub fn stage(below: bool) -> Result<Scene, LoadError> {
    let mut parts = Parts::new("glossy");
    fill(&mut parts.graph, if below { -1.0 } else { 1.0 });
    parts.camera = SceneCamera {
        rig: Rig::look_at(DVec3::new(0.4, 2.2, 4.6), DVec3::new(0.0, 0.0, 0.1)),
        view: Some(View::Perspective { tan_half_height: tan_half(42.0) }),
        near: None,
    };
    parts.background = Vec3::new(0.45, 0.55, 0.70);
    parts.settings = Settings { width: 320, height: 180, samples: 16, ..Settings::default() };
    Scene::new(parts)
}

/// Receiver of the test scene.
pub fn receiver() -> Receiver {
    Receiver::lying(DVec3::ZERO, [1.8, 1.2])
}

fn fill(graph: &mut Graph, side: f64) {
    let colours = [[0.80, 0.12, 0.08], [0.90, 0.80, 0.30], [0.10, 0.30, 0.75], [0.15, 0.55, 0.25]];
    let colours = colours.map(|[r, g, b]| {
        graph.push_material(Material { unlit: true, ..Material::colored("colour", Vec3::new(r, g, b)) })
    });
    let mut put = |size: Vec3, at: [f64; 3], colour: usize| {
        let at = DVec3::new(at[0], side * at[1], at[2]);
        let trs = Trs { translation: at, ..Trs::default() };
        let node = graph.push_node(Node::new("block", None, Local::Trs(trs)));
        graph.hang(shapes::cuboid(size, colours[colour % 4]), node);
    };
    for (post, x) in [-1.1, 0.0, 1.1].into_iter().enumerate() {
        for step in 0..4 {
            let size = Vec3::new(0.26, 0.35, 0.26);
            put(size, [x, 0.176 + 0.35 * f64::from(step), -0.5], post + step as usize);
        }
    }
    put(Vec3::new(3.4, 0.12, 0.12), [0.0, 1.9, -0.9], 2);
}
