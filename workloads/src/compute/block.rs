//! Which pixels each lane of a group works on, and trees in shared memory.

use pipeline::{Group, GroupLane};
use serde::{Deserialize, Serialize};

/// Pixels of an image in blocks, one for each group. A group works on its block row by row: lanes beside each other have pixels
/// beside each other.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Blocks {
    /// Columns and rows of pixels that are read.
    pub grid: [u32; 2],
    /// Columns and rows of a block.
    pub block: [u32; 2],
    /// Every so many pixels one is read, along both axes.
    step: u32,
    offset: [u32; 2],
}

/// Columns of a block.
const COLUMNS: u32 = 16;

impl Blocks {
    /// Blocks of an image of `size` pixels for groups of `lanes`, with `per_lane` pixels for each lane. One pixel in `step` along
    /// each axis is read, in the middle of those it stands for.
    pub fn new(size: [u32; 2], lanes: u32, per_lane: u32, step: u32) -> Self {
        let columns = COLUMNS.min(lanes);
        let offset = size.map(|side| (step / 2).min(side - 1));
        let grid = [0, 1].map(|axis| (size[axis] - offset[axis]).div_ceil(step));
        Self { grid, block: [columns, lanes / columns * per_lane], step, offset }
    }

    /// Square tiles of `side` pixels that hold all pixels of the image.
    pub fn tiles(size: [u32; 2], side: u32) -> Self {
        Self { grid: size, block: [side; 2], step: 1, offset: [0; 2] }
    }

    /// Groups along x, y and z.
    pub fn groups(&self) -> [u32; 3] {
        let [across, down] = [0, 1].map(|axis| self.grid[axis].div_ceil(self.block[axis]));
        [across, down, 1]
    }

    /// Number of pixels that are read.
    pub fn count(&self) -> u64 {
        u64::from(self.grid[0]) * u64::from(self.grid[1])
    }

    /// Runs `work` on each pixel of a lane that is in the image. The position of a pixel takes two operations, as the sizes of
    /// blocks are constants, and two more where pixels are left out; whether it is inside takes a branch.
    pub fn pixels(&self, lane: &GroupLane<'_, '_>, id: [u32; 3], size: u32, mut work: impl FnMut([u32; 2])) {
        let [columns, rows] = self.block;
        for number in (lane.index()..columns * rows).step_by(size as usize) {
            let within = [number % columns, number / columns];
            let at = [0, 1].map(|axis| lane.madd(id[axis], self.block[axis], within[axis]));
            if lane.branch(at[0] < self.grid[0] && at[1] < self.grid[1]) {
                let left_out = |axis: usize| lane.madd(at[axis], self.step, self.offset[axis]);
                work(if self.step == 1 { at } else { [0, 1].map(left_out) });
            }
        }
    }
}

/// Places of the values of lanes in shared memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Slots {
    /// First word.
    pub first: u32,
    /// Words from the value of a lane to that of the next.
    pub stride: u32,
    /// An empty word after so many words, two to this power; `None` for none.
    pub pad_log2: Option<u32>,
}

impl Slots {
    /// Words for the values of `lanes`, without those before the first.
    pub fn words(&self, lanes: u32) -> u32 {
        let last = (lanes - 1) * self.stride;
        last + self.pad_log2.map_or(0, |log2| last >> log2) + 1
    }

    /// Word of value `index`. Counts what the address takes.
    pub fn word(&self, lane: &GroupLane<'_, '_>, index: u32) -> u32 {
        let word = if self.stride == 1 { index } else { lane.mul(index, self.stride) };
        let padded = self.pad_log2.map_or(word, |log2| lane.add(word, lane.shift_right(word, log2)));
        if self.first == 0 { padded } else { lane.add(padded, self.first) }
    }
}

/// Which values a step of a tree combines (Harris 2007, "Optimizing Parallel Reduction in CUDA").
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Order {
    /// The first half with the second half: lanes beside each other use words beside each other.
    Sequential,
    /// Neighbours at a distance that doubles: lanes use words farther and farther apart.
    Interleaved,
}

impl Order {
    /// Pairs of values that the steps combine, of `size` values, a power of two: the first of a pair keeps the result. The last
    /// result is in value 0.
    pub fn steps(self, size: u32) -> impl Iterator<Item = (u32, impl Fn(u32) -> [u32; 2])> {
        (0..size.ilog2()).map(move |step| {
            let active = size >> (step + 1);
            let pair = move |lane: u32| match self {
                Self::Sequential => [lane, lane + active],
                Self::Interleaved => [lane << (step + 1), (lane << (step + 1)) + (1 << step)],
            };
            (active, pair)
        })
    }
}

/// Combines the values of all lanes by a tree, with a barrier before each step and after the last.
pub fn tree(group: &mut Group<'_>, order: Order, combine: impl Fn(&GroupLane<'_, '_>, [u32; 2])) {
    for (active, pair) in order.steps(group.size()) {
        group.barrier();
        group.lanes(|lane| {
            if lane.branch(lane.index() < active) {
                combine(lane, pair(lane.index()));
            }
        });
    }
    group.barrier();
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_value_is_combined_once() {
        for order in [Order::Sequential, Order::Interleaved] {
            for size in [1, 2, 8, 256] {
                let mut values: Vec<u64> = (0..size).map(|n| 1 << (n % 60)).collect();
                let total: u64 = values.iter().sum();
                for (active, pair) in order.steps(size) {
                    let pairs: Vec<[u32; 2]> = (0..active).map(pair).collect();
                    let mut used: Vec<u32> = pairs.concat();
                    used.sort_unstable();
                    used.dedup();
                    assert_eq!(used.len() as u32, 2 * active, "no value twice in a step");
                    pairs.iter().for_each(|&[a, b]| values[a as usize] += values[b as usize]);
                }
                assert_eq!(values[0], total);
            }
        }
    }

    #[test]
    fn blocks_hold_every_pixel_that_is_read() {
        let all = Blocks::new([100, 37], 64, 2, 1);
        assert_eq!((all.groups(), all.count(), all.block), ([7, 5, 1], 3700, [16, 8]));
        let few = Blocks::new([100, 37], 64, 2, 4);
        // Columns 2, 6, ..., 98 and rows 2, 6, ..., 34.
        assert_eq!((few.grid, few.count()), ([25, 9], 225));
        assert_eq!(Blocks::new([1, 1], 32, 1, 16).count(), 1);
    }

    #[test]
    fn padding_keeps_words_apart() {
        let slots = Slots { first: 5, stride: 2, pad_log2: Some(5) };
        // The last of 64 values is at 126, after three empty words.
        assert_eq!(slots.words(64), 130);
        assert_eq!(Slots { first: 0, stride: 1, pad_log2: None }.words(64), 64);
    }
}
