//! The shading pass. Each sample is shaded alone, because its light depends on its time and its point of the
//! light.

use activity::{Counts, Event, Packet, PacketKind};
use glam::{DVec3, Vec3};
use pipeline::geometry::Projection;
use pipeline::sample_test::exact::weights;
use pipeline::sampling::{Sample, SampleSource};
use pipeline::setup::Corner;
use pipeline::{Camera, Gpu, Viewport};
use rayon::prelude::*;

use super::light::AreaLight;
use super::map::{ShadowMap, View};
use crate::accumulation::Rays;

/// Ambient light, relative to the light on a surface that faces the light.
const AMBIENT: f32 = 0.18;

/// Source of the shadows.
#[derive(Clone, Copy)]
pub enum Shadows<'a> {
    /// A shadow map; points less than `bias` scene units behind the stored depth are lit.
    Map {
        /// The map.
        map: &'a ShadowMap,
        /// Depth bias, scene units.
        bias: f64,
    },
    /// Rays to the light, against all triangles: the ground truth.
    Rays,
    /// No shadows.
    None,
}

/// A frame to be shaded: surfaces, camera and light.
pub struct World<'a> {
    /// The camera, a pinhole.
    pub camera: &'a Camera,
    /// Size of the image.
    pub viewport: Viewport,
    /// The light.
    pub light: &'a AreaLight,
    /// Linear RGB reflectance of each draw.
    pub albedos: &'a [Vec3],
    /// Linear RGB radiance of the background.
    pub background: Vec3,
    rays: Rays,
    projection: Projection,
}

/// Surface point of a sample.
struct Point {
    place: DVec3,
    normal: DVec3,
    albedo: Vec3,
    triangle: u32,
}

impl<'a> World<'a> {
    /// Makes the world of a frame.
    pub fn new(
        view: &View<'a>,
        viewport: Viewport,
        light: &'a AreaLight,
        albedos: &'a [Vec3],
        background: Vec3,
    ) -> Self {
        let View { camera, draws } = *view;
        let projection = Projection::new(camera, viewport);
        Self { camera, viewport, light, albedos, background, rays: Rays::new(draws), projection }
    }

    /// Renders the image: the mean over each pixel's samples, in order.
    pub fn image(&self, samples: &dyn SampleSource, seen: &[(u32, u32)], shadows: Shadows<'_>) -> Vec<Vec3> {
        let (width, per_pixel) = (self.viewport.width(), samples.per_pixel() as usize);
        let pixel = |(place, seen): (usize, &[(u32, u32)])| {
            let [px, py] = [place as u32 % width, place as u32 / width];
            let mut at = vec![Sample::default(); per_pixel];
            samples.pixel_into(px, py, &mut at);
            let colours = at.iter().zip(seen).enumerate();
            let colours = colours.map(|(index, (sample, (triangle, _)))| {
                self.point([px, py], sample, *triangle)
                    .map_or(self.background, |point| self.shade(&point, sample, index, shadows))
            });
            colours.sum::<Vec3>() / per_pixel as f32
        };
        seen.par_chunks_exact(per_pixel).enumerate().map(pixel).collect()
    }

    /// For each sample, whether its point is lit; `None` if it sees no surface that faces the light.
    pub fn lit_and_unlit(
        &self,
        samples: &dyn SampleSource,
        seen: &[(u32, u32)],
        shadows: Shadows<'_>,
    ) -> Vec<Option<bool>> {
        let (width, per_pixel) = (self.viewport.width(), samples.per_pixel() as usize);
        let pixel = |(place, seen): (usize, &[(u32, u32)])| {
            let [px, py] = [place as u32 % width, place as u32 / width];
            let mut at = vec![Sample::default(); per_pixel];
            samples.pixel_into(px, py, &mut at);
            let of = |(index, (sample, (triangle, _))): (usize, (&Sample, &(u32, u32)))| {
                let point = self.point([px, py], sample, *triangle)?;
                let toward = self.light.point([sample.u, sample.v]) - point.place;
                (point.normal.dot(toward) > 0.0).then(|| self.is_lit(&point, sample, index, shadows))
            };
            at.iter().zip(seen).enumerate().map(of).collect::<Vec<_>>()
        };
        seen.par_chunks_exact(per_pixel).enumerate().flat_map_iter(pixel).collect()
    }

    /// World position of a sample's point, for counting the cost of the look-up.
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

    /// Lambert's law for one point of the light, plus ambient light.
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
                !self.rays.is_blocked(point.place, light, sample.t, point.triangle)
            }
            Shadows::None => true,
        }
    }
}

/// Operations per sample: vertices at its time (15), weights of its point (12), the point (9), the normal
/// (15), the point in the light's map (14), the comparison (2), Lambert's law (9).
const OPS: u32 = 76;
/// Bytes of a stored depth and of an image pixel.
const BYTES: u64 = 4;

/// Emits the packets of the pass that shades the visible samples, one per tile, and returns their sum.
pub fn look_up_packets(
    world: &World<'_>,
    (samples, seen): (&dyn SampleSource, &[(u32, u32)]),
    map: &ShadowMap,
    gpu: &mut Gpu<'_>,
) -> Counts {
    gpu.wait();
    let pass = gpu.begin("look-ups");
    let image = gpu.surface(world.viewport.pixels() as u64 * BYTES);
    let (width, height) = (world.viewport.width(), world.viewport.height());
    let (side, per_pixel) = (gpu.spec().tile_px, samples.per_pixel() as usize);
    let mut counts = Counts::default();
    let mut at = vec![Sample::default(); per_pixel];
    let tiles = (0..height)
        .step_by(side as usize)
        .flat_map(|y| (0..width).step_by(side as usize).map(move |x| [x, y]));
    for (tile, [x0, y0]) in (0..).zip(tiles) {
        let mut packet = Packet { tile, ..Packet::new(PacketKind::Tile, pass) };
        for [px, py] in
            (y0..height.min(y0 + side)).flat_map(|y| (x0..width.min(x0 + side)).map(move |x| [x, y]))
        {
            let pixel = py as usize * width as usize + px as usize;
            samples.pixel_into(px, py, &mut at);
            for (index, (sample, (triangle, _))) in at.iter().zip(&seen[pixel * per_pixel..]).enumerate() {
                let Some(point) = world.position([px, py], sample, *triangle) else { continue };
                packet.counts[Event::PixelInvocations] += 1;
                packet.counts[Event::ShaderOps] += OPS;
                if let Some((place, _)) = map.place(world.light, point, index) {
                    packet.counts[Event::TextureFetches] += 1;
                    gpu.memory().texture(map.address(place), &mut packet.counts);
                }
            }
            packet.counts[Event::PixelsResolved] += 1;
            gpu.memory().colour(image.address() + pixel as u64 * BYTES, true, true, &mut packet.counts);
        }
        counts += &packet.counts;
        gpu.push(&packet, 0);
    }
    gpu.keep(image);
    counts
}
