//! Options of the workload.

use pipeline::ComputeSpec;
use serde::{Deserialize, Serialize};

use super::block::Order;
use super::luminance::{Atomics, Scan};
use crate::error::LoadError;
use crate::job::{JobError, JobOptions, Need, must_hold};

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
    pub(super) fn check_for(&self, spec: &ComputeSpec) -> Result<(), JobError> {
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
    pub(super) fn check(&self) -> Result<(), LoadError> {
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
