//! The pass over the visible samples: it leaves the number of the triangle that each sample sees in memory, where the
//! shading pass fetches it.

use glam::{Vec3, Vec4};
use pipeline::{
    Attachment, Attachments, Clear, Draw, Format, Gpu, Lane, Lanes, RasterPass, Settings, Shader,
    ShadingPoint, SurfaceId, SurfaceSpec, SurfaceView, Target, Viewport,
};

use super::map::{Method, SceneView, in_passes};
use crate::accumulation::SharedSamples;
use crate::job::JobError;

/// Triangles that a surface of numbers distinguishes: shaders compute them in single precision.
const MAX_TRIANGLES: usize = 1 << 24;
/// Bytes of a number.
const NUMBER_BYTES: u64 = 4;

/// The triangle that each sample sees, numbered as in a pass, in one surface of all samples or in one for each of them.
pub struct VisibleTriangles {
    surfaces: Vec<Numbers>,
    width: u32,
}

/// A surface of numbers.
struct Numbers {
    view: SurfaceView,
    /// In the order `(y width + x) n + index`; `u32::MAX` for none.
    of: Vec<u32>,
}

/// Writes the number of a triangle; those of its draw begin with `first`.
struct Numbering {
    first: u32,
}

impl Shader for Numbering {
    fn shade(&self, lane: &Lane, at: &ShadingPoint, _: Vec4) -> Vec4 {
        Vec4::splat(lane.add(self.first, at.triangle) as f32)
    }
}

impl VisibleTriangles {
    /// Draws `view` at the samples of `set`.
    ///
    /// # Errors
    /// [`JobError`] if the hardware cannot be built, or for more triangles than single precision distinguishes.
    pub fn draw(
        view: &SceneView<'_>,
        viewport: Viewport,
        set: &SharedSamples,
        method: Method,
        gpu: &mut Gpu<'_>,
    ) -> Result<Self, JobError> {
        let triangles: usize = view.draws.iter().map(|draw| draw.geometry.triangles().len()).sum();
        if triangles > MAX_TRIANGLES {
            let most = format_args!(
                "soft shadows distinguish {MAX_TRIANGLES} triangles, and the scene has {triangles}"
            );
            return Err(JobError::setting(most));
        }
        let surfaces = in_passes(view, (viewport, set, method), gpu, |view, samples, gpu| {
            numbers(view, viewport, samples, gpu)
        })?;
        Ok(Self { surfaces, width: viewport.width() })
    }

    /// The number of the triangle that a sample of a pixel sees; `u32::MAX` for none.
    pub fn at(&self, [x, y]: [u32; 2], sample: usize) -> u32 {
        let (numbers, sample, count) = self.place(sample);
        numbers.of[(y * self.width + x) as usize * count + sample]
    }

    /// The same, fetched by a lane.
    pub(super) fn fetch(&self, lanes: &Lanes, pixel: [u32; 2], sample: usize) -> u32 {
        let (numbers, index, _) = self.place(sample);
        let address = numbers.view.address(pixel, index as u32);
        address.into_iter().for_each(|address| lanes.fetch(address, NUMBER_BYTES));
        self.at(pixel, sample)
    }

    /// Surface of a sample, and its index and the number of samples there.
    fn place(&self, sample: usize) -> (&Numbers, usize, usize) {
        match &self.surfaces[..] {
            [all] => (all, sample, all.view.samples() as usize),
            each => (&each[sample], 0, 1),
        }
    }
}

/// Draws the numbers of triangles onto a new surface. Depths end with the pass.
fn numbers(
    view: &SceneView<'_>,
    viewport: Viewport,
    set: &SharedSamples,
    gpu: &mut Gpu<'_>,
) -> Result<Numbers, JobError> {
    let mut first = 0;
    let numbering = view.draws.iter().map(|draw| {
        let shader = Numbering { first };
        first += draw.geometry.triangles().len() as u32;
        shader
    });
    let numbering: Vec<Numbering> = numbering.collect();
    let draws = view.draws.iter().zip(&numbering).map(|(draw, shader)| Draw { shader, ..*draw });
    let draws: Vec<Draw<'_>> = draws.collect();
    let surface = |gpu: &mut Gpu<'_>, name, format| {
        gpu.create_surface(&SurfaceSpec::new(name, viewport, format).sampled(set.samples().len() as u32))
    };
    let (to, depth) = (surface(gpu, "triangles", Format::R32u), surface(gpu, "depths", Format::D32));
    let colours = vec![Attachment::cleared(to, Vec4::splat(u32::MAX as f32))];
    let depth = Some(Attachment::cleared(depth, Clear::default()).dropped());
    let targets = Attachments { colours, depth };
    let settings = Settings { spec: gpu.spec(), viewport, samples: set, background: Vec3::ZERO };
    let pass = RasterPass::new(view.camera, &draws, &settings).named("triangles").without_image();
    gpu.draw(&pass.onto(Target::Surfaces(&targets)))?;
    stored(to, gpu).ok_or_else(|| JobError::setting("the pass left no triangles"))
}

/// What a pass left in a surface of numbers. A value beyond single precision saturates, as that for none does.
fn stored(surface: SurfaceId, gpu: &mut Gpu<'_>) -> Option<Numbers> {
    let of = gpu.contents(surface)?.into_iter().map(|value| value.x as u32).collect();
    Some(Numbers { view: gpu.surface_view(surface)?, of })
}
