//! Random scenes, and a brute-force image as the reference.

pub mod case;
pub mod meshes;
mod probe;
pub mod stage;

use glam::{Affine3A, Vec3, Vec4};
use pipeline::conservative::{Grid, MovingTriangle, Rasterizer, Rect, Region, Touch};
use pipeline::depth::DepthSpec;
use pipeline::random::{GOLDEN, SplitMix, mix};
use pipeline::sample_test::{Hits, StoredSamples, test_run};
use pipeline::sampling::{Sample, TileSamples};
use pipeline::setup::{SetupResult, Triangle, set_up};
use pipeline::traversal::Box5;
use pipeline::*;
pub use probe::{Probe, SamplePosition, repeated, sample_positions, weight};
use proptest::prelude::*;

/// Uniform numbers in [0, 1).
pub struct Uniform(SplitMix);

impl Uniform {
    pub fn new(seed: u64) -> Self {
        Self(SplitMix::new(mix(seed.wrapping_mul(GOLDEN) + 1)))
    }

    pub fn next(&mut self) -> f32 {
        self.within(0.0, 1.0)
    }

    pub fn within(&mut self, lo: f32, hi: f32) -> f32 {
        self.0.within_single(lo, hi)
    }
}

/// Intervals in which a triangle may touch `rect` within `region`, or `None` if it cannot: a grid of one tile.
pub fn touch(
    rasterizer: &Rasterizer,
    triangle: &MovingTriangle,
    rect: &Rect,
    region: &Region,
) -> Option<Touch> {
    let tile = [rect.x, rect.y].map(|[lo, hi]| hi - lo);
    let grid = Grid { origin: [rect.x[0], rect.y[0]], tile, columns: 1, rows: 1 };
    let mut found = None;
    rasterizer.clipped(*region).rasterize(triangle, &grid, |_, touch| found = Some(*touch));
    found
}

/// A shader whose colour is a function of the normal.
pub struct Plain;

impl Shader for Plain {
    fn shade(&self, _lane: &Lane, at: &ShadingPoint, _texel: Vec4) -> Vec4 {
        at.normal.abs().extend(1.0)
    }
}

/// Shows its texture.
pub struct Textured(pub Texture);

impl Shader for Textured {
    fn texture(&self) -> Option<&Texture> {
        Some(&self.0)
    }

    fn shade(&self, _lane: &Lane, _at: &ShadingPoint, texel: Vec4) -> Vec4 {
        texel
    }
}

/// Triangle soup at both ends of the shutter, in front of a camera at the origin that looks along +z.
pub struct Soup {
    pub open: Vec<Vec3>,
    pub close: Vec<Vec3>,
    pub triangles: Vec<[u32; 3]>,
}

/// Kind of a soup.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SoupKind {
    Still,
    Moving,
    /// A third of the triangles reach behind the camera.
    Crossing,
    /// Slivers, and triangles that turn over.
    Slivers,
    /// Vertices on a coarse grid, shared and aligned with samples, so that ties are frequent.
    Grid,
    /// Large layers, each slightly nearer than the one before, so that depth culling matters.
    Layers,
}

impl SoupKind {
    pub const ALL: [Self; 6] =
        [Self::Still, Self::Moving, Self::Crossing, Self::Slivers, Self::Grid, Self::Layers];
}

/// All kinds with equal probability.
pub fn kinds() -> impl Strategy<Value = SoupKind> {
    prop::sample::select(&SoupKind::ALL[..])
}

impl Soup {
    pub fn new(kind: SoupKind, count: u32, seed: u64) -> Self {
        let mut r = Uniform::new(seed);
        let (mut open, mut close) = (Vec::new(), Vec::new());
        for triangle in 0..count {
            let behind = kind == SoupKind::Crossing && triangle % 3 == 0;
            let middle = Vec3::new(
                r.within(-4.0, 4.0),
                r.within(-4.0, 4.0),
                r.within(if behind { -3.0 } else { 2.0 }, 12.0),
            );
            let size = if behind { 4.0 } else { r.within(0.05, 2.0) };
            let drift = Vec3::new(r.within(-2.0, 2.0), r.within(-2.0, 2.0), r.within(-1.0, 1.0));
            for corner in 0..3 {
                let mut offset =
                    Vec3::new(r.within(-1.0, 1.0), r.within(-1.0, 1.0), r.within(-1.0, 1.0)) * size;
                if kind == SoupKind::Slivers && corner == 2 {
                    offset = (open[open.len() - 1] - middle) * 0.999 + offset * 1e-4;
                }
                let p = middle + offset;
                let wobble = Vec3::new(r.within(-0.5, 0.5), r.within(-0.5, 0.5), r.within(-0.5, 0.5));
                open.push(p);
                close.push(if kind == SoupKind::Still { p } else { p + drift + wobble * size });
            }
        }
        if kind == SoupKind::Layers {
            for end in [&mut open, &mut close] {
                for (corner, p) in end.iter_mut().enumerate() {
                    *p = Vec3::new(p.x * 5.0, p.y * 5.0, 6.0 - 1e-5 * (corner / 3) as f32);
                }
            }
        }
        if kind == SoupKind::Grid {
            // With 50 rows and a half field of view of 0.7, this puts vertices on pixel corners at depth 4.
            let px = |c: f32| (c * 10.0).round() * (4.0 * 0.7 / 25.0);
            let snap = |p: &mut Vec3| *p = Vec3::new(px(p.x), px(p.y), 4.0);
            open.iter_mut().for_each(snap);
            close = open.iter().enumerate().map(|(i, p)| if i % 9 < 3 { *p + Vec3::X } else { *p }).collect();
        }
        Self { open, close, triangles: (0..count).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect() }
    }

    pub fn draw<'a>(&'a self, shader: &'a dyn Shader, cull: Cull) -> Draw<'a> {
        let still = self.open == self.close;
        let close = if still { &self.open } else { &self.close };
        Draw::new(Geometry::new(&self.open, close, &self.triangles).unwrap(), shader, cull)
    }
}

/// A table whose samples are on or next to the borders of pixels, shutter and lens, where tile tests round.
pub fn border_table(seed: u64) -> SampleTable {
    let below_one = 1.0 - f32::EPSILON / 2.0;
    let mut r = Uniform::new(seed);
    let mut pick = |choices: [f32; 4]| choices[(r.next() * 4.0) as usize];
    let unit = [0.0, below_one, 0.5, f32::EPSILON];
    let lens = [-1.0, 1.0, 0.0, below_one];
    let samples = (0..64 * 64 * 4)
        .map(|_| Sample { x: pick(unit), y: pick(unit), u: pick(lens), v: pick(lens), t: pick(unit) })
        .collect();
    SampleTable::programmed(4, seed, samples).unwrap()
}

/// Number of combinations of enabled tests.
pub const SWITCHES: u32 = 1 << 7;

/// One combination.
pub fn switched(switches: u32) -> Features {
    let on = |bit: u32| switches & (1 << bit) != 0;
    Features {
        lens_lines: on(0),
        side_planes: on(1),
        facing: on(2),
        edges: on(3),
        coarse: on(4),
        screen: on(5),
        z_max: on(6),
        ..Features::ALL
    }
}

pub fn spec(features: Features) -> PipelineSpec {
    let lines = CacheSpec::lru(256, 4);
    PipelineSpec {
        tile_px: 8,
        coarse_tile_px: 32,
        batch_triangles: 100,
        vertex_reuse: 16,
        shading_cache: CacheSpec::lru(1024, 4),
        shading: Shading::Cached,
        memory: MemorySpec {
            depth: lines,
            colour: lines,
            texture: lines,
            bins: None,
            l2: CacheSpec::lru(4096, 8),
            llc: None,
            edram: None,
            compression: Default::default(),
        },
        features,
        depth: DepthSpec::default(),
        compute: None,
        warp_lanes: 32,
    }
}

/// Kind of camera; `lens.into()` is one in perspective.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Optics {
    pub lens: bool,
    pub parallel: bool,
}

impl From<bool> for Optics {
    fn from(lens: bool) -> Self {
        Self { lens, parallel: false }
    }
}

pub fn camera(optics: impl Into<Optics>) -> Camera {
    let Optics { lens, parallel } = optics.into();
    // The orthographic view has the size of the perspective one at depth 4, so the grid is on pixels in both.
    let make = if parallel { Camera::orthographic } else { Camera::new };
    let camera = make(Affine3A::IDENTITY, if parallel { 2.8 } else { 0.7 }, 0.25).unwrap();
    camera.with_lens(lens.then(|| Lens::new(0.3, 6.0).unwrap()))
}

/// Samples of a tile of 8x8 pixels, and all triangles of a soup set up for them.
pub struct TileOfSoup<'a> {
    pub samples: &'a TileSamples,
    pub origin: [u32; 2],
    set_up: &'a dyn Fn(usize, Cull) -> Option<Triangle>,
}

impl TileOfSoup<'_> {
    /// Tests all samples against triangle `id`, on the full path: no dimension is dropped.
    pub fn test(&self, id: usize, cull: Cull, depth: &mut [f32], triangle: &mut [u32]) -> Vec<u16> {
        let mut hits = Hits::default();
        if let Some(ready) = (self.set_up)(id, cull) {
            let mut target = StoredSamples { depth, triangle };
            test_run(&ready, self.samples, &Box5::whole(true), 0.25, &mut target, &mut hits);
        }
        hits.written
    }
}

/// Calls `each` with every tile of the image of a soup.
pub fn every_tile(
    soup: &Soup,
    optics: impl Into<Optics>,
    viewport: Viewport,
    table: &SampleTable,
    mut each: impl FnMut(&TileOfSoup<'_>),
) {
    let optics = optics.into();
    let camera = camera(optics);
    let shear = if optics.lens {
        let s = 0.5 * f64::from(viewport.height()) / f64::from(camera.half_height()) * f64::from(0.3_f32);
        Shear::new([s as f32, -s as f32], [(s / 6.0) as f32, -(s / 6.0) as f32])
    } else {
        Shear::default()
    };
    let shear = Shear { parallel: optics.parallel, ..shear };
    let image = |p: Vec3| {
        let k = 0.5 * f64::from(viewport.height()) / f64::from(camera.half_height());
        [(k * f64::from(p.x)) as f32, (-k * f64::from(p.y)) as f32, p.z]
    };
    let vertex =
        |i: u32| MovingVertex { open: image(soup.open[i as usize]), close: image(soup.close[i as usize]) };
    let set_up = |id: usize, cull: Cull| {
        let v = soup.triangles[id].map(vertex);
        let half = [0.5 * viewport.width() as f32, 0.5 * viewport.height() as f32];
        match set_up(id as u32, [&v[0], &v[1], &v[2]], cull, &shear, 0.25, half) {
            SetupResult::Ready(ready) => Some(Triangle { moving: true, ..ready }),
            _ => None,
        }
    };
    let mut samples = TileSamples::default();
    for py in (0..viewport.height()).step_by(8) {
        for px in (0..viewport.width()).step_by(8) {
            samples.fill(table, viewport, &shear, [px, py], 8);
            each(&TileOfSoup { samples: &samples, origin: [px, py], set_up: &set_up });
        }
    }
}

/// Triangle (`u32::MAX` for none) and depth of every sample, pixel by pixel in rows, by testing all triangles
/// against all samples.
pub fn brute_force(
    soup: &Soup,
    cull: Cull,
    optics: impl Into<Optics>,
    viewport: Viewport,
    table: &SampleTable,
) -> Vec<(u32, u32)> {
    let mut seen = vec![(u32::MAX, f32::INFINITY.to_bits()); viewport.pixels() * table.per_pixel() as usize];
    every_tile(soup, optics, viewport, table, |tile| {
        let mut depth = vec![f32::INFINITY; tile.samples.len];
        let mut triangle = vec![u32::MAX; tile.samples.len];
        for id in 0..soup.triangles.len() {
            tile.test(id, cull, &mut depth, &mut triangle);
        }
        for slot in 0..tile.samples.len {
            let index = tile.samples.in_image(slot, tile.origin, 8, viewport, table.per_pixel());
            seen[index] = (triangle[slot], depth[slot].to_bits());
        }
    });
    seen
}

/// A shader of one colour, in four operations.
pub struct Flat(pub Vec3);

impl Shader for Flat {
    fn shade(&self, lane: &Lane, _at: &ShadingPoint, texel: Vec4) -> Vec4 {
        lane.mul(self.0.extend(1.0), texel)
    }
}

/// A camera at the origin for which `(x, y, z)` appears at `(x / z, -y / z)` pixels from the centre of the
/// image.
pub fn pixel_camera(viewport: Viewport, near: f32) -> Camera {
    Camera::new(Affine3A::IDENTITY, 0.5 * viewport.height() as f32, near).unwrap()
}

/// Triangles of one quad with corners `0, 1, 2, 3` in counter-clockwise order on the screen.
pub const QUAD: [[u32; 3]; 2] = [[0, 1, 2], [0, 2, 3]];

/// A rectangle `x0..x1` by `y0..y1` in pixels from the centre of the image, `y` upwards, at depth `z`, for
/// [`pixel_camera`] and [`QUAD`].
pub fn rectangle(x: [f32; 2], y: [f32; 2], z: f32) -> [Vec3; 4] {
    [[x[0], y[0]], [x[1], y[0]], [x[1], y[1]], [x[0], y[1]]].map(|[x, y]| Vec3::new(x * z, y * z, z))
}

pub fn culls() -> impl Strategy<Value = Cull> {
    prop_oneof![Just(Cull::None), Just(Cull::Back), Just(Cull::Front)]
}
