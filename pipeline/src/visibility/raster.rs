//! One worker at one bin: each triangle through cells, blocks and packets.

use super::cells::{CellSetup, Scene, all};
use super::facing::Facing;
use super::layout::{BinSamples, PacketBoxes, SampleLayout};
use crate::sample_test::block::{Crossing, View};
use crate::sample_test::exact;
use crate::setup::Triangle;
use crate::simd::{Kernel, LANES, Lanes, Mask, Row};

/// A triangle set up for all bins.
#[derive(Clone, Debug)]
pub(super) struct Ready {
    pub triangle: Triangle,
    pub facing: Facing,
}

/// What the samples of a bin see.
#[derive(Clone, Debug)]
pub(super) struct BinSurface {
    /// By packet, the depth of the nearest hit; infinite where there is none, below everything where there is no sample.
    pub depth: Vec<Row>,
    /// By packet, the triangle of the nearest hit, [`Self::NOTHING`] where there is none.
    pub triangle: Vec<[u32; LANES]>,
    /// By block and cell, the largest depth of each packet.
    pub farthest: Vec<Row>,
}

/// How often each step was taken.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Tally {
    /// Triangles set up in a bin.
    pub bins: u64,
    /// Cells of a bin in which a triangle may be seen.
    pub cells: u64,
    /// Blocks of a cell of which the packets were bounded.
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
    pub const NOTHING: u32 = u32::MAX;

    pub fn new(samples: &BinSamples) -> Self {
        let packets = samples.places.len();
        Self {
            depth: vec![Row::splat(0.0); packets],
            triangle: vec![[Self::NOTHING; LANES]; packets],
            farthest: vec![Row::splat(0.0); samples.boxes.len()],
        }
    }

    /// Forgets what was seen.
    fn clear(&mut self, samples: &BinSamples) {
        self.triangle.fill([Self::NOTHING; LANES]);
        self.farthest.fill(Row::splat(f32::INFINITY));
        for (depth, places) in self.depth.iter_mut().zip(&samples.places) {
            for (depth, &place) in depth.0.iter_mut().zip(places) {
                *depth = if place == BinSamples::NO_SAMPLE { f32::NEG_INFINITY } else { f32::INFINITY };
            }
        }
    }
}

/// A worker at a bin; the triangles come front to back, and any order gives the same result.
pub(super) struct Worker<'a> {
    pub layout: &'a SampleLayout,
    pub samples: &'a BinSamples,
    pub surface: &'a mut BinSurface,
    pub ready: &'a [Ready],
    pub list: &'a [u32],
    pub tally: &'a mut Tally,
}

impl Kernel for Worker<'_> {
    #[inline(always)]
    fn run<V: Lanes>(mut self) {
        self.surface.clear(self.samples);
        if self.layout.projection.shear.is_none() { self.bin::<V, false>() } else { self.bin::<V, true>() }
    }
}

impl Worker<'_> {
    #[inline(always)]
    fn bin<V: Lanes, const LENS: bool>(&mut self) {
        let mut setup = CellSetup::EMPTY;
        for &index in self.list {
            let ready = &self.ready[index as usize];
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
        ready: &Ready,
        setup: &mut CellSetup,
    ) {
        let mut active = self.scene(ready).cells::<V, MOTION, LENS>(setup) & all(self.layout.plan.cells());
        self.tally.bins += 1;
        self.tally.cells += u64::from(active.count_ones());
        while active != 0 {
            let cell = active.trailing_zeros() as usize;
            active &= active - 1;
            let [columns, rows] =
                [&setup.columns, &setup.rows].map(|ends| [ends[0].0[cell] as u32, ends[1].0[cell] as u32]);
            for row in rows[0]..=rows[1] {
                for column in columns[0]..=columns[1] {
                    let block = row * self.layout.plan.blocks()[0] + column;
                    self.block::<V, MOTION, LENS>(&ready.triangle, setup, cell, block as usize);
                }
            }
        }
    }

    fn scene<'s>(&'s self, ready: &'s Ready) -> Scene<'s> {
        Scene {
            triangle: &ready.triangle,
            facing: &ready.facing,
            shear: &self.layout.projection.shear,
            near: self.layout.projection.near,
            bin: self.samples,
            half_px: self.layout.viewport.half_px(),
            block_px: self.layout.plan.block_px,
            blocks: self.layout.plan.blocks(),
        }
    }

    /// The packets of one cell in one block that may see the triangle, each to be tested.
    #[inline(always)]
    fn block<V: Lanes, const MOTION: bool, const LENS: bool>(
        &mut self,
        triangle: &Triangle,
        setup: &CellSetup,
        cell: usize,
        block: usize,
    ) {
        let block_cell = block * self.layout.plan.cells() + cell;
        let boxes = &self.samples.boxes[block_cell];
        self.tally.blocks += 1;
        let mut pass = V::load(&self.surface.farthest[block_cell].0).ge(V::splat(setup.nearest.0[cell]));
        for (packets, range) in [(&boxes.x, &setup.x), (&boxes.y, &setup.y)] {
            pass &= V::load(&packets[1].0).ge(V::splat(range[0].0[cell]));
            pass &= V::splat(range[1].0[cell]).ge(V::load(&packets[0].0));
        }
        let mut shown = 0;
        for face in 0..2 {
            if setup.faces[face] >> cell & 1 != 0 {
                shown |= in_front_of_edges::<V>(setup, cell, face, boxes);
            }
        }
        pass &= shown;
        while pass != 0 {
            let lane = pass.trailing_zeros() as usize;
            pass &= pass - 1;
            self.packet::<V, MOTION, LENS>(triangle, block_cell, lane);
        }
    }

    #[inline(always)]
    fn packet<V: Lanes, const MOTION: bool, const LENS: bool>(
        &mut self,
        triangle: &Triangle,
        block_cell: usize,
        lane: usize,
    ) {
        let packet = block_cell * LANES + lane;
        self.tally.packets += 1;
        let view = View::<V, MOTION, LENS>::load(&self.samples.packet(packet));
        let crossing = Crossing::new(&triangle.corners, &view);
        let inside = crossing.shown(triangle.faces);
        if inside == 0 && crossing.tie == 0 {
            return;
        }
        let depth = crossing.depth();
        let seen = inside & depth.gt(V::splat(self.layout.projection.near));
        let stored = V::load(&self.surface.depth[packet].0);
        let mut closer = seen & stored.gt(depth);
        let equal = seen & stored.equal(depth);
        if equal != 0 {
            closer |= self.lower_id(triangle.id, packet, equal);
        }
        self.tally.hits += u64::from(seen.count_ones());
        if closer != 0 {
            let nearest = depth.or_else(closer, stored);
            nearest.store(&mut self.surface.depth[packet].0);
            V::put(closer, triangle.id, &mut self.surface.triangle[packet]);
            self.surface.farthest[block_cell].0[lane] = nearest.largest();
        }
        if crossing.tie != 0 && self.ties(triangle, packet, crossing.tie) {
            self.surface.farthest[block_cell].0[lane] = V::load(&self.surface.depth[packet].0).largest();
        }
    }

    /// Of the lanes at equal depth, those where this triangle comes first.
    #[cold]
    fn lower_id(&self, id: u32, packet: usize, equal: Mask) -> Mask {
        let owners = &self.surface.triangle[packet];
        (0..LANES)
            .filter(|&lane| equal >> lane & 1 != 0 && id < owners[lane])
            .fold(0, |mask, lane| mask | 1 << lane)
    }

    /// Decides and stores the lanes on an edge; says whether any was written.
    #[cold]
    fn ties(&mut self, triangle: &Triangle, packet: usize, tie: Mask) -> bool {
        let mut written = false;
        for lane in (0..LANES).filter(|lane| tie >> lane & 1 != 0) {
            let seen = exact::seen(&triangle.corners, &self.samples.packet(packet), lane);
            let Some(depth) = exact::hit(&seen, triangle.faces) else { continue };
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

/// The packets in which no edge of the face is known to be below zero, in the sign of the face, for all samples.
#[inline(always)]
fn in_front_of_edges<V: Lanes>(setup: &CellSetup, cell: usize, face: usize, boxes: &PacketBoxes) -> Mask {
    let (mut pass, zero) = (Mask::MAX, V::splat(0.0));
    for edge in &setup.edges {
        let (slope_x, slope_y) = (edge.slope_x.0[cell], edge.slope_y.0[cell]);
        // The end of the box at which the edge is largest.
        let (end_x, end_y) = (usize::from(slope_x > 0.0) ^ face, usize::from(slope_y > 0.0) ^ face);
        let sign = if face == 0 { 1.0 } else { -1.0 };
        let most = V::load(&boxes.x[end_x].0)
            .times_plus(V::splat(sign * slope_x), V::splat(edge.most[face].0[cell]));
        let most = V::load(&boxes.y[end_y].0).times_plus(V::splat(sign * slope_y), most);
        // Where the arithmetic overflowed to NaN nothing is known.
        pass &= !zero.gt(most);
    }
    pass
}
