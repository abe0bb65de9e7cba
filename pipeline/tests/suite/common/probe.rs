//! Samples of one tile, tested against single triangles.

use pipeline::sample_test::{Hits, StoredSamples, test_run};
use pipeline::sampling::{Sample, TileSamples};
use pipeline::setup::{Corner, SetupResult, Triangle, set_up};
use pipeline::traversal::Box5;
use pipeline::*;

/// One tile of samples; single triangles are tested into a fresh target.
pub struct Probe {
    pub samples: TileSamples,
    pub shear: Shear,
    near: f32,
    half_px: [f32; 2],
}

impl Probe {
    pub const SIDE_PX: u32 = 8;

    /// The tile of 8x8 pixels at `origin` of `viewport`.
    pub fn new(table: &SampleTable, viewport: Viewport, shear: Shear, origin: [u32; 2], near: f32) -> Self {
        let mut samples = TileSamples::default();
        samples.fill(table, viewport, &shear, origin, Self::SIDE_PX);
        let half_px = [viewport.width(), viewport.height()].map(|side| 0.5 * side as f32);
        Self { samples, shear, near, half_px }
    }

    /// Position of the sample in `slot`.
    pub fn at(&self, slot: usize) -> SamplePosition {
        let s = &self.samples;
        SamplePosition {
            x: f64::from(s.x[slot]),
            y: f64::from(s.y[slot]),
            u: f64::from(s.u[slot]),
            v: f64::from(s.v[slot]),
            t: f64::from(s.t[slot]),
        }
    }

    pub fn set_up(&self, v: [MovingVertex; 3], cull: Cull) -> SetupResult {
        set_up(7, [&v[0], &v[1], &v[2]], cull, &self.shear, self.near, self.half_px)
    }

    /// The whole box, for a camera with or without a lens.
    pub fn whole(&self) -> Box5 {
        Box5::whole(!self.shear.is_none())
    }

    /// Depth of every sample that sees `triangle`, and the result of the test.
    pub fn test(&self, triangle: &Triangle, within: &Box5) -> (Vec<Option<f32>>, Hits) {
        let mut depth = vec![f32::INFINITY; self.samples.len];
        let mut owner = vec![u32::MAX; self.samples.len];
        let mut hits = Hits::default();
        let mut target = StoredSamples { depth: &mut depth, triangle: &mut owner };
        test_run(triangle, &self.samples, within, self.near, &mut target, &mut hits);
        let seen = depth.into_iter().zip(owner).map(|(d, id)| (id == triangle.id).then_some(d)).collect();
        (seen, hits)
    }

    /// Depth of every sample that sees the triangle with these vertices.
    pub fn see(&self, v: [MovingVertex; 3], cull: Cull) -> Vec<Option<f32>> {
        match self.set_up(v, cull) {
            SetupResult::Ready(triangle) => self.test(&triangle, &self.whole()).0,
            _ => vec![None; self.samples.len],
        }
    }

    /// The same without dropping triangles of no area in set-up: the sample test alone.
    pub fn see_without_area(&self, v: [MovingVertex; 3], cull: Cull) -> Vec<Option<f32>> {
        let still = |open| MovingVertex { open, close: open };
        let any = [[0.0, 0.0, 64.0], [64.0, 0.0, 64.0], [0.0, 64.0, 64.0]].map(still);
        match (self.set_up(v, cull), self.set_up(any, Cull::None)) {
            (SetupResult::Degenerate, SetupResult::Ready(ready)) => {
                let triangle = Triangle {
                    corners: [0, 1, 2].map(|k| Corner::new(&v[k])),
                    moving: v.iter().any(|vertex| !vertex.is_still()),
                    faces: [cull != Cull::Back, cull != Cull::Front],
                    ..ready
                };
                self.test(&triangle, &self.whole()).0
            }
            _ => self.see(v, cull),
        }
    }
}

/// Position of a sample in the five dimensions, `x` and `y` in pixels from the centre of the image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SamplePosition {
    pub x: f64,
    pub y: f64,
    pub u: f64,
    pub v: f64,
    pub t: f64,
}

impl SamplePosition {
    /// A vertex at the time and lens position of this sample, not rounded to f32: `[x, y, w]`.
    pub fn sheared(&self, vertex: &MovingVertex, shear: &Shear) -> [f64; 3] {
        let p: [f64; 3] = std::array::from_fn(|axis| {
            let (q, r) = (f64::from(vertex.open[axis]), f64::from(vertex.close[axis]));
            q + self.t * (r - q)
        });
        let [s, a] = [shear.s, shear.a].map(|c| c.map(f64::from));
        [p[0] + self.u * (a[0] * p[2] - s[0]), p[1] + self.v * (a[1] * p[2] - s[1]), p[2]]
    }
}

/// Factor of an image coordinate for a vertex at this depth: 1 in an orthographic view.
pub fn weight(shear: &Shear, depth: f64) -> f64 {
    if shear.parallel { 1.0 } else { depth }
}

/// A table that repeats one block of 8x8 pixels, `block[pixel * per_pixel + index]`, over the whole image.
pub fn repeated(per_pixel: u32, block: &[Sample]) -> SampleTable {
    assert_eq!(block.len(), 64 * per_pixel as usize);
    let samples = (0..64_u32 * 64)
        .flat_map(|pixel| {
            let (x, y) = (pixel % 64 % 8, pixel / 64 % 8);
            let first = ((y * 8 + x) * per_pixel) as usize;
            block[first..first + per_pixel as usize].iter().copied()
        })
        .collect();
    SampleTable::programmed(per_pixel, 0, samples).unwrap()
}

/// Samples of an image in the order of [`visibility`](pipeline::RasterPass::visibility): pixel by pixel in rows.
pub fn sample_positions(table: &SampleTable, viewport: Viewport) -> Vec<([u32; 2], Sample)> {
    let pixels = (0..viewport.height()).flat_map(|y| (0..viewport.width()).map(move |x| [x, y]));
    pixels.flat_map(|[x, y]| table.pixel(x, y).iter().map(move |&sample| ([x, y], sample))).collect()
}
