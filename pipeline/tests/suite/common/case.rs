//! Random triangles that stress one property each, and samples on their edges.

use super::{Probe, SamplePosition, Uniform, repeated, weight};
use pipeline::sampling::Sample;
use pipeline::*;
use proptest::prelude::*;

/// Scenes that stress one property each.
#[derive(Clone, Copy, Debug)]
pub struct Case {
    pub moving: bool,
    pub lens: bool,
    /// Orthographic view; pixels are then no lengths of the scene.
    pub parallel: bool,
    /// A third of the vertices may be behind the camera.
    pub behind: bool,
    /// In the far corner of the largest image.
    pub far: bool,
    /// Vertices nearly collinear.
    pub sliver: bool,
    /// Binary logarithm of a factor of all lengths.
    pub scale: i32,
}

pub fn cases() -> impl Strategy<Value = Case> {
    let shape = (any::<bool>(), any::<bool>(), any::<bool>(), -20..20_i32);
    let flags = (any::<bool>(), any::<bool>(), any::<bool>(), shape);
    flags.prop_map(|(moving, lens, parallel, (behind, far, sliver, scale))| Case {
        moving,
        lens,
        parallel,
        behind,
        far,
        sliver,
        scale,
    })
}

pub const NEAR: f32 = 0.25;

pub struct Setting {
    pub triangle: [MovingVertex; 3],
    pub probe: Probe,
}

pub fn setting(case: Case, seed: u64) -> Setting {
    let mut r = Uniform::new(seed);
    let side = if case.far { Viewport::MAX_PX } else { 8 };
    let origin = if case.far { [0, side - 8] } else { [0, 0] };
    let origin_px = origin.map(|px| px as f32 - 0.5 * side as f32);
    let scale = libm::exp2f(case.scale as f32);
    let weight = |w: f32| if case.parallel { 1.0 } else { w };
    let end = |r: &mut Uniform, near: Option<[f32; 3]>| {
        let w = if case.behind && r.next() < 0.33 { r.within(-4.0, 1.0) } else { r.within(0.5, 8.0) } * scale;
        let mut at = [0, 1].map(|axis| origin_px[axis] + r.within(-8.0, 16.0));
        if let Some([x, y, w]) = near.filter(|_| case.sliver) {
            at = [x, y].map(|c| c / weight(w) + r.within(-1e-3, 1e-3));
        }
        [at[0] * weight(w), at[1] * weight(w), w]
    };
    let mut triangle = [MovingVertex { open: [0.0; 3], close: [0.0; 3] }; 3];
    for k in 0..3 {
        let near = if k == 2 { [Some(triangle[1].open), Some(triangle[1].close)] } else { [None; 2] };
        let open = end(&mut r, near[0]);
        let close = end(&mut r, near[1]);
        triangle[k] = MovingVertex { open, close: if case.moving { close } else { open } };
    }
    let s = [0; 2].map(|_| r.within(-20.0, 20.0) * if case.parallel { 1.0 } else { scale });
    let focus = r.within(0.5, 10.0) * scale;
    let shear = if case.lens { Shear::new(s, s.map(|s| s / focus)) } else { Shear::default() };
    let shear = Shear { parallel: case.parallel, ..shear };
    let table = on_its_edges(&mut r, &triangle, &shear, origin_px, case.lens);
    let probe = Probe::new(&table, Viewport::new(side, side).unwrap(), shear, origin, NEAR * scale);
    Setting { triangle, probe }
}

/// Four samples per pixel; where the edges of the triangle cross the tile, most samples are on an edge within
/// f32 precision.
pub fn on_its_edges(
    r: &mut Uniform,
    triangle: &[MovingVertex; 3],
    shear: &Shear,
    origin_px: [f32; 2],
    lens: bool,
) -> SampleTable {
    let mut pixels = vec![Vec::new(); 64];
    for _ in 0..600 {
        let place = if lens { [r.within(-1.0, 1.0), r.within(-1.0, 1.0)] } else { [0.0; 2] };
        let mut sample = Sample { x: r.next(), y: r.next(), u: place[0], v: place[1], t: r.next() };
        let [u, v, t] = [sample.u, sample.v, sample.t].map(f64::from);
        let position = SamplePosition { x: 0.0, y: 0.0, u, v, t };
        let k = (r.next() * 3.0) as usize;
        let [p, q] = [k, (k + 1) % 3].map(|corner| position.sheared(&triangle[corner], shear));
        let along = f64::from(r.next());
        let mix = |axis: usize| p[axis] + along * (q[axis] - p[axis]);
        let at = [0, 1].map(|axis| mix(axis) / weight(shear, mix(2)) - f64::from(origin_px[axis]));
        let mut pixel = (r.next() * 64.0) as usize;
        if at.iter().all(|c| (0.0..8.0).contains(c)) {
            pixel = at[0] as usize + 8 * (at[1] as usize);
            [sample.x, sample.y] = at.map(|c| (c.fract() as f32).min(1.0 - f32::EPSILON / 2.0));
        }
        if pixels[pixel].len() < 4 {
            pixels[pixel].push(sample);
        }
    }
    for pixel in &mut pixels {
        while pixel.len() < 4 {
            pixel.push(Sample { x: r.next(), y: r.next(), u: 0.0, v: 0.0, t: r.next() });
        }
    }
    repeated(4, &pixels.concat())
}
