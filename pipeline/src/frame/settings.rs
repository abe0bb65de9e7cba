//! Settings of a frame: the functional parameters of the hardware and their checks, the image, and its
//! samples.

use glam::Vec3;
use serde::{Deserialize, Serialize};

use crate::compute::ComputeSpec;
use crate::depth::{BoxGrid, DepthSpec};
use crate::geometry::Viewport;
use crate::memory::{Cache, CacheError, CacheSpec, MemorySpec};
use crate::sampling::SampleSource;
use crate::traversal::TimePieces;

/// Functional parameters of the hardware: sizes that decide *what* happens. Throughput belongs to the timing
/// models.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PipelineSpec {
    /// Side of a fine tile in pixels: 1, 2, 4 or 8.
    pub tile_px: u32,
    /// Side of a coarse tile in pixels, a multiple of `tile_px` up to 256.
    pub coarse_tile_px: u32,
    /// Triangles per batch, which limits the memory of bins.
    pub batch_triangles: u32,
    /// Capacity of the FIFO of shaded vertices.
    pub vertex_reuse: u32,
    /// Where visible samples are shaded.
    #[serde(default)]
    pub shading: Shading,
    /// Shading cache, with quads as entries; unused if every sample is shaded.
    pub shading_cache: CacheSpec,
    /// Caches of memory.
    pub memory: MemorySpec,
    /// Enabled tests.
    pub features: Features,
    /// Depth bounds and Hi-Z.
    #[serde(default)]
    pub depth: DepthSpec,
    /// Groups of lanes; a GPU without it runs none.
    #[serde(default)]
    pub compute: Option<ComputeSpec>,
    /// Lanes of a warp, which run in step. A GPU file has them in `units.shader`, from where they come.
    #[serde(skip_deserializing, default = "usual_warp_lanes")]
    pub warp_lanes: u32,
}

fn usual_warp_lanes() -> u32 {
    32
}

/// Where visible samples are shaded. The choice changes the image.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Shading {
    /// At cells of the shading grid, through the shading cache.
    #[default]
    Cached,
    /// At every sample's own position, lens position and time, without a cache.
    PerSample,
}

/// Tests that can be disabled. They change the cost, never the image. The two thresholds change the image if
/// they are above zero.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Features {
    /// Narrow the lens interval by dual-space lines found in set-up.
    pub lens_lines: bool,
    /// Narrow the box of lens and time by the side planes of a tile.
    pub side_planes: bool,
    /// Narrow it by the sides along `u` for each region of the lens, where samples have disjoint ones
    /// ([`crate::sampling::LensRegions`]).
    pub lens_regions: bool,
    /// Find which face of a triangle is visible over a tile and its box of lens and time.
    pub facing: bool,
    /// Largest number of time bisections while the visible face is undecided; 0 to 3.
    pub facing_splits: u32,
    /// Bound the edges over a tile and its box of lens and time.
    pub edges: bool,
    /// Test facing and edges on coarse tiles, too.
    pub coarse: bool,
    /// Screen single samples by the linearized edges before the sample test.
    pub screen: bool,
    /// Cull tiles behind the farthest stored depth.
    pub z_max: bool,
    /// Run only those of the enabled tests that pay off.
    pub auto: bool,
    /// Shade the visible samples of a bin after its last triangle, and no others (hidden-surface removal of
    /// tile-based deferred renderers). A draw that blends, discards samples or masks channels is shaded in
    /// order: what is visible in the bin before it is shaded first, what comes after it waits again.
    pub hidden_surface_removal: bool,
    /// A triangle whose points are all within this distance in pixels of their mid-shutter position is drawn
    /// still at that position. 0 disables it.
    pub still_px: f32,
    /// A triangle whose circle of confusion has at most this radius in pixels is drawn in focus. 0 disables
    /// it.
    pub in_focus_px: f32,
}

impl Default for Features {
    fn default() -> Self {
        Self::ALL
    }
}

impl Features {
    /// All tests.
    pub const ALL: Self = Self {
        lens_lines: true,
        side_planes: true,
        lens_regions: false,
        facing: true,
        facing_splits: 2,
        edges: true,
        coarse: true,
        screen: true,
        z_max: true,
        auto: false,
        hidden_surface_removal: false,
        still_px: 0.0,
        in_focus_px: 0.0,
    };
    /// Bounding boxes only.
    pub const NONE: Self = Self {
        lens_lines: false,
        side_planes: false,
        facing: false,
        facing_splits: 0,
        edges: false,
        coarse: false,
        screen: false,
        z_max: false,
        ..Self::ALL
    };
}

/// Why a pipeline specification is invalid.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum PipelineSpecError {
    /// A size has an invalid value.
    #[error("`{field}` is {value}; {allowed}")]
    Size {
        /// Field.
        field: &'static str,
        /// Value.
        value: u32,
        /// Allowed values.
        allowed: &'static str,
    },
    /// A threshold has an invalid value.
    #[error("`{field}` is {value}; it has to be 0 to 16384")]
    Threshold {
        /// Field.
        field: &'static str,
        /// Value.
        value: String,
    },
    /// A cache is invalid.
    #[error("`{field}`: {source}")]
    Cache {
        /// Field.
        field: &'static str,
        /// Reason.
        source: CacheError,
    },
}

/// Largest threshold in pixels: the side of the largest image.
const MAX_THRESHOLD_PX: f32 = 16_384.0;

impl PipelineSpecError {
    /// The invalid field, such as `memory.l2`.
    pub fn field(&self) -> &'static str {
        match self {
            Self::Size { field, .. } | Self::Threshold { field, .. } | Self::Cache { field, .. } => field,
        }
    }
}

impl PipelineSpec {
    /// Check every size.
    ///
    /// # Errors
    /// The first invalid field, with the allowed values.
    pub fn validate(&self) -> Result<(), PipelineSpecError> {
        let size = |field, value, fits: bool, allowed| {
            if fits { Ok(()) } else { Err(PipelineSpecError::Size { field, value, allowed }) }
        };
        size("tile_px", self.tile_px, [1, 2, 4, 8].contains(&self.tile_px), "it has to be 1, 2, 4 or 8")?;
        let coarse = self.coarse_tile_px;
        let fits = (1..=256).contains(&coarse) && coarse.is_multiple_of(self.tile_px);
        size("coarse_tile_px", coarse, fits, "it has to be a multiple of `tile_px`, at most 256")?;
        let batch = self.batch_triangles;
        size("batch_triangles", batch, (1..=1 << 24).contains(&batch), "it has to be 1 to 16777216")?;
        let reuse = self.vertex_reuse;
        size("vertex_reuse", reuse, (1..=4096).contains(&reuse), "it has to be 1 to 4096")?;
        let Features { facing_splits, still_px, in_focus_px, .. } = self.features;
        let max = TimePieces::MAX_SPLITS;
        size("features.facing_splits", facing_splits, facing_splits <= max, "it has to be 0 to 3")?;
        for (field, value) in [("features.still_px", still_px), ("features.in_focus_px", in_focus_px)] {
            if !(0.0..=MAX_THRESHOLD_PX).contains(&value) {
                return Err(PipelineSpecError::Threshold { field, value: value.to_string() });
            }
        }
        let boxes = self.depth.boxes;
        let invalid = boxes.iter().copied().find(|count| !(1..=BoxGrid::MAX).contains(count));
        size("depth.boxes", invalid.unwrap_or(1), invalid.is_none(), "it has to be 1 to 16 along each axis")?;
        if let Some((field, value, allowed)) = self.compute.as_ref().and_then(ComputeSpec::invalid) {
            return Err(PipelineSpecError::Size { field, value, allowed });
        }
        let caches = [
            ("shading_cache", self.shading_cache),
            ("memory.depth", self.memory.depth),
            ("memory.colour", self.memory.colour),
            ("memory.texture", self.memory.texture),
            ("memory.l2", self.memory.l2),
        ];
        let [llc, edram] = self.memory.levels();
        let optional = [("memory.bins", self.memory.bins), ("memory.llc", llc), ("memory.edram", edram)];
        let optional = optional.into_iter().filter_map(|(field, cache)| Some((field, cache?)));
        for (field, cache) in caches.into_iter().chain(optional) {
            Cache::new(cache).map_err(|source| PipelineSpecError::Cache { field, source })?;
        }
        Ok(())
    }
}

/// Settings of one frame.
#[derive(Clone, Copy, Debug)]
pub struct Settings<'a> {
    /// Hardware; validated.
    pub spec: &'a PipelineSpec,
    /// Image size.
    pub viewport: Viewport,
    /// Sample positions of every pixel.
    pub samples: &'a dyn SampleSource,
    /// Linear RGB radiance of samples without a hit.
    pub background: Vec3,
}
