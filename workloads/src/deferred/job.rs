//! The job `deferred`: the passes of a frame, deferred or forward.

use activity::Event;
use glam::{Vec2, Vec3, Vec4};
use pipeline::sampling::SampleSource;
use pipeline::{
    Attachment, Attachments, Binding, Blend, Camera, Clear, Cull, DepthState, Draw, DrawState, Format,
    Geometry, Gpu, RasterPass, Rendered, ResolvePass, Shader, SurfaceId, SurfaceSpec, Target, Viewport,
};
use serde::{Deserialize, Serialize};
use warnings::{Code, Warning};

use super::{
    CameraRays, Forward, GBuffer, LightBuffer, NormalFormat, Screen, Volume, Writer, bounds, point_lights,
};
use crate::error::LoadError;
use crate::job::{
    Drawn, DrawsScene, Fact, Flag, Flags, IMAGE_SIZE, Job, JobError, JobOptions, JobRequest, Need,
    OptionSource, facts, must_hold,
};
use crate::material::{PointLight, SurfaceShader};
use crate::samples::{SampleChoice, blur_warning, empty_warning};
use crate::scene::{Frame, Overrides, Scene};
use crate::shapes;

/// How surfaces are lit.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum LightingMethod {
    /// From a G-buffer.
    #[default]
    Deferred,
    /// As they are drawn.
    Forward,
}

/// How a G-buffer is lit.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum LightPass {
    /// By a quad over the screen that goes through all lights.
    #[default]
    Screen,
    /// By the volume of each light, whose light is added.
    Volumes,
}

/// How often a G-buffer is lit.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum LightingRate {
    /// For every sample.
    #[default]
    Sample,
    /// For the first sample of a pixel, whose light all of them get.
    Pixel,
}

/// Options of the job.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct DeferredOptions {
    /// A built-in scene or a file.
    pub scene: String,
    /// How surfaces are lit.
    pub method: LightingMethod,
    /// Point lights besides the light of the scene.
    pub lights: u32,
    /// Range of a point light, scene units.
    pub range: f32,
    /// How the G-buffer is lit.
    pub lighting: LightPass,
    /// Format of its normals.
    pub normals: NormalFormat,
    /// How often it is lit.
    pub rate: LightingRate,
}

impl JobOptions for DeferredOptions {
    const NEEDS: &'static [Need] = &[
        Need::new("lighting", "method", &["deferred"]),
        Need::new("normals", "method", &["deferred"]),
        Need::new("rate", "method", &["deferred"]),
    ];
}

impl Default for DeferredOptions {
    fn default() -> Self {
        let (method, lighting, normals, rate) = Default::default();
        Self { scene: "default".to_owned(), method, lights: 32, range: 4.0, lighting, normals, rate }
    }
}

impl DeferredOptions {
    fn check(&self) -> Result<(), LoadError> {
        must_hold([
            ("lights", &self.lights, self.lights <= 4096, "0 to 4096"),
            ("range", &self.range, (1e-15..=1e15).contains(&self.range), "1e-15 to 1e15 scene units"),
        ])
    }
}

/// Name of the sample table without a shutter.
const MULTISAMPLE: &str = "msaa";
/// Radiance of lit samples.
const LIT: Format = Format::Rgba16f;
/// State of what is drawn over the image, without depths.
fn overlay(cull: Cull, blend: Blend) -> DrawState {
    DrawState { depth: DepthState::NONE, blend, ..DrawState::new(cull) }
}

/// The job with its scene and lights.
pub struct Deferred {
    scene: Scene,
    options: DeferredOptions,
    lights: Vec<PointLight>,
    samples: Box<dyn SampleSource>,
}

impl Deferred {
    /// Makes the job in the scene of `options`, with settings changed by `overrides`.
    ///
    /// # Errors
    /// [`LoadError`] for a scene that cannot be loaded, or an invalid option.
    pub fn new(options: DeferredOptions, overrides: &Overrides, seed: u64) -> Result<Self, LoadError> {
        Self::of(crate::load(&options.scene)?, options, overrides, seed)
    }

    /// The same in a given scene. Unless `overrides` change them, pixels have one sample in the middle, and
    /// the shutter has no length; without a shutter, several samples of a pixel are those of multisampling.
    ///
    /// # Errors
    /// [`LoadError`] for an invalid option.
    pub fn of(
        scene: Scene,
        options: DeferredOptions,
        overrides: &Overrides,
        seed: u64,
    ) -> Result<Self, LoadError> {
        options.check()?;
        let shutter = overrides.shutter.unwrap_or(0.0);
        let multisample = || (shutter == 0.0).then(|| MULTISAMPLE.to_owned());
        let overrides = Overrides {
            samples: overrides.samples.or(Some(1)),
            shutter: Some(shutter),
            lens_radius: Some(0.0),
            table: overrides.table.clone().or_else(multisample),
            ..overrides.clone()
        };
        let scene = scene.with_overrides(&overrides)?;
        let wrong = |setting, message: String| LoadError::Setting { setting, message };
        let table = SampleChoice::load(&scene.settings().table)?;
        let first = scene.frame(0).map_err(|error| wrong("frames", error.to_string()))?;
        let lights = point_lights(bounds(&first), options.lights, options.range);
        let samples = table.source(scene.settings().samples, seed)?;
        Ok(Self { scene, options, lights, samples })
    }

    fn regime_warnings(&self, frame: &Frame) -> Vec<Warning> {
        let mut warnings = Vec::new();
        if self.options.method == LightingMethod::Forward {
            return warnings;
        }
        if self.options.rate == LightingRate::Pixel && self.samples.per_pixel() > 1 {
            let message = format!(
                "one of {} samples of a pixel is lit, and the others get its light: edges are not smooth; --set rate=sample",
                self.samples.per_pixel()
            );
            warnings.push(Warning::new(Code::DeferredOneSurface, message));
        }
        if frame.camera.open() != frame.camera.close() {
            let message = "the camera moves while the shutter is open, but positions are reconstructed with the camera of its opening: \
                           point lights are off for later samples; --shutter 0";
            warnings.push(Warning::new(Code::DeferredMovingCamera, message));
        }
        warnings
    }
}

impl DrawsScene for Deferred {
    fn scene(&self) -> &Scene {
        &self.scene
    }

    fn draw_frame(&self, frame: &Frame, gpu: &mut Gpu<'_>) -> Result<Drawn, JobError> {
        let settings = self.scene.settings();
        let viewport =
            Viewport::new(settings.width, settings.height).ok_or_else(|| JobError::setting(IMAGE_SIZE))?;
        let samples = self.samples.per_pixel();
        let lit = gpu.create_surface(&SurfaceSpec::new("lit samples", viewport, LIT).sampled(samples));
        let (lights, screen) = (LightBuffer::new(gpu, &self.lights), Corners::of(frame, viewport));
        let stage = Stage { job: self, frame, viewport, lit, lights, screen };
        let surfaces = stage.surfaces(gpu)?;
        // Forward rendering has no pass over the whole screen, so the counters of its frame show if it is empty.
        let (lit_runs, sees_any) = match self.options.method {
            LightingMethod::Forward => (stage.forward(&surfaces, gpu)?, true),
            LightingMethod::Deferred => stage.deferred(&surfaces, gpu)?,
        };
        let image = stage.resolve(gpu)?.into_image();
        let bytes = match self.options.method {
            LightingMethod::Forward => 0,
            LightingMethod::Deferred => GBuffer::bytes(self.options.normals) * u64::from(samples),
        };
        let facts = Fact::all([
            (fact::point_lights, self.lights.len() as f64),
            (fact::g_buffer_bytes_per_pixel, bytes as f64),
            (fact::lighting_invocations, lit_runs as f64),
        ]);
        let mut warnings = self.regime_warnings(frame);
        let moving = frame.is_moving();
        warnings.extend(blur_warning(&*self.samples, moving, false));
        warnings.extend(empty_warning(sees_any));
        Ok(Drawn { image, moving, lens: false, facts, warnings })
    }
}

/// A triangle over the whole image.
struct Corners([Vec3; 3]);

/// Its vertices.
const TRIANGLE: [[u32; 3]; 1] = [[0, 1, 2]];

impl Corners {
    /// As far away as the farthest vertex, so that reconstructed positions are between it and the camera.
    fn of(frame: &Frame, viewport: Viewport) -> Self {
        let (camera, aspect) = (&frame.camera, viewport.width() as f32 / viewport.height() as f32);
        let depth = |point: &Vec3| camera.open().transform_point3(*point).z;
        let depths = frame.meshes.iter().flat_map(|mesh| mesh.open.iter()).map(depth);
        let depth = depths.fold(2.0 * camera.near(), f32::max);
        let half = camera.half_height() * if camera.is_orthographic() { 1.0 } else { depth };
        let reach = half * (Vec2::new(aspect, 1.0) + 2.0 * camera.shift().abs()) * 1.01;
        let world = camera.open().inverse();
        Self(
            [[-1.0, -1.0], [3.0, -1.0], [-1.0, 3.0]]
                .map(|[x, y]| world.transform_point3(Vec3::new(x * reach.x, y * reach.y, depth))),
        )
    }

    fn draw<'a>(&'a self, shader: &'a dyn Shader, bindings: &'a [Binding<'a>]) -> Result<Draw<'a>, JobError> {
        let geometry = Geometry::new(&self.0, &self.0, &TRIANGLE).map_err(JobError::setting)?;
        Ok(Draw::new(geometry, shader, Cull::None)
            .with_state(overlay(Cull::None, Blend::Replace))
            .binding(bindings))
    }
}

/// A mesh with its material's shader.
struct Surfaced<'a> {
    draw: Draw<'a>,
    shader: &'a SurfaceShader,
}

/// A frame that is drawn.
struct Stage<'a> {
    job: &'a Deferred,
    frame: &'a Frame,
    viewport: Viewport,
    /// Radiance of samples, with the covered share in the last channel.
    lit: SurfaceId,
    lights: LightBuffer,
    screen: Corners,
}

impl<'a> Stage<'a> {
    fn camera(&self) -> &'a Camera {
        &self.frame.camera
    }

    fn surfaces(&self, gpu: &mut Gpu<'_>) -> Result<Vec<Surfaced<'a>>, JobError> {
        let (scene, frame) = (&self.job.scene, self.frame);
        let draws = gpu.resident(&frame.draws(scene)?);
        let shaders = frame.drawn(scene).into_iter().map(|mesh| {
            let shader = scene.shader(mesh.material, !mesh.colors.is_empty());
            shader.ok_or_else(|| JobError::setting(format_args!("there is no material {}", mesh.material)))
        });
        draws.into_iter().zip(shaders).map(|(draw, shader)| Ok(Surfaced { draw, shader: shader? })).collect()
    }

    /// Draws a pass onto surfaces with all samples; returns its shader runs.
    fn pass(
        &self,
        name: &str,
        draws: &[Draw<'_>],
        targets: &Attachments,
        gpu: &mut Gpu<'_>,
        per_sample: bool,
    ) -> Result<u64, JobError> {
        let (spec, samples) = (gpu.spec(), &*self.job.samples);
        let background = self.job.scene.background();
        let settings = pipeline::Settings { spec, viewport: self.viewport, samples, background };
        let pass = RasterPass::new(self.camera(), draws, &settings).named(name).without_image();
        let pass = pass.onto(Target::Surfaces(targets));
        let pass = if per_sample { pass.shaded_per_sample() } else { pass };
        Ok(gpu.draw(&pass)?.counts[Event::PixelInvocations])
    }

    /// Surfaces lit as they are drawn, onto cleared samples.
    fn forward(&self, surfaces: &[Surfaced<'a>], gpu: &mut Gpu<'_>) -> Result<u64, JobError> {
        let spec = SurfaceSpec::new("depths", self.viewport, Format::D32);
        let depth = gpu.create_surface(&spec.sampled(self.job.samples.per_pixel()));
        let colours = vec![Attachment::cleared(self.lit, Vec4::ZERO)];
        let depth = Some(Attachment::cleared(depth, Clear::default()).dropped());
        self.lit_forward("forward", surfaces.iter().collect(), &Attachments { colours, depth }, gpu)
    }

    fn lit_forward(
        &self,
        name: &str,
        surfaces: Vec<&Surfaced<'a>>,
        targets: &Attachments,
        gpu: &mut Gpu<'_>,
    ) -> Result<u64, JobError> {
        let forward = |of: &&Surfaced<'a>| Forward { surface: of.shader, lights: self.lights };
        let shaders: Vec<Forward<'_>> = surfaces.iter().map(forward).collect();
        let bindings = [self.lights.binding()];
        let draws =
            surfaces.iter().zip(&shaders).map(|(of, shader)| Draw { shader, ..of.draw }.binding(&bindings));
        self.pass(name, &draws.collect::<Vec<_>>(), targets, gpu, false)
    }

    /// The G-buffer of opaque surfaces, their light, and blended surfaces over them. Returns the shader runs of the
    /// light, and whether any surface is in view.
    fn deferred(&self, surfaces: &[Surfaced<'a>], gpu: &mut Gpu<'_>) -> Result<(u64, bool), JobError> {
        let (samples, normals) = (self.job.samples.per_pixel(), self.job.options.normals);
        let buffer = GBuffer::new(gpu, self.viewport, samples, normals);
        let (opaque, blended): (Vec<_>, Vec<_>) =
            surfaces.iter().partition(|of| of.draw.state.blend == Blend::Replace);
        let writers: Vec<Writer<'_>> =
            opaque.iter().map(|of| Writer { surface: of.shader, normals }).collect();
        let draws = opaque.iter().zip(&writers).map(|(of, shader)| Draw { shader, ..of.draw });
        let mut seen = self.pass("g-buffer", &draws.collect::<Vec<_>>(), &buffer.targets(), gpu, false)?;
        let runs = self.light(&buffer, surfaces, gpu)?;
        if !blended.is_empty() {
            let colours = vec![Attachment::loaded(self.lit)];
            let depth = Some(Attachment::loaded(buffer.depth).dropped());
            seen += self.lit_forward("blended", blended, &Attachments { colours, depth }, gpu)?;
        }
        Ok((runs, seen > 0))
    }

    /// Lights the G-buffer.
    fn light(&self, buffer: &GBuffer, surfaces: &[Surfaced<'a>], gpu: &mut Gpu<'_>) -> Result<u64, JobError> {
        let DeferredOptions { lighting, rate, .. } = self.job.options;
        let per_sample = rate == LightingRate::Sample;
        let (reader, rays) = (buffer.reader(per_sample), CameraRays::new(self.camera()));
        let Some(first) = surfaces.first() else { return Ok(0) };
        let [base, normal, depth] = buffer.bindings();
        let bindings = [base, normal, depth, self.lights.binding()];
        let (all, lights, by_volumes) = (&self.job.lights, self.lights, lighting == LightPass::Volumes);
        let in_loop = (!by_volumes && !all.is_empty()).then_some(lights);
        let screen = Screen { reader, rays, scene: *first.shader.lighting(), lights: in_loop };
        let volume = |(light, at): (u32, &PointLight)| Lit::new(at, Volume { reader, rays, lights, light });
        let volumes: Vec<Lit> = (0..).zip(all).filter(|_| by_volumes).map(volume).collect();
        let mut draws = vec![self.screen.draw(&screen, &bindings)?];
        for volume in &volumes {
            draws.push(volume.draw(&bindings)?);
        }
        let colours = vec![Attachment::cleared(self.lit, Vec4::ZERO)];
        let targets = Attachments { colours, depth: None };
        self.pass("lighting", &draws, &targets, gpu, per_sample)
    }

    /// The image of the lit samples.
    fn resolve(&self, gpu: &mut Gpu<'_>) -> Result<Rendered, JobError> {
        let pass = ResolvePass::new("resolve", self.lit).dropping();
        Ok(gpu.resolve_image(&pass, self.job.scene.background())?)
    }
}

/// A light with the box around its range.
struct Lit {
    shader: Volume,
    corners: Vec<Vec3>,
    triangles: std::sync::Arc<[[u32; 3]]>,
}

impl Lit {
    /// The box is a little larger than the range, so that rounding takes nothing away.
    fn new(&PointLight { position, range, .. }: &PointLight, shader: Volume) -> Self {
        let mesh = shapes::cuboid(Vec3::splat(2.0 * range * 1.001), 0);
        let corners = mesh.positions.iter().map(|corner| *corner + position).collect();
        Self { shader, corners, triangles: mesh.triangles }
    }

    /// Back faces, which are in view from inside, too.
    fn draw<'a>(&'a self, bindings: &'a [Binding<'a>]) -> Result<Draw<'a>, JobError> {
        let geometry = Geometry::new(&self.corners, &self.corners, &self.triangles);
        let draw = Draw::new(geometry.map_err(JobError::setting)?, &self.shader, Cull::Front);
        Ok(draw.with_state(overlay(Cull::Front, Blend::Add)).binding(bindings))
    }
}

facts! {
    point_lights "count" "point lights besides the light of the scene"
    g_buffer_bytes_per_pixel "bytes" "G-buffer of a pixel with all of its samples; 0 for forward rendering"
    lighting_invocations "count" "invocations of the shader that lights"
}

/// Run options in use.
pub(crate) const FLAGS: Flags = Flags {
    uses: &[Flag::Size, Flag::Samples, Flag::Shutter, Flag::Table, Flag::Clip, Flag::Camera],
    instead: &[],
};

/// Makes the job from its options.
///
/// # Errors
/// As [`Deferred::new`].
pub fn job(options: &OptionSource, request: &JobRequest<'_>) -> Result<Box<dyn Job>, LoadError> {
    Ok(Box::new(Deferred::new(options.read()?, request.overrides, request.seed)?))
}
