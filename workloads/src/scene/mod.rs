//! A scene: what there is, how it moves, and what of it one frame's shutter sees.

pub(crate) mod camera;
pub(crate) mod clip;
mod deform;
pub(crate) mod fit;
mod frame;
mod graph;
mod light;
pub(crate) mod measure;
mod mesh;
mod node;
mod parts;
mod settings;
mod track;

use std::sync::OnceLock;

use activity::Warning;
use glam::{DVec3, Vec3};

pub use camera::{DEFAULT_FOV_DEG, LookAt, Place, Rig, SceneCamera, View, tan_half};
pub use clip::{Clip, Property};
pub use frame::{Frame, FrameError, FrameMesh};
pub use graph::Graph;
pub use light::Light;
pub use mesh::{Influences, Instance, Mesh, Normals, Skin, Target};
pub use node::{Channels, Local, Motion, Node, Spin, Trs, world_poses};
pub use parts::{DEFAULT_BACKGROUND, Parts};
pub use settings::{Overrides, Settings};
pub use track::{Instant, Interpolation, Track};
pub(crate) use track::{rotation, unit_quat};

use crate::error::LoadError;
use crate::material::{Material, SurfaceShader};
use camera::{Stand, between};
use deform::Pose;
use fit::Fit;
use frame::Interval;
use measure::LENS_LEAVES_VIEW;

/// A scene that can be asked for its frames.
#[derive(Clone, Debug)]
pub struct Scene {
    name: String,
    graph: Graph,
    clips: Vec<Clip>,
    camera: SceneCamera,
    light: Light,
    background: Vec3,
    settings: Settings,
    warnings: Vec<Warning>,
    shaders: Vec<SurfaceShader>,
    moving: Vec<bool>,
    /// Meshes that never move, made when first asked for.
    still: Vec<OnceLock<FrameMesh>>,
    /// Where a fitted camera has been put.
    fit: Option<Fit>,
    /// Middle of the scene's bounds in the first frame.
    centre: DVec3,
}

/// Vertices and triangles of all instances together: a small file that asks for more is broken.
const MOST: usize = 100_000_000;

impl Scene {
    /// Makes `parts` renderable: checks the settings, fits the camera, places the light. The first clip plays
    /// unless another has been chosen.
    ///
    /// # Errors
    /// [`LoadError`] when the settings make no sense, there is nothing to draw, or something is not finite.
    pub fn new(parts: Parts) -> Result<Self, LoadError> {
        parts.settings.check()?;
        let mut scene = Self {
            name: parts.name,
            graph: parts.graph,
            clips: parts.clips,
            camera: parts.camera,
            light: parts.light,
            background: parts.background,
            settings: parts.settings,
            warnings: parts.warnings,
            shaders: Vec::new(),
            moving: Vec::new(),
            still: Vec::new(),
            fit: None,
            centre: DVec3::ZERO,
        };
        scene.graph.check().map_err(|message| scene.broken(message))?;
        scene.check_size()?;
        scene.prepare()?;
        Ok(scene)
    }

    fn check_size(&self) -> Result<(), LoadError> {
        let (vertices, triangles) = (self.graph.vertex_count(), self.graph.triangle_count());
        if triangles == 0 {
            return Err(self.broken("it has no triangles, so there is nothing to draw: name another file, or export it with its surfaces as triangles"));
        }
        if vertices > MOST || triangles > MOST {
            let message =
                format!("{triangles} triangles over {vertices} vertices; up to {MOST} of each are taken");
            return Err(self.broken(message));
        }
        Ok(())
    }

    fn broken(&self, message: impl Into<String>) -> LoadError {
        LoadError::Broken { file: self.name.clone(), place: "scene".to_owned(), message: message.into() }
    }

    /// Everything that depends on settings or on the clip that plays.
    fn prepare(&mut self) -> Result<(), LoadError> {
        self.moving = self.graph.moving_instances();
        self.still = vec![OnceLock::new(); self.graph.instances.len()];
        let measured = self.measure().map_err(|error| self.broken(error.to_string()))?;
        (self.centre, self.fit) = measured;
        let first = self.interval(self.settings.frames.start);
        let (stand, ..) = self.stands(&first).map_err(|error| self.broken(error.to_string()))?;
        let axes = [stand.right, stand.up, stand.forward].map(|axis| axis.as_vec3());
        let toward = self.light.toward.unwrap_or_else(|| light::over_the_shoulder(axes[0], axes[1], axes[2]));
        let light = Light { toward: Some(toward), ..self.light };
        self.shaders =
            self.graph.materials.iter().map(|material| SurfaceShader::new(material, &light)).collect();
        Ok(())
    }

    /// The scene with other settings, or playing another clip.
    ///
    /// # Errors
    /// [`LoadError::Setting`] when a value makes no sense or there is no such clip.
    pub fn with_overrides(mut self, overrides: &Overrides) -> Result<Self, LoadError> {
        self.settings = self.settings.with(overrides)?;
        if let Some(wanted) = &overrides.clip {
            let index = clip::find(&self.clips, wanted)?;
            clip::play(&mut self.graph.nodes, &self.clips[index]);
        }
        self.warnings.retain(|warning| warning.code != LENS_LEAVES_VIEW);
        self.prepare()?;
        Ok(self)
    }

    /// The scene while the shutter of frame `index` is open, whether or not the settings ask for that frame.
    ///
    /// # Errors
    /// [`FrameError`] when something leaves the range of numbers.
    pub fn frame(&self, index: u32) -> Result<Frame, FrameError> {
        let interval = self.interval(index);
        let meshes = (0..self.graph.instances.len()).map(|instance| self.frame_mesh(&interval, instance));
        let meshes = meshes.collect::<Result<Vec<_>, _>>()?;
        let (open_s, close_s) = self.shutter_s(index);
        Ok(Frame { index, open_s, close_s, camera: self.frame_camera(&interval)?, meshes })
    }

    fn frame_mesh(&self, interval: &Interval, index: usize) -> Result<FrameMesh, FrameError> {
        let instance = self.graph.instances[index];
        if self.moving[index] {
            return interval.mesh(self, instance);
        }
        if let Some(made) = self.still[index].get() {
            return Ok(made.clone());
        }
        let made = interval.mesh(self, instance)?;
        Ok(self.still[index].get_or_init(|| made).clone())
    }

    /// When the shutter of frame `index` opens and closes, in seconds.
    fn shutter_s(&self, index: u32) -> (f64, f64) {
        let open_s = f64::from(index) / self.settings.frame_rate_hz;
        (open_s, open_s + self.settings.shutter / self.settings.frame_rate_hz)
    }

    fn instants(&self, index: u32) -> [Instant; 3] {
        let (open_s, _) = self.shutter_s(index);
        let length_s = self.settings.shutter / self.settings.frame_rate_hz;
        [0.0, 0.5, 1.0].map(|part| Instant { open_s, offset_s: part * length_s })
    }

    fn interval(&self, frame: u32) -> Interval {
        let [open, middle, close] = self.instants(frame).map(|at| Pose::new(&self.graph, at));
        Interval { frame, open, middle, close }
    }

    /// Where the camera stands at both ends, the near depth, and what it is focused on.
    fn stands(&self, interval: &Interval) -> Result<(Stand, Stand, f64, f64), FrameError> {
        if let Some(fit) = &self.fit {
            return Ok((fit.stand, fit.stand, fit.near, fit.focus));
        }
        let [open_at, _, close_at] = self.instants(interval.frame);
        let ends = [(&interval.open, open_at), (&interval.close, close_at)];
        let [Some(open), Some(close)] = ends.map(|(pose, at)| self.camera.stand(pose, at)) else {
            let message =
                "it looks nowhere, because position and target coincide or are not finite: move one of them"
                    .to_owned();
            return Err(FrameError::Camera { frame: interval.frame, message });
        };
        let subject = self.camera.subject_depth(&open, open_at, self.centre);
        let distance = open.eye.distance(self.centre).max(subject);
        let near = self.camera.near.unwrap_or(1e-3 * distance.max(1e-3));
        Ok((open, close, near, subject.max(2.0 * near)))
    }

    fn frame_camera(&self, interval: &Interval) -> Result<pipeline::Camera, FrameError> {
        let (open, close, near, subject) = self.stands(interval)?;
        let radius = self.settings.lens_radius;
        let lens = (radius > 0.0).then(|| (radius, self.settings.focus.map_or(subject, f64::from)));
        between(&open, &close, self.camera.view, near, lens)
            .map_err(|message| FrameError::Camera { frame: interval.frame, message })
    }
}

/// What there is to know about a scene.
impl Scene {
    /// Name of the scene, or the file it came from.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Size of the image, sampling, time and lens.
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// Remarks of the importer, with stable codes.
    pub fn warnings(&self) -> &[Warning] {
        &self.warnings
    }

    /// Linear RGB radiance where nothing is hit.
    pub fn background(&self) -> Vec3 {
        self.background
    }

    /// Materials, in the order of [`FrameMesh::material`].
    pub fn materials(&self) -> &[Material] {
        &self.graph.materials
    }

    /// Names of the animation clips; the first plays unless another is chosen.
    pub fn clip_names(&self) -> impl Iterator<Item = &str> {
        self.clips.iter().map(|clip| clip.name.as_str())
    }

    /// Triangles in every frame.
    pub fn triangle_count(&self) -> usize {
        self.graph.triangle_count()
    }

    /// Vertices in every frame.
    pub fn vertex_count(&self) -> usize {
        self.graph.vertex_count()
    }

    /// Whether any vertex moves, leaving the camera aside.
    pub fn is_animated(&self) -> bool {
        self.moving.contains(&true)
    }
}
