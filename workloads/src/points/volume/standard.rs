//! Standard mode: a pass draws the triangles that bound a volume, and its pixel shader keeps the samples inside.

use std::f64::consts::{PI, TAU};

use glam::{Affine3A, Vec3, Vec4};
use pipeline::sampling::{Sample, SampleSource};
use pipeline::{
    Camera, FrameReport, Gpu, Lane, Lens, PassError, PipelineSpec, RasterPass, Settings, Shader,
    ShadingPoint, Viewport,
};

use super::{DEPTH, Layer, MARGIN, Prisms, SamplePoint};

/// A volume in the space of samples.
pub trait Volume: Sync {
    /// Whether a sample is inside, with operations that the lane counts.
    fn has(&self, lane: &Lane, point: &SamplePoint) -> bool;

    /// Moving triangles around it.
    fn prisms(&self) -> Vec<Prisms>;

    /// Radius of the lens that shears them, in units of the square.
    fn lens(&self) -> f64 {
        0.0
    }
}

/// A disk that moves and grows while the shutter is open, out of the focus of a lens: four dimensions at
/// rest, five in motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Blurred {
    /// Radius at time 0 and 1.
    pub radius: [f64; 2],
    /// Middle at time 0 and 1, seen from the middle of the lens. With blur and radius it stays in the unit square.
    pub middle: [[f64; 2]; 2],
    /// How far a ray from the border of the lens is moved.
    pub blur: f64,
}

impl Blurred {
    /// At rest: x, y, u, v.
    pub const FOUR: Self = Self { radius: [0.2; 2], middle: [[0.5; 2]; 2], blur: 0.25 };
    /// In motion: x, y, u, v, t.
    pub const FIVE: Self = Self { radius: [0.1, 0.2], middle: [[0.4, 0.35], [0.55, 0.6]], blur: 0.15 };

    /// Share of the samples' space.
    pub fn volume(&self) -> f64 {
        let [a, b] = self.radius;
        PI / 3.0 * (a * a + a * b + b * b)
    }

    /// Integral of the squared distance from the axis of the disk, as a share of the samples' space.
    pub fn moment(&self) -> f64 {
        let [a, b] = self.radius;
        // Of a disk it is pi r^4 / 2, and r grows evenly.
        let fourth = (0..=4).map(|k| a.powi(k) * b.powi(4 - k)).sum::<f64>() / 5.0;
        0.5 * PI * fourth
    }

    /// Squared distance from the axis.
    pub fn from_axis(&self, lane: &Lane, &[x, y, t, u, v]: &SamplePoint) -> f64 {
        let apart = |at: f64, lens: f64, axis: usize| {
            let [open, close] = self.middle.map(|middle| middle[axis]);
            let middle = lane.madd(t, close - open, open);
            lane.sub(at, lane.madd(lens, self.blur, middle))
        };
        let [x, y] = [apart(x, u, 0), apart(y, v, 1)];
        lane.madd(y, y, lane.mul(x, x))
    }
}

/// Corners of the polygon around a disk.
const CORNERS: u32 = 32;

impl Volume for Blurred {
    fn has(&self, lane: &Lane, point: &SamplePoint) -> bool {
        let radius = lane.madd(point[2], self.radius[1] - self.radius[0], self.radius[0]);
        lane.branch(self.from_axis(lane, point) <= lane.mul(radius, radius))
    }

    fn prisms(&self) -> Vec<Prisms> {
        let chord = 1.0 / libm::cos(PI / f64::from(CORNERS));
        let end = |end: usize| {
            let ([x, y], radius) = (self.middle[end], self.radius[end] * chord + MARGIN);
            let corner = |number: u32| {
                let (sine, cosine) = libm::sincos(TAU * f64::from(number) / f64::from(CORNERS));
                [x + radius * cosine, y + radius * sine]
            };
            std::iter::once([x, y]).chain((0..CORNERS).map(corner)).collect()
        };
        let triangles = (0..CORNERS).map(|n| [0, 1 + n, 1 + (n + 1) % CORNERS]).collect();
        let layer = Layer { t: [f64::NEG_INFINITY, f64::INFINITY], ends: [end(0), end(1)], triangles };
        Prisms::new(layer).into_iter().collect()
    }

    fn lens(&self) -> f64 {
        self.blur
    }
}

/// Samples of the rasterizer that were found inside.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CoveredSamples {
    /// Samples inside the volume.
    pub points: Vec<SamplePoint>,
    /// Number of samples that a triangle covers.
    pub covered: u64,
    /// Number of all samples.
    pub samples: u64,
    /// Mean over each pixel of what the shader returned: coordinates where a sample is inside, black elsewhere.
    pub image: Vec<Vec3>,
}

/// Camera of the unit square, with y up, for a square image. Its focus is at half the depth of the triangles,
/// so that a ray from the border of the lens is moved by the radius.
fn camera(lens: f64) -> Option<Camera> {
    let middle = Affine3A::from_translation(Vec3::new(-0.5, -0.5, 0.0));
    let camera = Camera::orthographic(middle, 0.5, 0.01).ok()?;
    let lens = (lens > 0.0).then(|| Lens::new(lens as f32, 0.5 * DEPTH).ok());
    Some(camera.with_lens(lens.flatten()))
}

/// Position of a sample.
fn place(sample: &Sample, pixel: [u32; 2], side: u32) -> SamplePoint {
    let across = (f64::from(pixel[0]) + f64::from(sample.x)) / f64::from(side);
    let down = (f64::from(pixel[1]) + f64::from(sample.y)) / f64::from(side);
    [across, 1.0 - down, f64::from(sample.t), f64::from(sample.u), f64::from(sample.v)]
}

/// Shader that discards samples outside of a volume, and returns x, y and t of the others.
struct Reject<'a> {
    domain: &'a dyn Volume,
    samples: &'a dyn SampleSource,
    side: u32,
}

impl Shader for Reject<'_> {
    fn shade(&self, lane: &Lane, at: &ShadingPoint, _texel: Vec4) -> Vec4 {
        let mut own = vec![Sample::default(); self.samples.per_pixel() as usize];
        let pixel = at.pixel.map(|at| at.max(0) as u32);
        self.samples.pixel_into(pixel[0], pixel[1], &mut own);
        let Some(sample) = own.get(at.sample as usize) else { return Vec4::ZERO };
        // The rasterizer has the position of the sample.
        let point = place(sample, pixel, self.side);
        let is_inside = self.domain.has(lane, &point);
        lane.discard_below(if is_inside { 1.0 } else { 0.0 }, 0.5);
        let [x, y, t, ..] = point.map(|at| at as f32);
        Vec4::new(x, y, t, 1.0)
    }

    fn may_discard(&self) -> bool {
        true
    }
}

/// Draws the triangles around a volume in a pass of `gpu`, for an image of `side` by `side` pixels. The pixel
/// shader runs on every sample that they cover and discards those outside.
///
/// # Errors
/// [`PassError`] if a cache of the GPU cannot be built, or if the surfaces are too large.
pub fn fill(
    domain: &dyn Volume,
    side: u32,
    samples: &dyn SampleSource,
    gpu: &mut Gpu<'_>,
) -> Result<CoveredSamples, PassError> {
    let (Some(camera), Some(viewport)) = (camera(domain.lens()), Viewport::new(side, side)) else {
        return Ok(CoveredSamples::default());
    };
    let (spec, background) = (gpu.spec(), Vec3::ZERO);
    let settings = Settings { spec, viewport, samples, background };
    let (prisms, shader) = (domain.prisms(), Reject { domain, samples, side });
    let draws = Prisms::draws(&prisms, &shader);
    let pass = RasterPass::new(&camera, &draws, &settings).named("volume").with_visible().shaded_per_sample();
    let drawn = gpu.draw(&pass)?;
    let hits = gpu.counts_of_pass()[activity::Event::SamplesHit];
    let mut found =
        CoveredSamples { covered: hits, samples: drawn.visible.len() as u64, ..CoveredSamples::default() };
    let is_hit = |number: usize| drawn.visible[number].0 != u32::MAX;
    each_sample(side, samples, |number, point| found.points.extend(is_hit(number).then_some(point)));
    Ok(CoveredSamples { image: drawn.into_image(), ..found })
}

/// The same on a GPU of its own, and its work.
///
/// # Errors
/// As [`fill`].
pub fn standard_mode(
    domain: &dyn Volume,
    side: u32,
    samples: &dyn SampleSource,
    spec: &PipelineSpec,
) -> Result<(CoveredSamples, FrameReport), PassError> {
    let mut gpu = Gpu::without_packets(spec)?;
    let found = fill(domain, side, samples, &mut gpu)?;
    Ok((found, gpu.finish()))
}

/// The samples inside a volume, by testing every one: the reference without a rasterizer.
pub fn every_sample(domain: &dyn Volume, side: u32, samples: &dyn SampleSource) -> Vec<SamplePoint> {
    let (lane, mut found) = (Lane::default(), Vec::new());
    each_sample(side, samples, |_, point| found.extend(domain.has(&lane, &point).then_some(point)));
    found
}

/// Every sample of an image with its number.
fn each_sample(side: u32, samples: &dyn SampleSource, mut each: impl FnMut(usize, SamplePoint)) {
    let per_pixel = samples.per_pixel() as usize;
    let mut own = vec![Sample::default(); per_pixel];
    for pixel in 0..side * side {
        let at = [pixel % side, pixel / side];
        samples.pixel_into(at[0], at[1], &mut own);
        for (index, sample) in own.iter().enumerate() {
            each(pixel as usize * per_pixel + index, place(sample, at, side));
        }
    }
}
