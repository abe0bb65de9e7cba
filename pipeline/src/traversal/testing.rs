//! Random triangles over random boxes, with direct evaluation in `f64`, for tests.

use super::{Box5, TileRect};
use crate::geometry::{Cull, MovingVertex, Shear};
use crate::random::mix;
use crate::setup::{SetupResult, Triangle, set_up};

pub const NEAR: f32 = 0.25;

/// Counter-based uniform numbers.
pub struct Uniform(u64);

impl Uniform {
    pub fn new(seed: u64) -> Self {
        Self(mix(seed.wrapping_add(0x9E37_79B9_7F4A_7C15)))
    }

    pub fn within(&mut self, lo: f32, hi: f32) -> f32 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        lo + (hi - lo) * ((mix(self.0) >> 40) as f32 / 16_777_216.0)
    }

    /// A number of a range, often an end of it.
    pub fn often_an_end(&mut self, [lo, hi]: [f32; 2]) -> f32 {
        match self.within(0.0, 4.0) as u32 {
            0 => lo,
            1 => hi,
            _ => self.within(lo, hi).clamp(lo, hi),
        }
    }

    /// Non-negative weights that add up to 1.
    pub fn weights(&mut self) -> [f64; 3] {
        let parts = [0; 3].map(|_| f64::from(self.within(0.0, 1.0)).powi(3));
        let sum: f64 = parts.iter().sum();
        parts.map(|part| part / sum.max(1e-30))
    }
}

/// A triangle over a box.
pub struct Case {
    pub triangle: Triangle,
    pub shear: Shear,
    pub tile: TileRect,
    pub within: Box5,
}

/// A random case; a third of the vertices of every other triangle may be behind the camera.
pub fn case(seed: u64, moving: bool, lens: bool, parallel: bool) -> Case {
    let mut r = Uniform::new(seed);
    let size = [4.0, 40.0, 400.0][(seed % 3) as usize];
    let shear = if lens { Shear::new([90.0, -90.0], [15.0, -15.0]) } else { Shear::default() };
    // A short focus depth, so that terms with depth dominate, with opposite signs on the two axes.
    let shear = match (parallel, lens) {
        (true, true) => Shear { parallel, ..Shear::new([12.0, -30.0], [18.0, -5.0]) },
        _ => Shear { parallel, ..shear },
    };
    let [px, py] = [r.within(-60.0, 52.0).floor(), r.within(-60.0, 52.0).floor()];
    let side = [1.0, 8.0, 32.0][(seed / 3 % 3) as usize];
    let tile = TileRect { x: [px, px + side], y: [py, py + side] };
    let mut end = || {
        let behind = seed.is_multiple_of(2) && r.within(0.0, 1.0) < 0.33;
        let w = if behind { r.within(-3.0, 1.0) } else { r.within(2.0, 9.0) };
        let weight = shear.weight(w);
        [(px + r.within(-size, size)) * weight, (py + r.within(-size, size)) * weight, w]
    };
    let v = [0; 3].map(|_| {
        let (open, close) = (end(), end());
        let close = [0, 1, 2].map(|k| open[k] + 0.3 * (close[k] - open[k]));
        MovingVertex { open, close: if moving { close } else { open } }
    });
    let mut range = |lo: f32, hi: f32| {
        let ends = [r.within(lo, hi), r.within(lo, hi)];
        [ends[0].min(ends[1]), ends[0].max(ends[1])]
    };
    let within = Box5 { u: range(-1.0, 1.0), v: range(-1.0, 1.0), t: range(0.0, 1.0), lens };
    match set_up(0, [&v[0], &v[1], &v[2]], Cull::None, &shear, NEAR, [64.0; 2]) {
        SetupResult::Ready(triangle) => Case { triangle, shear, tile, within },
        _ => case(seed + 1_000_003, moving, lens, parallel),
    }
}

/// All combinations of dimensions, with `count` random cases each, in perspective and in orthographic views.
pub fn cases(count: u64) -> impl Iterator<Item = (u64, Case)> {
    [false, true].into_iter().flat_map(move |parallel| (0..count).flat_map(move |seed| mixed(seed, parallel)))
}

fn mixed(seed: u64, parallel: bool) -> impl Iterator<Item = (u64, Case)> {
    let all = [[false, false], [true, false], [false, true], [true, true]];
    let one = move |first: u64| move |[moving, lens]: [bool; 2]| (seed, case(first, moving, lens, parallel));
    all.map(one(seed * 4 + 1)).into_iter().chain([[true, false], [true, true]].map(one(seed * 4)))
}

impl Case {
    /// A position in the box, often on its border: X, Y, u, v, t.
    pub fn position(&self, r: &mut Uniform) -> [f64; 5] {
        let lens = if self.within.lens { [self.within.u, self.within.v] } else { [[0.0; 2]; 2] };
        [self.tile.x, self.tile.y, lens[0], lens[1], self.within.t]
            .map(|range| f64::from(r.often_an_end(range)))
    }

    /// Factor of an image coordinate for a vertex at this depth.
    pub fn weight(&self, depth: f64) -> f64 {
        if self.shear.parallel { 1.0 } else { depth }
    }

    /// Vertices as seen from a position of the box: `[x', y', w]`.
    pub fn seen(&self, [x, y, u, v, t]: [f64; 5]) -> [[f64; 3]; 3] {
        let [s, a] = [self.shear.s, self.shear.a].map(|c| c.map(f64::from));
        self.triangle.corners.map(|corner| {
            let p = [0, 1, 2].map(|k| f64::from(corner.open[k]) + t * f64::from(corner.delta[k]));
            let weight = self.weight(p[2]);
            [p[0] + u * (a[0] * p[2] - s[0]) - x * weight, p[1] + v * (a[1] * p[2] - s[1]) - y * weight, p[2]]
        })
    }

    /// The three edges there.
    pub fn edges(&self, at: [f64; 5]) -> [f64; 3] {
        let p = self.seen(at);
        [(1, 2), (2, 0), (0, 1)].map(|(i, j): (usize, usize)| p[i][0] * p[j][1] - p[j][0] * p[i][1])
    }

    /// The determinant there.
    pub fn det(&self, at: [f64; 5]) -> f64 {
        let p = self.seen(at);
        (0..3).map(|k| self.edges(at)[k] * self.weight(p[k][2])).sum()
    }

    /// Depth of the triangle's plane there.
    pub fn depth(&self, at: [f64; 5]) -> f64 {
        let (p, e) = (self.seen(at), self.edges(at));
        (0..3).map(|k| e[k] * p[k][2]).sum::<f64>() / e.iter().sum::<f64>()
    }
}
