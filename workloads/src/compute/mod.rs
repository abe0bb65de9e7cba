//! Programs of groups on surfaces that raster passes of the same frame wrote.
//!
//! - [`Kernels`]: the mean luminance of an image by a reduction ([`Chain`]: by a mip chain), its histogram by
//!   atomics, and the lights of each tile by the depths of a pre-pass.
//! - [`ComputeOptions`]: sizes of groups, layouts of shared memory and kinds of atomics; [`Blocks`],
//!   [`Order`]: which pixels a lane works on, and the steps of a tree.
//! - [`job()`]: the workload.

mod job;
mod kernels;
mod luminance;

use pipeline::texture::LUMINANCE;
use pipeline::{ComputeSpec, Group, GroupLane, SurfaceView};
use serde::{Deserialize, Serialize};

use crate::error::LoadError;
use crate::job::{JobError, JobOptions, Need, must_hold};
pub use job::{ATOMICS_PER_WORD, CHAIN, CYCLES_PER_ACCESS, Chain, Compute, job};
pub(crate) use job::{FACTS, FLAGS};
pub use kernels::{Kernels, LightSphere, TileLights};
use luminance::Scan;
pub use luminance::{Atomics, bin};

/// Luminance of a sample of an image in linear RGB: loads and a dot product.
fn luminance(lane: &GroupLane<'_, '_>, image: &SurfaceView, pixel: [u32; 2], sample: u32) -> f32 {
    lane.dot(lane.texel(image, pixel, sample).truncate(), LUMINANCE)
}

/// What groups of lanes compute.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Kernel {
    /// Mean luminance of the image, for its exposure.
    Reduction,
    /// The same by a mip chain, which raster passes draw from level to level.
    MipChain,
    /// Histogram of the luminance of the image, to equalise it.
    Histogram,
    /// Lights that reach each tile of the image.
    LightCulling,
}

/// Options of the job.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ComputeOptions {
    /// What is computed.
    pub kernel: Kernel,
    /// A built-in scene or a file, drawn without motion and without a lens.
    pub scene: String,
    /// Lanes of a group: a power of two, 16 to 1024.
    pub group: u32,
    /// Pixels of a lane, 1 to 64. Lanes of `light_culling` share the pixels of their tile.
    pub per_lane: u32,
    /// `reduction` and `histogram` read one pixel in so many along both axes, 1 to 16.
    pub step: u32,
    /// Which sums a step of the reduction adds.
    pub order: Order,
    /// Words of shared memory from the sum of a lane to that of the next, 1 to 64.
    pub stride: u32,
    /// Whether shared memory has an empty word after each row of banks.
    pub padded: bool,
    /// Where the lanes of the histogram count.
    pub atomics: Atomics,
    /// Bins of the histogram: a power of two, 16 to 256.
    pub bins: u32,
    /// Histograms in the shared memory of a group, which lanes use in turn, 1 to 32.
    pub copies: u32,
    /// Contrast of the image, 0 (one grey) to 1.
    pub contrast: f32,
    /// Number of lights, 1 to 65536.
    pub lights: u32,
    /// Radius of the sphere that a light reaches, as a share of the diagonal of the scene, 0 to 1.
    pub light_radius: f32,
    /// Side of a tile in pixels: a power of two, 4 to 64.
    pub tile_px: u32,
    /// Whether the depths of a tile bound its lights.
    pub depth_bounds: bool,
    /// Longest list of a tile, 1 to 65536.
    pub list: u32,
}

impl JobOptions for ComputeOptions {
    const NEEDS: &'static [Need] = &[
        Need::new("per_lane", "kernel", &["reduction", "histogram"]),
        Need::new("step", "kernel", &["reduction", "histogram"]),
        Need::new("order", "kernel", &["reduction"]),
        Need::new("stride", "kernel", &["reduction"]),
        Need::new("padded", "kernel", &["reduction", "histogram"]),
        Need::new("padded", "atomics", &["shared"]),
        Need::new("atomics", "kernel", &["histogram"]),
        Need::new("bins", "kernel", &["histogram"]),
        Need::new("copies", "kernel", &["histogram"]),
        Need::new("copies", "atomics", &["shared"]),
        Need::new("lights", "kernel", &["light_culling"]),
        Need::new("light_radius", "kernel", &["light_culling"]),
        Need::new("tile_px", "kernel", &["light_culling"]),
        Need::new("depth_bounds", "kernel", &["light_culling"]),
        Need::new("list", "kernel", &["light_culling"]),
    ];
}

impl Default for ComputeOptions {
    fn default() -> Self {
        Self {
            kernel: Kernel::LightCulling,
            scene: "default".to_owned(),
            group: 128,
            per_lane: 4,
            step: 1,
            order: Order::Sequential,
            stride: 1,
            padded: false,
            atomics: Atomics::Shared,
            bins: 256,
            copies: 1,
            contrast: 1.0,
            lights: 512,
            light_radius: 0.04,
            tile_px: 16,
            depth_bounds: true,
            list: 64,
        }
    }
}

impl ComputeOptions {
    /// Checks that the groups are not too large for a GPU.
    ///
    /// # Errors
    /// [`JobError::Setting`] with the option that makes them smaller.
    fn check_for(&self, spec: &ComputeSpec) -> Result<(), JobError> {
        let power_below = |most: u32| 1 << most.max(1).ilog2();
        let most = spec.group_lanes;
        if self.group > most {
            return Err(JobError::setting(format_args!(
                "group {}: this GPU runs groups of up to {most} lanes; `--set group={}`",
                self.group,
                power_below(most)
            )));
        }
        let bins = most.min(spec.shared_bytes / Scan::BYTES_PER_BIN);
        if self.kernel == Kernel::Histogram && self.bins > bins {
            return Err(JobError::setting(format_args!(
                "bins {}: a group adds them up, with a lane and {} bytes of shared memory for each, and this GPU gives a group {most} lanes \
                 and {} bytes; `--set bins={}`",
                self.bins,
                Scan::BYTES_PER_BIN,
                spec.shared_bytes,
                power_below(bins)
            )));
        }
        Ok(())
    }

    /// Checks every value.
    ///
    /// # Errors
    /// [`LoadError::Setting`] with the first invalid value.
    fn check(&self) -> Result<(), LoadError> {
        let power = |value: u32, from: u32, to: u32| value.is_power_of_two() && (from..=to).contains(&value);
        must_hold([
            ("group", &self.group, power(self.group, 16, 1024), "a power of two, 16 to 1024"),
            ("per_lane", &self.per_lane, (1..=64).contains(&self.per_lane), "1 to 64"),
            ("step", &self.step, (1..=16).contains(&self.step), "1 to 16"),
            ("stride", &self.stride, (1..=64).contains(&self.stride), "1 to 64"),
            ("bins", &self.bins, power(self.bins, 16, 256), "a power of two, 16 to 256"),
            ("copies", &self.copies, (1..=32).contains(&self.copies), "1 to 32"),
            ("contrast", &self.contrast, (0.0..=1.0).contains(&self.contrast), "0 to 1"),
            ("lights", &self.lights, (1..=65_536).contains(&self.lights), "1 to 65536"),
            ("light_radius", &self.light_radius, (0.0..=1.0).contains(&self.light_radius), "0 to 1"),
            ("tile_px", &self.tile_px, power(self.tile_px, 4, 64), "a power of two, 4 to 64"),
            ("list", &self.list, (1..=65_536).contains(&self.list), "1 to 65536"),
        ])
    }
}

/// Pixels of an image in blocks, one for each group. A group works on its block row by row: lanes beside each
/// other have pixels beside each other.
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
    /// Blocks of an image of `size` pixels for groups of `lanes`, with `per_lane` pixels for each lane. One
    /// pixel in `step` along each axis is read, in the middle of those it stands for.
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

    /// Runs `work` on each pixel of a lane that is in the image. The position of a pixel takes two
    /// operations, as the sizes of blocks are constants, and two more where pixels are left out; whether it
    /// is inside takes a branch.
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
struct Slots {
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
    /// Pairs of values that the steps combine, of `size` values, a power of two: the first of a pair keeps
    /// the result. The last result is in value 0.
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
fn tree(group: &mut Group<'_>, order: Order, combine: impl Fn(&GroupLane<'_, '_>, [u32; 2])) {
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
