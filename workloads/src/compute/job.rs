//! The job `compute`: raster passes draw a scene, and groups of lanes work on what they stored.

use glam::{Vec3, Vec4};
use pipeline::random::{mix, unit_single};
use pipeline::surface::{Format, SurfaceSpec};
use pipeline::texture::LUMINANCE;
use pipeline::{
    Attachment, Attachments, Clear, Compare, DepthState, Draw, DrawState, Gpu, Lane, LensShape, RasterPass,
    ResolvePass, SampleTable, Shader, ShadingPoint, SurfaceId, SurfaceView, Target, Texture, Viewport,
};
use warnings::{Code, Warning};

use super::kernels::{Kernels, LightSphere};
use super::luminance::Show;
use super::{ComputeOptions, Kernel};
use crate::error::LoadError;
use crate::job::{
    Drawn, DrawsScene, Fact, Flag, Flags, IMAGE_SIZE, Job, JobError, JobRequest, OptionSource, facts,
};
use crate::scene::{Frame, Overrides, Scene};

facts! {
    mean_luminance "luminance" "mean luminance of the image"
    cycles_per_shared_access "ratio" "cycles of an access of a warp to shared memory over the fewest possible, mean"
    values_counted "count" "pixels that the histogram counts"
    fullest_bin_share "share" "of these, those in the fullest bin"
    atomics_in_line "count" "atomics that wait for each other in an access of a warp, mean; 1 without conflicts"
    lights_per_tile "count" "lights that reach a tile, mean over tiles"
    most_lights "count" "lights that reach the tile with the most"
    tiles_full "count" "tiles with more lights than a list holds"
}

/// Run options in use. Scenes are drawn without motion and lens, as bounds of tiles hold for one view.
pub(crate) const FLAGS: Flags =
    Flags { uses: &[Flag::Size, Flag::Samples, Flag::Clip, Flag::Camera], instead: &[] };

/// Makes the job `compute`.
///
/// # Errors
/// As [`Compute::new`].
pub fn job(options: &OptionSource, request: &JobRequest<'_>) -> Result<Box<dyn Job>, LoadError> {
    Ok(Box::new(Compute::new(options.read()?, request.overrides, request.seed)?))
}

/// Cycles of an access to shared memory, on average, from which a reduction gives a warning: half of the rate
/// is lost.
pub const CYCLES_PER_ACCESS: f64 = 2.0;
/// Atomics of a warp on a word, or cycles of one in shared memory, on average, from which a histogram gives a
/// warning: a quarter of a warp of 32 waits in line.
pub const ATOMICS_PER_WORD: f64 = 8.0;

/// Grey to which a lower contrast draws all colours.
const GREY: Vec3 = Vec3::splat(0.18);

/// A scene, and what groups compute of it.
pub struct Compute {
    scene: Scene,
    options: ComputeOptions,
    samples: SampleTable,
    seed: u64,
}

impl Compute {
    /// The job with its scene, with a sample a pixel unless `overrides` say otherwise.
    ///
    /// # Errors
    /// [`LoadError`] for a scene that cannot be loaded, or an invalid option or setting.
    pub fn new(options: ComputeOptions, overrides: &Overrides, seed: u64) -> Result<Self, LoadError> {
        options.check()?;
        let samples = overrides.samples.unwrap_or(1);
        let still = Overrides {
            shutter: Some(0.0),
            lens_radius: Some(0.0),
            samples: Some(samples),
            ..overrides.clone()
        };
        let scene = crate::load(&options.scene)?.with_overrides(&still)?;
        let samples = SampleTable::low_discrepancy(samples, seed, LensShape::Disk);
        let samples =
            samples.map_err(|error| LoadError::Setting { setting: "samples", message: error.to_string() })?;
        Ok(Self { scene, options, samples, seed })
    }

    /// Size of the image.
    ///
    /// # Errors
    /// [`JobError`] if it has no pixels, or too many.
    pub fn viewport(&self) -> Result<Viewport, JobError> {
        let settings = self.scene.settings();
        Viewport::new(settings.width, settings.height).ok_or_else(|| JobError::setting(IMAGE_SIZE))
    }

    /// Samples of the pixels.
    pub fn samples(&self) -> &SampleTable {
        &self.samples
    }

    /// Draws the depths of a frame.
    ///
    /// # Errors
    /// [`JobError`] if they cannot be drawn.
    pub fn depths(&self, frame: &Frame, gpu: &mut Gpu<'_>) -> Result<SurfaceId, JobError> {
        let depth = self.surface(gpu, "depth", Format::D32)?;
        let to =
            Attachments { colours: Vec::new(), depth: Some(Attachment::cleared(depth, Clear::default())) };
        let opaque = frame.draws(&self.scene)?;
        let opaque: Vec<Draw<'_>> = opaque.into_iter().filter(|draw| draw.state.depth.write).collect();
        self.raster("depth pre-pass", (frame, &opaque), &to, gpu)?;
        Ok(depth)
    }

    /// Draws the image of a frame, on the depths of a pre-pass if there is one.
    ///
    /// # Errors
    /// [`JobError`] if it cannot be drawn.
    pub fn image(
        &self,
        frame: &Frame,
        prepass: Option<SurfaceId>,
        gpu: &mut Gpu<'_>,
    ) -> Result<SurfaceId, JobError> {
        let levels = if self.is_chained() { u32::MAX } else { 1 };
        let image = gpu.create_surface(&self.surface_spec("image", Format::Rgba16f)?.with_levels(levels));
        let depth = match prepass {
            Some(depth) => Attachment::loaded(depth),
            None => Attachment::cleared(self.surface(gpu, "depth", Format::D32)?, Clear::default()).dropped(),
        };
        let mut draws = frame.draws(&self.scene)?;
        if prepass.is_some() {
            draws = draws.into_iter().map(after_prepass).collect();
        }
        let background = self.flattened(self.scene.background()).extend(1.0);
        let colours = vec![Attachment::cleared(image, background)];
        let to = Attachments { colours, depth: Some(depth) };
        let flat: Vec<Flattened<'_>> =
            draws.iter().map(|draw| Flattened { shader: draw.shader, job: self }).collect();
        if self.options.contrast < 1.0 {
            draws = draws.iter().zip(&flat).map(|(draw, flat)| Draw { shader: flat, ..*draw }).collect();
        }
        self.raster("image", (frame, &draws), &to, gpu)?;
        Ok(image)
    }

    /// Spheres that lights reach, spread evenly over the bounds of a frame.
    pub fn lights(&self, frame: &Frame) -> Result<Vec<LightSphere>, JobError> {
        let draws = frame.draws(&self.scene)?;
        let points = || draws.iter().flat_map(|draw| draw.geometry.open().iter().copied());
        let Some((low, high)) = points().reduce(Vec3::min).zip(points().reduce(Vec3::max)) else {
            return Ok(Vec::new());
        };
        let radius = self.options.light_radius * (high - low).length();
        let uniform =
            |light: u32, axis: u64| unit_single(mix(mix(self.seed ^ axis << 32) ^ u64::from(light)));
        let centre = |light| low + (high - low) * Vec3::from([0, 1, 2].map(|axis| uniform(light, axis)));
        Ok((0..self.options.lights).map(|light| LightSphere { centre: centre(light), radius }).collect())
    }

    /// Draws the image of a frame with one sample per pixel, and its mip chain. Samples of a pixel are
    /// resolved first. The last level is the mean, without the columns and rows that odd sizes leave out.
    ///
    /// # Errors
    /// [`JobError`] if it cannot be drawn.
    pub fn chain(&self, frame: &Frame, gpu: &mut Gpu<'_>) -> Result<Chain, JobError> {
        let image = self.image(frame, None, gpu)?;
        let spec = SurfaceSpec::new("pixels", self.viewport()?, Format::Rgba16f).mipmapped();
        let pixels = if self.is_chained() { image } else { gpu.create_surface(&spec) };
        if pixels != image {
            gpu.resolve(&ResolvePass::new("resolve", image).dropping(), pixels)?;
        }
        gpu.make_levels(CHAIN, pixels)?;
        let last = pixels.level(spec.levels - 1);
        let mean = gpu.contents(last).and_then(|texels| Some(texels.first()?.truncate()));
        Ok(Chain { pixels, last, mean: mean.unwrap_or_default().dot(LUMINANCE) })
    }

    /// Whether the image itself has a mip chain: samples of a pixel have to be resolved first.
    fn is_chained(&self) -> bool {
        self.options.kernel == Kernel::MipChain && self.samples.per_pixel() == 1
    }

    fn surface(&self, gpu: &mut Gpu<'_>, name: &str, format: Format) -> Result<SurfaceId, JobError> {
        Ok(gpu.create_surface(&self.surface_spec(name, format)?))
    }

    fn surface_spec<'n>(&self, name: &'n str, format: Format) -> Result<SurfaceSpec<'n>, JobError> {
        Ok(SurfaceSpec::new(name, self.viewport()?, format).sampled(self.scene.settings().samples))
    }

    fn raster(
        &self,
        name: &str,
        (frame, draws): (&Frame, &[Draw<'_>]),
        to: &Attachments,
        gpu: &mut Gpu<'_>,
    ) -> Result<(), JobError> {
        let (spec, viewport, background) = (gpu.spec(), self.viewport()?, self.scene.background());
        let settings = pipeline::Settings { spec, viewport, samples: &self.samples, background };
        let pass = RasterPass::new(&frame.camera, draws, &settings).named(name);
        gpu.draw(&pass.onto(Target::Surfaces(to)).without_image())?;
        Ok(())
    }

    fn flattened(&self, color: Vec3) -> Vec3 {
        GREY + (color - GREY) * self.options.contrast
    }
}

/// The draw on the depths of a pre-pass, which its nearest samples equal.
fn after_prepass(draw: Draw<'_>) -> Draw<'_> {
    let depth = DepthState { test: Compare::LessEqual, write: false };
    draw.with_state(DrawState { depth, ..draw.state })
}

/// A shader with less contrast.
struct Flattened<'a> {
    shader: &'a dyn Shader,
    job: &'a Compute,
}

impl Shader for Flattened<'_> {
    fn texture(&self) -> Option<&Texture> {
        self.shader.texture()
    }

    fn vertex(&self, lane: &Lane, position: Vec3) {
        self.shader.vertex(lane, position);
    }

    fn shade(&self, lane: &Lane, at: &ShadingPoint, texel: Vec4) -> Vec4 {
        let color = self.shader.shade(lane, at, texel);
        let contrast = self.job.options.contrast;
        lane.madd(Vec3::splat(contrast), color.truncate(), GREY * (1.0 - contrast)).extend(color.w)
    }

    fn may_discard(&self) -> bool {
        self.shader.may_discard()
    }
}

/// Start of the names of the passes that draw a mip chain.
pub const CHAIN: &str = "mean";

/// A mip chain of the image.
#[derive(Clone, Copy, Debug)]
pub struct Chain {
    /// The surface, at its finest level.
    pub pixels: SurfaceId,
    /// Last level of the chain, of one texel.
    pub last: SurfaceId,
    /// Luminance of that texel.
    pub mean: f32,
}

impl DrawsScene for Compute {
    fn scene(&self) -> &Scene {
        &self.scene
    }

    fn draw_frame(&self, frame: &Frame, gpu: &mut Gpu<'_>) -> Result<Drawn, JobError> {
        gpu.spec().compute.map_or(Ok(()), |spec| self.options.check_for(&spec))?;
        match self.options.kernel {
            Kernel::Reduction => self.expose(frame, gpu),
            Kernel::MipChain => self.expose_by_chain(frame, gpu),
            Kernel::Histogram => self.equalise(frame, gpu),
            Kernel::LightCulling => self.heat(frame, gpu),
        }
    }
}

/// Warns if the chain leaves out pixels. Each level halves a side and drops the rest, so a power of two is
/// left of it.
fn left_out(viewport: Viewport) -> Option<Warning> {
    let [columns, rows] = [viewport.width(), viewport.height()].map(|side| 1_usize << side.ilog2());
    let share = (columns * rows) as f64 / viewport.pixels() as f64;
    (share < 1.0).then(|| {
        let message = format!(
            "levels of odd size leave out their last row or column: the mean is that of {columns} x {rows} pixels, {:.0} % of the image; \
             --set kernel=reduction takes all",
            100.0 * share
        );
        Warning::new(Code::MipChainOdd, message)
    })
}

fn view(gpu: &mut Gpu<'_>, id: SurfaceId) -> Result<SurfaceView, JobError> {
    gpu.surface_view(id).ok_or_else(|| JobError::setting("a pass stored nothing"))
}

impl Compute {
    fn expose(&self, frame: &Frame, gpu: &mut Gpu<'_>) -> Result<Drawn, JobError> {
        let image = self.image(frame, None, gpu)?;
        let image = view(gpu, image)?;
        let mut kernels = Kernels::new(gpu, &self.options)?;
        let mean = kernels.mean_luminance(&image)?;
        let cycles = kernels.cycles_per_shared_access();
        let facts = [
            (fact::mean_luminance, f64::from(kernels.values(mean)[0])),
            (fact::cycles_per_shared_access, cycles),
        ];
        let padding = if self.options.padded || !kernels.padding_fits() { "" } else { ", or padded=true," };
        let message = || {
            format!(
                "an access of a warp to shared memory takes {cycles:.1} cycles on average (a warning from {CYCLES_PER_ACCESS} on): lanes ask a bank \
                 for several words; order=sequential with stride=1{padding} avoids it"
            )
        };
        let warning = (cycles >= CYCLES_PER_ACCESS).then(|| Warning::new(Code::BankConflicts, message()));
        let shown = kernels.display(&image, Show::Exposed(mean), &[mean.reads()])?;
        let (facts, warnings) = (Fact::all(facts), warning.into_iter().collect());
        Ok(Drawn { image: shown, facts, warnings, ..Drawn::default() })
    }

    fn expose_by_chain(&self, frame: &Frame, gpu: &mut Gpu<'_>) -> Result<Drawn, JobError> {
        let Chain { pixels, last, mean } = self.chain(frame, gpu)?;
        let (image, level) = (view(gpu, pixels)?, view(gpu, last)?);
        let mut kernels = Kernels::new(gpu, &self.options)?;
        let shown = kernels.display(&image, Show::ExposedBy(level), &[level.reads()])?;
        let facts = Fact::all([(fact::mean_luminance, f64::from(mean))]);
        let warnings = left_out(self.viewport()?).into_iter().collect();
        Ok(Drawn { image: shown, facts, warnings, ..Drawn::default() })
    }

    fn equalise(&self, frame: &Frame, gpu: &mut Gpu<'_>) -> Result<Drawn, JobError> {
        let image = self.image(frame, None, gpu)?;
        let image = view(gpu, image)?;
        let mut kernels = Kernels::new(gpu, &self.options)?;
        let counts = kernels.histogram(&image)?;
        let bins = kernels.values(counts);
        let in_line = kernels.atomics_in_line(bins.iter().copied().map(u64::from).sum());
        let sums = kernels.sums(counts)?;
        let [all, most] = [bins.iter().sum::<u32>(), bins.iter().copied().max().unwrap_or(0)].map(f64::from);
        let facts = [
            (fact::values_counted, all),
            (fact::fullest_bin_share, most / all.max(1.0)),
            (fact::atomics_in_line, in_line),
        ];
        let message = || {
            format!(
                "an atomic waits for {:.1} others on average (a warning from {} on), as lanes of a warp count in the same bin: the fullest has {:.0} % \
                 of the values; more copies with padded=true help in shared memory",
                in_line - 1.0,
                ATOMICS_PER_WORD - 1.0,
                100.0 * most / all.max(1.0)
            )
        };
        let warning = (in_line >= ATOMICS_PER_WORD).then(|| Warning::new(Code::AtomicContention, message()));
        let shown = kernels.display(&image, Show::Equalised(sums), &[sums.reads()])?;
        let (facts, warnings) = (Fact::all(facts), warning.into_iter().collect());
        Ok(Drawn { image: shown, facts, warnings, ..Drawn::default() })
    }

    fn heat(&self, frame: &Frame, gpu: &mut Gpu<'_>) -> Result<Drawn, JobError> {
        let (lights, viewport) = (self.lights(frame)?, self.viewport()?);
        let depth = self.depths(frame, gpu)?;
        let stored = view(gpu, depth)?;
        let mut kernels = Kernels::new(gpu, &self.options)?;
        let found = kernels.cull(&stored, (&frame.camera, viewport), &lights)?;
        let tiles = kernels.tile_lights(&found);
        let full = tiles.counts.iter().filter(|count| **count > self.options.list).count();
        let image = self.image(frame, Some(depth), gpu)?;
        let image = view(gpu, image)?;
        let (lists, blocks) = found;
        let show = Show::Heat { counts: lists.counts, most: lists.most, tiles: blocks };
        let reads = [lists.counts.reads(), lists.most.reads()];
        let shown = Kernels::new(gpu, &self.options)?.display(&image, show, &reads)?;
        let sum: u64 = tiles.counts.iter().copied().map(u64::from).sum();
        let facts = [
            (fact::lights_per_tile, sum as f64 / tiles.counts.len() as f64),
            (fact::most_lights, f64::from(tiles.counts.iter().copied().max().unwrap_or(0))),
            (fact::tiles_full, full as f64),
        ];
        let message = || {
            format!(
                "{full} of {} tiles have more lights than the {} of a list, and lose the others; a longer list=..., a smaller tile_px or \
                 depth_bounds=true help",
                tiles.counts.len(),
                self.options.list
            )
        };
        let warning = (full > 0).then(|| Warning::new(Code::LightListsFull, message()));
        let (facts, warnings) = (Fact::all(facts), warning.into_iter().collect());
        Ok(Drawn { image: shown, facts, warnings, ..Drawn::default() })
    }
}
