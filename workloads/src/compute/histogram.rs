//! Histogram of the luminance of an image, by atomics in the shared memory of each group or in a buffer.

use pipeline::{Atomic, Buffer, Group, GroupShader, Lane, SurfaceView};
use serde::{Deserialize, Serialize};

use super::block::Blocks;
use super::luminance;

/// Where lanes count.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Atomics {
    /// In the shared memory of their group, whose counts are then added to the buffer (Podlozhnyuk 2007, "Histogram calculation in
    /// CUDA").
    Shared,
    /// In the buffer.
    Global,
}

/// Binary logarithm of the luminance of the first bin.
const LOWEST: f32 = -8.0;
/// Range of the binary logarithm over all bins.
const RANGE: f32 = 10.0;

/// Bin of a luminance: bins are even in its logarithm, from 1/256 to 4, and the outer ones have all beyond.
pub fn bin(lane: &Lane<'_>, luminance: f32, bins: u32) -> u32 {
    let log = lane.log2(lane.max(luminance, f32::MIN_POSITIVE));
    let share = lane.saturate(lane.madd(log, 1.0 / RANGE, -LOWEST / RANGE));
    lane.min(lane.truncate(lane.mul(share, bins as f32)), bins - 1)
}

/// Counts of the luminances of an image.
pub(super) struct Count {
    pub image: SurfaceView,
    pub blocks: Blocks,
    pub atomics: Atomics,
    /// Histograms in shared memory; lanes use them in turn.
    pub copies: u32,
    /// Words from one of them to the next.
    pub copy_words: u32,
    pub counts: Buffer<u32>,
}

impl GroupShader for Count {
    fn run(&self, group: &mut Group<'_>) {
        if self.atomics == Atomics::Shared {
            self.clear(group);
        }
        let (id, size, bins) = (group.id(), group.size(), self.counts.len());
        group.lanes(|lane| {
            let first = self.copy_words * (lane.index() % self.copies);
            self.blocks.pixels(lane, id, size, |pixel| {
                for sample in 0..self.image.samples() {
                    let bin = bin(lane, luminance(lane, &self.image, pixel, sample), bins);
                    match self.atomics {
                        Atomics::Shared => {
                            lane.add_shared(lane.add(first, bin), 1);
                        }
                        Atomics::Global => lane.atomic(self.counts, bin, Atomic::Add, 1),
                    }
                }
            });
        });
        if self.atomics == Atomics::Shared {
            self.add_to_buffer(group);
        }
    }
}

impl Count {
    /// Shared memory of a group in words.
    pub fn words(&self) -> u32 {
        if self.atomics == Atomics::Shared { self.copies * self.copy_words } else { 0 }
    }

    fn clear(&self, group: &mut Group<'_>) {
        let size = group.size();
        group.lanes(|lane| {
            (lane.index()..self.words()).step_by(size as usize).for_each(|word| lane.set_shared(word, 0));
        });
        group.barrier();
    }

    fn add_to_buffer(&self, group: &mut Group<'_>) {
        let size = group.size();
        group.barrier();
        group.lanes(|lane| {
            for bin in (lane.index()..self.counts.len()).step_by(size as usize) {
                let copies = (0..self.copies).map(|copy| lane.shared(copy * self.copy_words + bin));
                let count = copies.reduce(|a, b| lane.add(a, b)).unwrap_or(0);
                if lane.branch(count > 0) {
                    lane.atomic(self.counts, bin, Atomic::Add, count);
                }
            }
        });
    }
}

/// Sums of the counts up to each bin, in one group with a lane for each bin (Hillis and Steele 1986).
pub(super) struct Scan {
    pub counts: Buffer<u32>,
    pub sums: Buffer<u32>,
}

impl Scan {
    /// Bytes of shared memory for a bin: steps read one word and write the other.
    pub const BYTES_PER_BIN: u32 = 8;
}

impl GroupShader for Scan {
    fn run(&self, group: &mut Group<'_>) {
        let size = group.size();
        group.lanes(|lane| lane.set_shared(lane.index(), lane.load(self.counts, lane.index())));
        // Steps read one half of the shared memory and write the other.
        let (mut from, mut to, mut distance) = (0, size, 1);
        while distance < size {
            group.barrier();
            group.lanes(|lane| {
                let own: u32 = lane.shared(lane.add(from, lane.index()));
                let is_far = lane.branch(lane.index() >= distance);
                let sum =
                    if is_far { lane.add(own, lane.shared(from + lane.index() - distance)) } else { own };
                lane.set_shared(lane.add(to, lane.index()), sum);
            });
            (from, to, distance) = (to, from, 2 * distance);
        }
        group.barrier();
        group.lanes(|lane| lane.store(self.sums, lane.index(), lane.shared::<u32>(from + lane.index())));
    }
}
