//! The shading pass. Each sample is shaded alone, because its light depends on its time and its point of the
//! light. The pass over the visible samples before it leaves the number of the triangle that each sample sees
//! in memory, where the shading pass fetches it.

use std::cell::Cell;

use glam::{DVec3, Vec3, Vec4};
use pipeline::geometry::Projection;
use pipeline::memory::MemoryRange;
use pipeline::sample_test::weights_on;
use pipeline::sampling::{Sample, SampleSource};
use pipeline::setup::Corner;
use pipeline::{
    Attachment, Attachments, Camera, Clear, Draw, Format, Gpu, Lane, Lanes, PassError, RasterPass, Rendered,
    Settings, Shader, ShadingPoint, SurfaceId, SurfaceSpec, SurfaceView, Target, Uses, Viewport,
};
use rayon::prelude::*;

use super::{AreaLight, DEPTH_BYTES, SceneView, ShadowMap, ShadowMethod, in_passes};
use crate::accumulation::{Face, RayCaster, RayWork, SharedSamples};
use crate::job::JobError;

/// Bytes of the reflectance of a draw.
const ALBEDO_BYTES: u64 = 12;
/// Ambient light, relative to the light on a surface that faces the light.
const AMBIENT: f32 = 0.18;

/// Source of the shadows.
#[derive(Clone, Copy)]
pub enum Shadows<'a> {
    /// A shadow map; points less than `bias` scene units behind the stored depth are lit.
    Map {
        /// The map.
        map: &'a ShadowMap,
        /// Depth bias, scene units.
        bias: f64,
    },
    /// Rays to the light, against all triangles: the ground truth.
    Rays,
    /// No shadows.
    None,
}

/// A frame to be shaded: surfaces, camera and light.
pub struct World<'a> {
    /// The camera, a pinhole.
    pub camera: &'a Camera,
    /// Size of the image.
    pub viewport: Viewport,
    /// The light.
    pub light: &'a AreaLight,
    /// Linear RGB reflectance of each draw.
    pub albedos: &'a [Vec3],
    /// Linear RGB radiance of the background.
    pub background: Vec3,
    rays: RayCaster,
    draws: &'a [Draw<'a>],
    /// First triangle of each draw.
    first: Vec<u32>,
    projection: Projection,
}

/// Surface point of a sample.
struct Point {
    place: DVec3,
    normal: DVec3,
    albedo: Vec3,
    triangle: u32,
}

/// A sample and its index in the pixel.
#[derive(Clone, Copy)]
struct Place<'s> {
    sample: &'s Sample,
    index: usize,
}

impl<'a> World<'a> {
    /// Makes the world of a frame.
    pub fn new(
        view: &SceneView<'a>,
        viewport: Viewport,
        light: &'a AreaLight,
        albedos: &'a [Vec3],
        background: Vec3,
    ) -> Self {
        let SceneView { camera, draws } = *view;
        let (projection, rays) = (Projection::new(camera, viewport), RayCaster::new(draws));
        let first = draws.iter().scan(0, |next, draw| {
            let first = *next;
            *next += draw.geometry.triangles().len() as u32;
            Some(first)
        });
        let first = first.collect();
        Self { camera, viewport, light, albedos, background, rays, draws, first, projection }
    }

    /// Renders the image: the mean over each pixel's samples, in order.
    pub fn image(&self, samples: &dyn SampleSource, seen: &[(u32, u32)], shadows: Shadows<'_>) -> Vec<Vec3> {
        self.image_counted(samples, seen, shadows).0
    }

    /// The same with the work of its rays.
    pub fn image_counted(
        &self,
        samples: &dyn SampleSource,
        seen: &[(u32, u32)],
        shadows: Shadows<'_>,
    ) -> (Vec<Vec3>, RayWork) {
        let (width, per_pixel) = (self.viewport.width(), samples.per_pixel() as usize);
        let pixel = |(place, seen): (usize, &[(u32, u32)])| {
            let place = [place as u32 % width, place as u32 / width];
            let (lanes, rays) = (Lanes::default(), Cell::default());
            let work = Work { lanes: &lanes, rays: &rays };
            (self.pixel(place, samples, |index| seen[index].0, shadows, work), rays.get())
        };
        let pixels: Vec<_> = seen.par_chunks_exact(per_pixel).enumerate().map(pixel).collect();
        let mut work = RayWork::default();
        pixels.iter().for_each(|(_, rays)| work += *rays);
        (pixels.into_iter().map(|(colour, _)| colour).collect(), work)
    }

    /// Mean of the samples of a pixel, each shaded by a program of its own, which adds its colour to those before;
    /// the last one divides. `triangle` gets the visible triangle of a sample.
    fn pixel(
        &self,
        [px, py]: [u32; 2],
        samples: &dyn SampleSource,
        triangle: impl Fn(usize) -> u32,
        shadows: Shadows<'_>,
        work: Work<'_>,
    ) -> Vec3 {
        let mut at = vec![Sample::default(); samples.per_pixel() as usize];
        samples.pixel_into(px, py, &mut at);
        let mut mean = Vec3::ZERO;
        for (index, sample) in at.iter().enumerate() {
            mean = work.lanes.run(|lane| {
                let point = self.point(lane, [px, py], sample, triangle(index));
                let is_seen = lane.branch(point.is_some());
                let colour = match point.filter(|_| is_seen) {
                    Some(point) => self.shade(lane, &point, Place { sample, index }, shadows, work),
                    None => self.background,
                };
                let sum = lane.add(mean, colour);
                if index + 1 < at.len() { sum } else { divided(lane, sum, at.len()) }
            });
        }
        mean
    }

    /// Fetches what the point of a sample is made of: positions of the triangle, and the reflectance of its
    /// draw, which are in `albedos`.
    fn fetch(&self, lanes: &Lanes, triangle: u32, albedos: MemoryRange) {
        let Some(face) = self.rays.faces().get(triangle as usize) else { return };
        let data = self.draws[face.draw].data_of(triangle - self.first[face.draw]);
        data.iter().flatten().for_each(|&(address, bytes)| lanes.load(address, bytes));
        lanes.load(albedos.address() + face.draw as u64 * ALBEDO_BYTES, ALBEDO_BYTES);
    }

    /// For each sample, whether its point is lit; `None` if it sees no surface that faces the light.
    pub fn lit_and_unlit(
        &self,
        samples: &dyn SampleSource,
        seen: &[(u32, u32)],
        shadows: Shadows<'_>,
    ) -> Vec<Option<bool>> {
        let (width, per_pixel) = (self.viewport.width(), samples.per_pixel() as usize);
        let pixel = |(place, seen): (usize, &[(u32, u32)])| {
            let [px, py] = [place as u32 % width, place as u32 / width];
            let mut at = vec![Sample::default(); per_pixel];
            samples.pixel_into(px, py, &mut at);
            let of = |(index, (sample, (triangle, _))): (usize, (&Sample, &(u32, u32)))| {
                let lane = Lane::default();
                let point = self.point(&lane, [px, py], sample, *triangle)?;
                let toward = self.light.point(&lane, [sample.u, sample.v]) - point.place;
                let (lanes, rays) = (Lanes::default(), Cell::default());
                let work = Work { lanes: &lanes, rays: &rays };
                let is_lit = || self.is_lit(&lane, &point, Place { sample, index }, shadows, work);
                (point.normal.dot(toward) > 0.0).then(is_lit)
            };
            at.iter().zip(seen).enumerate().map(of).collect::<Vec<_>>()
        };
        seen.par_chunks_exact(per_pixel).enumerate().flat_map_iter(pixel).collect()
    }

    /// Surface point of a sample. All of it is computed on the lane: the pass covers the image and fetches triangles,
    /// which no interpolator has seen.
    fn point(&self, lane: &Lane, pixel: [u32; 2], sample: &Sample, triangle: u32) -> Option<Point> {
        let face = self.rays.faces().get(triangle as usize)?;
        let is_still = self.draws[face.draw].geometry.is_still();
        let weights = self.weights(lane, pixel, sample, (face, is_still));
        let corners = face.at_on(lane, sample.t, is_still);
        let [first, second, third] = weights.map(DVec3::splat);
        let place = lane.madd(second, corners[1], lane.mul(first, corners[0]));
        let place = lane.madd(third, corners[2], place);
        let [across, along] = [1, 2].map(|k| lane.sub(corners[k], corners[0]));
        let normal = lane.normalize(lane.cross(across, along));
        let to_camera = lane.sub(self.projection.eye().truncate().as_dvec3(), place);
        let normal = lane.select_greater([0.0, lane.dot(normal, to_camera)], -normal, normal);
        let albedo = self.albedos.get(face.draw).copied().unwrap_or(Vec3::ONE);
        Some(Point { place, normal, albedo, triangle })
    }

    /// Barycentric weights of a sample in its triangle, whose vertices a lane projects. What does not move in a whole
    /// draw is projected once, and is not interpolated in time.
    fn weights(
        &self,
        lane: &Lane,
        [px, py]: [u32; 2],
        sample: &Sample,
        (face, is_still): (&Face, bool),
    ) -> [f64; 3] {
        let is_still = is_still && self.camera.open() == self.camera.close();
        let [x, y] = [(px, sample.x, self.viewport.width()), (py, sample.y, self.viewport.height())]
            .map(|(pixel, within, side)| lane.add(lane.sub(pixel as f32, 0.5 * side as f32), within));
        let seen = std::array::from_fn(|k| {
            let vertex = self.projection.vertex_on(lane, face.ends.map(|corners| corners[k]), is_still);
            let [vx, vy, w] = Corner::vertex_on(lane, &vertex, sample.t, is_still);
            [lane.fused(-x, w, vx), lane.fused(-y, w, vy), w]
        });
        weights_on(lane, &seen).unwrap_or([1.0 / 3.0; 3])
    }

    /// Lambert's law for one point of the light, plus ambient light.
    fn shade(&self, lane: &Lane, point: &Point, at: Place<'_>, shadows: Shadows<'_>, work: Work<'_>) -> Vec3 {
        let light = self.light.point(lane, [at.sample.u, at.sample.v]);
        let toward = lane.normalize(lane.sub(light, point.place));
        let facing = lane.max(lane.dot(point.normal, toward), 0.0) as f32;
        let lit = lane.branch(facing > 0.0) && self.is_lit(lane, point, at, shadows, work);
        lane.scale(point.albedo, lane.add(AMBIENT, if lit { facing } else { 0.0 }))
    }

    fn is_lit(
        &self,
        lane: &Lane,
        point: &Point,
        Place { sample, index }: Place<'_>,
        shadows: Shadows<'_>,
        work: Work<'_>,
    ) -> bool {
        match shadows {
            Shadows::Map { map, bias } => {
                let at = (point.place.as_vec3(), index);
                map.is_lit(lane, self.light, at, bias, |place| {
                    work.lanes.fetch(map.address(place), DEPTH_BYTES);
                })
            }
            Shadows::Rays => {
                let lens = [sample.u, sample.v];
                let light = self.light.point(&Lane::default(), lens);
                let mut rays = work.rays.get();
                let blocked =
                    self.rays.is_blocked(point.place, (light, lens), sample.t, point.triangle, &mut rays);
                work.rays.set(rays);
                !blocked
            }
            Shadows::None => true,
        }
    }
}

/// A sum of `count` colours divided by their number. Quotients in double precision round to those in single precision.
fn divided(lane: &Lane, sum: Vec3, count: usize) -> Vec3 {
    Vec3::from(sum.to_array().map(|channel| lane.div(f64::from(channel), count as f64) as f32))
}

/// Where the work of shading a pixel is counted.
#[derive(Clone, Copy)]
struct Work<'w> {
    lanes: &'w Lanes,
    rays: &'w Cell<RayWork>,
}

/// Shades the visible samples in a pass of its own. A program fetches the number of the triangle of its
/// sample, then the triangle; where its draw is not resident, only what it reflects.
///
/// # Errors
/// [`PassError`] if the GPU refuses the pass.
pub fn look_ups(
    world: &World<'_>,
    samples: &dyn SampleSource,
    seen: &VisibleTriangles,
    shadows: Shadows<'_>,
    gpu: &mut Gpu<'_>,
) -> Result<Rendered, PassError> {
    let albedos = gpu.allocate(world.albedos.len() as u64 * ALBEDO_BYTES);
    let map = if let Shadows::Map { map, .. } = shadows { map.surfaces() } else { &[] };
    let uses = Uses::default()
        .reading([albedos])
        .reading(map.iter().copied())
        .reading(seen.surfaces.iter().map(|numbers| numbers.view.region()))
        .reading(world.draws.iter().filter_map(Draw::ranges).flatten());
    gpu.shade_pixels("look-ups", world.viewport, uses, |lanes, pixel| {
        let work = Work { lanes, rays: &Cell::default() };
        let triangle = |index| {
            let triangle = seen.fetch(lanes, pixel, index);
            world.fetch(lanes, triangle, albedos);
            triangle
        };
        world.pixel(pixel, samples, triangle, shadows, work)
    })
}

/// Triangles that a surface of numbers distinguishes: shaders compute them in single precision.
const MAX_TRIANGLES: usize = 1 << 24;
/// Bytes of a number.
const NUMBER_BYTES: u64 = 4;

/// The triangle that each sample sees, numbered as in a pass, in one surface of all samples or in one for
/// each of them.
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
        method: ShadowMethod,
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

    /// Whether any sample sees one.
    pub fn is_any(&self) -> bool {
        self.surfaces.iter().flat_map(|numbers| &numbers.of).any(|&number| number != u32::MAX)
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
