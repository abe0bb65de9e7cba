//! A scene: its content and motion, and its frames.

pub(crate) mod camera;
mod camera_spec;
mod camera_used;
mod deform;
mod frame;
mod graph;
mod info;
pub(crate) mod inside;
mod measure;
mod mesh;
mod rays;
mod settings;
mod track;

pub use camera::{Aim, DEFAULT_FOV_DEG, Frustum, LookAt, Place, Rig, SceneCamera, Side, tan_half};
pub(crate) use camera_spec::Wrong;
pub use camera_spec::{CameraKey, CameraSpec, InterpolationSpec};
pub use camera_used::{CameraSource, CameraUsed, OwnCamera};
pub use frame::{Frame, FrameError, FrameMesh, NearSpace};
pub use graph::{AnimationClip, Channels, Graph, Local, Motion, Node, Property, Spin, Trs, world_poses};
pub use info::{
    CameraInfo, ClipInfo, LensInfo, LightInfo, MaterialInfo, MeshInfo, SceneInfo, SettingsInfo, TextureInfo,
};
pub(crate) use measure::lens_leaves_view;
pub(crate) use mesh::Bounds;
pub use mesh::{Influences, Instance, Mesh, MorphTarget, Normals, Skin};
pub use settings::{Overrides, SceneSettings};
pub use track::{Instant, Interpolation, Track};
pub(crate) use track::{rotation, unit_quat};

use std::ops::Range;
use std::sync::OnceLock;

use glam::{DVec3, Vec3};
use warnings::Warning;

use crate::error::LoadError;
use crate::material::{Light, Material, SurfaceShader};
use camera::{Standing, between};
use deform::Pose;
use frame::Interval;
use inside::Inside;
use measure::Placed;

/// A scene that can be rendered frame by frame.
#[derive(Clone, Debug)]
pub struct Scene {
    name: String,
    graph: Graph,
    clips: Vec<AnimationClip>,
    /// The playing clip, if there are any.
    playing: Option<usize>,
    /// Cameras of the scene's file.
    cameras: Vec<OwnCamera>,
    camera: SceneCamera,
    camera_source: CameraSource,
    light: Light,
    background: Vec3,
    settings: SceneSettings,
    /// Frames that the scene renders where nothing else is requested. What is placed once for all frames (a
    /// fitted camera, the lamp over its shoulder, the centre that a lens is focused on) is placed for these,
    /// so that a frame looks the same whichever frames are rendered with it.
    own_frames: Range<u32>,
    warnings: Vec<Warning>,
    /// Shaders of each material, without and with vertex colours.
    shaders: Vec<[SurfaceShader; 2]>,
    moving: Vec<bool>,
    /// Meshes that never move, made on first use.
    still: Vec<OnceLock<FrameMesh>>,
    /// Origin of the positions in frames.
    origin: DVec3,
    /// Camera of an automatic placement, relative to `origin`.
    placed: Option<Placed>,
    /// Position inside the scene, computed on first use.
    room: Option<Option<Inside>>,
    /// Middle of the scene's bounds in the first of its own frames, relative to `origin`.
    centre: DVec3,
}

/// Vertices and triangles of all instances together: a small file that requests more is broken.
const MAX_ELEMENTS: usize = 100_000_000;

/// The automatic near depth, in depths of the camera's target.
const NEAR: f64 = 1e-3;

/// Least near depth for objects in view, relative to the automatic near depth.
const MIN_NEAR: f64 = 1e-3;

impl Scene {
    /// Makes `parts` renderable: checks the settings, fits the camera, places the light. The first clip plays
    /// unless another has been chosen.
    ///
    /// # Errors
    /// [`LoadError`] when the settings make no sense, there is nothing to draw, or something is not finite.
    pub fn new(parts: Parts) -> Result<Self, LoadError> {
        parts.settings.check()?;
        let (cameras, camera_source) = camera_used::cameras(parts.cameras, &parts.camera);
        let mut scene = Self {
            name: parts.name,
            graph: parts.graph,
            playing: (!parts.clips.is_empty()).then_some(0),
            clips: parts.clips,
            cameras,
            camera: parts.camera,
            camera_source,
            light: parts.light,
            background: parts.background,
            own_frames: parts.settings.frames.clone(),
            settings: parts.settings,
            warnings: Warning::fold(parts.warnings),
            shaders: Vec::new(),
            moving: Vec::new(),
            still: Vec::new(),
            origin: DVec3::ZERO,
            placed: None,
            room: None,
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
        if vertices > MAX_ELEMENTS || triangles > MAX_ELEMENTS {
            let message = format!(
                "{triangles} triangles over {vertices} vertices; up to {MAX_ELEMENTS} of each are taken"
            );
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
        self.recentre();
        let measured = self.measure().map_err(|error| self.broken(error.to_string()))?;
        (self.centre, self.placed) = measured;
        let first = self.interval(self.own_frames.start);
        let stand = self.standing(&first).map_err(|error| self.broken(error.to_string()))?.open;
        let axes = [stand.right, stand.up, stand.forward].map(|axis| axis.as_vec3());
        let toward = self.light.toward.unwrap_or_else(|| over_the_shoulder(axes[0], axes[1], axes[2]));
        let light = Light { toward: Some(toward), ..self.light };
        let shaders = |material: &Material| {
            let plain = SurfaceShader::new(material, &light);
            [plain.clone(), plain.with_vertex_colors()]
        };
        self.shaders = self.graph.materials.iter().map(shaders).collect();
        Ok(())
    }

    /// Chooses what positions are relative to.
    fn recentre(&mut self) {
        self.origin = DVec3::ZERO;
        let first = self.interval(self.own_frames.start).open;
        let mut bounds = Bounds::default();
        for instance in &self.graph.instances {
            let at_rest = self.graph.meshes[instance.mesh].positions.iter().map(|point| point.as_dvec3());
            first.transforms(&self.graph, *instance).place(&Bounds::of(at_rest), &mut bounds);
        }
        self.origin = bounds.origin();
        if self.origin != DVec3::ZERO {
            self.warnings.push(mesh::recentred(self.origin));
        }
    }

    /// The shader of a material, with or without vertex colours.
    pub(crate) fn shader(&self, material: usize, vertex_colors: bool) -> Option<&SurfaceShader> {
        self.shaders.get(material).map(|shaders| &shaders[usize::from(vertex_colors)])
    }

    /// The scene with other settings, or playing another clip.
    ///
    /// # Errors
    /// [`LoadError::Setting`] when a value makes no sense or the clip or camera does not exist; as
    /// [`CameraSpec::flag`] when another camera cannot be read.
    pub fn with_overrides(mut self, overrides: &Overrides) -> Result<Self, LoadError> {
        let lens = self.choose_camera(overrides)?;
        self.settings = self.settings.with(&lens.over(overrides))?;
        if let Some(wanted) = &overrides.clip {
            let index = AnimationClip::find(&self.clips, wanted)?;
            self.clips[index].play(&mut self.graph.nodes);
            self.playing = Some(index);
            self.room = None;
        }
        let placed = |code| code == warnings::Code::CoordinatesRecentred || measure::CODES.contains(&code);
        self.warnings.retain(|warning| !placed(warning.code));
        self.prepare()?;
        Ok(self)
    }

    /// The scene while the shutter of frame `index` is open. The frame need not be in the range of the settings.
    ///
    /// # Errors
    /// [`FrameError`] if a position overflows.
    pub fn frame(&self, index: u32) -> Result<Frame, FrameError> {
        let interval = self.interval(index);
        let meshes = self.frame_meshes(&interval)?;
        let camera = self.camera_at(&interval, &self.standing_before(&interval, &meshes)?)?;
        Ok(Frame { camera, meshes })
    }

    fn frame_meshes(&self, interval: &Interval) -> Result<Vec<FrameMesh>, FrameError> {
        (0..self.graph.instances.len()).map(|instance| self.frame_mesh(interval, instance)).collect()
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

    /// When the shutter of frame `index` opens, is halfway and closes.
    fn instants(&self, index: u32) -> [Instant; 3] {
        let open_s = f64::from(index) / self.settings.frame_rate_hz;
        let length_s = self.settings.shutter / self.settings.frame_rate_hz;
        [0.0, 0.5, 1.0].map(|part| Instant { open_s, offset_s: part * length_s })
    }

    fn interval(&self, frame: u32) -> Interval {
        let [open, middle, close] = self.instants(frame).map(|at| Pose::new(&self.graph, at, self.origin));
        Interval { frame, open, middle, close }
    }

    /// Position of the camera, and the near and focus depths that depend on its target.
    fn standing(&self, interval: &Interval) -> Result<Standing, FrameError> {
        if let Some(Placed { fit, .. }) = &self.placed {
            let near = self.camera.near.unwrap_or(fit.near);
            return Ok(Standing { open: fit.stand, close: fit.stand, near, focus: fit.focus });
        }
        let [open_at, _, close_at] = self.instants(interval.frame);
        let ends = [(&interval.open, open_at), (&interval.close, close_at)];
        let [Some(open), Some(close)] = ends.map(|(pose, at)| self.camera.stand(pose, at)) else {
            let message =
                "it has no direction, because position and target coincide or are not finite: move one of them"
                    .to_owned();
            return Err(FrameError::Camera { frame: interval.frame, message });
        };
        let (near, focus) = match self.camera.target_depth(&open, (&interval.open, open_at)) {
            Some(depth) => (NEAR * depth, depth),
            None => {
                let depth = open.depth(self.centre);
                let near = NEAR * open.eye.distance(self.centre).max(1e-3);
                (near, depth.max(2.0 * self.camera.near.unwrap_or(near)))
            }
        };
        Ok(Standing { open, close, near: self.camera.near.unwrap_or(near), focus })
    }

    /// The camera in a frame of `meshes`. An automatic near depth is reduced for objects in view.
    fn standing_before(&self, interval: &Interval, meshes: &[FrameMesh]) -> Result<Standing, FrameError> {
        let standing = self.standing(interval)?;
        if self.camera.near.is_some() {
            return Ok(standing);
        }
        let camera = self.camera_at(interval, &standing)?;
        let aspect = f64::from(self.settings.width) / f64::from(self.settings.height);
        let space = NearSpace::new(&camera, aspect, f64::from(camera.near()));
        let near = meshes
            .iter()
            .filter_map(|mesh| mesh.nearest(&space))
            .fold(standing.near, |near, depth| near.min(0.5 * depth));
        Ok(Standing { near: near.max(MIN_NEAR * standing.near), ..standing })
    }

    /// View of the camera.
    fn sees(&self) -> Frustum {
        self.placed.as_ref().map_or_else(|| self.camera.view.unwrap_or_default(), |placed| placed.view)
    }

    /// Depth at which the lens is sharp: as given, else that of the subject, to the precision of one that is given.
    fn focus(&self, subject: f64) -> f32 {
        self.settings.focus.unwrap_or(subject as f32)
    }

    fn camera_at(&self, interval: &Interval, standing: &Standing) -> Result<pipeline::Camera, FrameError> {
        let radius = self.settings.lens_radius;
        let lens = (radius > 0.0).then(|| (radius, f64::from(self.focus(standing.focus))));
        between(standing, self.sees(), lens).map_err(|message| {
            let message = format!(
                "{message}: coordinates of {} are too large for numbers of 32 bits, or too small; scale the scene",
                self.name
            );
            FrameError::Camera { frame: interval.frame, message }
        })
    }
}

/// Properties of a scene.
impl Scene {
    /// Name of the scene, or the file it came from.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Size of the image, sampling, time and lens.
    pub fn settings(&self) -> &SceneSettings {
        &self.settings
    }

    /// Warnings of the importer, with stable codes.
    pub fn warnings(&self) -> &[Warning] {
        &self.warnings
    }

    /// What positions and cameras of frames are relative to, in the coordinates of the scene's files: zero,
    /// unless the scene is so far from its own origin that rounding to f32 would change its shape.
    pub fn origin(&self) -> DVec3 {
        self.origin
    }

    /// Linear RGB radiance of the background.
    pub fn background(&self) -> Vec3 {
        self.background
    }

    /// Materials, in the order of [`FrameMesh::material`].
    pub fn materials(&self) -> &[Material] {
        &self.graph.materials
    }

    /// The name of the animation clip that plays.
    pub fn clip(&self) -> Option<&str> {
        Some(self.clips.get(self.playing?)?.name.as_str())
    }

    /// Triangles in every frame.
    pub fn triangle_count(&self) -> usize {
        self.graph.triangle_count()
    }

    /// Vertices in every frame.
    pub fn vertex_count(&self) -> usize {
        self.graph.vertex_count()
    }
}

/// Direction towards a lamp over the right shoulder of a camera with the axes `right`, `up`, `forward`.
fn over_the_shoulder(right: Vec3, up: Vec3, forward: Vec3) -> Vec3 {
    mesh::unit((0.45 * right + 0.75 * up - 0.65 * forward).as_dvec3())
}

/// What an importer or a program puts together; [`Scene::new`](Scene::new) makes it renderable.
#[derive(Clone, Debug)]
pub struct Parts {
    /// Name of the scene, or the file it came from.
    pub name: String,
    /// Shapes, materials and their hierarchy.
    pub graph: Graph,
    /// Animation clips of which one at a time is played.
    pub clips: Vec<AnimationClip>,
    /// Default camera.
    pub camera: SceneCamera,
    /// Cameras to choose from by name or number. If empty, `camera` is one, unless it is placed automatically.
    pub cameras: Vec<OwnCamera>,
    /// The light.
    pub light: Light,
    /// Linear RGB radiance of the background.
    pub background: Vec3,
    /// Size of the image, sampling, time and lens.
    pub settings: SceneSettings,
    /// Warnings of the importer.
    pub warnings: Vec<Warning>,
}

/// A light blue-grey.
const DEFAULT_BACKGROUND: Vec3 = Vec3::new(0.42, 0.50, 0.60);

impl Parts {
    /// Parts without shapes, with a fitted camera and default light, background and settings.
    pub fn new(name: impl Into<String>) -> Self {
        Self {
            name: name.into(),
            graph: Graph::default(),
            clips: Vec::new(),
            camera: SceneCamera::default(),
            cameras: Vec::new(),
            light: Light::default(),
            background: DEFAULT_BACKGROUND,
            settings: SceneSettings::default(),
            warnings: Vec::new(),
        }
    }
}
