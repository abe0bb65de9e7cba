//! Luminance of an image: its histogram by atomics in the shared memory of each group or in a buffer, and its
//! mean by a tree in the shared memory of each group and a last group for their sums. Programs write the
//! image: a tone map, an equalised image, and a heat map of lights.

use glam::{Vec3, Vec4};
use pipeline::surface::Format;
use pipeline::texture::LUMINANCE;
use pipeline::{Atomic, Buffer, Group, GroupLane, GroupShader, Lane, SurfaceView};
use serde::{Deserialize, Serialize};

use super::{Blocks, Order, Slots, luminance, tree};

/// Where lanes count.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Atomics {
    /// In the shared memory of their group, whose counts are then added to the buffer (Podlozhnyuk 2007,
    /// "Histogram calculation in CUDA").
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

/// Sum of the luminance of the pixels of a group.
pub(super) struct BlockSums {
    pub image: SurfaceView,
    pub blocks: Blocks,
    pub slots: Slots,
    pub order: Order,
    /// Sum of each group.
    pub sums: Buffer<f32>,
}

impl GroupShader for BlockSums {
    fn run(&self, group: &mut Group<'_>) {
        let (id, size, groups) = (group.id(), group.size(), group.groups());
        group.lanes(|lane| {
            let mut sum = 0.0;
            self.blocks.pixels(lane, id, size, |pixel| {
                for sample in 0..self.image.samples() {
                    sum = lane.add(sum, luminance(lane, &self.image, pixel, sample));
                }
            });
            lane.set_shared(self.slots.word(lane, lane.index()), sum);
        });
        add_up(group, &self.slots, self.order);
        group.lanes(|lane| {
            if lane.branch(lane.index() == 0) {
                let number = lane.madd(id[1], groups[0], id[0]);
                lane.store(self.sums, number, lane.shared::<f32>(self.slots.first));
            }
        });
    }
}

/// Mean from the sums of groups, in one group.
pub(super) struct Mean {
    pub sums: Buffer<f32>,
    pub slots: Slots,
    pub order: Order,
    /// Number of values in all sums.
    pub count: f32,
    /// A word.
    pub mean: Buffer<f32>,
}

impl GroupShader for Mean {
    fn run(&self, group: &mut Group<'_>) {
        let size = group.size();
        group.lanes(|lane| {
            let mut sum = 0.0;
            for number in (lane.index()..self.sums.len()).step_by(size as usize) {
                sum = lane.add(sum, lane.load(self.sums, number));
            }
            lane.set_shared(self.slots.word(lane, lane.index()), sum);
        });
        add_up(group, &self.slots, self.order);
        group.lanes(|lane| {
            if lane.branch(lane.index() == 0) {
                let sum = lane.shared::<f32>(self.slots.first);
                lane.store(self.mean, 0, lane.mul(sum, 1.0 / self.count));
            }
        });
    }
}

fn add_up(group: &mut Group<'_>, slots: &Slots, order: Order) {
    tree(group, order, |lane: &GroupLane<'_, '_>, [to, from]| {
        let [to, from] = [to, from].map(|index| slots.word(lane, index));
        let sum = lane.add(lane.shared::<f32>(to), lane.shared::<f32>(from));
        lane.set_shared(to, sum);
    });
}

/// What a pixel of the image shows.
pub(super) enum Show {
    /// Colours exposed for this mean luminance, and compressed (Reinhard et al. 2002, equation 3).
    Exposed(Buffer<f32>),
    /// The same for the luminance of the only texel of a level.
    ExposedBy(SurfaceView),
    /// Colours whose luminance is the share of values up to their bin, by sums over bins.
    Equalised(Buffer<u32>),
    /// Counts of the tiles of these blocks over the largest, as the colours of a hot body, over the image in grey.
    Heat { counts: Buffer<u32>, most: Buffer<u32>, tiles: Blocks },
}

/// Luminance to which the mean is exposed.
const KEY: f32 = 0.18;
/// Least luminance that is exposed.
const DARKEST: f32 = 1e-4;

/// Writes the image.
pub(super) struct Display {
    pub image: SurfaceView,
    pub blocks: Blocks,
    pub show: Show,
    /// A word for each pixel, in [`FORMAT`].
    pub out: Buffer<u32>,
}

/// Format of the image.
const FORMAT: Format = Format::Rgba8Srgb;

/// Colours of an image in [`FORMAT`].
pub(super) fn decoded(words: &[u32]) -> Vec<Vec3> {
    words.iter().map(|word| FORMAT.decode(&word.to_le_bytes()).truncate()).collect()
}

/// An encoded colour. Fixed functions do it, as for typed stores.
fn encoded(color: Vec3) -> u32 {
    let bytes = FORMAT.encode(Vec4::from((color, 1.0)));
    u32::from_le_bytes(std::array::from_fn(|byte| bytes[byte]))
}

impl GroupShader for Display {
    fn run(&self, group: &mut Group<'_>) {
        let (id, size, width) = (group.id(), group.size(), self.image.size()[0]);
        group.lanes(|lane| {
            self.blocks.pixels(lane, id, size, |pixel| {
                let color = self.show.color(lane, pixel, self.mean(lane, pixel));
                lane.store(self.out, lane.madd(pixel[1], width, pixel[0]), encoded(color));
            });
        });
    }
}

impl Display {
    fn mean(&self, lane: &GroupLane<'_, '_>, pixel: [u32; 2]) -> Vec3 {
        let samples = self.image.samples();
        let color = |sample| lane.texel(&self.image, pixel, sample).truncate();
        let sum = (1..samples).fold(color(0), |sum, sample| lane.add(sum, color(sample)));
        if samples == 1 { sum } else { lane.scale(sum, 1.0 / samples as f32) }
    }
}

/// A colour exposed for a mean luminance.
fn exposed(lane: &GroupLane<'_, '_>, color: Vec3, mean: f32) -> Vec3 {
    let exposure = lane.mul(KEY, lane.recip(lane.max(mean, DARKEST)));
    let exposed = lane.scale(color, exposure);
    let over = lane.add(Vec3::ONE, exposed).to_array().map(|part| lane.recip(part));
    lane.mul(exposed, Vec3::from(over))
}

impl Show {
    fn color(&self, lane: &GroupLane<'_, '_>, pixel: [u32; 2], color: Vec3) -> Vec3 {
        match self {
            Self::Exposed(mean) => exposed(lane, color, lane.load(*mean, 0)),
            Self::ExposedBy(level) => {
                exposed(lane, color, lane.dot(lane.texel(level, [0; 2], 0).truncate(), LUMINANCE))
            }
            Self::Equalised(sums) => {
                let luminance = lane.dot(color, LUMINANCE);
                let [below, all] =
                    [bin(lane, luminance, sums.len()), sums.len() - 1].map(|bin| lane.load(*sums, bin));
                let share = lane.mul(below as f32, lane.recip(all as f32));
                lane.scale(color, lane.mul(share, lane.recip(lane.max(luminance, DARKEST))))
            }
            Self::Heat { counts, most, tiles } => {
                // The sizes of tiles are powers of two.
                let at = [0, 1].map(|axis| lane.shift_right(pixel[axis], tiles.block[axis].ilog2()));
                let count = lane.load(*counts, lane.madd(at[1], tiles.groups()[0], at[0]));
                let most: u32 = lane.load(*most, 0);
                let share = lane.mul(count as f32, lane.recip(lane.max(most as f32, 1.0)));
                let hot = [0.0, 1.0, 2.0].map(|from| lane.saturate(lane.madd(3.0, share, -from)));
                let grey = lane.mul(0.5, lane.dot(color, LUMINANCE));
                lane.madd(Vec3::from(hot), Vec3::splat(0.7), Vec3::splat(grey))
            }
        }
    }
}
