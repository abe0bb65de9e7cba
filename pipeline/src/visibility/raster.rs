//! Worker: rasterizes the triangles of one bin, through cells, blocks and packets.
//!
//! In sixteen cells at once the edges of a triangle are linearized about the middle of the box (Munkberg and
//! Akenine-Moeller 2012), and the remainder is bounded term by term. Let `dX, dY, du, dv, dt` be offsets from
//! the middle, `P` the position of a vertex there, `V` its velocity, `w` its depth and `w'` the change of
//! depth. `(s, a)` is the shear of the lens in x, `(r, b)` in y. Then
//!
//! ```text
//! P(d) = P + (du (a w - s) - dX w, dv (b w - r) - dY w) + dt (V + w' (a du - dX, b dv - dY))
//! e(d) = e + linear + (w_j - w_i + dt (w'_j - w'_i)) (dY s du - dX r dv)
//!          + dt [-dX c_a - dY c_b + du (a c_a + s (V_i - V_j)_y) + dv (b c_b + r (V_j - V_i)_x)]
//!          + dt^2 [V_i x V_j + (a du - dX) (w'_i V_j - w'_j V_i)_y + (b dv - dY) (w'_j V_i - w'_i V_j)_x]
//! c_a = w_i V_jy - w_j V_iy + w'_i P_jy - w'_j P_iy        c_b = w_j V_ix - w_i V_jx + w'_j P_ix - w'_i P_jx
//! ```
//!
//! which is exact, as `a r = b s` for a lens. All arithmetic is `f32` with an allowance for the rounding of
//! both sides. The sample test sees each vertex within `slack` of its exact position (see
//! [`crate::setup::Triangle::slack`]), and so does this.

use super::BinTriangle;
use super::cells::{CellBounds, CellSetup, EdgeRows, Extent, ROUNDING, Scene, all, in_front_of_edges};
use super::sorter::{BinSamples, SampleLayout};
use crate::sample_test::{Crossing, SeenLanes, View, hit, vertices_seen};
use crate::setup::{Corner, Triangle};
use crate::simd::{Kernel, LANES, Lanes, Mask, Row, prefetch};

/// Prefetch distance, in triangles or packets.
const PREFETCH_DISTANCE: usize = 4;

/// With at most this many blocks, packets are tested against edges without a test of the blocks.
const MAX_UNTESTED_BLOCKS: u32 = 4;

/// Visible triangles of the samples of a bin.
#[derive(Clone, Debug)]
pub(super) struct BinSurface {
    /// By packet, the depth of the nearest hit; infinite without a hit, negative infinity without a sample.
    pub depth: Vec<Row>,
    /// By packet, the triangle of the nearest hit; undefined without a hit.
    pub triangle: Vec<[u32; LANES]>,
    /// By block and cell, the largest depth of each packet.
    pub farthest: Vec<Row>,
}

/// Number of executions of each step.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct StepTally {
    /// Triangles set up in a bin.
    pub bins: u64,
    /// Cells of a bin in which a triangle may be visible.
    pub cells: u64,
    /// Blocks of a cell whose packets were tested.
    pub blocks: u64,
    /// Packets of sixteen samples tested.
    pub packets: u64,
    /// Samples hit, hidden or not.
    pub hits: u64,
}

impl std::iter::Sum for StepTally {
    fn sum<I: Iterator<Item = Self>>(tallies: I) -> Self {
        tallies.fold(Self::default(), |a, b| Self {
            bins: a.bins + b.bins,
            cells: a.cells + b.cells,
            blocks: a.blocks + b.blocks,
            packets: a.packets + b.packets,
            hits: a.hits + b.hits,
        })
    }
}

impl BinSurface {
    pub fn new(samples: &BinSamples) -> Self {
        let packets = samples.sample_indices.len();
        Self {
            depth: vec![Row::splat(0.0); packets],
            triangle: vec![[0; LANES]; packets],
            farthest: vec![Row::splat(0.0); samples.boxes.len()],
        }
    }

    /// Clear the result.
    fn clear(&mut self, samples: &BinSamples) {
        self.farthest.fill(Row::splat(f32::INFINITY));
        self.depth.fill(Row::splat(f32::INFINITY));
        for packet in samples.partial.iter().map(|&packet| packet as usize) {
            let mut farthest = f32::NEG_INFINITY;
            for (depth, &sample_index) in self.depth[packet].0.iter_mut().zip(&samples.sample_indices[packet])
            {
                *depth =
                    if sample_index == BinSamples::NO_SAMPLE { f32::NEG_INFINITY } else { f32::INFINITY };
                farthest = farthest.max(*depth);
            }
            self.farthest[packet / LANES].0[packet % LANES] = farthest;
        }
    }
}

/// A worker at a bin. Triangles come front to back, but any order gives the same result.
pub(super) struct VisibleBinWorker<'a> {
    pub layout: &'a SampleLayout,
    pub samples: &'a BinSamples,
    pub surface: &'a mut BinSurface,
    pub placed: &'a [Option<BinTriangle>],
    pub list: &'a [u32],
    pub tally: &'a mut StepTally,
    pub queue: Queue,
}

impl Kernel for VisibleBinWorker<'_> {
    #[inline(always)]
    fn run<V: Lanes>(mut self) {
        self.surface.clear(self.samples);
        if self.layout.projection.shear.is_none() { self.bin::<V, false>() } else { self.bin::<V, true>() }
    }
}

impl VisibleBinWorker<'_> {
    #[inline(always)]
    fn bin<V: Lanes, const LENS: bool>(&mut self) {
        let mut setup = CellSetup::EMPTY;
        for (turn, &index) in self.list.iter().enumerate() {
            if let Some(&soon) = self.list.get(turn + PREFETCH_DISTANCE) {
                prefetch(&self.placed[soon as usize]);
            }
            let Some(ready) = &self.placed[index as usize] else { continue };
            if ready.triangle.moving {
                self.triangle::<V, true, LENS>(ready, &mut setup);
            } else {
                self.triangle::<V, false, LENS>(ready, &mut setup);
            }
        }
    }

    #[inline(always)]
    fn triangle<V: Lanes, const MOTION: bool, const LENS: bool>(
        &mut self,
        ready: &BinTriangle,
        setup: &mut CellSetup,
    ) {
        let mut active =
            self.scene(ready).cells::<V, MOTION, LENS>(setup) & all(self.layout.hierarchy.cells());
        self.tally.bins += 1;
        self.tally.cells += u64::from(active.count_ones());
        self.queue.clear();
        while active != 0 {
            let cell = active.trailing_zeros() as usize;
            active &= active - 1;
            self.cell::<V>(setup, cell);
        }
        self.tally.packets += self.queue.len() as u64;
        for turn in 0..self.queue.len() {
            prefetch(&self.samples.packets[self.queue.packet(turn + PREFETCH_DISTANCE)]);
            self.packet::<V, MOTION, LENS>(&ready.triangle, self.queue.packet(turn));
        }
    }

    fn scene<'s>(&'s self, ready: &'s BinTriangle) -> Scene<'s> {
        Scene {
            triangle: &ready.triangle,
            facing: &ready.facing,
            shear: &self.layout.projection.shear,
            near: self.layout.projection.near,
            bin: self.samples,
            half_px: self.layout.viewport.half_px(),
            block_px: self.layout.hierarchy.block_px[1],
            block_rows: self.layout.hierarchy.blocks()[1],
        }
    }

    /// Queue the packets of a cell that may see the triangle.
    #[inline(always)]
    fn cell<V: Lanes>(&mut self, setup: &CellSetup, cell: usize) {
        let bounds = CellBounds::<V>::new(setup, cell);
        let (across, cells) = (self.layout.hierarchy.blocks()[0], self.layout.hierarchy.cells());
        let [first, last] = [setup.rows[0].0[cell] as u32, setup.rows[1].0[cell] as u32 + 1];
        for group in first * across / LANES as u32..(last * across).div_ceil(LANES as u32) {
            let boxes = &self.samples.blocks[group as usize];
            let mut pass = bounds.meet(boxes);
            if pass.count_ones() > MAX_UNTESTED_BLOCKS {
                pass &= in_front_of_edges::<V>(setup, cell, boxes);
            }
            self.tally.blocks += u64::from(pass.count_ones());
            while pass != 0 {
                let block = group as usize * LANES + pass.trailing_zeros() as usize;
                pass &= pass - 1;
                let block_cell = block * cells + cell;
                let boxes = &self.samples.boxes[block_cell];
                let near = bounds.meet(boxes) & bounds.before(&self.surface.farthest[block_cell]);
                if near != 0 {
                    let packets = near & in_front_of_edges::<V>(setup, cell, boxes);
                    self.queue.push::<V>(packets, (block_cell * LANES) as u32);
                }
            }
        }
    }

    /// Test the samples of a packet against a triangle, and store the hits.
    #[inline(always)]
    fn packet<V: Lanes, const MOTION: bool, const LENS: bool>(&mut self, triangle: &Triangle, packet: usize) {
        let view = View::<V, MOTION, LENS>::load(&self.samples.packets[packet].rows());
        let crossing = Crossing::new(&triangle.corners, &view);
        if !crossing.any() {
            return;
        }
        let inside = crossing.shown(triangle.faces);
        let depth = crossing.depth();
        let seen = inside & depth.gt(V::splat(self.layout.projection.near));
        let stored = V::load(&self.surface.depth[packet].0);
        let mut closer = seen & stored.gt(depth);
        let equal = seen & stored.equal(depth);
        if equal != 0 {
            closer |= self.lower_id(triangle.id, packet, equal);
        }
        self.tally.hits += u64::from(seen.count_ones());
        let mut nearest = depth.or_else(closer, stored);
        nearest.store(&mut self.surface.depth[packet].0);
        V::put(closer, triangle.id, &mut self.surface.triangle[packet]);
        let tie = crossing.tie();
        if tie != 0 && self.ties(triangle, packet, tie) {
            nearest = V::load(&self.surface.depth[packet].0);
        }
        self.surface.farthest[packet / LANES].0[packet % LANES] = nearest.largest();
    }

    /// Lanes at equal depth for which this triangle has the lower number.
    #[cold]
    fn lower_id(&self, id: u32, packet: usize, equal: Mask) -> Mask {
        let owners = &self.surface.triangle[packet];
        (0..LANES)
            .filter(|&lane| equal >> lane & 1 != 0 && id < owners[lane])
            .fold(0, |mask, lane| mask | 1 << lane)
    }

    /// Decide and store the lanes on an edge; returns whether any was written.
    #[cold]
    fn ties(&mut self, triangle: &Triangle, packet: usize, tie: Mask) -> bool {
        let mut written = false;
        for lane in (0..LANES).filter(|lane| tie >> lane & 1 != 0) {
            let seen = vertices_seen(&triangle.corners, &self.samples.packets[packet].rows(), lane);
            let Some((depth, _)) = hit(&seen, triangle.faces) else { continue };
            let (stored, owner) =
                (&mut self.surface.depth[packet].0[lane], &mut self.surface.triangle[packet][lane]);
            let seen = depth > self.layout.projection.near;
            self.tally.hits += u64::from(seen);
            if seen && (depth < *stored || (depth == *stored && triangle.id < *owner)) {
                (*stored, *owner) = (depth, triangle.id);
                written = true;
            }
        }
        written
    }
}

/// Packets of a bin that may see one triangle. It is filled without data-dependent branches, and is known
/// ahead of the tests, so that samples can be prefetched.
pub(super) struct Queue {
    /// With room for a whole block after the last packet.
    packets: Vec<u32>,
    len: usize,
}

impl Queue {
    /// A queue for bins of this many packets.
    pub fn new(packets: usize) -> Self {
        Self { packets: vec![0; packets + LANES], len: 0 }
    }

    pub fn clear(&mut self) {
        self.len = 0;
    }

    pub fn len(&self) -> usize {
        self.len
    }

    /// Packet number `turn` of the queue. Shortly past the end it is some packet of the bin, for a useless
    /// prefetch.
    #[inline(always)]
    pub fn packet(&self, turn: usize) -> usize {
        self.packets[turn] as usize
    }

    /// Queue the packets of a mask, numbered from `first`.
    #[inline(always)]
    pub fn push<V: Lanes>(&mut self, mask: Mask, first: u32) {
        if let Some(room) = self.packets[self.len..].first_chunk_mut() {
            V::number(mask, first, room);
            self.len += mask.count_ones() as usize;
        }
    }
}

/// A vertex over the cells: its position in the middle, and its largest distance from the samples anywhere.
#[derive(Clone, Copy)]
pub(super) struct Vertex<V> {
    seen: SeenLanes<V>,
    velocity: [V; 2],
    dw: V,
    reach: [V; 2],
    pub w_abs: V,
}

impl Scene<'_> {
    /// A vertex of the triangle.
    #[inline(always)]
    pub fn vertex<V: Lanes, const MOTION: bool, const LENS: bool>(
        &self,
        corner: &Corner,
        view: &View<V, MOTION, LENS>,
        extent: &Extent<V>,
    ) -> Vertex<V> {
        let seen = view.see(corner);
        let [dx, dy, dw] = [V::splat(corner.delta[0]), V::splat(corner.delta[1]), V::splat(corner.delta[2])];
        let mut w_abs = seen.w.abs();
        let mut velocity = [V::splat(0.0); 2];
        if MOTION {
            velocity = [dx - view.slope[0] * dw, dy - view.slope[1] * dw];
            w_abs = w_abs + extent.t * dw.abs();
        }
        let mut reach = [seen.x.abs(), seen.y.abs()];
        for axis in 0..2 {
            reach[axis] = reach[axis] + extent.turn[axis] * w_abs;
            if LENS {
                reach[axis] = reach[axis] + extent.shift[axis];
            }
            if MOTION {
                reach[axis] = reach[axis] + extent.t * velocity[axis].abs();
            }
        }
        Vertex { seen, velocity, dw, reach, w_abs }
    }

    /// Write one edge and return the bound of its rounding error.
    #[inline(always)]
    pub fn edge<V: Lanes, const MOTION: bool, const LENS: bool>(
        &self,
        i: &Vertex<V>,
        j: &Vertex<V>,
        middle: [V; 2],
        extent: &Extent<V>,
        row: &mut EdgeRows,
    ) -> V {
        let (p, q) = (&i.seen, &j.seen);
        let value = p.x * q.y - q.x * p.y;
        let slope_x = q.w * p.y - p.w * q.y;
        let slope_y = q.x * p.w - p.x * q.w;
        let (slack_x, slack_y) =
            (V::splat(2.0 * self.triangle.slack[0]), V::splat(2.0 * self.triangle.slack[1]));
        let rounding = slack_x * ((i.reach[1] + j.reach[1]) + slack_y)
            + slack_y * (i.reach[0] + j.reach[0])
            + V::splat(ROUNDING) * (i.reach[0] * j.reach[1] + j.reach[0] * i.reach[1]);
        let far = slope_x.abs() * V::splat(self.half_px[0]) + slope_y.abs() * V::splat(self.half_px[1]);
        let mut margin = V::splat(ROUNDING).times_plus(far, rounding + rounding)
            + self.remainder::<V, MOTION, LENS>(i, j, extent);
        if LENS {
            let (a, b) = (V::splat(self.shear.a[0]), V::splat(self.shear.a[1]));
            let (s, r) = (V::splat(self.shear.s[0]), V::splat(self.shear.s[1]));
            let slope_u = a.times_plus(slope_x, s * (q.y - p.y));
            let slope_v = b.times_plus(slope_y, r * (p.x - q.x));
            margin =
                slope_v.abs().times_plus(extent.lens[1], slope_u.abs().times_plus(extent.lens[0], margin));
        }
        if MOTION {
            let slope_t =
                (i.velocity[0] * q.y - j.velocity[0] * p.y) + (p.x * j.velocity[1] - q.x * i.velocity[1]);
            margin = slope_t.abs().times_plus(extent.t, margin);
        }
        let value = value - slope_x * middle[0] - slope_y * middle[1];
        (value + margin).store(&mut row.bound[0].0);
        (margin - value).store(&mut row.bound[1].0);
        slope_x.store(&mut row.slope_x.0);
        slope_y.store(&mut row.slope_y.0);
        rounding
    }

    /// Bound of the terms left out of the linear part, by the formula above.
    #[inline(always)]
    fn remainder<V: Lanes, const MOTION: bool, const LENS: bool>(
        &self,
        i: &Vertex<V>,
        j: &Vertex<V>,
        extent: &Extent<V>,
    ) -> V {
        let ([turn_x, turn_y], [shift_x, shift_y]) = (extent.turn, extent.shift);
        let (p, q, [vi_x, vi_y], [vj_x, vj_y]) = (&i.seen, &j.seen, i.velocity, j.velocity);
        let mut sum = V::splat(0.0);
        if LENS {
            let mut apart = (q.w - p.w).abs();
            if MOTION {
                apart = apart + extent.t * (j.dw - i.dw).abs();
            }
            sum = apart * (extent.screen[1] * shift_x + extent.screen[0] * shift_y);
        }
        if MOTION {
            let turn_a = (p.w * vj_y - q.w * vi_y) + (i.dw * q.y - j.dw * p.y);
            let turn_b = (q.w * vi_x - p.w * vj_x) + (j.dw * p.x - i.dw * q.x);
            let mut once = extent.screen[0] * turn_a.abs() + extent.screen[1] * turn_b.abs();
            if LENS {
                let by_u = V::splat(self.shear.a[0]) * turn_a + V::splat(self.shear.s[0]) * (vi_y - vj_y);
                let by_v = V::splat(self.shear.a[1]) * turn_b + V::splat(self.shear.s[1]) * (vj_x - vi_x);
                once = once + extent.lens[0] * by_u.abs() + extent.lens[1] * by_v.abs();
            }
            let twice = (vi_x * vj_y - vj_x * vi_y).abs()
                + turn_x * (i.dw * vj_y - j.dw * vi_y).abs()
                + turn_y * (j.dw * vi_x - i.dw * vj_x).abs();
            sum = sum + extent.t * (once + extent.t * twice);
        }
        sum
    }
}
