//! Motion-blurred soft shadows from a 5D shadow map (thesis, Paper VI, section 7).
//!
//! The lens of the light's camera is the area of the light, focused at infinity. All texels share a small
//! fixed set of light and time samples. So the map is an array of ordinary shadow maps, one per `(u, v, t)`.
//! It is made in one pass ([`ShadowMethod::OnePass`]) or in one pass per sample ([`ShadowMethod::Accumulation`]). The
//! shading pass uses the same set, and each of its samples reads the map of its own `(u, v, t)`
//! ([`World::image`]).
//!
//! - [`AreaLight`]: the light as a camera.
//! - [`ShadowMap`]: both ways of making a map, and look-ups.
//! - [`VisibleTriangles`]: the triangle that each sample of the image sees, in surfaces.
//! - [`World`]: shading, with a map or with rays as the ground truth.
//! - [`job()`]: the workload; [`default_scene()`]: its default scene.

mod job;
mod shade;

use activity::Counts;
use glam::{DVec3, Vec3};
use pipeline::memory::MemoryRange;
use pipeline::sampling::Sample;
use pipeline::{
    Camera, Draw, Format, Gpu, Lane, Layout, Lens, RasterPass, Settings, SurfaceSpec, Target, Viewport,
};
use serde::{Deserialize, Serialize};

use crate::accumulation::{SharedSamples, Snapshot};
use crate::error::LoadError;
use crate::job::JobError;
use crate::scene::camera::CameraFrame;
use crate::scene::{Frustum, tan_half};
pub(crate) use job::{FACTS, FLAGS};
pub use job::{SoftShadowOptions, SoftShadows, default_scene, job};
pub use shade::{Shadows, VisibleTriangles, World, look_ups};

/// Position, target and size of an area light.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct LightSpec {
    /// Centre, scene units.
    pub position: [f64; 3],
    /// Target point, scene units.
    pub target: [f64; 3],
    /// Radius, scene units. The shape is that of the samples' lens.
    pub radius: f64,
    /// Field of view of its map in degrees, across and down.
    pub fov_deg: f64,
    /// Near depth of shadow casters, scene units.
    pub near: f64,
}

impl Default for LightSpec {
    fn default() -> Self {
        Self { position: [2.6, 5.2, 2.2], target: [0.0; 3], radius: 0.45, fov_deg: 62.0, near: 0.5 }
    }
}

impl LightSpec {
    /// Translates the light and its target.
    fn move_by(&mut self, distance: DVec3) {
        for point in [&mut self.position, &mut self.target] {
            *point = (DVec3::from_array(*point) + distance).to_array();
        }
    }

    /// Checks angle and lengths, at distance `distance` from the target.
    fn check(&self, distance: f64) -> Result<(), String> {
        let Self { radius, fov_deg, near, .. } = *self;
        let widest = MAX_RADIUS_PER_DISTANCE * distance;
        if !(1.0..=170.0).contains(&fov_deg) {
            return Err(format!("fov_deg {fov_deg:?}: a map sees 1 to 170 degrees"));
        }
        if near >= distance {
            return Err(format!(
                "near {near:?}: nothing before the target would throw a shadow; it has to be below {distance:?}, the way to it"
            ));
        }
        if !(MIN_RADIUS..=widest).contains(&radius) {
            return Err(format!(
                "radius {radius:?}: it has to be {MIN_RADIUS:e} to {widest:?} scene units, {MAX_RADIUS_PER_DISTANCE} times the way to the target"
            ));
        }
        Ok(())
    }
}

/// An area light: a camera whose lens is the light.
#[derive(Clone, Copy, Debug)]
pub struct AreaLight {
    stand: CameraFrame,
    radius: f64,
    tan_half: f64,
    camera: Camera,
}

/// Focus at infinity, in scene units: the lens moves a texel's image by less than rounding.
const FAR_FOCUS: f32 = 1e30;

/// Largest radius relative to the target's distance. The map of a wider light contains nothing that is lit.
const MAX_RADIUS_PER_DISTANCE: f64 = 100.0;
/// Smallest radius in scene units that single precision represents.
const MIN_RADIUS: f64 = 1e-30;

impl AreaLight {
    /// Makes the light of a specification.
    ///
    /// # Errors
    /// [`LoadError`] if light and target coincide, or a length or angle is out of range.
    pub fn new(spec: &LightSpec) -> Result<Self, LoadError> {
        let refused = |message: String| LoadError::Setting { setting: "light", message };
        let position = DVec3::from_array(spec.position);
        let stand = CameraFrame::new(position, DVec3::from_array(spec.target) - position, DVec3::Y);
        let stand = stand.ok_or_else(|| {
            refused("position and target coincide or are not finite: move one of them".to_owned())
        })?;
        let distance = (DVec3::from_array(spec.target) - position).length();
        spec.check(distance).map_err(refused)?;
        let view = Frustum::Perspective { tan_half_height: tan_half(spec.fov_deg) };
        let camera = view.camera(stand.pose(), spec.near as f32).map_err(|e| refused(e.to_string()))?;
        let lens = Lens::new(spec.radius as f32, FAR_FOCUS).map_err(|e| refused(e.to_string()))?;
        let camera = camera.with_lens(Some(lens));
        Ok(Self { stand, radius: spec.radius, tan_half: tan_half(spec.fov_deg), camera })
    }

    /// Camera of its map.
    pub fn camera(&self) -> &Camera {
        &self.camera
    }

    /// World position of the point `(u, v)` of the light.
    pub fn point(&self, lane: &Lane, [u, v]: [f32; 2]) -> DVec3 {
        let [u, v] = [u, v].map(|c| DVec3::splat(lane.mul(f64::from(c), self.radius)));
        lane.madd(v, self.stand.up, lane.madd(u, self.stand.right, self.stand.eye))
    }

    /// Texel of a map `side` texels wide, and depth, at which the point `(u, v)` of the light sees `point`;
    /// `None` outside the map.
    pub fn texel(&self, lane: &Lane, point: Vec3, lens: [f32; 2], side: u32) -> Option<([u32; 2], f64)> {
        let seen = self.stand.view_on(lane, point.as_dvec3());
        let [u, v] = lens.map(|c| lane.mul(f64::from(c), self.radius));
        let middle = 0.5 * f64::from(side);
        let per_unit = lane.div(middle, lane.mul(self.tan_half, seen.z));
        let at = [lane.sub(seen.x, u), -lane.sub(seen.y, v)].map(|c| lane.madd(c, per_unit, middle));
        let inside = lane.branch(seen.z > 0.0 && at.iter().all(|c| (0.0..f64::from(side)).contains(c)));
        inside.then(|| (at.map(|c| c as u32), seen.z))
    }

    /// Width of a texel at the light's target, scene units.
    pub fn texel_width(&self, target: DVec3, side: u32) -> f64 {
        2.0 * self.tan_half * self.stand.depth(target).max(0.0) / f64::from(side)
    }
}

/// Bytes of a stored depth.
const DEPTH_BYTES: u64 = 4;

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
    /// Where the depths lie in each of them.
    layouts: Vec<Layout>,
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
        method: ShadowMethod,
        gpu: &mut Gpu<'_>,
    ) -> Result<Self, JobError> {
        let viewport = Viewport::new(side, side).filter(|_| side.is_multiple_of(2));
        let refused =
            || JobError::setting(format_args!("map_px {side}: a shadow map has an even number of texels"));
        let viewport = viewport.ok_or_else(refused)?;
        let set = set.centred();
        let seen = depth_pass(&SceneView { camera: light.camera(), draws }, viewport, &set, method, gpu)?;
        let depths = seen.samples.into_iter().map(|(_, depth)| f32::from_bits(depth)).collect();
        let samples = (set.samples().len() / seen.surfaces.len().max(1)) as u32;
        let spec = SurfaceSpec::new("map", viewport, Format::D32).sampled(samples);
        let layout = |region: &MemoryRange| Layout::new(&spec, gpu.spec().tile_px, region.address()).0;
        let layouts = seen.surfaces.iter().map(layout).collect();
        Ok(Self { side, set, depths, counts: seen.counts, surfaces: seen.surfaces, layouts })
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
        let (texel, index) = (place / count, place % count);
        let pixel = [texel as u32 % self.side, texel as u32 / self.side];
        match &self.layouts[..] {
            [all] => all.at(pixel, index as u32),
            each => each[index].at(pixel, 0),
        }
    }

    /// Where the depths are in memory.
    pub fn surfaces(&self) -> &[MemoryRange] {
        &self.surfaces
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
pub enum ShadowMethod {
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
    method: ShadowMethod,
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
fn in_passes<T>(
    &SceneView { camera, draws }: &SceneView<'_>,
    (viewport, set, method): (Viewport, &SharedSamples, ShadowMethod),
    gpu: &mut Gpu<'_>,
    mut draw: impl FnMut(&SceneView<'_>, &SharedSamples, &mut Gpu<'_>) -> Result<T, JobError>,
) -> Result<Vec<T>, JobError> {
    let draws = gpu.resident(draws);
    if method == ShadowMethod::OnePass {
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_centre_of_the_light_sees_its_target_in_the_centre() {
        let spec =
            LightSpec { position: [0.0, 4.0, 0.0], radius: 0.5, fov_deg: 90.0, ..LightSpec::default() };
        let light = AreaLight::new(&spec).unwrap();
        let lane = &Lane::default();
        assert_eq!(light.texel(lane, Vec3::new(0.01, 0.0, 0.01), [0.0; 2], 64).map(|(_, w)| w), Some(4.0));
        // Half a unit at depth 4, of 8 units over 64 texels, is four texels in the opposite direction.
        let [right, up] = [light.point(lane, [1.0, 0.0]), light.point(lane, [0.0, 1.0])];
        assert!((right - light.point(lane, [0.0; 2])).length() == 0.5 && (up - right).length() > 0.5);
        let shifted = |lens| light.texel(lane, Vec3::new(0.01, 0.0, 0.01), lens, 64).unwrap().0;
        let [here, u, v] = [[0.0; 2], [1.0, 0.0], [0.0, 1.0]].map(shifted);
        assert_eq!([here[0] - u[0], v[1] - here[1]], [4, 4]);
        assert!((light.texel_width(DVec3::ZERO, 64) - 0.125).abs() < 1e-12);
        assert_eq!(light.texel(lane, Vec3::new(9.0, 0.0, 0.0), [0.0; 2], 64), None);
        assert_eq!(light.texel(lane, Vec3::new(0.0, 5.0, 0.0), [0.0; 2], 64), None, "behind the light");
    }

    #[test]
    fn invalid_lights_are_refused() {
        let base = LightSpec::default();
        for bad in [
            LightSpec { target: base.position, ..base },
            LightSpec { radius: 0.0, ..base },
            LightSpec { radius: 1e-300, ..base },
            LightSpec { radius: 1e4, ..base },
            LightSpec { fov_deg: 200.0, ..base },
            LightSpec { near: -1.0, ..base },
            LightSpec { near: 1e30, ..base },
        ] {
            assert!(AreaLight::new(&bad).unwrap_err().is_usage());
        }
    }
}
