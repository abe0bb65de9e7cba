//! The shading pass. Each sample is shaded alone, because its light depends on its time and its point of the
//! light.

use glam::{DVec3, Vec3};
use pipeline::geometry::Projection;
use pipeline::memory::Surface;
use pipeline::sample_test::exact::weights;
use pipeline::sampling::{Sample, SampleSource};
use pipeline::setup::Corner;
use pipeline::{Camera, Client, Gpu, Lane, TileWork, Touch, Viewport};
use rayon::prelude::*;

use super::light::AreaLight;
use super::map::{ShadowMap, View};
use crate::accumulation::{RayWork, Rays};

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
    /// Rays to the light: the ground truth, and a rival.
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
        self.image_counted(samples, seen, shadows).0
    }

    /// The same with the work of its rays.
    pub fn image_counted(
        &self,
        samples: &dyn SampleSource,
        seen: &[(u32, u32)],
        shadows: Shadows<'_>,
    ) -> (Vec<Vec3>, RayWork) {
        let (width, per_pixel) = (self.viewport.width(), samples.per_pixel() as usize);
        let pixel = |(place, seen): (usize, &[(u32, u32)])| {
            let (place, mut shaded) = ([place as u32 % width, place as u32 / width], Shaded::default());
            (self.pixel(place, (samples, seen), shadows, &mut shaded), shaded.rays)
        };
        let pixels: Vec<_> = seen.par_chunks_exact(per_pixel).enumerate().map(pixel).collect();
        let mut work = RayWork::default();
        pixels.iter().for_each(|(_, rays)| work += *rays);
        (pixels.into_iter().map(|(colour, _)| colour).collect(), work)
    }

    /// Mean of the samples of a pixel, whose visible triangles are in `seen`; the work is added to `shaded`.
    fn pixel(
        &self,
        [px, py]: [u32; 2],
        (samples, seen): (&dyn SampleSource, &[(u32, u32)]),
        shadows: Shadows<'_>,
        shaded: &mut Shaded,
    ) -> Vec3 {
        let mut at = vec![Sample::default(); seen.len()];
        samples.pixel_into(px, py, &mut at);
        let colours = at.iter().zip(seen).enumerate().map(|(index, (sample, (triangle, _)))| {
            let Some(point) = self.point([px, py], sample, *triangle) else { return self.background };
            self.shade(&point, (sample, index), shadows, shaded)
        });
        colours.sum::<Vec3>() / seen.len() as f32
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
                let lane = Lane::default();
                let toward = self.light.point(&lane, [sample.u, sample.v]) - point.place;
                let is_lit = || self.is_lit(&lane, &point, (sample, index), shadows, &mut Shaded::default());
                (point.normal.dot(toward) > 0.0).then(is_lit)
            };
            at.iter().zip(seen).enumerate().map(of).collect::<Vec<_>>()
        };
        seen.par_chunks_exact(per_pixel).enumerate().flat_map_iter(pixel).collect()
    }

    /// Surface point of a sample: interpolation and normals are fixed functions, as in the pipeline.
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
    fn shade(&self, point: &Point, at: (&Sample, usize), shadows: Shadows<'_>, shaded: &mut Shaded) -> Vec3 {
        let lane = Lane::default();
        let light = self.light.point(&lane, [at.0.u, at.0.v]);
        let toward = lane.normalize(lane.sub(light, point.place));
        let facing = lane.max(lane.dot(point.normal, toward), 0.0) as f32;
        let lit = lane.branch(facing > 0.0) && self.is_lit(&lane, point, at, shadows, shaded);
        let colour = lane.scale(point.albedo, lane.add(AMBIENT, if lit { facing } else { 0.0 }));
        shaded.lanes += 1;
        shaded.ops += lane.ops();
        colour
    }

    fn is_lit(
        &self,
        lane: &Lane,
        point: &Point,
        (sample, index): (&Sample, usize),
        shadows: Shadows<'_>,
        shaded: &mut Shaded,
    ) -> bool {
        match shadows {
            Shadows::Map { map, bias } => {
                let at = (point.place.as_vec3(), index);
                map.is_lit(lane, self.light, at, bias, |place| shaded.fetches.push(place))
            }
            Shadows::Rays => {
                let light = self.light.point(&Lane::default(), [sample.u, sample.v]);
                !self.rays.is_blocked(point.place, light, sample.t, point.triangle, &mut shaded.rays)
            }
            Shadows::None => true,
        }
    }
}

/// Work of shading samples.
#[derive(Default)]
struct Shaded {
    /// Samples that see a surface.
    lanes: u32,
    /// Operations of their shader.
    ops: u32,
    /// Places of the fetched depths in the map.
    fetches: Vec<usize>,
    rays: RayWork,
}

/// Bytes of an image pixel and of a stored depth.
const BYTES: u64 = 4;

/// Colours of the pixels of a tile, row by row, with the work and the accesses of shading them.
struct ShadedTile {
    first: [u32; 2],
    colours: Vec<Vec3>,
    work: TileWork,
    touches: Vec<Touch>,
}

/// Shades the visible samples by the map in a pass of its own, and returns the image and the number of fetches.
pub fn look_ups(
    world: &World<'_>,
    (samples, seen): (&dyn SampleSource, &[(u32, u32)]),
    (map, bias): (&ShadowMap, f64),
    gpu: &mut Gpu<'_>,
) -> (Vec<Vec3>, u64) {
    gpu.wait();
    let viewport = world.viewport;
    let image = gpu.surface(viewport.pixels() as u64 * BYTES);
    let look_up = LookUp { world, samples, seen, map, bias, image, side: gpu.spec().tile_px };
    gpu.begin("look-ups", Some(viewport));
    let (mut colours, mut fetches) = (vec![Vec3::ZERO; viewport.pixels()], 0);
    for row in (0..viewport.height()).step_by(look_up.side as usize) {
        let columns: Vec<u32> = (0..viewport.width()).step_by(look_up.side as usize).collect();
        let tiles: Vec<ShadedTile> = columns.par_iter().map(|&column| look_up.tile([column, row])).collect();
        for tile in tiles {
            fetches += u64::from(tile.work.texture_fetches);
            for ([x, y], colour) in look_up.pixels(tile.first).zip(&tile.colours) {
                colours[(y * viewport.width() + x) as usize] = *colour;
            }
            gpu.tile(&tile.work, tile.touches);
        }
    }
    gpu.keep(image);
    (colours, fetches)
}

/// Inputs of the pass that shades by a map.
struct LookUp<'a> {
    world: &'a World<'a>,
    samples: &'a dyn SampleSource,
    seen: &'a [(u32, u32)],
    map: &'a ShadowMap,
    bias: f64,
    image: Surface,
    /// Side of a tile in pixels.
    side: u32,
}

impl LookUp<'_> {
    /// Pixels of the tile with a given first pixel, row by row.
    fn pixels(&self, [x0, y0]: [u32; 2]) -> impl Iterator<Item = [u32; 2]> + use<> {
        let (viewport, side) = (self.world.viewport, self.side);
        let columns = x0..viewport.width().min(x0 + side);
        (y0..viewport.height().min(y0 + side)).flat_map(move |y| columns.clone().map(move |x| [x, y]))
    }

    fn tile(&self, first: [u32; 2]) -> ShadedTile {
        let (width, per_pixel) = (self.world.viewport.width(), self.samples.per_pixel() as usize);
        let (mut shaded, mut touches, mut colours) = (Shaded::default(), Vec::new(), Vec::new());
        let touch = |client, address| {
            let write = client == Client::Colour;
            Touch { client, address, bytes: BYTES, write, fresh: write }
        };
        for [x, y] in self.pixels(first) {
            let pixel = (y * width + x) as usize;
            let seen = &self.seen[pixel * per_pixel..(pixel + 1) * per_pixel];
            let (shadows, before) = (Shadows::Map { map: self.map, bias: self.bias }, shaded.fetches.len());
            colours.push(self.world.pixel([x, y], (self.samples, seen), shadows, &mut shaded));
            let read =
                shaded.fetches[before..].iter().map(|&at| touch(Client::Texture, self.map.address(at)));
            touches.extend(read);
            touches.push(touch(Client::Colour, self.image.address() + pixel as u64 * BYTES));
        }
        let work = TileWork {
            tile: first[1] / self.side * width.div_ceil(self.side) + first[0] / self.side,
            lanes: shaded.lanes,
            shader_ops: shaded.ops,
            texture_fetches: shaded.fetches.len() as u32,
            pixels: colours.len() as u32,
            ..TileWork::default()
        };
        ShadedTile { first, colours, work, touches }
    }
}
