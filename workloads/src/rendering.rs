//! The job of a scene: every frame is one rendering. The file of what is visible at its samples.

use std::io::{self, Write};
use std::sync::Arc;

use pipeline::sampling::SampleSource;
use pipeline::{Gpu, RasterPass, Viewport};
use warnings::Warning;

use crate::error::LoadError;
use crate::job::{Drawn, Draws, IMAGE_SIZE, Job, JobError, JobRequest, Reduction};
use crate::regime::Regime;
use crate::samples::{SampleChoice, blur_warning};
use crate::scene::{Frame, FrameMesh, Scene, SceneSettings};

/// Renderings of a scene in one pass per frame.
pub struct Rendering {
    scene: Arc<Scene>,
    settings: SceneSettings,
    table: SampleChoice,
    samples: Arc<dyn SampleSource>,
    seed: u64,
    /// One in so many triangles of each mesh is drawn.
    triangle_step: usize,
}

impl Rendering {
    /// Renderings of `scene` with the changes of `request`. A sample table in a file sets the samples per
    /// pixel, unless the request does.
    ///
    /// # Errors
    /// [`LoadError`] if a setting or the sample table is invalid.
    pub fn new(scene: Scene, request: &JobRequest<'_>) -> Result<Self, LoadError> {
        let scene = scene.with_overrides(request.overrides)?;
        let mut settings = scene.settings().clone();
        let table = SampleChoice::load(&settings.table)?;
        let own = table.per_pixel().filter(|_| request.overrides.samples.is_none());
        settings.samples = own.unwrap_or(settings.samples);
        settings.check()?;
        let samples = table.source(settings.samples, request.seed)?.into();
        let (scene, seed) = (Arc::new(scene), request.seed);
        Ok(Self { scene, settings, table, samples, seed, triangle_step: 1 })
    }

    fn viewport(&self) -> Result<Viewport, JobError> {
        Viewport::new(self.settings.width, self.settings.height).ok_or_else(|| JobError::setting(IMAGE_SIZE))
    }
}

impl Draws for Rendering {
    type Input = Frame;

    fn settings(&self) -> &SceneSettings {
        &self.settings
    }

    fn warnings(&self) -> &[Warning] {
        self.scene.warnings()
    }

    fn scene(&self) -> Option<&Scene> {
        Some(&self.scene)
    }

    /// Camera and light stay those of the full size.
    fn reduced(&self, to: &Reduction) -> Option<Box<dyn Job + '_>> {
        let fewer = to.samples.and_then(|samples| self.table.source(samples, self.seed).ok());
        let samples: Arc<dyn SampleSource> = fewer.map_or_else(|| Arc::clone(&self.samples), Arc::from);
        let [width, height] = to.size;
        let settings = SceneSettings { width, height, samples: samples.per_pixel(), ..self.settings.clone() };
        let limit = to.max_triangles.unwrap_or(usize::MAX).max(1);
        Some(Box::new(Self {
            scene: Arc::clone(&self.scene),
            settings,
            table: self.table.clone(),
            samples,
            seed: self.seed,
            triangle_step: self.scene.triangle_count().div_ceil(limit).max(1),
        }))
    }

    fn input(&self, number: u32) -> Result<Frame, JobError> {
        let mut frame = self.scene.frame(number)?;
        frame.meshes.iter_mut().for_each(|mesh| thin_out(mesh, self.triangle_step));
        Ok(frame)
    }

    fn draw(&self, frame: &Frame, gpu: &mut Gpu<'_>) -> Result<Drawn, JobError> {
        let draws = frame.draws(&self.scene)?;
        let (viewport, samples) = (self.viewport()?, &*self.samples);
        let background = self.scene.background();
        let settings = pipeline::Settings { spec: gpu.spec(), viewport, samples, background };
        let pass = RasterPass::new(&frame.camera, &draws, &settings).named("scene");
        let rendered = gpu.draw(&pass)?;
        let (moving, lens) = (frame.is_moving(), frame.camera.lens().is_some());
        let warnings = blur_warning(samples, moving, lens).into_iter().collect();
        Ok(Drawn { image: rendered.into_image(), moving, lens, warnings, ..Drawn::default() })
    }

    fn regime(&self, frame: &Frame) -> Result<Regime, JobError> {
        let draws = frame.draws(&self.scene)?;
        Ok(Regime::of(&frame.camera, &draws, self.viewport()?, self.settings.samples))
    }
}

/// Keeps one in `step` triangles.
fn thin_out(mesh: &mut FrameMesh, step: usize) {
    if step > 1 {
        mesh.triangles = mesh.triangles.iter().copied().step_by(step).collect();
    }
}

/// Writes the visible triangle of each sample (`u32::MAX` for none) and its depth (infinite for none), both
/// in the order `(py * width + px) * per_pixel + s`. The header is `M5DHIT1\0`, width, height, samples per
/// pixel, and zero.
///
/// # Errors
/// Errors of `out`.
pub fn write_hits(
    viewport: Viewport,
    per_pixel: u32,
    triangles: &[u32],
    depths: &[f32],
    out: &mut dyn Write,
) -> io::Result<()> {
    out.write_all(b"M5DHIT1\0")?;
    for word in [viewport.width(), viewport.height(), per_pixel, 0] {
        out.write_all(&word.to_le_bytes())?;
    }
    for triangle in triangles {
        out.write_all(&triangle.to_le_bytes())?;
    }
    for depth in depths {
        out.write_all(&depth.to_le_bytes())?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::job::testing::hardware;
    use crate::scene::Overrides;

    fn tiny() -> Rendering {
        let overrides = Overrides { size: Some((64, 36)), samples: Some(4), ..Overrides::default() };
        Rendering::new(crate::load("tiny").unwrap(), &JobRequest { overrides: &overrides, seed: 1 }).unwrap()
    }

    #[test]
    fn a_reduced_rendering_draws_fewer_pixels_samples_and_triangles() {
        let whole = tiny();
        let drawn = |job: &dyn Job| {
            let spec = hardware();
            let mut gpu = Gpu::without_packets(&spec).unwrap();
            let drawn = job.frame(0, &mut gpu).unwrap();
            (drawn, gpu.finish().triangles())
        };
        let to = Reduction { size: [32, 18], samples: Some(1), max_triangles: Some(5) };
        let reduced = Draws::reduced(&whole, &to).unwrap();
        let (all, triangles) = drawn(&whole);
        let (small, fewer) = drawn(&*reduced);
        assert_eq!((all.image.len(), small.image.len()), (64 * 36, 32 * 18));
        assert_eq!((triangles, reduced.settings().samples), (whole.scene.triangle_count(), 1));
        assert!(0 < fewer && fewer < triangles, "{fewer} of {triangles}");
        let ready = Job::prepare(&whole, 0).unwrap();
        assert!(ready.regime().unwrap().in_view > 0);
    }
}
