//! The job `soft_shadows`: the shadow map, the visible samples, and their shading.

use std::collections::HashSet;

use activity::{Counts, Event};
use glam::{DVec3, Vec3};
use pipeline::sampling::{Pattern, Sample, SampleSource, SampleSpec};
use pipeline::{Cull, Draw, PipelineSpec, Viewport};
use serde::{Deserialize, Serialize};
use warnings::{Code, Warning};

use super::light::{AreaLight, LightSpec};
use super::look_up::look_up_packets;
use super::map::{Method, Renderer, ShadowMap, View, depth_pass};
use super::shade::{Shadows, World};
use super::stage::stage;
use crate::accumulation::SharedSamples;
use crate::error::LoadError;
use crate::job::{Drawn, Draws, Emit, Fact, Flag, Flags, Job, JobError, OptionSource, Request, shifted};
use crate::scene::{Frame, Overrides, Scene, Settings};

/// Options of the job.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Options {
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

impl Default for Options {
    fn default() -> Self {
        let light = LightSpec::default();
        Self { scene: None, light, map_px: 256, bias: 0.06, points: None, accumulate: false }
    }
}

impl Options {
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
    options: Options,
}

impl SoftShadows {
    /// Makes soft shadows in the scene of `options`, with settings changed by `overrides`. The set has as
    /// many samples as a pixel.
    ///
    /// # Errors
    /// [`LoadError`] for a scene that cannot be loaded, or an invalid option.
    pub fn new(mut options: Options, overrides: &Overrides, seed: u64) -> Result<Self, LoadError> {
        let scene = options.scene.as_deref().map_or_else(stage, crate::load)?.with_overrides(overrides)?;
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

    fn method(&self) -> Method {
        if self.options.accumulate { Method::Accumulation } else { Method::OnePass }
    }

    /// Number of passes for the map.
    fn passes(&self) -> u16 {
        if self.options.accumulate { self.set.samples().len() as u16 } else { 1 }
    }

    fn facts(&self, map: &ShadowMap, shaded: &Counts) -> Vec<Fact> {
        vec![
            Fact { name: "shadow_map_bytes", value: map.bytes() as f64 },
            Fact { name: "shadow_map_passes", value: f64::from(self.passes()) },
            Fact { name: "shadow_map_samples_tested", value: map.counts[Event::SamplesTested] as f64 },
            Fact { name: "look_ups", value: shaded[Event::TextureFetches] as f64 },
        ]
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
                 surfaces shade themselves (acne), with more than eight shadows come off what throws them"
            );
            warnings.push(Warning::new(Code::ShadowBias, message));
        }
        warnings
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
            let message = format!("{count} light samples: penumbras show as {count} steps (bands); {remedy}");
            Warning::new(Code::ShadowBanding, message)
        })
    }

    /// Least number of different samples that hides the bands of a penumbra.
    const MIN_SAMPLES: usize = 16;
    /// Range of the bias that works, in texel widths.
    const BIAS_RANGE_TEXELS: [f64; 2] = [0.5, 8.0];
}

impl Draws for SoftShadows {
    type Input = Frame;

    fn settings(&self) -> &Settings {
        self.scene.settings()
    }

    fn warnings(&self) -> &[Warning] {
        self.scene.warnings()
    }

    fn input(&self, number: u32) -> Result<Frame, JobError> {
        Ok(self.scene.frame(number)?)
    }

    fn draw(&self, frame: &Frame, spec: &PipelineSpec, emit: Emit<'_>) -> Result<Drawn, JobError> {
        let settings = self.scene.settings();
        let (draws, albedos) = parts(&self.scene, frame)?;
        let viewport = Viewport::new(settings.width, settings.height)
            .ok_or_else(|| JobError::Setting("an image of no size".to_owned()))?;
        let (camera, each) = (frame.camera.with_lens(None), self.passes());
        let (view, renderer) =
            (View { camera: &camera, draws: &draws }, Renderer { method: self.method(), spec });
        let map = ShadowMap::new(&self.light, &draws, self.options.map_px, &self.set, renderer, emit)?;
        let visible = depth_pass(&view, viewport, &self.set, renderer, &mut shifted(each, emit))?;
        let world = World::new(&view, viewport, &self.light, &albedos, self.scene.background());
        let lookups = (&self.set as &dyn SampleSource, &visible.samples[..]);
        let shaded = look_up_packets(&world, lookups, &map, spec, &mut shifted(2 * each, emit))?;
        let shadows = Shadows::Map { map: &map, bias: self.options.bias };
        let image = world.image(&self.set, &visible.samples, shadows);
        let mut counts = map.counts;
        counts += &visible.counts;
        counts += &shaded;
        let triangles = map.triangles + visible.triangles;
        let facts = self.facts(&map, &shaded);
        let (moving, warnings) = (frame.is_moving(), self.regime_warnings());
        Ok(Drawn { image, counts, triangles, moving, lens: true, facts, warnings })
    }
}

/// The draws of a frame without culling, and the reflectance of each.
pub(crate) fn parts<'a>(scene: &'a Scene, frame: &'a Frame) -> Result<(Vec<Draw<'a>>, Vec<Vec3>), JobError> {
    let draws = frame.draws(scene)?.into_iter().map(|draw| Draw { cull: Cull::None, ..draw }).collect();
    let drawn = frame.meshes.iter().filter(|mesh| !mesh.triangles.is_empty());
    Ok((draws, drawn.map(|mesh| scene.materials()[mesh.material].base_color).collect()))
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
pub fn job(options: &OptionSource, request: &Request<'_>) -> Result<Box<dyn Job>, LoadError> {
    Ok(Box::new(SoftShadows::new(options.read()?, request.overrides, request.seed)?))
}
