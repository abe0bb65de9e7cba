//! The map of a receiver: the light that each texel gathers through the lens.

use activity::Counts;
use glam::{DVec3, Vec2, Vec3};
use pipeline::sampling::{Sample, SampleSource};
use pipeline::{Camera, Draw, Gpu, Lens, RasterPass, Rendered, Settings, Target, Viewport};
use rayon::prelude::*;

use super::receiver::{Effect, Receiver};
use crate::accumulation::{RayWork, Rays, SharedSamples, pinhole};
use crate::error::LoadError;
use crate::job::JobError;
use crate::scene::camera::CameraFrame;

/// A map: its camera, and the texels of the receiver.
#[derive(Clone, Copy, Debug)]
pub struct Map {
    camera: Camera,
    stand: CameraFrame,
    receiver: Receiver,
    radius: f64,
    /// Texels across and down.
    pub viewport: Viewport,
}

/// Directions that a point of the receiver gathers light from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Lobe {
    /// Directions through the lens, as in the map.
    Lens,
    /// A cone around the direction to the lens centre. It has the same angle everywhere: that of the lens at
    /// the receiver's centre.
    Cone,
}

impl Map {
    /// Makes the map of `receiver`, `rows` texels high, for a viewer at `eye` who looks along `along`,
    /// through a lens of `radius` scene units.
    ///
    /// # Errors
    /// [`LoadError`] if the viewer is not above the receiver, or a length is invalid.
    pub fn new(
        receiver: &Receiver,
        (eye, along): (DVec3, DVec3),
        effect: Effect,
        radius: f64,
        rows: u32,
    ) -> Result<Self, LoadError> {
        let refused = |setting, message: String| LoadError::Setting { setting, message };
        let from = receiver.eye(eye, along, effect).ok_or_else(|| {
            refused("receiver", "the camera has to be above it and to look down on it".to_owned())
        })?;
        let forward = if effect == Effect::Reflection { receiver.normal } else { -receiver.normal };
        let up = receiver.right.cross(forward);
        let stand = CameraFrame { eye: from, right: receiver.right, up, forward };
        let to = receiver.centre - from;
        let (distance, [x, y]) = (to.dot(forward), [to.dot(stand.right), to.dot(up)]);
        let [wide, high] = receiver.half;
        let columns = (f64::from(rows) * wide / high).ceil();
        let viewport = Viewport::new(columns as u32, rows).ok_or_else(|| {
            refused("texels", format!("{columns:?} x {rows}: a map is 1 to 16384 texels wide and high"))
        })?;
        let shift = Vec2::new((-0.5 * x / high) as f32, (0.5 * y / high) as f32);
        let camera = Camera::new(stand.pose(), (high / distance) as f32, distance as f32)
            .and_then(|camera| camera.with_shift(shift))
            .map_err(|error| refused("receiver", error.to_string()))?;
        let lens = if radius > 0.0 {
            let lens = Lens::new(radius as f32, distance as f32);
            Some(lens.map_err(|error| refused("roughness", error.to_string()))?)
        } else {
            None
        };
        Ok(Self { camera: camera.with_lens(lens), stand, receiver: *receiver, radius, viewport })
    }

    /// Distance of the map's camera from the plane, scene units.
    pub fn distance(&self) -> f64 {
        (self.receiver.centre - self.stand.eye).dot(self.stand.forward)
    }

    /// Side of a texel, scene units.
    pub fn texel(&self) -> f64 {
        2.0 * self.receiver.half[1] / f64::from(self.viewport.height())
    }

    /// Width of the blur on the plane of a point at this height above (or depth below) it, scene units.
    pub fn blur(&self, height: f64) -> f64 {
        2.0 * self.radius * height / (self.distance() + height)
    }

    /// Texture coordinates of the receiver's corners.
    pub fn uvs(&self) -> [Vec2; 4] {
        self.receiver.corners().map(|corner| {
            let from = corner.as_dvec3() - self.receiver.centre;
            let size = [self.viewport.width(), self.viewport.height()].map(|c| f64::from(c) * self.texel());
            Vec2::new(
                (0.5 + from.dot(self.stand.right) / size[0]) as f32,
                (0.5 - from.dot(self.stand.up) / size[1]) as f32,
            )
        })
    }

    /// Renders the map in one pass; a texel is the mean of its samples.
    ///
    /// # Errors
    /// [`JobError`] if the hardware cannot be built.
    pub fn one_pass(
        &self,
        draws: &[Draw<'_>],
        samples: &dyn SampleSource,
        background: Vec3,
        gpu: &mut Gpu<'_>,
    ) -> Result<Rendered, JobError> {
        let settings = Settings { spec: gpu.spec(), viewport: self.viewport, samples, background };
        Ok(gpu.draw(&RasterPass::new(&self.camera, draws, &settings).named("map").onto(Target::Texture))?)
    }

    /// Renders the map by accumulation: one pinhole pass per sample of a set that all texels share
    /// (Diefenbach and Badler 1997).
    ///
    /// # Errors
    /// [`JobError`] if the hardware cannot be built.
    pub fn accumulated(
        &self,
        draws: &[Draw<'_>],
        set: &SharedSamples,
        background: Vec3,
        gpu: &mut Gpu<'_>,
    ) -> Result<(Vec<Vec3>, Counts), JobError> {
        let draws = gpu.resident(draws);
        let mut sum = vec![Vec3::ZERO; self.viewport.pixels()];
        let mut counts = Counts::default();
        for (index, at) in set.samples().iter().enumerate() {
            let camera = pinhole(&self.camera, [at.u, at.v]);
            let camera = camera.map_err(JobError::setting)?;
            let samples = set.still(index);
            let settings =
                Settings { spec: gpu.spec(), viewport: self.viewport, samples: &samples, background };
            let one = gpu.draw(&RasterPass::new(&camera, &draws, &settings).named("map sample"))?;
            counts += &one.counts;
            sum.iter_mut().zip(one.into_image()).for_each(|(sum, pixel)| *sum += pixel);
        }
        sum.iter_mut().for_each(|pixel| *pixel /= set.samples().len() as f32);
        Ok((sum, counts))
    }

    /// Traces the map: one ray per sample of every texel, with a colour per draw. The result is the mean over all
    /// tables, and the work.
    pub fn by_rays(
        &self,
        (rays, colours): (&Rays, &[Vec3]),
        tables: &[&dyn SampleSource],
        background: Vec3,
        lobe: Lobe,
    ) -> (Vec<Vec3>, RayWork) {
        let width = self.viewport.width();
        let texel = |place: usize| {
            let at = [place as u32 % width, place as u32 / width];
            let (mut sum, mut count, mut work) = (DVec3::ZERO, 0_u32, RayWork::default());
            for table in tables {
                let mut samples = vec![Sample::default(); table.per_pixel() as usize];
                table.pixel_into(at[0], at[1], &mut samples);
                for sample in &samples {
                    let seen = rays.first(self.ray(at, sample, lobe), 0.0, 1.0, &mut work);
                    let colour = seen.map_or(background, |(face, _)| colours[rays.faces()[face].draw]);
                    sum += colour.as_dvec3();
                    count += 1;
                }
            }
            ((sum / f64::from(count.max(1))).as_vec3(), work)
        };
        let texels: Vec<_> = (0..self.viewport.pixels()).into_par_iter().map(texel).collect();
        let mut total = RayWork::default();
        texels.iter().for_each(|(_, work)| total += *work);
        (texels.into_iter().map(|(colour, _)| colour).collect(), total)
    }

    /// Ray of a sample, from the lens; it meets the plane at parameter 1.
    fn ray(&self, [px, py]: [u32; 2], sample: &Sample, lobe: Lobe) -> (DVec3, DVec3) {
        let size = [self.viewport.width(), self.viewport.height()].map(f64::from);
        let x = (f64::from(px) + f64::from(sample.x) - 0.5 * size[0]) * self.texel();
        let y = (f64::from(py) + f64::from(sample.y) - 0.5 * size[1]) * self.texel();
        let met = self.receiver.centre + x * self.stand.right - y * self.stand.up;
        let [u, v] = [sample.u, sample.v].map(f64::from);
        let Lobe::Cone = lobe else {
            let from = self.stand.eye + self.radius * (u * self.stand.right + v * self.stand.up);
            return (from, met - from);
        };
        let middle = (met - self.stand.eye).normalize_or_zero();
        let tangent = self.radius / (self.receiver.centre - self.stand.eye).length();
        let across = middle.cross(self.stand.up).normalize_or_zero();
        let along = middle + tangent * (u * across + v * middle.cross(across));
        (met - along, along)
    }
}
