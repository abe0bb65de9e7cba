//! The failure catalogue: families of triangles from harmless to hopeless, each swept along one parameter.
//!
//! A [`Family`] makes a [`StressScene`] from a value of its parameter, a [`Size`] and a seed,
//! deterministically. `quintile stress` measures the methods on it.
//!
//! Scenes are built from image positions in pixels, depths in scene units, and random numbers from a hash.
//! [`Soup`] has random triangles of a known blur in pixels, for measuring how the cost grows.

mod motion;
mod shape;

use std::ops::Range;

use glam::{Affine3A, DVec2, DVec3};
use pipeline::geometry::Projection;
use pipeline::random::{SplitMix, mix};
use pipeline::sample_test::{Hits, StoredSamples, test_run};
use pipeline::sampling::{SampleSource, SampleTableError, TileSamples};
use pipeline::setup::{SetupResult, Triangle, set_up};
use pipeline::traversal::{Box5, TileRect};
use pipeline::{
    Camera, CameraError, Cull, Draw, DrawError, Geometry, Lens, LensShape, SampleTable, Shader, Viewport,
};

/// A family of triangles with one kind of difficulty, and its parameter.
#[derive(Clone, Copy, Debug)]
pub struct Family {
    /// Name on the command line.
    pub name: &'static str,
    /// Description, in a line.
    pub what: &'static str,
    /// Meaning of the parameter, with its unit.
    pub parameter: &'static str,
    /// Values of the parameter, harmless ones first.
    pub values: &'static [f64],
    /// Number of slow last values, which quick runs skip.
    pub slow: usize,
    build: fn(&mut SceneBuilder, f64) -> Result<(), StressError>,
}

/// Size of a scene of a family.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Size {
    /// Side of the image in pixels, a power of two so that positions are exact.
    pub side_px: u32,
    /// Number of triangles; meshes and families that sweep it have their own.
    pub triangles: u32,
}

impl Size {
    /// Size of the results in the book.
    pub const FULL: Self = Self { side_px: 128, triangles: 300 };
    /// Size of a quick run.
    pub const QUICK: Self = Self { side_px: 64, triangles: 100 };
}

/// Samples per pixel.
pub const PER_PIXEL: u32 = 4;

/// A stress scene: triangles in world space at both ends of the shutter, camera and samples.
#[derive(Clone, Debug)]
pub struct StressScene {
    /// The camera.
    pub camera: Camera,
    /// Size of the image.
    pub viewport: Viewport,
    /// Sample table.
    pub samples: SampleTable,
    /// Vertices at shutter open.
    pub open: Vec<glam::Vec3>,
    /// Vertices at shutter close.
    pub close: Vec<glam::Vec3>,
    /// Vertex indices of each triangle.
    pub triangles: Vec<[u32; 3]>,
}

/// Reason why a scene cannot be made.
#[derive(Clone, Debug, thiserror::Error)]
pub enum StressError {
    /// The camera is invalid.
    #[error(transparent)]
    Camera(#[from] CameraError),
    /// The samples are invalid.
    #[error(transparent)]
    Samples(#[from] SampleTableError),
    /// The vertices are invalid.
    #[error(transparent)]
    Draw(#[from] DrawError),
    /// The image size is invalid.
    #[error("an image of {0} pixels a side; it has to be a power of two from 8 to 16384")]
    Side(u32),
}

impl Family {
    /// Makes the scene at `value` of the parameter, with random numbers from `seed`.
    ///
    /// # Errors
    /// [`StressError`] if `value` or `size` is invalid. The family's own values are valid.
    pub fn scene(&self, value: f64, size: Size, seed: u64) -> Result<StressScene, StressError> {
        let side = size.side_px;
        let viewport = Viewport::new(side, side).filter(|_| side.is_power_of_two() && side >= 8);
        let viewport = viewport.ok_or(StressError::Side(side))?;
        let samples = SampleTable::low_discrepancy(PER_PIXEL, seed, LensShape::Disk)?;
        let mut builder = SceneBuilder::new(size, viewport, samples, seed)?;
        (self.build)(&mut builder, value)?;
        let scene = builder.finish();
        Geometry::new(&scene.open, &scene.close, &scene.triangles)?;
        Ok(scene)
    }

    /// Values to sweep, without the slow ones if `quick`.
    pub fn sweep(&self, quick: bool) -> &'static [f64] {
        &self.values[..self.values.len() - if quick { self.slow } else { 0 }]
    }
}

impl StressScene {
    /// The draw of the triangles, without culling.
    ///
    /// # Errors
    /// None for an unchanged scene of a family; otherwise [`DrawError`] for invalid vertices.
    pub fn draw<'a>(&'a self, shader: &'a dyn Shader) -> Result<Draw<'a>, DrawError> {
        let close = if self.open == self.close { &self.open } else { &self.close };
        Ok(Draw::new(Geometry::new(&self.open, close, &self.triangles)?, shader, Cull::None))
    }
}

/// All families, by cause: shape, motion, lens, meshes.
pub fn families() -> impl Iterator<Item = &'static Family> {
    [shape::SHAPE_FAMILIES, motion::MOTION_FAMILIES, motion::LENS_FAMILIES, shape::MESH_FAMILIES]
        .into_iter()
        .flatten()
}

/// The family with a name.
pub fn family(name: &str) -> Option<&'static Family> {
    families().find(|family| family.name == name)
}

/// The triangles of `draws` that pass set-up, numbered through all draws.
pub fn set_up_all<'a>(
    camera: &Camera,
    draws: &'a [Draw<'a>],
    viewport: Viewport,
) -> impl Iterator<Item = Triangle> + use<'a> {
    let projection = Projection::new(camera, viewport);
    let triangles = draws.iter().flat_map(|draw| draw.geometry.triangles().iter().map(move |t| (draw, *t)));
    (0..).zip(triangles).filter_map(move |(id, (draw, corners))| {
        let (open, close) = (draw.geometry.open(), draw.geometry.close());
        let [a, b, c] = corners.map(|v| projection.vertex(open[v as usize], close[v as usize]));
        match set_up(
            id,
            [&a, &b, &c],
            draw.state.cull,
            &projection.shear,
            projection.near,
            viewport.half_px(),
        ) {
            SetupResult::Ready(triangle) => Some(triangle),
            _ => None,
        }
    })
}

/// Visible triangle of each sample and the bits of its depth, in the form of
/// [`visibility`](pipeline::RasterPass::visibility). All triangles are tested against all samples in all
/// dimensions.
pub fn brute_force(
    camera: &Camera,
    draws: &[Draw<'_>],
    viewport: Viewport,
    source: &dyn SampleSource,
) -> Vec<(u32, u32)> {
    within_bounds(camera, draws, viewport, source, |_, _| Some(Box5::whole(true)))
}

/// The same, but only within the part of lens and time that `bound` returns for each triangle and tile of 8x8
/// pixels.
pub fn within_bounds(
    camera: &Camera,
    draws: &[Draw<'_>],
    viewport: Viewport,
    source: &dyn SampleSource,
    bound: impl Fn(&Triangle, &TileRect) -> Option<Box5>,
) -> Vec<(u32, u32)> {
    const SIDE_PX: u32 = 8;
    let projection = Projection::new(camera, viewport);
    let triangles: Vec<_> =
        set_up_all(camera, draws, viewport).map(|ready| Triangle { moving: true, ..ready }).collect();
    let per_pixel = source.per_pixel();
    let mut seen = vec![(u32::MAX, f32::INFINITY.to_bits()); viewport.pixels() * per_pixel as usize];
    let (mut samples, mut hits) = (TileSamples::default(), Hits::default());
    for tile in 0..viewport.width().div_ceil(SIDE_PX) * viewport.height().div_ceil(SIDE_PX) {
        let across = viewport.width().div_ceil(SIDE_PX);
        let origin = [tile % across * SIDE_PX, tile / across * SIDE_PX];
        let rect = TileRect::new(viewport, origin, SIDE_PX);
        samples.fill(source, viewport, &projection.shear, origin, SIDE_PX);
        let (mut depth, mut owner) = (vec![f32::INFINITY; samples.len], vec![u32::MAX; samples.len]);
        let mut target = StoredSamples { depth: &mut depth, triangle: &mut owner };
        for triangle in &triangles {
            let Some(within) = bound(triangle, &rect) else { continue };
            hits.clear();
            test_run(triangle, &samples, &within, projection.near, &mut target, &mut hits);
        }
        for slot in 0..samples.len {
            let place = samples.in_image(slot, origin, SIDE_PX, viewport, per_pixel);
            seen[place] = (owner[slot], depth[slot].to_bits());
        }
    }
    seen
}

/// A scene under construction. The camera looks along z, with a field of view of 90 degrees, from one unit
/// before everything.
struct SceneBuilder {
    pub size: Size,
    random: SplitMix,
    scene: StressScene,
}

/// Near depth of the camera.
const NEAR: f64 = 0.25;

impl SceneBuilder {
    pub fn new(size: Size, viewport: Viewport, samples: SampleTable, seed: u64) -> Result<Self, CameraError> {
        let camera = Camera::new(Affine3A::IDENTITY, 1.0, NEAR as f32)?;
        let (open, close, triangles) = (Vec::new(), Vec::new(), Vec::new());
        let scene = StressScene { camera, viewport, samples, open, close, triangles };
        Ok(Self { size, random: SplitMix::new(mix(seed)), scene })
    }

    pub fn finish(self) -> StressScene {
        self.scene
    }

    /// Adds a lens whose circle of confusion has a radius of `blur_px` at infinity, focused at `focus`.
    pub fn lens(&mut self, blur_px: f64, focus: f64) -> Result<(), CameraError> {
        self.lens_of(blur_px / self.scale() * focus, focus)
    }

    /// Adds a lens of `radius` in scene units; none if it is zero.
    pub fn lens_of(&mut self, radius: f64, focus: f64) -> Result<(), CameraError> {
        let lens = if radius > 0.0 { Some(Lens::new(radius as f32, focus as f32)?) } else { None };
        self.scene.camera = self.scene.camera.with_lens(lens);
        Ok(())
    }

    /// Scales the geometry so far, the lens and the near depth by `factor`.
    pub fn enlarge(&mut self, factor: f64) -> Result<(), CameraError> {
        for vertex in self.scene.open.iter_mut().chain(&mut self.scene.close) {
            *vertex = (vertex.as_dvec3() * factor).as_vec3();
        }
        let lens = self.scene.camera.lens();
        self.scene.camera = Camera::new(Affine3A::IDENTITY, 1.0, (NEAR * factor) as f32)?;
        lens.map_or(Ok(()), |l| self.lens_of(f64::from(l.radius()) * factor, f64::from(l.focus()) * factor))
    }

    /// Replaces the samples.
    pub fn sample_with(&mut self, samples: SampleTable) {
        self.scene.samples = samples;
    }

    pub fn samples(&self) -> &SampleTable {
        &self.scene.samples
    }

    pub fn side(&self) -> f64 {
        f64::from(self.size.side_px)
    }

    /// Pixels per unit at depth one.
    pub fn scale(&self) -> f64 {
        0.5 * self.side()
    }

    /// World point at image position `px` (from the image centre, y upwards) and depth `w`.
    pub fn at(&self, px: DVec2, w: f64) -> DVec3 {
        (px / self.scale() * w).extend(w)
    }

    /// Random number between `low` and `high`.
    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        self.random.within(low, high)
    }

    /// Random number between `low` and `high`, uniform in its logarithm.
    pub fn octaves(&mut self, low: f64, high: f64) -> f64 {
        low * libm::exp2(self.between(0.0, libm::log2(high / low)))
    }

    /// Random image position.
    pub fn position(&mut self) -> DVec2 {
        let half = 0.5 * self.side();
        DVec2::new(self.between(-half, half), self.between(-half, half))
    }

    /// Random direction in the image.
    pub fn direction(&mut self) -> DVec2 {
        let turn = self.between(0.0, std::f64::consts::TAU);
        DVec2::new(libm::cos(turn), libm::sin(turn))
    }

    /// Corners of a randomly rotated equilateral triangle around the origin, with sides of `size_px`.
    pub fn corners(&mut self, size_px: f64) -> [DVec2; 3] {
        let first = self.direction() * (size_px / libm::sqrt(3.0));
        let (sin, cos) = (libm::sqrt(0.75), -0.5);
        [0, 1, 2].map(|k| {
            let turn = [DVec2::X, DVec2::new(cos, sin), DVec2::new(cos, -sin)][k];
            turn.rotate(first)
        })
    }

    /// Adds a triangle with its own vertices, given at both ends of the shutter.
    pub fn triangle(&mut self, open: [DVec3; 3], close: [DVec3; 3]) {
        let corners = [0, 1, 2].map(|k| self.vertex(open[k], close[k]));
        self.face(corners);
    }

    /// Adds a vertex and returns its index.
    pub fn vertex(&mut self, open: DVec3, close: DVec3) -> u32 {
        self.scene.open.push(open.as_vec3());
        self.scene.close.push(close.as_vec3());
        self.scene.open.len() as u32 - 1
    }

    /// Adds a triangle of existing vertices.
    pub fn face(&mut self, corners: [u32; 3]) {
        self.scene.triangles.push(corners);
    }
}

/// Random triangles of one size that together cover the image a given number of times, whatever their count.
/// Each is translated linearly.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Soup {
    /// Image size and number of triangles.
    pub size: Size,
    /// Total area of the triangles, relative to the image.
    pub layers: f64,
    /// Motion across the image during the shutter, in pixels.
    pub motion_px: f64,
    /// Diameter in pixels of the circle of confusion at the middle of a triangle, within a few per cent.
    pub defocus_px: f64,
}

/// Depths of triangles, far behind the focus so that all have a similar blur.
const DEPTHS: Range<f64> = 9.0..11.0;
/// Focus depth.
const FOCUS: f64 = 1.0;

impl Soup {
    /// Makes the scene; `seed` determines positions and directions.
    ///
    /// # Errors
    /// [`StressError`] for an invalid image size or lens.
    pub fn scene(&self, seed: u64) -> Result<StressScene, StressError> {
        let side = self.size.side_px;
        let viewport = Viewport::new(side, side).ok_or(StressError::Side(side))?;
        let samples = SampleTable::low_discrepancy(PER_PIXEL, seed, LensShape::Disk)?;
        let mut builder = SceneBuilder::new(self.size, viewport, samples, seed)?;
        // The blur at depth z relative to that at infinity is 1 - focus / z.
        let blur_share = 1.0 - FOCUS / (0.5 * (DEPTHS.start + DEPTHS.end));
        builder.lens(0.5 * self.defocus_px / blur_share, FOCUS)?;
        (0..self.size.triangles).for_each(|_| self.add_triangle(&mut builder));
        let scene = builder.finish();
        Geometry::new(&scene.open, &scene.close, &scene.triangles)?;
        Ok(scene)
    }

    /// Side of a triangle in pixels; the area of an equilateral one is sqrt(3)/4 side^2.
    fn side_px(&self) -> f64 {
        let image = f64::from(self.size.side_px);
        image * libm::sqrt(4.0 * self.layers / (libm::sqrt(3.0) * f64::from(self.size.triangles)))
    }

    fn add_triangle(&self, builder: &mut SceneBuilder) {
        let (position, half_way) = (builder.position(), 0.5 * self.motion_px * builder.direction());
        let depth = builder.between(DEPTHS.start, DEPTHS.end);
        // The mean tilt of a randomly rotated triangle, limited to stay in front of the camera.
        let tilt = 0.5 * (self.side_px() / builder.scale()).min(1.0);
        let corners = builder.corners(self.side_px());
        let depths = [0, 1, 2].map(|_| depth * (1.0 + tilt * builder.between(-1.0, 1.0)));
        let at = |k: usize, shift: DVec2| builder.at(position + corners[k] + shift, depths[k]);
        let (open, close) = ([0, 1, 2].map(|k| at(k, -half_way)), [0, 1, 2].map(|k| at(k, half_way)));
        builder.triangle(open, close);
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec2;

    use super::*;

    #[test]
    fn every_family_is_deterministic_at_every_value() {
        for family in families() {
            assert!(family.values.len() > family.slow + 1, "{}", family.name);
            for &value in family.sweep(true) {
                let [once, again, other] = [1, 1, 2]
                    .map(|seed| family.scene(value, Size { side_px: 32, triangles: 30 }, seed).unwrap());
                assert!(!once.triangles.is_empty(), "{} at {value}", family.name);
                assert_eq!(
                    (&once.open, &once.close),
                    (&again.open, &again.close),
                    "{} at {value}",
                    family.name
                );
                assert_eq!(once.triangles.len(), other.triangles.len());
            }
        }
    }

    #[test]
    fn names_are_unique_and_found() {
        for known in families() {
            assert_eq!(family(known.name).map(|found| found.what), Some(known.what));
            assert_eq!(families().filter(|other| other.name == known.name).count(), 1);
        }
        assert!(family("no such family").is_none());
    }

    #[test]
    fn sides_other_than_powers_of_two_are_refused() {
        let family = family("slivers").unwrap();
        let error = family.scene(1.0, Size { side_px: 100, triangles: 3 }, 1).unwrap_err();
        assert!(error.to_string().contains("100"), "{error}");
    }

    const SOUP: Soup =
        Soup { size: Size { side_px: 128, triangles: 200 }, layers: 4.0, motion_px: 24.0, defocus_px: 12.0 };

    /// Image position of a vertex through a lens position, in pixels from the centre.
    fn seen(scene: &StressScene, vertex: glam::Vec3, lens: Vec2) -> Vec2 {
        let optics = scene.camera.lens().unwrap();
        let shift = lens * optics.radius() * (1.0 / vertex.z - 1.0 / optics.focus());
        64.0 * (vertex.truncate() / vertex.z - shift)
    }

    #[test]
    fn triangles_move_and_blur_as_requested() {
        let scene = SOUP.scene(7).unwrap();
        for (open, close) in scene.open.iter().zip(&scene.close) {
            let moved = seen(&scene, *close, Vec2::ZERO) - seen(&scene, *open, Vec2::ZERO);
            assert!((moved.length() - 24.0).abs() < 1e-2, "{moved}");
        }
        for corners in &scene.triangles {
            let corners = corners.map(|corner| scene.open[corner as usize]);
            let middle = (corners[0] + corners[1] + corners[2]) / 3.0;
            let blur = seen(&scene, middle, Vec2::X) - seen(&scene, middle, Vec2::NEG_X);
            assert!((blur.length() / 12.0 - 1.0).abs() < 0.05, "{blur}");
        }
    }

    #[test]
    fn more_triangles_cover_as_much() {
        for triangles in [50, 800] {
            let soup = Soup { size: Size { triangles, ..SOUP.size }, ..SOUP };
            let scene = soup.scene(7).unwrap();
            let area = |corners: &[u32; 3]| {
                let [a, b, c] = corners.map(|corner| seen(&scene, scene.open[corner as usize], Vec2::ZERO));
                f64::from(0.5 * (b - a).perp_dot(c - a).abs())
            };
            let layers = scene.triangles.iter().map(area).sum::<f64>() / (128.0 * 128.0);
            assert!((layers - 4.0).abs() < 1e-3, "{layers}");
        }
    }

    #[test]
    fn without_blur_there_is_neither_lens_nor_motion() {
        let scene = Soup { motion_px: 0.0, defocus_px: 0.0, ..SOUP }.scene(7).unwrap();
        assert!(scene.camera.lens().is_none() && scene.open == scene.close);
    }
}
