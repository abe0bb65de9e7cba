//! What a scene is made from.

use glam::Vec3;
use warnings::Warning;

use super::camera::SceneCamera;
use super::camera_choice::OwnCamera;
use super::clip::Clip;
use super::graph::Graph;
use super::settings::Settings;
use crate::material::Light;

/// What an importer or a program puts together; [`Scene::new`](super::Scene::new) makes it renderable.
#[derive(Clone, Debug)]
pub struct Parts {
    /// Name of the scene, or the file it came from.
    pub name: String,
    /// Shapes, materials and their hierarchy.
    pub graph: Graph,
    /// Animation clips of which one at a time is played.
    pub clips: Vec<Clip>,
    /// The camera that sees the scene unless another is chosen.
    pub camera: SceneCamera,
    /// Cameras that can be chosen by name or number; where there are none, `camera` can be, unless it is placed by itself.
    pub cameras: Vec<OwnCamera>,
    /// The light.
    pub light: Light,
    /// Linear RGB radiance where nothing is hit.
    pub background: Vec3,
    /// Size of the image, sampling, time and lens.
    pub settings: Settings,
    /// What the importer has to say.
    pub warnings: Vec<Warning>,
}

/// A light blue-grey.
pub const DEFAULT_BACKGROUND: Vec3 = Vec3::new(0.42, 0.50, 0.60);

impl Parts {
    /// Parts with nothing but a name: no shapes, a fitted camera, default light, background and settings.
    pub fn new(name: impl Into<String>) -> Self {
        Self {
            name: name.into(),
            graph: Graph::default(),
            clips: Vec::new(),
            camera: SceneCamera::default(),
            cameras: Vec::new(),
            light: Light::default(),
            background: DEFAULT_BACKGROUND,
            settings: Settings::default(),
            warnings: Vec::new(),
        }
    }
}
