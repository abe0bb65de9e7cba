//! Other methods of multi-view rendering, for comparison.

use activity::Counts;
use glam::{Affine3A, Vec3};
use pipeline::sampling::Sample;
use pipeline::{Camera, Draw, Geometry, Lens, PipelineSpec, Shading};

use super::rig::{OwnLens, Run};
use super::rig::{Rig, Target, Views, settings};
use crate::accumulation::{SharedSamples, pinhole};
use crate::job::{Emit, JobError, shifted};

impl Rig {
    /// Accumulation buffering (Haeberli and Akeley 1990): one pinhole pass of still geometry per sample of
    /// each view. All pixels share the samples of lens and time. Samples that views share are rendered once.
    ///
    /// # Errors
    /// [`JobError`] if the hardware cannot be built.
    pub fn accumulated(
        &self,
        draws: &[Draw<'_>],
        to: &Target<'_>,
        emit: Emit<'_>,
    ) -> Result<Views, JobError> {
        let refused = |error: &dyn std::fmt::Display| JobError::Setting(error.to_string());
        // The samples of one pixel of the table serve all pixels.
        let set = SharedSamples::new(self.table.pixel(0, 0).to_vec())
            .ok_or_else(|| JobError::Setting("too many samples".to_owned()))?;
        let mut views = Views { images: Vec::new(), counts: Counts::default(), passes: 0 };
        let mut images = Vec::new();
        for (number, at) in set.samples().iter().enumerate() {
            let camera = pinhole(&self.camera, [at.u, at.v]).map_err(|e| refused(&e))?;
            let camera = frozen(&camera, at.t).map_err(|e| refused(&e))?;
            let stills: Vec<Vec<Vec3>> = draws.iter().map(|draw| still(draw, at)).collect();
            let draws = draws.iter().zip(&stills).map(|(draw, at)| with_positions(draw, at));
            let draws = draws.collect::<Result<Vec<_>, _>>().map_err(|e| refused(&e))?;
            let one = set.still(number);
            let (drawn, _) = pipeline::frame::render_with_heat(
                &camera,
                &draws,
                &settings(to, &one),
                &[],
                &mut shifted(number as u16, emit),
            )?;
            views.counts += &drawn.counts;
            views.passes += 1;
            images.push(drawn.image);
        }
        views.images =
            self.runs.iter().map(|run| mean(&images[run.start as usize..run.end as usize])).collect();
        Ok(views)
    }

    /// Renders each view with its own camera and lens at its part of the line, and with the same samples,
    /// each shaded where it is. This shows the error of shading once for all views. (With overlapping
    /// filters, a view's lens is as wide as its box.)
    ///
    /// # Errors
    /// [`JobError`] if the hardware cannot be built.
    pub fn own_cameras(&self, draws: &[Draw<'_>], to: &Target<'_>) -> Result<Vec<Vec<Vec3>>, JobError> {
        let refused = |error: &dyn std::fmt::Display| JobError::Setting(error.to_string());
        let spec = PipelineSpec { shading: Shading::PerSample, ..*to.spec };
        let to = Target { spec: &spec, ..*to };
        let focus = self.camera.lens().map_or(1.0, |lens| lens.focus());
        let radius = self.layout.radius();
        let along = match self.layout.overlap {
            0 => self.layout.aperture,
            strips => 0.5 * f64::from(strips) * self.layout.spacing,
        };
        let half = along.max(self.layout.aperture) / radius;
        let image = |(view, run): (u32, &std::ops::Range<u32>)| {
            let middle = self.layout.middle(view) as f32;
            let camera = pinhole(&self.camera, [middle, 0.0]).map_err(|e| refused(&e))?;
            let lens = Lens::new((half * radius) as f32, focus).map_err(|e| refused(&e))?;
            let run = Run { table: &self.table, run: run.clone() };
            let samples = OwnLens { run, middle, half: half as f32 };
            let settings = settings(&to, &samples);
            Ok(pipeline::render(&camera.with_lens(Some(lens)), draws, &settings, |_| ())?.image)
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
