//! What methods are tried on: draws, a camera and samples.

use activity::Counts;
use glam::Vec3;
use pipeline::frame::{render, visibility};
use pipeline::memory::CacheError;
use pipeline::sampling::SampleSource;
use pipeline::{Camera, Draw, Features, PipelineSpec, Settings, Viewport};
use workloads::stress::{Family, Size, brute_force};
use workloads::visibility::Unshaded;

use run::GpuSpec;
use run::RunError;

/// Draws with what looks at them.
#[derive(Clone, Copy)]
pub struct Subject<'a> {
    /// The camera.
    pub camera: &'a Camera,
    /// Size of the image.
    pub viewport: Viewport,
    /// Where and when each pixel looks.
    pub samples: &'a dyn SampleSource,
    /// What is drawn.
    pub draws: &'a [Draw<'a>],
    /// The hardware; its features are those of each method in turn.
    pub spec: &'a PipelineSpec,
}

/// Calls `run` with the scene of `family` at `value`.
///
/// # Errors
/// When the scene cannot be made or the hardware cannot be built.
pub fn on<T>(
    family: &Family,
    value: f64,
    (size, seed): (Size, u64),
    gpu: &GpuSpec,
    run: impl FnOnce(&Subject<'_>) -> Result<T, CacheError>,
) -> Result<T, RunError> {
    let failed = |message: String| RunError::Setting(format!("{} at {value}: {message}", family.name));
    let scene = family.scene(value, size, seed).map_err(|error| failed(error.to_string()))?;
    let draws = [scene.draw(&Unshaded).map_err(|error| failed(error.to_string()))?];
    let (camera, viewport, samples) = (&scene.camera, scene.viewport, &scene.samples);
    let subject = Subject { camera, viewport, samples, draws: &draws, spec: &gpu.pipeline };
    run(&subject).map_err(|error| failed(error.to_string()))
}

/// The triangle of each sample and the bits of its depth.
pub type Seen = Vec<(u32, u32)>;

/// The most tests of a sample against a triangle that brute force may take.
const MOST_TESTS: u64 = 200_000_000;

impl Subject<'_> {
    /// Triangles that are drawn.
    pub fn triangles(&self) -> u64 {
        self.draws.iter().map(|draw| draw.geometry.triangles().len() as u64).sum()
    }

    /// What every sample sees with the tests of `features`.
    pub fn seen(&self, features: Features) -> Result<Seen, CacheError> {
        self.with(features, |settings| visibility(self.camera, self.draws, settings))
    }

    /// How often each event happens with the tests of `features`.
    pub fn counts(&self, features: Features) -> Result<Counts, CacheError> {
        self.with(features, |settings| Ok(render(self.camera, self.draws, settings, |_| ())?.counts))
    }

    /// What every sample has to see: from all triangles against all samples where that is not too much, else from the pipeline
    /// with every test off. Also says whether it was brute force.
    pub fn reference(&self) -> Result<(Seen, bool), CacheError> {
        let samples = self.viewport.pixels() as u64 * u64::from(self.samples.per_pixel());
        if samples * self.triangles() <= MOST_TESTS {
            Ok((brute_force(self.camera, self.draws, self.viewport, self.samples), true))
        } else {
            Ok((self.seen(Features::NONE)?, false))
        }
    }

    fn with<T>(&self, features: Features, run: impl FnOnce(&Settings<'_>) -> T) -> T {
        let spec = PipelineSpec { features, ..*self.spec };
        let (viewport, samples) = (self.viewport, self.samples);
        run(&Settings { spec: &spec, viewport, samples, background: Vec3::ZERO })
    }
}

/// Samples that differ: lost to another triangle, to none, or gained.
pub fn differing(a: &Seen, b: &Seen) -> u64 {
    a.iter().zip(b).filter(|(a, b)| a != b).count() as u64 + a.len().abs_diff(b.len()) as u64
}
