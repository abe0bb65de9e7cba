//! The sample test over a run of samples, sixteen at a time.
//!
//! One source serves every combination of dimensions (by const generics) and every vector width (the compiler turns
//! the lane loop into the widest instructions of the function it is inlined into). No operation is contracted, so
//! all of them give the same bytes.

use std::ops::Range;

use super::exact;
use super::lanes::{LANES, View, any, block_of, lanes};
use super::width::{Vectors, Width};
use crate::sampling::TileSamples;
use crate::setup::Triangle;
use crate::traversal::{Box5, Screen};

/// The stored samples of a tile, in the order of its [`TileSamples`].
pub struct Target<'a> {
    /// Depth of the nearest hit so far, infinite where there is none.
    pub depth: &'a mut [f32],
    /// Triangle of the nearest hit so far; meaningless where there is none.
    pub triangle: &'a mut [u32],
}

/// What a run of sample tests found.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Hits {
    /// Samples screened by the linearized edges.
    pub screened: u32,
    /// Samples tested.
    pub tested: u32,
    /// Samples inside the triangle and beyond the near depth.
    pub hit: u32,
    /// The slots of samples that now see the triangle, in order.
    pub written: Vec<u16>,
    /// Pixels of the tile whose stored depth was read.
    pub read_pixels: u64,
    /// Pixels of the tile whose stored depth was written.
    pub written_pixels: u64,
}

impl Hits {
    /// Forgets what was found, keeping the memory.
    pub fn clear(&mut self) {
        self.written.clear();
        *self = Self { written: std::mem::take(&mut self.written), ..Self::default() };
    }
}

/// Tests the samples of a tile that lie in the box against `triangle` and stores those that see it.
pub fn test_run(
    triangle: &Triangle,
    samples: &TileSamples,
    within: &Box5,
    near: f32,
    target: &mut Target<'_>,
    hits: &mut Hits,
) {
    test_screened(triangle, samples, within, None, near, target, hits);
}

/// The same for those samples only that pass the screen, where there is one.
pub fn test_screened(
    triangle: &Triangle,
    samples: &TileSamples,
    within: &Box5,
    screen: Option<&Screen>,
    near: f32,
    target: &mut Target<'_>,
    hits: &mut Hits,
) {
    Job { triangle, samples, within, screen, near, target, hits, width: Width::widest() }.start();
}

/// The same as [`test_run`] with vectors of a given width, to show that all give the same bytes.
pub fn test_run_at(
    width: Width,
    triangle: &Triangle,
    samples: &TileSamples,
    within: &Box5,
    near: f32,
    target: &mut Target<'_>,
    hits: &mut Hits,
) {
    Job { triangle, samples, within, screen: None, near, target, hits, width }.start();
}

struct Job<'a, 'b> {
    triangle: &'a Triangle,
    samples: &'a TileSamples,
    within: &'a Box5,
    screen: Option<&'a Screen>,
    near: f32,
    target: &'a mut Target<'b>,
    hits: &'a mut Hits,
    width: Width,
}

/// What one block of lanes found: bit masks by lane, and the depth of each.
struct Block {
    clockwise: u32,
    counter_clockwise: u32,
    tie: u32,
    depth: [f32; LANES],
}

impl Job<'_, '_> {
    fn start(&mut self) {
        let run = if self.triangle.moving {
            self.samples.between(self.within.t[0], self.within.t[1])
        } else {
            0..self.samples.len
        };
        match (self.triangle.moving, self.within.lens) {
            (false, false) => self.dispatch::<false, false>(run),
            (true, false) => self.dispatch::<true, false>(run),
            (false, true) => self.dispatch::<false, true>(run),
            (true, true) => self.dispatch::<true, true>(run),
        }
    }

    fn dispatch<const MOTION: bool, const LENS: bool>(&mut self, run: Range<usize>) {
        match self.width.0 {
            Vectors::Plain => self.run::<MOTION, LENS>(run),
            // SAFETY: a `Width` other than the plain one exists only where the machine has it.
            #[cfg(target_arch = "x86_64")]
            Vectors::Avx2 => unsafe { self.run_avx2::<MOTION, LENS>(run) },
            #[cfg(target_arch = "x86_64")]
            Vectors::Avx512 => unsafe { self.run_avx512::<MOTION, LENS>(run) },
        }
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2")]
    fn run_avx2<const MOTION: bool, const LENS: bool>(&mut self, run: Range<usize>) {
        self.run::<MOTION, LENS>(run);
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx512f,avx512dq")]
    fn run_avx512<const MOTION: bool, const LENS: bool>(&mut self, run: Range<usize>) {
        self.run::<MOTION, LENS>(run);
    }

    #[inline(always)]
    fn run<const MOTION: bool, const LENS: bool>(&mut self, run: Range<usize>) {
        let mut base = run.start / LANES * LANES;
        while base < run.end {
            let mut active = lanes(&run, base) & if LENS { self.in_lens_box(base) } else { u32::MAX };
            if active != 0
                && let Some(screen) = self.screen
            {
                self.hits.screened += active.count_ones();
                active &= self.pass::<MOTION, LENS>(screen, base);
            }
            if active != 0 {
                self.hits.tested += active.count_ones();
                let block = self.block::<MOTION, LENS>(base);
                self.store(base, &block, active);
            }
            base += LANES;
        }
    }

    /// Lanes whose place on the lens lies in the box.
    #[inline(always)]
    fn in_lens_box(&self, base: usize) -> u32 {
        let ([u_lo, u_hi], [v_lo, v_hi]) = (self.within.u, self.within.v);
        let (u, v) = (block_of(&self.samples.u, base), block_of(&self.samples.v, base));
        let mut inside = [0; LANES];
        for lane in 0..LANES {
            let within = (u[lane] >= u_lo) & (u[lane] <= u_hi) & (v[lane] >= v_lo) & (v[lane] <= v_hi);
            inside[lane] = u16::from(within) << lane;
        }
        any(&inside)
    }

    /// Lanes that no pair of linearized edges tells to lie outside.
    #[inline(always)]
    fn pass<const MOTION: bool, const LENS: bool>(&self, screen: &Screen, base: usize) -> u32 {
        let (x, y) = (block_of(&self.samples.x, base), block_of(&self.samples.y, base));
        let (u, v) = (block_of(&self.samples.u, base), block_of(&self.samples.v, base));
        let t = block_of(&self.samples.t, base);
        let [middle_x, middle_y, middle_u, middle_v, middle_t] = screen.middle;
        let mut passing = [0; LANES];
        for lane in 0..LANES {
            let (mut below, mut above) = (false, false);
            for edge in 0..3 {
                let [slope_x, slope_y, slope_u, slope_v, slope_t] = screen.gradient[edge];
                let mut value =
                    screen.value[edge] + slope_x * (x[lane] - middle_x) + slope_y * (y[lane] - middle_y);
                if LENS {
                    value += slope_u * (u[lane] - middle_u) + slope_v * (v[lane] - middle_v);
                }
                if MOTION {
                    value += slope_t * (t[lane] - middle_t);
                }
                below |= value < -screen.margin[edge];
                above |= value > screen.margin[edge];
            }
            passing[lane] = u16::from(!(below & above)) << lane;
        }
        any(&passing)
    }

    #[inline(always)]
    fn block<const MOTION: bool, const LENS: bool>(&self, base: usize) -> Block {
        let view = View::<MOTION, LENS>::at(self.samples, base);
        let [corner_a, corner_b, corner_c] = &self.triangle.corners;
        let mut depth = [0.0; LANES];
        let (mut clockwise, mut counter_clockwise, mut tie) =
            ([0_u16; LANES], [0_u16; LANES], [0_u16; LANES]);
        for lane in 0..LANES {
            let (a, b, c) = (view.see(corner_a, lane), view.see(corner_b, lane), view.see(corner_c, lane));
            let e0 = b.x * c.y - c.x * b.y;
            let e1 = c.x * a.y - a.x * c.y;
            let e2 = a.x * b.y - b.x * a.y;
            let (above, below) = ((e0 > 0.0) | (e1 > 0.0) | (e2 > 0.0), (e0 < 0.0) | (e1 < 0.0) | (e2 < 0.0));
            clockwise[lane] = u16::from((e0 > 0.0) & (e1 > 0.0) & (e2 > 0.0)) << lane;
            counter_clockwise[lane] = u16::from((e0 < 0.0) & (e1 < 0.0) & (e2 < 0.0)) << lane;
            tie[lane] = u16::from(((e0 == 0.0) | (e1 == 0.0) | (e2 == 0.0)) & !(above & below)) << lane;
            let quotient = ((e0 * a.w + e1 * b.w) + e2 * c.w) / ((e0 + e1) + e2);
            // The quotient may leave the range of the vertices by a rounding; depth culling relies on it.
            depth[lane] = quotient.max(a.w.min(b.w).min(c.w)).min(a.w.max(b.w).max(c.w));
        }
        Block {
            clockwise: any(&clockwise),
            counter_clockwise: any(&counter_clockwise),
            tie: any(&tie),
            depth,
        }
    }

    /// Resolves ties, applies facing and the near depth, and keeps what is nearest.
    #[inline(always)]
    fn store(&mut self, base: usize, block: &Block, active: u32) {
        let [clockwise, counter_clockwise] = self.triangle.faces;
        let mut inside = 0;
        if clockwise {
            inside |= block.clockwise;
        }
        if counter_clockwise {
            inside |= block.counter_clockwise;
        }
        inside &= active;
        while inside != 0 {
            let lane = inside.trailing_zeros() as usize;
            inside &= inside - 1;
            self.keep(base + lane, block.depth[lane]);
        }
        let mut tie = block.tie & active;
        while tie != 0 {
            let lane = tie.trailing_zeros() as usize;
            tie &= tie - 1;
            self.keep_exact(base + lane);
        }
    }

    #[cold]
    fn keep_exact(&mut self, slot: usize) {
        let seen = exact::seen(&self.triangle.corners, self.samples, slot);
        if let Some((weights, counter_clockwise)) = exact::weights(&seen)
            && self.triangle.faces[usize::from(counter_clockwise)]
        {
            self.keep(slot, exact::depth(&seen, &weights));
        }
    }

    #[inline(always)]
    fn keep(&mut self, slot: usize, depth: f32) {
        if depth <= self.near || depth.is_nan() {
            return;
        }
        let pixel = 1_u64 << self.samples.pixel[slot];
        self.hits.hit += 1;
        self.hits.read_pixels |= pixel;
        let (stored, owner) = (self.target.depth[slot], self.target.triangle[slot]);
        if depth < stored || (depth == stored && self.triangle.id < owner) {
            self.target.depth[slot] = depth;
            self.target.triangle[slot] = self.triangle.id;
            self.hits.written.push(slot as u16);
            self.hits.written_pixels |= pixel;
        }
    }
}
