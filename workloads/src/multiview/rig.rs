//! A camera line, its views and their samples.

use std::ops::Range;

use activity::Counts;
use glam::Vec3;
use pipeline::frame::{render_views, render_with_heat};
use pipeline::sampling::{Sample, SampleSource, SampleSpec};
use pipeline::{Camera, Draw, Lens, LensShape, PipelineSpec, SampleTable, Settings, Viewport};

use super::layout::Layout;
use crate::error::LoadError;
use crate::job::{Emit, JobError, shifted};

/// Render target of the views.
#[derive(Clone, Copy)]
pub struct Target<'a> {
    /// Size of each view.
    pub viewport: Viewport,
    /// The hardware.
    pub spec: &'a PipelineSpec,
    /// Linear RGB radiance of the background.
    pub background: Vec3,
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
pub struct Rig {
    pub(super) camera: Camera,
    pub(super) layout: Layout,
    pub(super) table: SampleTable,
    pub(super) runs: Vec<Range<u32>>,
}

/// Largest half length of the line relative to the depth of zero disparity; wider views have no common scene.
const MAX_RADIUS_PER_FOCUS: f64 = 100.0;

impl Rig {
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

    /// The camera with its wide lens.
    pub fn camera(&self) -> &Camera {
        &self.camera
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
    pub fn one_pass(&self, draws: &[Draw<'_>], to: &Target<'_>, emit: Emit<'_>) -> Result<Views, JobError> {
        let settings = settings(to, &self.table);
        let (images, counts) = render_views(&self.camera, draws, &settings, &self.runs, emit)?;
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
        to: &Target<'_>,
        emit: Emit<'_>,
    ) -> Result<(Vec<Vec3>, Counts), JobError> {
        let run = self.runs.get(view).cloned().unwrap_or(0..1);
        let samples = Run { table: &self.table, run };
        let (rendered, _) = render_with_heat(&self.camera, draws, &settings(to, &samples), &[], emit)?;
        Ok((rendered.image, rendered.counts))
    }

    /// Renders each view in its own pass; the images are the same bit for bit.
    ///
    /// # Errors
    /// [`JobError`] if the hardware cannot be built.
    pub fn view_by_view(
        &self,
        draws: &[Draw<'_>],
        to: &Target<'_>,
        emit: Emit<'_>,
    ) -> Result<Views, JobError> {
        let mut views = Views { images: Vec::new(), counts: Counts::default(), passes: 0 };
        for view in 0..self.runs.len() {
            let (image, counts) = self.view(view, draws, to, &mut shifted(view as u16, emit))?;
            views.add(image, &counts, 1);
        }
        Ok(views)
    }
}

impl Views {
    /// Adds a view and its counts.
    pub(super) fn add(&mut self, image: Vec<Vec3>, counts: &Counts, passes: u32) {
        self.images.push(image);
        self.counts += counts;
        self.passes += passes;
    }
}

pub(super) fn settings<'a>(to: &Target<'a>, samples: &'a dyn SampleSource) -> Settings<'a> {
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
pub(super) struct OwnLens<'a> {
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
