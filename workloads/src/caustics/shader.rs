//! Caustics on the modelled hardware: beams in conservative mode, with a shader that tests the pixels of a tile and
//! adds the light of those that are covered.

use glam::{DVec3, Vec3};
use pipeline::conservative::{Grid, MovingTriangle, Rasterizer, View};
use pipeline::memory::MemoryRange;
use pipeline::traversal::TimeIntervals;
use pipeline::{
    Atomic, Buffer, ComputePass, ConservativeDraw, Gpu, Group, GroupLane, GroupShader, Lane, Lanes,
    PassError, Placement, Primitive, TileIntervals, TileShader, Uses,
};

use super::bound::BoundingVolume;
use super::draw::{
    LightPicture, MAX_HALVINGS, TILE_PX, in_image, pixel_of, reach, reach_of_face, set_bits, slack,
    within_reach,
};
use super::light::{PixelInBeam, Seen};
use super::refraction::{BEAM_WORDS, BeamBuffer, GROUP_LANES, VERTICES_WORDS};
use super::{Beam, BeamMethod, Eye, LightQuantity};

/// Bytes of a vertex at one end of a beam.
const VERTEX_BYTES: u32 = 12;
/// Words of a face of a body.
const FACE_WORDS: u32 = 9;
/// Bytes per pixel of the buffer that accumulates light.
const LIGHT_BYTES: u64 = 4;
/// Bytes that mark the pixels of a tile: the number of the body that covered pixels of it last, and two words
/// of bits.
const MARK_BYTES: u64 = 12;
/// Bytes from the marks of a tile to those of the next.
const MARK_STRIDE: u64 = 16;
/// Colour of light in water, linear RGB.
const TINT: Vec3 = Vec3::new(0.55, 0.9, 1.0);
/// Pixels of a tile.
const TILE_PIXELS: u64 = (TILE_PX * TILE_PX) as u64;

/// The buffer that accumulates light, tile by tile.
#[derive(Clone, Copy, Debug)]
pub struct LightBuffer {
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

/// Draws the light in colours, in a pass that reads it; `white` is white.
///
/// # Errors
/// [`PassError`] if the GPU refuses the pass.
pub(super) fn tone_on(
    gpu: &mut Gpu<'_>,
    eye: &Eye,
    light: &[f64],
    buffer: LightBuffer,
    white: f64,
) -> Result<Vec<Vec3>, PassError> {
    // The host has read the light to find white.
    gpu.wait();
    let (viewport, uses) = (eye.viewport(), Uses::default().reading([buffer.region]));
    let drawn = gpu.shade_pixels("tone", viewport, uses, |lanes, at @ [x, y]| {
        lanes.fetch(buffer.region.address() + buffer.offset(at), LIGHT_BYTES);
        let light = light[(y * viewport.width() + x) as usize];
        lanes.run(|lane| lane.scale(TINT, lane.div(light, white) as f32))
    })?;
    Ok(drawn.into_image())
}

/// Draws beams that are in memory in a pass of `gpu`, after one that makes their bounding volumes, if there are
/// any. The picture is that of [`super::draw()`], and the light is in the buffer.
///
/// # Errors
/// [`PassError`] if the GPU does not take the pass that makes bounding volumes.
pub fn draw_on(
    gpu: &mut Gpu<'_>,
    beams: &[Beam],
    eye: &Eye,
    method: BeamMethod,
    light: LightQuantity,
) -> Result<(LightPicture, LightBuffer), PassError> {
    let buffer = BeamBuffer::new(gpu, beams.len(), method);
    draw_stored(gpu, (beams, buffer), eye, method, light)
}

/// The same of beams in `stored`.
pub(super) fn draw_stored(
    gpu: &mut Gpu<'_>,
    (beams, stored): (&[Beam], BeamBuffer),
    eye: &Eye,
    method: BeamMethod,
    light: LightQuantity,
) -> Result<(LightPicture, LightBuffer), PassError> {
    let seen: Vec<Option<Seen>> = beams.iter().map(|beam| eye.see(beam)).collect();
    let viewport = eye.viewport();
    let [half_width, half_height] = viewport.half_px().map(f64::from);
    let [columns, rows] = [viewport.width(), viewport.height()].map(|side| side.div_ceil(TILE_PX));
    let side = f64::from(TILE_PX);
    let grid = Grid { origin: [-half_width, -half_height], tile: [side; 2], columns, rows };
    let region = gpu.allocate(u64::from(columns * rows) * TILE_PIXELS * LIGHT_BYTES);
    let buffer = LightBuffer { region, columns };
    let (primitives, faces) = primitives(&seen, method, &grid);
    let input = if method == BeamMethod::Moving {
        Input::moving(&stored)
    } else {
        Input::bodies(gpu, method, (&seen, stored), &faces)?
    };
    let marks = gpu.allocate(u64::from(columns * rows) * MARK_STRIDE);
    let mut picture = LightPicture {
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
        vertices: input.vertices,
        vertex_bytes: input.vertex_bytes,
        projection: Some(eye.projection()),
    };
    let uses = Uses::default().reading([input.beams]).colours([region]).depths([marks]);
    let shader = LightShader { eye, seen: &seen, faces: &faces, light, buffer, input, marks };
    // The last tiles may reach beyond the image.
    let last = [(columns, viewport.width()), (rows, viewport.height())]
        .map(|(tiles, px)| f64::from(tiles * TILE_PX) / f64::from(px));
    let mut pass = gpu.begin_conservative("light", Some(Placement { first: [0.0; 2], last }), uses)?;
    pass.draw(gpu, &draw, &shader, |_, shaded| {
        picture.tiles += 1;
        picture.tests += u64::from(shaded.tests);
        for (place, light) in shaded.lit {
            picture.runs[place] += 1;
            picture.light[place] += light;
            picture.useful += u64::from(light > 0.0);
        }
    })?;
    pass.store(gpu, region)?;
    Ok((picture, buffer))
}

/// What a draw of beams reads from memory.
struct Input {
    /// Vertices of the primitives, at both ends of a moving triangle.
    vertices: MemoryRange,
    /// Bytes of a vertex.
    vertex_bytes: u32,
    /// Where the light finds what it needs of each beam beside the vertices of its primitives.
    beams: MemoryRange,
    /// Where that begins.
    first: u64,
    /// Bytes of that for a beam.
    beam_bytes: u64,
}

impl Input {
    /// The vertices of moving triangles, and the flux of each, as the light takes all else from the vertices.
    fn moving(stored: &BeamBuffer) -> Self {
        let (vertices, vertex_bytes) = (stored.words.region(), 2 * VERTEX_BYTES);
        let first = vertices.address() + 4 * u64::from(VERTICES_WORDS * stored.beams);
        Self { vertices, vertex_bytes, beams: vertices, first, beam_bytes: 4 }
    }

    /// The faces of bodies, which a pass makes from the beams.
    fn bodies(
        gpu: &mut Gpu<'_>,
        method: BeamMethod,
        (seen, stored): (&[Option<Seen>], BeamBuffer),
        faces: &[Face],
    ) -> Result<Self, PassError> {
        let beams = stored.words;
        let made = gpu.buffer("faces", &vec![0.0; faces.len() * FACE_WORDS as usize]);
        let count = gpu.buffer("count of faces", &[0]);
        let shader =
            VolumeShader { method, seen, beams, faces: made, first: firsts(seen.len(), faces), count };
        if !faces.is_empty() {
            gpu.dispatch(&ComputePass {
                name: "bounding volumes",
                groups: [(seen.len() as u32).div_ceil(GROUP_LANES), 1, 1],
                group_size: GROUP_LANES,
                shared_bytes: 0,
                bindings: &[beams.reads(), made.writes(), count.writes()],
                shader: &shader,
            })?;
        }
        let (vertices, beams) = (made.region(), beams.region());
        let beam_bytes = 4 * u64::from(BEAM_WORDS);
        Ok(Self { vertices, vertex_bytes: VERTEX_BYTES, beams, first: beams.address(), beam_bytes })
    }
}

/// Number of the first face of each beam.
fn firsts(beams: usize, faces: &[Face]) -> Vec<u32> {
    (0..beams).map(|beam| faces.partition_point(|face| face.beam < beam) as u32).collect()
}

/// Makes bounding volumes, a lane each.
struct VolumeShader<'a> {
    method: BeamMethod,
    seen: &'a [Option<Seen>],
    beams: Buffer<f32>,
    faces: Buffer<f32>,
    /// Place of the first face of each beam, which an atomic on `count` returns on hardware.
    first: Vec<u32>,
    count: Buffer<u32>,
}

impl GroupShader for VolumeShader<'_> {
    fn run(&self, group: &mut Group<'_>) {
        let (part, size) = (group.id()[0], group.size());
        group.lanes(|lane| self.volume(lane, lane.madd(part, size, lane.index())));
    }
}

impl VolumeShader<'_> {
    /// Reads a beam and writes the faces around it. Image coordinates stand for those in memory.
    fn volume(&self, lane: &GroupLane<'_, '_>, beam: u32) {
        if lane.branch(beam as usize >= self.seen.len()) {
            return;
        }
        let first = lane.mul(beam, BEAM_WORDS);
        (first..first + BEAM_WORDS).for_each(|word| _ = lane.load(self.beams, word));
        let seen = &self.seen[beam as usize];
        lane.branch(seen.is_some());
        let Some(seen) = seen else { return };
        let mut volume = BoundingVolume::new();
        self.method.bounding_volumes(lane, &seen.image, &mut volume);
        lane.atomic(self.count, 0, Atomic::Add, volume.len() as u32);
        let coordinates = volume.iter().flatten().flat_map(|corner| corner.to_array());
        for (word, value) in (lane.mul(self.first[beam as usize], FACE_WORDS)..).zip(coordinates) {
            lane.store(self.faces, word, value as f32);
        }
    }
}

/// A face of a bounding volume, or none for a moving triangle, of a beam.
struct Face {
    beam: usize,
    corners: Option<[DVec3; 3]>,
}

/// The triangles of every beam, and what they are.
fn primitives(seen: &[Option<Seen>], method: BeamMethod, grid: &Grid) -> (Vec<Primitive>, Vec<Face>) {
    let whole = Rasterizer::new(View::orthographic()).halving(MAX_HALVINGS).without_depths();
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
        if method == BeamMethod::Moving {
            add(beam, [seen.image.open, seen.image.close], None);
            continue;
        }
        method.bounding_volumes(&Lane::default(), &seen.image, &mut volume);
        volume.iter().for_each(|face| add(beam, [*face; 2], Some(*face)));
    }
    (primitives, faces)
}

/// The shader of the light.
struct LightShader<'a> {
    eye: &'a Eye,
    seen: &'a [Option<Seen>],
    faces: &'a [Face],
    light: LightQuantity,
    buffer: LightBuffer,
    input: Input,
    /// Marks of the tiles, row by row.
    marks: MemoryRange,
}

/// Result for a tile.
struct Shaded {
    /// Pixels tested.
    tests: u32,
    /// Covered pixels, by position in the image, with their light.
    lit: Vec<(usize, f64)>,
}

/// What a body has left in the marks of each tile that it touches.
#[derive(Default)]
struct Marks(Vec<([u32; 2], u64)>);

impl Marks {
    fn at(&mut self, tile: [u32; 2]) -> &mut u64 {
        let place = self.0.iter().position(|(known, _)| *known == tile).unwrap_or(self.0.len());
        if place == self.0.len() {
            self.0.push((tile, 0));
        }
        &mut self.0[place].1
    }
}

impl LightShader<'_> {
    /// Where the marks of a tile begin.
    fn mark(&self, [column, row]: [u32; 2]) -> u64 {
        u64::from(row * self.buffer.columns + column) * MARK_STRIDE
    }

    /// Tests these pixels of a tile, and shades those that are covered; their mask.
    fn pixels(
        &self,
        (lanes, seen): (&Lanes, &Seen),
        (first, pixels): ([u32; 2], u64),
        times_at: impl Fn([f64; 2]) -> Option<Option<[TimeIntervals; 2]>>,
        shaded: &mut Shaded,
    ) -> u64 {
        let (eye, viewport) = (self.eye, self.eye.viewport());
        let mut covered = 0;
        for bit in set_bits(pixels & in_image(eye, first)) {
            let [x, y] = pixel_of(first, bit);
            let at = eye.pixel_centre([x, y]);
            shaded.tests += 1;
            let Some(times) = times_at(at) else { continue };
            covered |= 1 << bit;
            let light = lanes.run(|lane| self.light.shade(lane, &PixelInBeam { eye, seen, at, times }));
            lanes.blend(self.buffer.region, self.buffer.offset([x, y]), LIGHT_BYTES);
            shaded.lit.push(((y * viewport.width() + x) as usize, light));
        }
        covered
    }

    /// A tile of a moving triangle, which comes to a tile once: the pixels within its reach.
    fn moving(&self, lanes: &Lanes, seen: &Seen, tile: &TileIntervals<'_>, shaded: &mut Shaded) {
        let first = tile.tile.map(|at| at * TILE_PX);
        let near = lanes
            .run(|lane| within_reach(lane, &reach(lane, seen, tile.touch), self.eye.pixel_centre(first)));
        let times_at = |at| {
            let times = lanes.times_at(&seen.triangle, self.eye.shear(), at);
            times.iter().any(|face| !face.as_slice().is_empty()).then_some(Some(times))
        };
        self.pixels((lanes, seen), (first, near), times_at, shaded);
    }

    /// A tile of a face of a body: the pixels within its reach. A pixel runs once for a body, as with a stencil: those
    /// that an earlier face of the body has covered are marked in memory.
    fn face(
        &self,
        marks: &mut Marks,
        (lanes, seen): (&Lanes, &Seen),
        (corners, tile): (&[DVec3; 3], [u32; 2]),
        shaded: &mut Shaded,
    ) {
        let (covered, first) = (marks.at(tile), tile.map(|at| at * TILE_PX));
        lanes.read(self.marks, self.mark(tile), MARK_BYTES);
        let (left, slack) = lanes.run(|lane| {
            // The number in memory is that of this body if it has covered pixels of the tile.
            let is_marked = lane.branch(*covered != 0);
            let near = within_reach(lane, &reach_of_face(lane, corners), self.eye.pixel_centre(first));
            let halves = |mask: u64| [mask as u32, (mask >> 32) as u32];
            let (marked, near) = (if is_marked { halves(*covered) } else { [0; 2] }, halves(near));
            let [low, high] = [0, 1].map(|half| lane.and(lane.xor(marked[half], u32::MAX), near[half]));
            (u64::from(high) << 32 | u64::from(low), slack(lane, self.eye, corners))
        });
        let flat = corners.map(|p| [p.x, p.y]);
        let times_at = |at| lanes.is_inside(&flat, at, slack).then_some(None);
        let found = self.pixels((lanes, seen), (first, left), times_at, shaded);
        if found != 0 {
            *covered |= found;
            lanes.merge(self.marks, self.mark(tile), MARK_BYTES);
        }
    }
}

impl TileShader for LightShader<'_> {
    type BodyState = Marks;
    type Output = Shaded;

    fn run(&self, marks: &mut Marks, lanes: &Lanes, tile: &TileIntervals<'_>) -> Option<Shaded> {
        let Face { beam, corners } = &self.faces[tile.primitive];
        let seen = self.seen[*beam].as_ref()?;
        let mut shaded = Shaded { tests: 0, lit: Vec::new() };
        let Input { first, beam_bytes, .. } = self.input;
        lanes.load(first + *beam as u64 * beam_bytes, beam_bytes);
        match corners {
            None => self.moving(lanes, seen, tile, &mut shaded),
            Some(corners) => self.face(marks, (lanes, seen), (corners, tile.tile), &mut shaded),
        }
        Some(shaded)
    }
}
