//! Meshes on the homogeneous image plane with shared vertices, and samples on their edges.

use super::{SamplePosition, Uniform, repeated, weight};
use pipeline::sampling::Sample;
use pipeline::*;
use proptest::prelude::*;

/// Dimensions in use.
#[derive(Clone, Copy, Debug)]
pub struct Dims {
    pub moving: bool,
    pub lens: bool,
    pub parallel: bool,
}

pub fn dims() -> impl Strategy<Value = Dims> {
    (any::<bool>(), any::<bool>(), any::<bool>()).prop_map(|(moving, lens, parallel)| Dims {
        moving,
        lens,
        parallel,
    })
}

/// Triangles on the homogeneous image plane that share vertices.
pub struct Mesh {
    pub vertices: Vec<MovingVertex>,
    pub triangles: Vec<[usize; 3]>,
}

impl Mesh {
    pub fn corners(&self, triangle: usize) -> [MovingVertex; 3] {
        self.triangles[triangle].map(|vertex| self.vertices[vertex])
    }
}

/// Samples of a tile of 8x8 pixels whose first pixel is at `origin_px` from the centre of the image. Most are
/// on edges or vertices of `mesh` within f32 precision, the rest anywhere.
pub fn on_edges(r: &mut Uniform, mesh: &Mesh, shear: &Shear, origin_px: [f32; 2], dims: Dims) -> SampleTable {
    const PER_PIXEL: usize = 8;
    let mut pixels: Vec<Vec<Sample>> = vec![Vec::new(); 64];
    for _ in 0..2000 {
        let below_one = |c: f32| c.min(1.0 - f32::EPSILON / 2.0);
        let coin = r.next();
        let time = if coin < 0.2 { 0.0 } else { below_one(r.next()) };
        let lens = [0, 1].map(|_| if coin < 0.1 { 1.0 } else { r.within(-1.0, 1.0) });
        let mut sample = Sample { x: 0.0, y: 0.0, u: lens[0], v: lens[1], t: time };
        if !dims.lens {
            (sample.u, sample.v) = (0.0, 0.0);
        }
        let position = SamplePosition {
            x: 0.0,
            y: 0.0,
            u: f64::from(sample.u),
            v: f64::from(sample.v),
            t: f64::from(sample.t),
        };
        let triangle = mesh.triangles[(r.next() * mesh.triangles.len() as f32) as usize];
        let [p, q] = [0, 1].map(|k| position.sheared(&mesh.vertices[triangle[k]], shear));
        let along = if r.next() < 0.2 { 0.0 } else { f64::from(r.next()) };
        let mix = |axis: usize| p[axis] + along * (q[axis] - p[axis]);
        let at = [0, 1].map(|axis| mix(axis) / weight(shear, mix(2)) - f64::from(origin_px[axis]));
        let inside = at.iter().all(|c| (0.0..8.0).contains(c));
        let at = if inside { at } else { [0, 1].map(|_| 8.0 * f64::from(r.next())) };
        let pixel = at[0] as usize + 8 * (at[1] as usize);
        (sample.x, sample.y) = (below_one(at[0].fract() as f32), below_one(at[1].fract() as f32));
        if pixels[pixel].len() < PER_PIXEL {
            pixels[pixel].push(sample);
        }
    }
    let anywhere = |r: &mut Uniform| Sample { x: r.next(), y: r.next(), u: 0.5, v: -0.25, t: r.next() };
    for pixel in &mut pixels {
        while pixel.len() < PER_PIXEL {
            pixel.push(anywhere(r));
        }
    }
    repeated(PER_PIXEL as u32, &pixels.concat())
}

pub fn random_shear(r: &mut Uniform, dims: Dims, reach: f32) -> Shear {
    let s = [r.within(0.2, 1.0) * reach, -r.within(0.2, 1.0) * reach];
    let focus = r.within(2.0, 8.0);
    let shear = if dims.lens { Shear::new(s, s.map(|s| s / focus)) } else { Shear::default() };
    Shear { parallel: dims.parallel, ..shear }
}

impl Dims {
    /// A vertex at this image position and depth.
    pub fn vertex(&self, at: [f32; 2], w: f32) -> [f32; 3] {
        let weight = if self.parallel { 1.0 } else { w };
        [at[0] * weight, at[1] * weight, w]
    }
}

/// Middle of the image, or the far corner of the largest one, where f32 pixels are coarse.
pub fn place(far: bool) -> (Viewport, [u32; 2], [f32; 2]) {
    if far {
        let side = Viewport::MAX_PX;
        (Viewport::new(side, side).unwrap(), [side - 8, 0], [8184.0, -8192.0])
    } else {
        (Viewport::new(8, 8).unwrap(), [0, 0], [-4.0, -4.0])
    }
}
