//! A camera line, its views and their samples, rendered in one pass and by other methods.

use std::ops::Range;

use activity::Counts;
use glam::{Affine3A, Vec3};
use pipeline::sampling::{Sample, SampleSource, SampleSpec};
use pipeline::{
    Camera, Draw, Geometry, Gpu, Lens, LensShape, PipelineSpec, RasterPass, Rendered, SampleTable, Settings,
    Shading, Viewport,
};

use super::layout::Layout;
use crate::accumulation::{SharedSamples, pinhole};
use crate::error::LoadError;
use crate::job::JobError;

/// Render target of the views.
#[derive(Clone, Copy)]
pub struct ViewTarget<'a> {
    /// Size of each view.
    pub viewport: Viewport,
    /// The hardware.
    pub spec: &'a PipelineSpec,
    /// Linear RGB radiance of the background.
    pub background: Vec3,
    /// First pixel of each view in the image of the frame, for heat maps; empty if a view has the size of that image.
    pub places: &'a [[u32; 2]],
}

/// Images of all views.
#[derive(Clone, Debug)]
pub struct Views {
    /// Linear RGB radiance, view by view, row by row.
    pub images: Vec<Vec<Vec3>>,
    /// Event counts.
    pub counts: Counts,
    /// Passes over the geometry.
    pub passes: u32,
}

/// A camera with a lens as wide as the camera line, and the samples of its views.
#[derive(Clone, Debug)]
pub struct MultiviewRig {
    pub(super) camera: Camera,
    pub(super) layout: Layout,
    pub(super) table: SampleTable,
    pub(super) runs: Vec<Range<u32>>,
}

/// Largest half length of the line relative to the depth of zero disparity; wider views have no common scene.
const MAX_RADIUS_PER_FOCUS: f64 = 100.0;

impl MultiviewRig {
    /// Makes a rig of `layout` at `camera`, with all views sharp at depth `focus`, and `samples` per pixel
    /// and view.
    ///
    /// # Errors
    /// [`LoadError`] for an invalid layout, or samples that cannot be divided among the strips.
    pub fn new(
        camera: &Camera,
        focus: f32,
        layout: &Layout,
        samples: u32,
        seed: u64,
    ) -> Result<Self, LoadError> {
        layout.check()?;
        let refused = |setting, message: String| LoadError::Setting { setting, message };
        let lens = Lens::new(layout.radius() as f32, focus).map_err(|e| refused("focus", e.to_string()))?;
        let most = MAX_RADIUS_PER_FOCUS * f64::from(focus);
        if layout.radius() > most {
            let message = format!(
                "{:?}: half the line of views is {:?} long; it has to be at most {most:?}, {MAX_RADIUS_PER_FOCUS} times the depth at which views agree",
                layout.aperture,
                layout.radius()
            );
            return Err(refused("aperture", message));
        }
        let strips = layout.overlap.max(1);
        let per_strip = samples / strips;
        if per_strip == 0 || !samples.is_multiple_of(strips) {
            let message =
                format!("{samples}: a view takes them from {strips} parts; give a multiple of {strips}");
            return Err(refused("samples", message));
        }
        // Box filters need a square lens; separate lenses are round.
        let shape = if layout.overlap == 0 { LensShape::Disk } else { LensShape::Square };
        let spec = SampleSpec { lens: shape, regions: layout.regions(), ..SampleSpec::default() };
        let table = SampleTable::new(&spec, per_strip * layout.strips(), seed);
        let table = table.map_err(|error| refused("samples", format!("all views together: {error}")))?;
        Ok(Self {
            camera: camera.with_lens(Some(lens)),
            layout: *layout,
            runs: layout.runs(per_strip),
            table,
        })
    }

    /// Angle of the whole lens seen from a point in focus, in degrees.
    pub fn degrees(&self) -> f64 {
        let half = |lens: Lens| libm::atan2(f64::from(lens.radius()), f64::from(lens.focus()));
        self.camera.lens().map_or(0.0, |lens| 2.0 * half(lens).to_degrees())
    }

    /// Samples per pixel, of all views.
    pub fn samples(&self) -> u32 {
        self.table.per_pixel()
    }

    /// Renders all views in one pass.
    ///
    /// # Errors
    /// [`JobError`] if the hardware cannot be built.
    pub fn one_pass(
        &self,
        draws: &[Draw<'_>],
        to: &ViewTarget<'_>,
        gpu: &mut Gpu<'_>,
    ) -> Result<Views, JobError> {
        let settings = settings(to, &self.table);
        let views = pipeline::Target::Views(&self.runs);
        let pass = RasterPass::new(&self.camera, draws, &settings)
            .named("all views")
            .onto(views)
            .shown_at(to.places);
        let Rendered { images, counts, .. } = gpu.draw(&pass)?;
        Ok(Views { images, counts, passes: 1 })
    }

    /// Renders one view, with the samples that it has in the common pass.
    ///
    /// # Errors
    /// [`JobError`] if the hardware cannot be built.
    pub fn view(
        &self,
        view: usize,
        draws: &[Draw<'_>],
        to: &ViewTarget<'_>,
        gpu: &mut Gpu<'_>,
    ) -> Result<Rendered, JobError> {
        let run = self.runs.get(view).cloned().unwrap_or(0..1);
        let samples = Run { table: &self.table, run };
        let (settings, name) = (settings(to, &samples), format!("view {view}"));
        let pass = RasterPass::new(&self.camera, draws, &settings).named(&name);
        Ok(gpu.draw(&pass.shown_at(to.places.get(view..=view).unwrap_or_default()))?)
    }

    /// Renders each view in its own pass; the images are the same bit for bit.
    ///
    /// # Errors
    /// [`JobError`] if the hardware cannot be built.
    pub fn view_by_view(
        &self,
        draws: &[Draw<'_>],
        to: &ViewTarget<'_>,
        gpu: &mut Gpu<'_>,
    ) -> Result<Views, JobError> {
        let draws = gpu.resident(draws);
        let mut views = Views { images: Vec::new(), counts: Counts::default(), passes: 0 };
        for view in 0..self.runs.len() {
            views.add(self.view(view, &draws, to, gpu)?);
        }
        Ok(views)
    }
}

impl Views {
    /// Adds the image of a pass.
    fn add(&mut self, drawn: Rendered) {
        self.counts += &drawn.counts;
        self.passes += 1;
        self.images.push(drawn.into_image());
    }
}

pub(super) fn settings<'a>(to: &ViewTarget<'a>, samples: &'a dyn SampleSource) -> Settings<'a> {
    Settings { spec: to.spec, viewport: to.viewport, samples, background: to.background }
}

/// A range of the samples of each pixel.
#[derive(Debug)]
pub(super) struct Run<'a> {
    pub table: &'a SampleTable,
    pub run: Range<u32>,
}

impl SampleSource for Run<'_> {
    fn per_pixel(&self) -> u32 {
        self.run.len() as u32
    }

    fn pixel_into(&self, px: u32, py: u32, into: &mut [Sample]) {
        let run = self.run.start as usize..self.run.end as usize;
        into.copy_from_slice(&self.table.pixel(px, py)[run]);
    }
}

/// The same samples relative to a view's own lens, which is the part `middle` plus or minus `half` of the
/// wide lens, along `u` and `v`.
#[derive(Debug)]
struct OwnLens<'a> {
    pub run: Run<'a>,
    pub middle: f32,
    pub half: f32,
}

impl SampleSource for OwnLens<'_> {
    fn per_pixel(&self) -> u32 {
        self.run.per_pixel()
    }

    fn pixel_into(&self, px: u32, py: u32, into: &mut [Sample]) {
        self.run.pixel_into(px, py, into);
        for sample in into {
            sample.u = ((sample.u - self.middle) / self.half).clamp(-1.0, 1.0);
            sample.v = (sample.v / self.half).clamp(-1.0, 1.0);
        }
    }
}

impl MultiviewRig {
    /// Accumulation buffering (Haeberli and Akeley 1990): one pinhole pass of still geometry per sample of
    /// each view. All pixels share the samples of lens and time. Samples that views share are rendered once.
    ///
    /// # Errors
    /// [`JobError`] if the hardware cannot be built.
    pub fn accumulated(
        &self,
        draws: &[Draw<'_>],
        to: &ViewTarget<'_>,
        gpu: &mut Gpu<'_>,
    ) -> Result<Views, JobError> {
        // The samples of one pixel of the table serve all pixels.
        let set = SharedSamples::new(self.table.pixel(0, 0).to_vec())
            .ok_or_else(|| JobError::setting("too many samples"))?;
        let mut views = Views { images: Vec::new(), counts: Counts::default(), passes: 0 };
        let resident = gpu.resident(draws);
        for (number, at) in set.samples().iter().enumerate() {
            let camera = pinhole(&self.camera, [at.u, at.v]).map_err(JobError::setting)?;
            let camera = frozen(&camera, at.t).map_err(JobError::setting)?;
            let stills: Vec<Vec<Vec3>> = resident.iter().map(|draw| still(draw, at)).collect();
            let draws = resident.iter().zip(&stills).map(|(draw, at)| with_positions(draw, at));
            let draws = draws.collect::<Result<Vec<_>, _>>().map_err(JobError::setting)?;
            let one = set.still(number);
            let settings = settings(to, &one);
            views.add(gpu.draw(&RasterPass::new(&camera, &draws, &settings).named("sample"))?);
        }
        let samples = std::mem::take(&mut views.images);
        views.images =
            self.runs.iter().map(|run| mean(&samples[run.start as usize..run.end as usize])).collect();
        Ok(views)
    }

    /// Renders each view with its own camera and lens at its part of the line, and with the same samples,
    /// each shaded where it is. This shows the error of shading once for all views. (With overlapping
    /// filters, a view's lens is as wide as its box.)
    ///
    /// # Errors
    /// [`JobError`] if the hardware cannot be built.
    pub fn own_cameras(&self, draws: &[Draw<'_>], to: &ViewTarget<'_>) -> Result<Vec<Vec<Vec3>>, JobError> {
        let spec = PipelineSpec { shading: Shading::PerSample, ..*to.spec };
        let to = ViewTarget { spec: &spec, ..*to };
        let focus = self.camera.lens().map_or(1.0, |lens| lens.focus());
        let radius = self.layout.radius();
        let along = match self.layout.overlap {
            0 => self.layout.aperture,
            strips => 0.5 * f64::from(strips) * self.layout.spacing,
        };
        let half = along.max(self.layout.aperture) / radius;
        let image = |(view, run): (u32, &Range<u32>)| {
            let middle = self.layout.middle(view) as f32;
            let camera = pinhole(&self.camera, [middle, 0.0]).map_err(JobError::setting)?;
            let lens = Lens::new((half * radius) as f32, focus).map_err(JobError::setting)?;
            let run = Run { table: &self.table, run: run.clone() };
            let samples = OwnLens { run, middle, half: half as f32 };
            let settings = settings(&to, &samples);
            Ok(RasterPass::new(&camera.with_lens(Some(lens)), draws, &settings).uncounted()?.into_image())
        };
        (0..).zip(&self.runs).map(image).collect()
    }
}

/// The camera at time `t`.
fn frozen(camera: &Camera, t: f32) -> Result<Camera, pipeline::CameraError> {
    let (open, close) = (camera.open(), camera.close());
    let matrix = open.matrix3 + (close.matrix3 - open.matrix3) * t;
    let place = open.translation + (close.translation - open.translation) * t;
    let pose = if open == close { open } else { Affine3A { matrix3: matrix, translation: place } };
    camera.moving(pose, pose)
}

fn still(draw: &Draw<'_>, at: &Sample) -> Vec<Vec3> {
    let geometry = &draw.geometry;
    if geometry.is_still() {
        return geometry.open().to_vec();
    }
    geometry
        .open()
        .iter()
        .zip(geometry.close())
        .map(|(open, close)| *open + at.t * (*close - *open))
        .collect()
}

fn with_positions<'a>(draw: &Draw<'a>, at: &'a [Vec3]) -> Result<Draw<'a>, pipeline::DrawError> {
    let mut geometry = Geometry::new(at, at, draw.geometry.triangles())?;
    if !draw.geometry.normals().is_empty() {
        geometry = geometry.with_normals(draw.geometry.normals())?;
    }
    if !draw.geometry.uvs().is_empty() {
        geometry = geometry.with_uvs(draw.geometry.uvs())?;
    }
    if !draw.geometry.colors().is_empty() {
        geometry = geometry.with_colors(draw.geometry.colors())?;
    }
    Ok(Draw { geometry, ..*draw })
}

fn mean(images: &[Vec<Vec3>]) -> Vec<Vec3> {
    let count = images.len().max(1) as f32;
    let pixels = images.first().map_or(0, Vec::len);
    (0..pixels).map(|pixel| images.iter().map(|image| image[pixel]).sum::<Vec3>() / count).collect()
}
