//! Caustics on the modelled hardware: beams in conservative mode, with a shader that tests the pixels of a tile and
//! adds the light of those that are covered.

use glam::{DVec3, Vec3};
use pipeline::conservative::{Grid, MovingTriangle, Rasterizer, View};
use pipeline::memory::MemoryRange;
use pipeline::{ConservativeDraw, Gpu, Lanes, Primitive, TileIntervals, TileShader};

use super::bound::BoundingVolume;
use super::cover::{EVERYWHERE, MAX_HALVINGS, TILE_PX, reach, slack};
use super::draw::Picture;
use super::eye::Seen;
use super::light::PixelInBeam;
use super::{Beam, Eye, Light, Method};

/// Bytes of a vertex at both ends of a beam.
const VERTEX_BYTES: u32 = 24;
/// Bytes per pixel of the buffer that accumulates light.
const LIGHT_BYTES: u64 = 4;
/// Colour of light in water, linear RGB.
const TINT: Vec3 = Vec3::new(0.55, 0.9, 1.0);
/// Pixels of a tile.
const TILE_PIXELS: u64 = (TILE_PX * TILE_PX) as u64;

/// The buffer that accumulates light, tile by tile.
#[derive(Clone, Copy)]
pub(super) struct LightBuffer {
    region: MemoryRange,
    /// Tiles in a row of the image.
    columns: u32,
}

impl LightBuffer {
    /// Where the light of a pixel begins.
    fn offset(&self, [x, y]: [u32; 2]) -> u64 {
        let tile = u64::from(y / TILE_PX * self.columns + x / TILE_PX);
        (tile * TILE_PIXELS + u64::from(y % TILE_PX * TILE_PX + x % TILE_PX)) * LIGHT_BYTES
    }
}

/// Draws the light in colours, in a pass that reads it; `white` is white. The host has read the light to find that.
pub(super) fn tone_on(
    gpu: &mut Gpu<'_>,
    eye: &Eye,
    light: &[f64],
    buffer: LightBuffer,
    white: f64,
) -> Vec<Vec3> {
    gpu.wait();
    let viewport = eye.viewport();
    let mut drawn = gpu.shade_pixels("tone", viewport, |lanes, at @ [x, y]| {
        lanes.fetch(buffer.region.address() + buffer.offset(at), LIGHT_BYTES);
        let light = light[(y * viewport.width() + x) as usize];
        lanes.run(|lane| lane.scale(TINT, lane.div(light, white) as f32))
    });
    drawn.images.swap_remove(0)
}

/// Draws beams in a pass of `gpu`. The picture is that of [`super::draw()`].
pub(super) fn draw_on(
    gpu: &mut Gpu<'_>,
    beams: &[Beam],
    eye: &Eye,
    method: Method,
    light: Light,
) -> (Picture, LightBuffer) {
    let seen: Vec<Option<Seen>> = beams.iter().map(|beam| eye.see(beam)).collect();
    let viewport = eye.viewport();
    let [half_width, half_height] = viewport.half_px().map(f64::from);
    let [columns, rows] = [viewport.width(), viewport.height()].map(|side| side.div_ceil(TILE_PX));
    let side = f64::from(TILE_PX);
    let grid = Grid { origin: [-half_width, -half_height], tile: [side; 2], columns, rows };
    let region = gpu.allocate(u64::from(columns * rows) * TILE_PIXELS * LIGHT_BYTES);
    let buffer = LightBuffer { region, columns };
    let (primitives, faces) = primitives(&seen, method, &grid);
    let vertices = gpu.allocate(3 * primitives.len() as u64 * u64::from(VERTEX_BYTES));
    // The maps of a GPU with other tiles cannot show these.
    let of_image = (gpu.spec().tile_px == TILE_PX).then_some(viewport);
    let mut picture = Picture {
        light: vec![0.0; viewport.pixels()],
        runs: vec![0; viewport.pixels()],
        useful: 0,
        tiles: 0,
        tests: 0,
        skipped: seen.iter().filter(|seen| seen.is_none()).count() as u64,
    };
    let draw = ConservativeDraw {
        primitives: &primitives,
        grid: &grid,
        block: 1,
        vertices,
        vertex_bytes: VERTEX_BYTES,
        projection: Some(eye.projection()),
    };
    let shader = LightShader { eye, seen: &seen, faces: &faces, light, buffer };
    let mut pass = gpu.begin_conservative("light", of_image);
    pass.draw(gpu, &draw, &shader, |_, shaded| {
        picture.tiles += 1;
        picture.tests += u64::from(shaded.tests);
        for (place, light) in shaded.lit {
            picture.runs[place] += 1;
            picture.light[place] += light;
            picture.useful += u64::from(light > 0.0);
        }
    });
    (picture, buffer)
}

/// A face of a bounding volume, or none for a moving triangle, of a beam.
struct Face {
    beam: usize,
    corners: Option<[DVec3; 3]>,
}

/// The triangles of every beam, and what they are.
fn primitives(seen: &[Option<Seen>], method: Method, grid: &Grid) -> (Vec<Primitive>, Vec<Face>) {
    let whole = Rasterizer::new(View::orthographic()).halving(MAX_HALVINGS);
    let (mut primitives, mut faces, mut volume) = (Vec::new(), Vec::new(), BoundingVolume::new());
    let mut add = |beam: usize, ends: [[DVec3; 3]; 2], corners: Option<[DVec3; 3]>| {
        let [open, close] = ends.map(|end| end.map(|p| p.to_array()));
        let Some(triangle) = MovingTriangle::new(open, close) else { return };
        let (scissor, body, keeps_back_faces_only) =
            ([0..grid.columns, 0..grid.rows], beam as u32, corners.is_some());
        primitives.push(Primitive {
            triangle,
            rasterizer: whole,
            scissor,
            body,
            reuses_vertices: false,
            keeps_back_faces_only,
        });
        faces.push(Face { beam, corners });
    };
    for (beam, seen) in seen.iter().enumerate() {
        let Some(seen) = seen else { continue };
        if method == Method::Moving {
            add(beam, [seen.image.open, seen.image.close], None);
            continue;
        }
        method.bounding_volumes(&seen.image, &mut volume);
        volume.iter().for_each(|face| add(beam, [*face; 2], Some(*face)));
    }
    (primitives, faces)
}

/// The shader of the light.
struct LightShader<'a> {
    eye: &'a Eye,
    seen: &'a [Option<Seen>],
    faces: &'a [Face],
    light: Light,
    buffer: LightBuffer,
}

/// Result for a tile.
struct Shaded {
    /// Pixels tested.
    tests: u32,
    /// Covered pixels, by position in the image, with their light.
    lit: Vec<(usize, f64)>,
}

/// Pixels that a beam has covered in each tile that it touches. Each runs once for a beam, as with a stencil.
#[derive(Default)]
struct Masks(Vec<([u32; 2], u64)>);

impl Masks {
    fn at(&mut self, tile: [u32; 2]) -> &mut u64 {
        let place = self.0.iter().position(|(known, _)| *known == tile).unwrap_or(self.0.len());
        if place == self.0.len() {
            self.0.push((tile, 0));
        }
        &mut self.0[place].1
    }
}

impl TileShader for LightShader<'_> {
    type BodyState = Masks;
    type Output = Shaded;

    fn run(&self, masks: &mut Masks, lanes: &Lanes, tile: &TileIntervals<'_>) -> Option<Shaded> {
        let Face { beam, corners } = &self.faces[tile.primitive];
        let seen = self.seen[*beam].as_ref()?;
        let (eye, viewport) = (self.eye, self.eye.viewport());
        let (reach, slack) = match corners {
            None => (reach(seen, tile.touch), 0.0),
            Some(face) => (EVERYWHERE, slack(eye, face)),
        };
        let flat = corners.map(|face| face.map(|p| [p.x, p.y]));
        let mask = masks.at(tile.tile);
        let covered = *mask;
        let mut shaded = Shaded { tests: 0, lit: Vec::new() };
        for bit in (0..TILE_PX * TILE_PX).filter(|bit| covered >> bit & 1 == 0) {
            let [x, y] = [tile.tile[0] * TILE_PX + bit % TILE_PX, tile.tile[1] * TILE_PX + bit / TILE_PX];
            let at = eye.pixel_centre([x, y]);
            let near = (0..2).all(|axis| (reach[axis][0]..=reach[axis][1]).contains(&at[axis]));
            if !near || x >= viewport.width() || y >= viewport.height() {
                continue;
            }
            shaded.tests += 1;
            let times = match flat {
                Some(face) => lanes.is_inside(&face, at, slack).then_some(None),
                None => {
                    let times = lanes.times_at(&seen.triangle, eye.shear(), at);
                    times.iter().any(|face| !face.as_slice().is_empty()).then_some(Some(times))
                }
            };
            let Some(times) = times else { continue };
            *mask |= 1 << bit;
            let light = lanes.run(|lane| self.light.shade(lane, &PixelInBeam { eye, seen, at, times }));
            lanes.blend(self.buffer.region, self.buffer.offset([x, y]), LIGHT_BYTES);
            shaded.lit.push(((y * viewport.width() + x) as usize, light));
        }
        Some(shaded)
    }
}
