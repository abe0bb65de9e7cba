//! A camera line and its views.

use std::ops::Range;

use activity::Counts;
use glam::Vec3;
use pipeline::frame::{render_views, render_with_heat};
use pipeline::sampling::{SampleSource, SampleSpec};
use pipeline::{Camera, Draw, Lens, LensShape, PipelineSpec, SampleTable, Settings, Viewport};

use super::layout::Layout;
use super::samples::Run;
use crate::error::LoadError;
use crate::job::{Emit, JobError, shifted};

/// What is drawn into.
#[derive(Clone, Copy)]
pub struct Target<'a> {
    /// Size of each view.
    pub viewport: Viewport,
    /// The hardware.
    pub spec: &'a PipelineSpec,
    /// Linear RGB radiance where nothing is hit.
    pub background: Vec3,
}

/// Images of all views.
#[derive(Clone, Debug)]
pub struct Views {
    /// Linear RGB radiance, view by view, row by row.
    pub images: Vec<Vec<Vec3>>,
    /// What was done.
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

/// Half the line of views over the depth at which they agree, at most: from farther apart they have no scene in common.
const WIDEST: f64 = 100.0;

impl Rig {
    /// A rig of `layout` where `camera` stands, all views sharp at depth `focus`, with `samples` for each view of a pixel.
    ///
    /// # Errors
    /// When the layout cannot be, or the samples cannot be shared out.
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
        let most = WIDEST * f64::from(focus);
        if layout.radius() > most {
            let message = format!(
                "{:?}: half the line of views is {:?} long; it has to be at most {most:?}, {WIDEST} times the depth at which views agree",
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
        // Boxes have the shape of a box; lenses of their own are round.
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

    /// The angle under which a point in focus sees the whole lens, in degrees.
    pub fn degrees(&self) -> f64 {
        let half = |lens: Lens| libm::atan2(f64::from(lens.radius()), f64::from(lens.focus()));
        self.camera.lens().map_or(0.0, |lens| 2.0 * half(lens).to_degrees())
    }

    /// Samples of a pixel in all.
    pub fn samples(&self) -> u32 {
        self.table.per_pixel()
    }

    /// All views in one pass.
    ///
    /// # Errors
    /// When the hardware cannot be built.
    pub fn one_pass(&self, draws: &[Draw<'_>], to: &Target<'_>, emit: Emit<'_>) -> Result<Views, JobError> {
        let settings = settings(to, &self.table);
        let (images, counts) = render_views(&self.camera, draws, &settings, &self.runs, emit)?;
        Ok(Views { images, counts, passes: 1 })
    }

    /// A view alone, with the samples that it has in the pass of all.
    ///
    /// # Errors
    /// When the hardware cannot be built.
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

    /// Each view in a pass of its own: the same images to the bit.
    ///
    /// # Errors
    /// When the hardware cannot be built.
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
    /// Adds a view and what it took.
    pub(super) fn add(&mut self, image: Vec<Vec3>, counts: &Counts, passes: u32) {
        self.images.push(image);
        self.counts += counts;
        self.passes += passes;
    }
}

pub(super) fn settings<'a>(to: &Target<'a>, samples: &'a dyn SampleSource) -> Settings<'a> {
    Settings { spec: to.spec, viewport: to.viewport, samples, background: to.background }
}
