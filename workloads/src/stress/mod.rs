//! The failure catalogue: families of triangles from harmless to hopeless, each swept along one parameter.
//!
//! A [`Family`] makes a [`StressScene`] from a value of its parameter, a [`Size`] and a seed, the same bits each time. What the
//! methods make of it is measured elsewhere (`quintile stress`).

mod brute;
mod easel;
mod lens;
mod mesh;
mod motion;
mod shape;
mod soup;

use pipeline::sampling::TableError;
use pipeline::{
    Camera, CameraError, Cull, Draw, DrawError, Geometry, LensShape, SampleTable, Shader, Viewport,
};

pub use brute::{brute_force, set_up_all, within_bounds};
use easel::Easel;
pub use soup::Soup;

/// Triangles of one kind of trouble, and how to have more or less of it.
#[derive(Clone, Copy, Debug)]
pub struct Family {
    /// Its name on the command line.
    pub name: &'static str,
    /// What it is, in a line.
    pub what: &'static str,
    /// What the parameter is, with its unit.
    pub parameter: &'static str,
    /// Values of the parameter, harmless ones first.
    pub values: &'static [f64],
    /// How many of the last values are left out where time is short.
    pub slow: usize,
    paint: fn(&mut Easel, f64) -> Result<(), StressError>,
}

/// How large a scene of a family is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Size {
    /// Side of the image in pixels, a power of two, so that places on it are exact.
    pub side_px: u32,
    /// Triangles; meshes and families that sweep their number have their own.
    pub triangles: u32,
}

impl Size {
    /// The size the book's numbers are of.
    pub const FULL: Self = Self { side_px: 128, triangles: 300 };
    /// A size for a first look.
    pub const QUICK: Self = Self { side_px: 64, triangles: 100 };
    /// A size for tests.
    pub const SMALL: Self = Self { side_px: 32, triangles: 30 };
}

/// Samples in each pixel.
pub const PER_PIXEL: u32 = 4;

/// Triangles in world space at both ends of the shutter, with the camera and the samples that look at them.
#[derive(Clone, Debug)]
pub struct StressScene {
    /// The camera.
    pub camera: Camera,
    /// Size of the image.
    pub viewport: Viewport,
    /// Where and when each pixel looks.
    pub samples: SampleTable,
    /// Vertices when the shutter opens.
    pub open: Vec<glam::Vec3>,
    /// Vertices when it closes.
    pub close: Vec<glam::Vec3>,
    /// The corners of each triangle.
    pub triangles: Vec<[u32; 3]>,
}

/// Why a scene of a family cannot be made.
#[derive(Clone, Debug, thiserror::Error)]
pub enum StressError {
    /// The value makes no camera.
    #[error(transparent)]
    Camera(#[from] CameraError),
    /// The samples cannot be made.
    #[error(transparent)]
    Samples(#[from] TableError),
    /// The value makes no vertices.
    #[error(transparent)]
    Draw(#[from] DrawError),
    /// The image cannot be of this size.
    #[error("an image of {0} pixels a side; it has to be a power of two from 8 to 16384")]
    Side(u32),
}

impl Family {
    /// The scene at `value` of the parameter; `seed` decides everything random.
    ///
    /// # Errors
    /// When `value` or `size` make no scene. The family's own values do.
    pub fn scene(&self, value: f64, size: Size, seed: u64) -> Result<StressScene, StressError> {
        let side = size.side_px;
        let viewport = Viewport::new(side, side).filter(|_| side.is_power_of_two() && side >= 8);
        let viewport = viewport.ok_or(StressError::Side(side))?;
        let samples = SampleTable::low_discrepancy(PER_PIXEL, seed, LensShape::Disk)?;
        let mut easel = Easel::new(size, viewport, samples, seed)?;
        (self.paint)(&mut easel, value)?;
        let scene = easel.finish();
        Geometry::new(&scene.open, &scene.close, &scene.triangles)?;
        Ok(scene)
    }

    /// The values to sweep: all, or without the slow ones.
    pub fn sweep(&self, quick: bool) -> &'static [f64] {
        &self.values[..self.values.len() - if quick { self.slow } else { 0 }]
    }
}

impl StressScene {
    /// The triangles as the pipeline takes them, both faces drawn.
    ///
    /// # Errors
    /// None for the scene of a family; [`DrawError`] where its vertices were changed.
    pub fn draw<'a>(&'a self, shader: &'a dyn Shader) -> Result<Draw<'a>, DrawError> {
        let close = if self.open == self.close { &self.open } else { &self.close };
        Ok(Draw { geometry: Geometry::new(&self.open, close, &self.triangles)?, shader, cull: Cull::None })
    }
}

/// Every family, by what makes the trouble: shape, motion, lens, meshes.
pub fn families() -> impl Iterator<Item = &'static Family> {
    [shape::FAMILIES, motion::FAMILIES, lens::FAMILIES, mesh::FAMILIES].into_iter().flatten()
}

/// The family called `name`.
pub fn family(name: &str) -> Option<&'static Family> {
    families().find(|family| family.name == name)
}

#[cfg(test)]
mod tests;
