//! Worker: rasterizes the triangles of one bin, through cells, blocks and packets.

use super::BinTriangle;
use super::bin::BinSamples;
use super::cells::{CellBounds, CellSetup, Scene, all, in_front_of_edges};
use super::sorter::SampleLayout;
use crate::sample_test::block::{Crossing, View};
use crate::sample_test::exact;
use crate::setup::Triangle;
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
pub struct Tally {
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

impl std::iter::Sum for Tally {
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
    pub tally: &'a mut Tally,
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
        let mut active = self.scene(ready).cells::<V, MOTION, LENS>(setup) & all(self.layout.plan.cells());
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
            block_px: self.layout.plan.block_px[1],
            block_rows: self.layout.plan.blocks()[1],
        }
    }

    /// Queue the packets of a cell that may see the triangle.
    #[inline(always)]
    fn cell<V: Lanes>(&mut self, setup: &CellSetup, cell: usize) {
        let bounds = CellBounds::<V>::new(setup, cell);
        let (across, cells) = (self.layout.plan.blocks()[0], self.layout.plan.cells());
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
            let seen = exact::seen(&triangle.corners, &self.samples.packets[packet].rows(), lane);
            let Some((depth, _)) = exact::hit(&seen, triangle.faces) else { continue };
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
