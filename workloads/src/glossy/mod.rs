//! Glossy reflection and refraction on planar receivers (thesis, Paper VI, section 6).
//!
//! The receiver is the focus plane, the near plane and the viewport of a camera with a lens. The camera is at
//! the mirrored position of the viewer, or at the position along the plane's normal that the refracted
//! central ray comes from. Objects that touch the receiver are sharp, and far ones are blurred. One 4D pass
//! makes the map, filtered by the resolve. The lens radius is the roughness.
//!
//! - [`Receiver`], [`GlossyEffect`]: the rectangle, and the camera position for it; [`ReceiverShader`]: its
//!   shading.
//! - [`Map`]: the map in [one pass](Map::one_pass), by [accumulation](Map::accumulated), and by
//!   [rays](Map::by_rays), the brute-force reference.
//! - [`job()`]: the workload; [`default_scene()`]: its scene.

mod job;

use activity::Counts;
use glam::{DVec3, Vec2, Vec3, Vec4};
use pipeline::sampling::{Sample, SampleSource};
use pipeline::texture::linear_to_srgb8;
use pipeline::{
    Camera, Draw, Gpu, Lane, Lens, RasterPass, Rendered, Settings, Shader, ShadingPoint, Target, Texture,
    TextureError, Viewport, Wrap,
};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::accumulation::{RayCaster, RayWork, SharedSamples, pinhole};
use crate::error::LoadError;
use crate::job::JobError;
use crate::scene::camera::CameraFrame;

pub(crate) use job::{FACTS, FLAGS};
pub use job::{Glossy, GlossyOptions, default_scene, job, receiver};

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
        effect: GlossyEffect,
        radius: f64,
        rows: u32,
    ) -> Result<Self, LoadError> {
        let refused = |setting, message: String| LoadError::Setting { setting, message };
        let from = receiver.eye(eye, along, effect).ok_or_else(|| {
            refused("receiver", "the camera has to be above it and to look down on it".to_owned())
        })?;
        let forward = if effect == GlossyEffect::Reflection { receiver.normal } else { -receiver.normal };
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
        (rays, colours): (&RayCaster, &[Vec3]),
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

/// A rectangle in world space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Receiver {
    /// Centre.
    pub centre: DVec3,
    /// Unit vector along the first side.
    pub right: DVec3,
    /// Unit normal, towards the viewer.
    pub normal: DVec3,
    /// Half of the sides, along `right` and across; scene units.
    pub half: [f64; 2],
}

/// Reflection or refraction.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum GlossyEffect {
    /// Reflection.
    Reflection,
    /// Refraction into a medium with this index.
    Refraction(f64),
}

impl Receiver {
    /// A horizontal rectangle seen from above.
    pub fn lying(centre: DVec3, half: [f64; 2]) -> Self {
        Self { centre, right: DVec3::X, normal: DVec3::Y, half }
    }

    /// Height of a point above the plane, scene units.
    pub fn height(&self, point: DVec3) -> f64 {
        (point - self.centre).dot(self.normal)
    }

    /// Camera position of the map (Figure 13): the viewer mirrored in the plane, or moved along the normal so
    /// that the ray `along`, refracted by Snell's law, comes straight from it. `None` if the viewer is not
    /// above the receiver, or the ray does not go down.
    pub fn eye(&self, eye: DVec3, along: DVec3, effect: GlossyEffect) -> Option<DVec3> {
        let height = self.height(eye);
        if !(height > 0.0 && height.is_finite()) {
            return None;
        }
        let GlossyEffect::Refraction(index) = effect else { return Some(eye - 2.0 * height * self.normal) };
        let down = -along.dot(self.normal) / along.length();
        if !(down > 1e-6 && index > 0.0) {
            return None;
        }
        let sine = (1.0 - down * down).max(0.0).sqrt();
        // At normal incidence, the ratio of tangents becomes that of sines.
        let refracted = sine / index;
        let cosine = (1.0 - refracted * refracted).max(0.0).sqrt();
        let ratio = if sine < 1e-9 { index } else { (sine / down) * cosine / refracted };
        (ratio.is_finite() && ratio > 0.0).then(|| eye + (ratio - 1.0) * height * self.normal)
    }

    /// Corners, counter-clockwise seen from above, starting at the first row of the map.
    pub fn corners(&self) -> [Vec3; 4] {
        let across = self.right.cross(self.normal);
        [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]]
            .map(|[x, y]| (self.centre + x * self.half[0] * self.right + y * self.half[1] * across).as_vec3())
    }
}

/// Shader of a surface of one colour with a map.
#[derive(Clone, Debug)]
pub struct ReceiverShader {
    map: Texture,
    /// Linear RGB radiance of the surface without the map.
    base: Vec3,
    /// Reflected share at normal incidence.
    normal_share: f32,
}

impl ReceiverShader {
    /// Makes the shader of a receiver with a map. `normal_share` is Schlick's reflectance at normal
    /// incidence; 1 for a mirror, or a fully transparent pane.
    ///
    /// # Errors
    /// [`TextureError`] if the size of the map differs from `viewport`.
    pub fn new(
        map: &[Vec3],
        viewport: Viewport,
        base: Vec3,
        normal_share: f32,
    ) -> Result<Self, TextureError> {
        let texel = |pixel: &Vec3| {
            let [r, g, b] = pixel.to_array().map(linear_to_srgb8);
            [r, g, b, 255]
        };
        let texels = map.iter().map(texel).collect();
        let map = Texture::from_srgb8(viewport.width(), viewport.height(), texels, [Wrap::Clamp; 2])?;
        Ok(Self { map, base, normal_share })
    }
}

impl Shader for ReceiverShader {
    fn texture(&self) -> Option<&Texture> {
        Some(&self.map)
    }

    fn shade(&self, lane: &Lane, at: &ShadingPoint, texel: Vec4) -> Vec4 {
        let away = lane.sub(1.0, lane.saturate(lane.dot(at.normal, at.to_camera)));
        let square = lane.mul(away, away);
        // Schlick 1994.
        let rest = lane.mul(lane.mul(1.0 - self.normal_share, square), square);
        let share = lane.madd(rest, away, self.normal_share);
        let over = lane.sub(texel.truncate(), self.base);
        lane.madd(over, Vec3::splat(share), self.base).extend(1.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_mirrored_position_is_as_far_below() {
        let floor = Receiver::lying(DVec3::new(0.0, 1.0, 0.0), [1.0, 1.0]);
        let eye = floor.eye(DVec3::new(2.0, 4.0, 1.0), DVec3::NEG_Y, GlossyEffect::Reflection);
        assert_eq!(eye, Some(DVec3::new(2.0, -2.0, 1.0)));
        assert_eq!(floor.eye(DVec3::ZERO, DVec3::NEG_Y, GlossyEffect::Reflection), None, "from below");
    }

    /// Compares the central ray with Snell's law.
    #[test]
    fn the_central_ray_follows_snell() {
        let water = Receiver::lying(DVec3::ZERO, [1.0, 1.0]);
        for (along, index) in [(DVec3::new(0.6, -0.8, 0.0), 1.33), (DVec3::new(0.3, -0.2, 0.4), 1.5)] {
            let eye = DVec3::new(-1.0, 2.0, 0.5);
            let met = eye + along * (eye.y / -along.y);
            let from = water.eye(eye, along, GlossyEffect::Refraction(index)).unwrap();
            assert_eq!([from.x, from.z], [eye.x, eye.z], "it moves along the normal");
            let sine = |ray: DVec3| (1.0 - (ray.normalize().y).powi(2)).sqrt();
            assert!((sine(along) / sine(met - from) - index).abs() < 1e-9);
        }
        let down = water.eye(DVec3::Y, DVec3::NEG_Y, GlossyEffect::Refraction(1.5)).unwrap();
        assert!((down.y - 1.5).abs() < 1e-9, "apparent depth");
        assert_eq!(water.eye(DVec3::Y, DVec3::X, GlossyEffect::Refraction(1.5)), None);
    }

    /// Schlick 1994: at 60 degrees, (1 - 1/2)^5 = 1/32 of the missing share is added to the reflectance at
    /// normal incidence.
    #[test]
    fn the_share_of_the_map_follows_schlick() {
        let one = Viewport::new(1, 1).unwrap();
        let surface = ReceiverShader::new(&[Vec3::ONE], one, Vec3::splat(0.2), 0.04).unwrap();
        let seen = |cosine: f32| {
            let to_camera = Vec3::new((1.0 - cosine * cosine).sqrt(), cosine, 0.0);
            let at = ShadingPoint { normal: Vec3::Y, to_camera, ..ShadingPoint::FACING };
            surface.shade(&Lane::default(), &at, Vec4::ONE).x
        };
        for (cosine, share) in [(1.0, 0.04), (0.5, 0.04 + 0.96 / 32.0), (0.0, 1.0)] {
            let expected = 0.2 + 0.8 * share;
            assert!((seen(cosine) - expected).abs() < 1e-6, "{cosine}: {} {expected}", seen(cosine));
        }
    }
}
