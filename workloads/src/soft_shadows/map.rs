//! Depth passes over a fixed set of samples, and the shadow map made by them.

use activity::Counts;
use glam::Vec3;
use pipeline::memory::MemoryRange;
use pipeline::sampling::Sample;
use pipeline::{Camera, Draw, Gpu, Lane, RasterPass, Settings, Target, Viewport};

use super::light::AreaLight;
use crate::accumulation::{SharedSamples, Snapshot};
use crate::job::JobError;

/// Bytes of a stored depth.
pub(super) const DEPTH_BYTES: u64 = 4;

/// An array of shadow maps, one per sample of light and time.
#[derive(Clone, Debug, PartialEq)]
pub struct ShadowMap {
    side: u32,
    set: SharedSamples,
    /// Depths in the order `(y side + x) n + index`, infinite for no hit.
    depths: Vec<f32>,
    /// Event counts.
    pub counts: Counts,
    surfaces: Vec<MemoryRange>,
}

impl ShadowMap {
    /// Makes a light's map of `side` by `side` texels. All texels are sampled at their centres, with the lens
    /// and time samples of `set`.
    ///
    /// # Errors
    /// [`JobError`] if the hardware cannot be built, or `side` is odd. A ray through the exact centre of the
    /// map has no slope to absorb the rest of a focus at infinity.
    pub fn new(
        light: &AreaLight,
        draws: &[Draw<'_>],
        side: u32,
        set: &SharedSamples,
        method: Method,
        gpu: &mut Gpu<'_>,
    ) -> Result<Self, JobError> {
        let viewport = Viewport::new(side, side).filter(|_| side.is_multiple_of(2));
        let refused =
            || JobError::setting(format_args!("map_px {side}: a shadow map has an even number of texels"));
        let viewport = viewport.ok_or_else(refused)?;
        let set = set.centred();
        let seen = depth_pass(&SceneView { camera: light.camera(), draws }, viewport, &set, method, gpu)?;
        let depths = seen.samples.into_iter().map(|(_, depth)| f32::from_bits(depth)).collect();
        Ok(Self { side, set, depths, counts: seen.counts, surfaces: seen.surfaces })
    }

    /// Texels across and down.
    pub fn side(&self) -> u32 {
        self.side
    }

    /// All depths.
    pub fn depths(&self) -> &[f32] {
        &self.depths
    }

    /// Bytes of the map.
    pub fn bytes(&self) -> u64 {
        DEPTH_BYTES * self.depths.len() as u64
    }

    /// Index in [`Self::depths`] that decides about a point for sample `index` of the set, and the point's
    /// depth; `None` outside the map.
    pub fn place(&self, lane: &Lane, light: &AreaLight, point: Vec3, index: usize) -> Option<(usize, f64)> {
        let Sample { u, v, .. } = self.set.samples()[index];
        let ([x, y], depth) = light.texel(lane, point, [u, v], self.side)?;
        let texel = y as usize * self.side as usize + x as usize;
        Some((texel * self.set.samples().len() + index, depth))
    }

    /// Address of the depth at a [place](Self::place).
    pub fn address(&self, place: usize) -> u64 {
        let count = self.set.samples().len();
        let (surface, at) = match &self.surfaces[..] {
            [all] => (all, place),
            each => (&each[place % count], place / count),
        };
        surface.address() + at as u64 * DEPTH_BYTES
    }

    /// Whether a point is lit for sample `index` of the set: no stored depth is nearer by more than `bias`
    /// scene units. Passes the place of the depth that is fetched to `fetch`.
    pub fn is_lit(
        &self,
        lane: &Lane,
        light: &AreaLight,
        (point, index): (Vec3, usize),
        bias: f64,
        mut fetch: impl FnMut(usize),
    ) -> bool {
        let Some((at, depth)) = self.place(lane, light, point, index) else { return true };
        fetch(at);
        lane.branch(lane.sub(depth, bias) <= f64::from(self.depths[at]))
    }
}

/// Rendering of the samples of a set.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Method {
    /// All in one 5D pass.
    OnePass,
    /// Each in its own pass, with still geometry and a pinhole.
    Accumulation,
}

/// Geometry in front of a camera.
#[derive(Clone, Copy)]
pub struct SceneView<'a> {
    /// The camera.
    pub camera: &'a Camera,
    /// The geometry.
    pub draws: &'a [Draw<'a>],
}

/// Result of a depth pass: the visible triangle of each sample (`u32::MAX` for none) and the bits of its
/// depth, in the order `(y width + x) n + index`.
pub struct DepthPass {
    /// Triangles and depths.
    pub samples: Vec<(u32, u32)>,
    /// Event counts.
    pub counts: Counts,
    /// The depths in memory, of all samples or sample by sample.
    pub surfaces: Vec<MemoryRange>,
}

/// Renders the depths of `draws` in `camera`, at the samples of `set`.
///
/// # Errors
/// [`JobError`] if the hardware cannot be built.
pub fn depth_pass(
    view: &SceneView<'_>,
    viewport: Viewport,
    set: &SharedSamples,
    method: Method,
    gpu: &mut Gpu<'_>,
) -> Result<DepthPass, JobError> {
    let passes = in_passes(view, (viewport, set, method), gpu, |view, samples, gpu| {
        let settings = Settings { spec: gpu.spec(), viewport, samples, background: Vec3::ZERO };
        Ok(gpu.draw(&depths(view.camera, view.draws, &settings))?)
    })?;
    let per_pixel = set.samples().len();
    let mut seen = DepthPass {
        samples: vec![(0, 0); viewport.pixels() * per_pixel],
        counts: Counts::default(),
        surfaces: Vec::new(),
    };
    let count = passes.len();
    for (index, one) in passes.into_iter().enumerate() {
        seen.counts += &one.counts;
        seen.surfaces.push(one.region);
        let of_pass = seen.samples.iter_mut().skip(index).step_by(count);
        of_pass.zip(one.visible).for_each(|(into, from)| *into = from);
    }
    Ok(seen)
}

/// Draws `view` at the samples of the set by `draw`: all at once, or each in a pass of its own with still geometry.
pub(super) fn in_passes<T>(
    &SceneView { camera, draws }: &SceneView<'_>,
    (viewport, set, method): (Viewport, &SharedSamples, Method),
    gpu: &mut Gpu<'_>,
    mut draw: impl FnMut(&SceneView<'_>, &SharedSamples, &mut Gpu<'_>) -> Result<T, JobError>,
) -> Result<Vec<T>, JobError> {
    let draws = gpu.resident(draws);
    if method == Method::OnePass {
        return Ok(vec![draw(&SceneView { camera, draws: &draws }, set, gpu)?]);
    }
    let one = |(index, at): (usize, &Sample)| {
        let snapshot = Snapshot::new(camera, &draws, viewport, at).map_err(JobError::setting)?;
        let still = snapshot.draws().map_err(JobError::setting)?;
        draw(&SceneView { camera: &snapshot.camera, draws: &still }, &set.still(index), gpu)
    };
    set.samples().iter().enumerate().map(one).collect()
}

/// A pass that draws depths.
fn depths<'a>(camera: &'a Camera, draws: &'a [Draw<'a>], settings: &'a Settings<'a>) -> RasterPass<'a> {
    RasterPass::new(camera, draws, settings).named("depths").onto(Target::Depth).with_visible()
}
