//! The failure catalogue: families of triangles from harmless to hopeless, each swept along one parameter.
//!
//! A [`Family`] makes a [`StressScene`] from a value of its parameter, a [`Size`] and a seed,
//! deterministically. `quintile stress` measures the methods on it.

mod builder;
mod motion;
mod shape;

pub use builder::Soup;

use pipeline::geometry::Projection;
use pipeline::sample_test::{Hits, Target, test_run};
use pipeline::sampling::{SampleSource, TableError, TileSamples};
use pipeline::setup::{SetupResult, Triangle, set_up};
use pipeline::traversal::{Box5, TileRect};
use pipeline::{
    Camera, CameraError, Cull, Draw, DrawError, Geometry, LensShape, SampleTable, Shader, Viewport,
};

use builder::SceneBuilder;

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
    Samples(#[from] TableError),
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
        let mut target = Target { depth: &mut depth, triangle: &mut owner };
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

#[cfg(test)]
mod tests {
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
}
