//! The pass that is shaded: each sample by itself, as what is lit depends on its time and its place on the light.

use glam::{DVec3, Vec3};
use pipeline::geometry::Projection;
use pipeline::sample_test::exact::weights;
use pipeline::sampling::{Sample, SampleSource};
use pipeline::setup::Corner;
use pipeline::{Camera, Draw, Viewport};
use rayon::prelude::*;

use super::light::AreaLight;
use super::map::ShadowMap;
use crate::accumulation::Rays;

/// Light that comes from everywhere, as a part of what the light sends to a surface that faces it.
const AMBIENT: f32 = 0.18;

/// What decides whether a point is lit.
#[derive(Clone, Copy)]
pub enum Shadows<'a> {
    /// A shadow map; points less than `bias` scene units behind what it holds are lit.
    Map {
        /// The map.
        map: &'a ShadowMap,
        /// Scene units.
        bias: f64,
    },
    /// Rays to the light, against all triangles: the truth.
    Rays,
    /// Nothing throws a shadow.
    None,
}

/// A frame as it is shaded: what there is, who looks and what shines.
pub struct World<'a> {
    /// Who looks, through a pinhole.
    pub camera: &'a Camera,
    /// Size of the image.
    pub viewport: Viewport,
    /// What shines.
    pub light: &'a AreaLight,
    /// Linear RGB reflectance of each draw.
    pub albedos: &'a [Vec3],
    /// Linear RGB radiance where nothing is hit.
    pub background: Vec3,
    rays: Rays,
    projection: Projection,
}

/// A point of a surface that a sample sees.
struct Point {
    place: DVec3,
    normal: DVec3,
    albedo: Vec3,
    triangle: u32,
}

impl<'a> World<'a> {
    /// The world of a frame.
    pub fn new(
        (camera, draws): (&'a Camera, &[Draw<'_>]),
        viewport: Viewport,
        light: &'a AreaLight,
        albedos: &'a [Vec3],
        background: Vec3,
    ) -> Self {
        let projection = Projection::new(camera, viewport);
        Self { camera, viewport, light, albedos, background, rays: Rays::new(draws), projection }
    }

    /// The image: the mean over the samples of each pixel, in their order, each shaded by what it sees.
    pub fn image(&self, samples: &dyn SampleSource, seen: &[(u32, u32)], shadows: Shadows<'_>) -> Vec<Vec3> {
        let (width, each) = (self.viewport.width(), samples.per_pixel() as usize);
        let pixel = |(place, seen): (usize, &[(u32, u32)])| {
            let [px, py] = [place as u32 % width, place as u32 / width];
            let mut at = vec![Sample::default(); each];
            samples.pixel_into(px, py, &mut at);
            let colours = at.iter().zip(seen).enumerate();
            let colours = colours.map(|(index, (sample, (triangle, _)))| {
                self.point([px, py], sample, *triangle)
                    .map_or(self.background, |point| self.shade(&point, sample, index, shadows))
            });
            colours.sum::<Vec3>() / each as f32
        };
        seen.par_chunks_exact(each).enumerate().map(pixel).collect()
    }

    /// The share of samples that see a surface which faces the light and are lit, and of those that are not.
    pub fn lit_and_unlit(
        &self,
        samples: &dyn SampleSource,
        seen: &[(u32, u32)],
        shadows: Shadows<'_>,
    ) -> Vec<Option<bool>> {
        let (width, each) = (self.viewport.width(), samples.per_pixel() as usize);
        let pixel = |(place, seen): (usize, &[(u32, u32)])| {
            let [px, py] = [place as u32 % width, place as u32 / width];
            let mut at = vec![Sample::default(); each];
            samples.pixel_into(px, py, &mut at);
            let of = |(index, (sample, (triangle, _))): (usize, (&Sample, &(u32, u32)))| {
                let point = self.point([px, py], sample, *triangle)?;
                let toward = self.light.point([sample.u, sample.v]) - point.place;
                (point.normal.dot(toward) > 0.0).then(|| self.is_lit(&point, sample, index, shadows))
            };
            at.iter().zip(seen).enumerate().map(of).collect::<Vec<_>>()
        };
        seen.par_chunks_exact(each).enumerate().flat_map_iter(pixel).collect()
    }

    /// The world position that each sample sees, for those who count what looking it up costs.
    pub fn position(&self, pixel: [u32; 2], sample: &Sample, triangle: u32) -> Option<Vec3> {
        self.point(pixel, sample, triangle).map(|point| point.place.as_vec3())
    }

    fn point(&self, [px, py]: [u32; 2], sample: &Sample, triangle: u32) -> Option<Point> {
        let face = self.rays.faces().get(triangle as usize)?;
        let [x, y] = [(px, sample.x, self.viewport.width()), (py, sample.y, self.viewport.height())]
            .map(|(pixel, within, side)| (pixel as f32 - 0.5 * side as f32) + within);
        let seen = std::array::from_fn(|k| {
            let vertex = self.projection.vertex(face.ends[0][k], face.ends[1][k]);
            let [vx, vy, w] = Corner::new(&vertex).at(sample.t);
            [(-x).mul_add(w, vx), (-y).mul_add(w, vy), w]
        });
        let (weights, _) = weights(&seen).unwrap_or(([1.0 / 3.0; 3], true));
        let corners = face.at(sample.t);
        let place: DVec3 = (0..3).map(|k| weights[k] * corners[k]).sum();
        let normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]).normalize_or_zero();
        let to_camera = self.projection.eye().truncate().as_dvec3() - place;
        let normal = if normal.dot(to_camera) < 0.0 { -normal } else { normal };
        let albedo = self.albedos.get(face.draw).copied().unwrap_or(Vec3::ONE);
        Some(Point { place, normal, albedo, triangle })
    }

    /// Lambert's law under one place of the light, and light from everywhere.
    fn shade(&self, point: &Point, sample: &Sample, index: usize, shadows: Shadows<'_>) -> Vec3 {
        let toward = (self.light.point([sample.u, sample.v]) - point.place).normalize_or_zero();
        let facing = point.normal.dot(toward).max(0.0) as f32;
        let lit = facing > 0.0 && self.is_lit(point, sample, index, shadows);
        point.albedo * (AMBIENT + if lit { facing } else { 0.0 })
    }

    fn is_lit(&self, point: &Point, sample: &Sample, index: usize, shadows: Shadows<'_>) -> bool {
        match shadows {
            Shadows::Map { map, bias } => map.is_lit(self.light, point.place.as_vec3(), index, bias),
            Shadows::Rays => {
                let light = self.light.point([sample.u, sample.v]);
                !self.rays.blocked(point.place, light, sample.t, point.triangle)
            }
            Shadows::None => true,
        }
    }
}
