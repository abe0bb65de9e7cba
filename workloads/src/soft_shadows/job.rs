//! The job `soft_shadows`: the shadow map, the visible samples, and their shading. The default scene has bars,
//! a gate and boxes that move over a floor.

use std::collections::HashSet;

use activity::Event;
use glam::{DVec3, Vec3};
use pipeline::sampling::{Pattern, Sample, SampleSpec};
use pipeline::{Cull, Draw, DrawState, Gpu, Viewport};
use serde::{Deserialize, Serialize};
use warnings::{Code, Warning};

use super::shade::{Shadows, VisibleTriangles, World, look_ups};
use super::{AreaLight, LightSpec, SceneView, ShadowMap, ShadowMethod};
use crate::accumulation::SharedSamples;
use crate::error::LoadError;
use crate::job::{
    Drawn, DrawsScene, Fact, Flag, Flags, Job, JobError, JobOptions, JobRequest, OptionSource, facts,
};
use crate::material::{Alpha, Material};
use crate::samples::empty_warning;
use crate::scene::{
    self, Frame, FrameMesh, Graph, Local, Motion, Node, Overrides, Parts, Rig, Scene, SceneCamera,
    SceneSettings, Spin, Trs, tan_half,
};
use crate::shapes;

/// Options of the job.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SoftShadowOptions {
    /// A built-in scene or a file; without it, the test scene of this workload.
    pub scene: Option<String>,
    /// The area light.
    pub light: LightSpec,
    /// Texels of the map across and down, even.
    pub map_px: u32,
    /// Depth bias: how far a point may lie behind the stored depth and still be lit, in scene units.
    pub bias: f64,
    /// User-defined samples `(u, v, t)` instead of the first points of a scrambled Sobol sequence. As many as
    /// there are samples per pixel are used; if there are fewer, they repeat.
    pub points: Option<Vec<(f32, f32, f32)>>,
    /// Whether to use accumulation instead of one pass: the same image at another cost.
    pub accumulate: bool,
}

impl JobOptions for SoftShadowOptions {}

impl Default for SoftShadowOptions {
    fn default() -> Self {
        let light = LightSpec::default();
        Self { scene: None, light, map_px: 256, bias: 0.06, points: None, accumulate: false }
    }
}

impl SoftShadowOptions {
    fn check(&self) -> Result<(), LoadError> {
        let refused = |setting, message: String| Err(LoadError::Setting { setting, message });
        if !(2..=4096).contains(&self.map_px) || !self.map_px.is_multiple_of(2) {
            let message = format!("{}: a shadow map is 2 to 4096 texels wide, an even number", self.map_px);
            return refused("map_px", message);
        }
        if !(self.bias >= 0.0 && self.bias.is_finite()) {
            return refused("bias", format!("{:?}: the bias is a finite depth, 0 or above", self.bias));
        }
        Ok(())
    }
}

/// The job with its scene, light and samples.
pub struct SoftShadows {
    scene: Scene,
    light: AreaLight,
    set: SharedSamples,
    options: SoftShadowOptions,
}

impl SoftShadows {
    /// Makes soft shadows in the scene of `options`, with settings changed by `overrides`. The set has as
    /// many samples as a pixel.
    ///
    /// # Errors
    /// [`LoadError`] for a scene that cannot be loaded, or an invalid option.
    pub fn new(mut options: SoftShadowOptions, overrides: &Overrides, seed: u64) -> Result<Self, LoadError> {
        let scene =
            options.scene.as_deref().map_or_else(default_scene, crate::load)?.with_overrides(overrides)?;
        options.light.move_by(-scene.origin());
        options.check()?;
        let light = AreaLight::new(&options.light)?;
        let samples = scene.settings().samples;
        let spec = SampleSpec::default();
        let set = match options.points.clone() {
            None => SharedSamples::interleaved(&spec, samples, seed),
            Some(points) => {
                let pattern = Pattern::Given { points };
                SharedSamples::from_spec(&SampleSpec { pattern, ..spec }, samples, seed)
            }
        };
        let set =
            set.map_err(|error| LoadError::Setting { setting: "points", message: error.to_string() })?;
        Ok(Self { scene, light, set, options })
    }

    fn method(&self) -> ShadowMethod {
        if self.options.accumulate { ShadowMethod::Accumulation } else { ShadowMethod::OnePass }
    }

    /// Number of passes for the map.
    fn passes(&self) -> u16 {
        if self.options.accumulate { self.set.samples().len() as u16 } else { 1 }
    }

    fn facts(&self, map: &ShadowMap, fetches: u64) -> Vec<Fact> {
        Fact::all([
            (fact::shadow_map_bytes, map.bytes() as f64),
            (fact::shadow_map_passes, f64::from(self.passes())),
            (fact::shadow_map_samples_tested, map.counts[Event::SamplesTested] as f64),
            (fact::shading_fetches, fetches as f64),
        ])
    }

    /// Warnings about too few samples and an unsuitable bias.
    fn regime_warnings(&self) -> Vec<Warning> {
        let mut warnings = Vec::new();
        warnings.extend(self.banding());
        let texel = self.light.texel_width(DVec3::from_array(self.options.light.target), self.options.map_px);
        let bias = self.options.bias;
        if bias < Self::BIAS_RANGE_TEXELS[0] * texel || bias > Self::BIAS_RANGE_TEXELS[1] * texel {
            let message = format!(
                "the bias is {bias} and a texel of the map {texel:.3} scene units wide at the target: with less than half a texel \
                 surfaces shade themselves (acne), with more than eight shadows detach from their casters"
            );
            warnings.push(Warning::new(Code::ShadowBias, message));
        }
        warnings
    }

    /// Warns about surfaces that do not look as their materials say.
    fn simplified(&self, frame: &Frame) -> Option<Warning> {
        let is_plain = |mesh: &&FrameMesh| {
            let material = &self.scene.materials()[mesh.material];
            mesh.colors.is_empty() && material.texture.is_none() && material.alpha == Alpha::Opaque
        };
        let meshes = frame.drawn(&self.scene);
        let others = meshes.len() - meshes.iter().copied().filter(is_plain).count();
        (others > 0).then(|| {
            let message = format!(
                "{others} of {} meshes are textured, cut out, blended or vertex-coloured; they are drawn as opaque surfaces of \
                 their base colour",
                meshes.len()
            );
            Warning::new(Code::MaterialsSimplified, message)
        })
    }

    /// Warns about banding: equal samples give only one step of a penumbra.
    fn banding(&self) -> Option<Warning> {
        // Adding zero makes -0.0 equal to 0.0.
        let place = |Sample { u, v, t, .. }: &Sample| [u, v, t].map(|of| (of + 0.0).to_bits());
        let (count, fewest) =
            (self.set.samples().iter().map(place).collect::<HashSet<_>>().len(), Self::MIN_SAMPLES);
        let remedy = match &self.options.points {
            Some(_) => format!("{fewest} or more `points` that differ, and as many --samples"),
            None => format!("--samples {fewest} or more"),
        };
        (count < fewest).then(|| {
            let message = format!("distinct light samples: {count}, so penumbras show as bands; {remedy}");
            Warning::new(Code::ShadowBanding, message)
        })
    }

    /// Least number of different samples that hides the bands of a penumbra.
    const MIN_SAMPLES: usize = 16;
    /// Range of the bias that works, in texel widths.
    const BIAS_RANGE_TEXELS: [f64; 2] = [0.5, 8.0];
}

impl DrawsScene for SoftShadows {
    fn scene(&self) -> &Scene {
        &self.scene
    }

    fn draw_frame(&self, frame: &Frame, gpu: &mut Gpu<'_>) -> Result<Drawn, JobError> {
        let settings = self.scene.settings();
        let (draws, albedos) = parts(&self.scene, frame)?;
        let viewport = Viewport::new(settings.width, settings.height)
            .ok_or_else(|| JobError::setting(crate::job::IMAGE_SIZE))?;
        let (camera, draws) = (frame.camera.with_lens(None), gpu.resident(&draws));
        let view = SceneView { camera: &camera, draws: &draws };
        let map = ShadowMap::new(&self.light, &draws, self.options.map_px, &self.set, self.method(), gpu)?;
        let visible = VisibleTriangles::draw(&view, viewport, &self.set, self.method(), gpu)?;
        let world = World::new(&view, viewport, &self.light, &albedos, self.scene.background());
        let shadows = Shadows::Map { map: &map, bias: self.options.bias };
        let shaded = look_ups(&world, &self.set, &visible, shadows, gpu)?;
        let facts = self.facts(&map, shaded.counts[Event::TextureFetches]);
        let mut warnings = self.regime_warnings();
        warnings.extend(self.simplified(frame));
        warnings.extend(empty_warning(visible.is_any()));
        let moving = frame.is_moving();
        Ok(Drawn { image: shaded.into_image(), moving, lens: true, facts, warnings })
    }
}

/// The draws of a frame, opaque and without culling, and the reflectance of each.
fn parts<'a>(scene: &'a Scene, frame: &'a Frame) -> Result<(Vec<Draw<'a>>, Vec<Vec3>), JobError> {
    let draws =
        frame.draws(scene)?.into_iter().map(|draw| draw.with_state(DrawState::new(Cull::None))).collect();
    let drawn = frame.drawn(scene).into_iter();
    Ok((draws, drawn.map(|mesh| scene.materials()[mesh.material].base_color).collect()))
}

facts! {
    shadow_map_bytes "bytes" "size of the shadow map"
    shadow_map_passes "count" "passes that draw the map"
    shadow_map_samples_tested "count" "samples tested in these passes"
    shading_fetches "count" "fetches from the map as the image is shaded"
}

/// Run options in use. The lens of the map is the light; the camera is a pinhole.
pub(crate) const FLAGS: Flags = Flags {
    uses: &[Flag::Size, Flag::Samples, Flag::Shutter, Flag::Clip, Flag::Camera],
    instead: &[(Flag::Table, "points")],
};

/// Makes the job from its options.
///
/// # Errors
/// As [`SoftShadows::new`].
pub fn job(options: &OptionSource, request: &JobRequest<'_>) -> Result<Box<dyn Job>, LoadError> {
    Ok(Box::new(SoftShadows::new(options.read()?, request.overrides, request.seed)?))
}

/// Makes the scene. It has contact shadows under boxes, a penumbra that widens along a leaning post, and
/// moving shadows.
///
/// # Errors
/// None are expected: the scene is tested.
pub fn default_scene() -> Result<Scene, LoadError> {
    let mut parts = Parts::new("soft shadows");
    fill(&mut parts.graph);
    parts.camera = SceneCamera {
        rig: Rig::look_at(DVec3::new(-0.8, 3.4, 5.6), DVec3::new(0.0, 0.35, 0.0)),
        view: Some(scene::Frustum::Perspective { tan_half_height: tan_half(40.0) }),
        near: None,
    };
    parts.background = Vec3::new(0.32, 0.40, 0.52);
    parts.settings = SceneSettings {
        width: 320,
        height: 180,
        samples: 64,
        frames: 0..4,
        shutter: 0.5,
        ..SceneSettings::default()
    };
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
        graph.attach(mesh, node);
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
