//! The job `glossy`: the map, and the scene with the map on its receiver. The default scene has posts that
//! stand on the receiver, and a bar above it.

use activity::Event;
use glam::{DVec3, Vec3};
use pipeline::memory::MemoryRange;
use pipeline::{Camera, Cull, Draw, Geometry, Gpu, RasterPass, Rendered, SampleSpec, SampleTable, Viewport};
use serde::{Deserialize, Serialize};
use warnings::{Code, Warning};

use super::{GlossyEffect, Map, Receiver, ReceiverShader};
use crate::error::LoadError;
use crate::job::{
    Drawn, DrawsScene, Fact, Flag, Flags, Job, JobError, JobOptions, JobRequest, OptionSource, facts,
};
use crate::material::Material;
use crate::scene::{
    Frame, Frustum, Graph, Local, Node, Overrides, Parts, Rig, Scene, SceneCamera, SceneSettings, Trs,
    tan_half,
};
use crate::shapes;

/// Options of the job.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct GlossyOptions {
    /// A built-in scene or a file; without it, the test scene of this workload.
    pub scene: Option<String>,
    /// Centre of the receiver, a horizontal rectangle seen from above; scene units.
    pub centre: [f64; 3],
    /// Half of its sides along x and z, scene units.
    pub half: [f64; 2],
    /// Refractive index, for refraction instead of reflection.
    pub index: Option<f64>,
    /// Roughness: radius of the lens, scene units. 0 is a mirror.
    pub roughness: f64,
    /// Texels of the map from the near to the far side of the receiver.
    pub texels: u32,
    /// Samples per texel.
    pub map_samples: u32,
    /// Share of reflected light at normal incidence; the rest shows the surface's own colour.
    pub fresnel: f32,
}

impl JobOptions for GlossyOptions {}

impl Default for GlossyOptions {
    fn default() -> Self {
        let Receiver { centre, half, .. } = receiver();
        Self {
            scene: None,
            centre: centre.to_array(),
            half,
            index: None,
            roughness: 0.25,
            texels: 128,
            map_samples: 16,
            fresnel: 0.6,
        }
    }
}

impl GlossyOptions {
    fn check(&self) -> Result<(), LoadError> {
        let refused = |setting, message: String| Err(LoadError::Setting { setting, message });
        if !self.half.iter().all(|half| (MIN_LENGTH..=MAX_LENGTH).contains(half)) {
            return refused(
                "half",
                format!("{:?}: both have to be {MIN_LENGTH:e} to {MAX_LENGTH:e}", self.half),
            );
        }
        if !self.centre.iter().all(|at| (-MAX_LENGTH..=MAX_LENGTH).contains(at)) {
            let message = format!("{:?}: all have to be -{MAX_LENGTH:e} to {MAX_LENGTH:e}", self.centre);
            return refused("centre", message);
        }
        let most = MAX_RADIUS_PER_HALF_SIDE * self.half[0].min(self.half[1]);
        if self.roughness != 0.0 && !(MIN_LENGTH..=most).contains(&self.roughness) {
            let why = format!(
                "{:?}: it has to be 0, or a radius of {MIN_LENGTH:e} to {most:?} scene units, {MAX_RADIUS_PER_HALF_SIDE} times the receiver's",
                self.roughness
            );
            return refused("roughness", format!("{why} smaller half side"));
        }
        if let Some(index) = self.index.filter(|index| !(1.0..=10.0).contains(index)) {
            return refused("index", format!("{index:?}: an index of refraction is 1 to 10 here"));
        }
        if !(0.0..=1.0).contains(&self.fresnel) {
            return refused("fresnel", format!("{:?}: it is a share, 0 to 1", self.fresnel));
        }
        match self.map_samples {
            1..=SampleTable::MAX_PER_PIXEL => Ok(()),
            samples => refused("map_samples", format!("{samples}: a texel takes 1 to 256")),
        }
    }
}

/// The job with its scene and receiver.
pub struct Glossy {
    scene: Scene,
    receiver: Receiver,
    options: GlossyOptions,
    seed: u64,
}

/// Largest lens radius relative to the receiver's smaller half side, far beyond any surface.
const MAX_RADIUS_PER_HALF_SIDE: f64 = 100.0;
/// Least length, in scene units, whose products single precision represents.
const MIN_LENGTH: f64 = 1e-15;
/// Largest length or coordinate, in scene units.
const MAX_LENGTH: f64 = 1e15;
/// Linear RGB radiance of the receiver's own surface.
const BASE: Vec3 = Vec3::new(0.10, 0.11, 0.12);

impl Glossy {
    /// Makes a glossy receiver in the scene of `options`, with settings changed by `overrides`.
    ///
    /// # Errors
    /// [`LoadError`] for a scene that cannot be loaded, or an invalid option.
    pub fn new(options: GlossyOptions, overrides: &Overrides, seed: u64) -> Result<Self, LoadError> {
        let scene = match &options.scene {
            Some(name) => crate::load(name)?,
            None => default_scene(options.index.is_some())?,
        };
        let scene = scene.with_overrides(overrides)?;
        options.check()?;
        let receiver = Receiver::lying(DVec3::from_array(options.centre) - scene.origin(), options.half);
        let job = Self { scene, receiver, options, seed };
        let first = job.scene.settings().frames.start;
        let frame = job.scene.frame(first);
        let frame =
            frame.map_err(|error| LoadError::Setting { setting: "frames", message: error.to_string() })?;
        job.map(&frame)?;
        Ok(job)
    }

    fn effect(&self) -> GlossyEffect {
        self.options.index.map_or(GlossyEffect::Reflection, GlossyEffect::Refraction)
    }

    fn map(&self, frame: &Frame) -> Result<Map, LoadError> {
        let world = frame.camera.open().inverse();
        let (eye, along) = (world.translation.as_dvec3(), world.matrix3.z_axis.as_dvec3());
        let GlossyOptions { roughness, texels, .. } = self.options;
        Map::new(&self.receiver, (eye, along), self.effect(), roughness, texels)
    }

    fn table(&self, samples: u32) -> Result<SampleTable, JobError> {
        SampleTable::new(&SampleSpec::default(), samples, self.seed).map_err(JobError::setting)
    }

    /// Renders the scene with the map on its receiver.
    fn show(
        &self,
        map: &Map,
        texels: &[Vec3],
        camera: &Camera,
        mut draws: Vec<Draw<'_>>,
        memory: MemoryRange,
        gpu: &mut Gpu<'_>,
    ) -> Result<Rendered, JobError> {
        let shader = ReceiverShader::new(texels, map.viewport, BASE, self.options.fresnel)
            .map_err(JobError::setting)?;
        let (corners, uvs) = (self.receiver.corners(), map.uvs());
        let geometry = Geometry::new(&corners, &corners, &[[0, 1, 2], [0, 2, 3]]);
        let geometry = geometry.and_then(|geometry| geometry.with_uvs(&uvs)).map_err(JobError::setting)?;
        let settings = self.scene.settings();
        let viewport = Viewport::new(settings.width, settings.height)
            .ok_or_else(|| JobError::setting(crate::job::IMAGE_SIZE))?;
        let samples = self.table(settings.samples)?;
        let background = self.scene.background();
        let settings = pipeline::Settings { spec: gpu.spec(), viewport, samples: &samples, background };
        let receiver = Draw::new(geometry, &shader, Cull::None).reading(memory);
        let draws: Vec<Draw<'_>> = draws.drain(..).chain([receiver]).collect();
        Ok(gpu.draw(&RasterPass::new(camera, &draws, &settings).named("image"))?)
    }

    fn regime_warnings(&self) -> Vec<Warning> {
        let (radius, least) = (self.options.roughness, self.receiver.half[0].min(self.receiver.half[1]));
        let message = format!(
            "the radius of the lens, {radius}, exceeds half the shorter side of the receiver, {least}: texels at its rim gather from other \
             directions than those of a uniformly rough surface would, and the blur has too few samples"
        );
        (radius > least).then(|| Warning::new(Code::LensWiderThanReceiver, message)).into_iter().collect()
    }
}

impl DrawsScene for Glossy {
    fn scene(&self) -> &Scene {
        &self.scene
    }

    fn draw_frame(&self, frame: &Frame, gpu: &mut Gpu<'_>) -> Result<Drawn, JobError> {
        let map = self.map(frame).map_err(JobError::setting)?;
        let draws: Vec<_> =
            frame.draws(&self.scene)?.into_iter().map(|draw| draw.culling(Cull::None)).collect();
        let draws = gpu.resident(&draws);
        let samples = self.table(self.options.map_samples)?;
        let drawn = map.one_pass(&draws, &samples, self.scene.background(), gpu)?;
        let facts = Fact::all([
            (fact::map_texels, map.viewport.pixels() as f64),
            (fact::map_samples_tested, drawn.counts[Event::SamplesTested] as f64),
            (fact::blur_at_height_1, map.blur(1.0)),
        ]);
        let (memory, texels) = (drawn.region, drawn.into_image());
        let image = self.show(&map, &texels, &frame.camera, draws, memory, gpu)?.into_image();
        let (moving, warnings) = (frame.is_moving(), self.regime_warnings());
        Ok(Drawn { image, moving, lens: true, facts, warnings })
    }
}

facts! {
    map_texels "count" "texels of the map of the receiver"
    map_samples_tested "count" "samples tested as the map is drawn"
    blur_at_height_1 "scene units" "width of the blur of a point one scene unit from the receiver"
}

/// Run options in use.
pub(crate) const FLAGS: Flags = Flags {
    uses: &[Flag::Size, Flag::Samples, Flag::Shutter, Flag::Lens, Flag::Focus, Flag::Clip, Flag::Camera],
    instead: &[],
};

/// Makes the job from its options.
///
/// # Errors
/// As [`Glossy::new`].
pub fn job(options: &OptionSource, request: &JobRequest<'_>) -> Result<Box<dyn Job>, LoadError> {
    Ok(Box::new(Glossy::new(options.read()?, request.overrides, request.seed)?))
}

/// Makes the scene without its receiver; `below` mirrors it vertically, for refraction. Materials are unlit,
/// so that every triangle has a constant colour.
///
/// # Errors
/// None are expected: the scene is tested.
pub fn default_scene(below: bool) -> Result<Scene, LoadError> {
    let mut parts = Parts::new("glossy");
    fill(&mut parts.graph, if below { -1.0 } else { 1.0 });
    parts.camera = SceneCamera {
        rig: Rig::look_at(DVec3::new(0.4, 2.2, 4.6), DVec3::new(0.0, 0.0, 0.1)),
        view: Some(Frustum::Perspective { tan_half_height: tan_half(42.0) }),
        near: None,
    };
    parts.background = Vec3::new(0.45, 0.55, 0.70);
    parts.settings = SceneSettings { width: 320, height: 180, samples: 16, ..SceneSettings::default() };
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
        graph.attach(shapes::cuboid(size, colours[colour % 4]), node);
    };
    for (post, x) in [-1.1, 0.0, 1.1].into_iter().enumerate() {
        for step in 0..4 {
            let size = Vec3::new(0.26, 0.35, 0.26);
            put(size, [x, 0.176 + 0.35 * f64::from(step), -0.5], post + step as usize);
        }
    }
    put(Vec3::new(3.4, 0.12, 0.12), [0.0, 1.9, -0.9], 2);
}
