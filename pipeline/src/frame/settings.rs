//! What the modelled hardware is made of, and what one frame asks of it.

use glam::Vec3;
use serde::Deserialize;

use crate::depth::{BoxGrid, DepthSpec};
use crate::geometry::Viewport;
use crate::memory::{Cache, CacheError, CacheSpec, MemorySpec};
use crate::sampling::SampleSource;
use crate::traversal::Timeline;

/// The functional side of the hardware: sizes that decide *what* happens. How fast is the business of a timing model.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PipelineSpec {
    /// Side of a fine tile in pixels: 1, 2, 4 or 8.
    pub tile_px: u32,
    /// Side of a coarse tile in pixels, a multiple of `tile_px` up to 256.
    pub coarse_tile_px: u32,
    /// Triangles binned together; memory for bins does not grow beyond it.
    pub batch_triangles: u32,
    /// Vertices remembered after shading, first in first out.
    pub vertex_reuse: u32,
    /// Where visible samples are shaded.
    #[serde(default)]
    pub shading: Shading,
    /// The shading cache, entries being quads; idle where every sample is shaded.
    pub shading_cache: CacheSpec,
    /// The caches of memory.
    pub memory: MemorySpec,
    /// Which tests are switched on.
    pub features: Features,
    /// How depth is bounded and what a tile remembers of it.
    #[serde(default)]
    pub depth: DepthSpec,
}

/// Where visible samples are shaded. This changes the image.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
pub enum Shading {
    /// At cells of the shading grid, remembered in the shading cache.
    #[default]
    Cached,
    /// Each at its own place, lens position and time, and nothing is remembered.
    PerSample,
}

/// Tests that can be switched off. They change what it costs, never the image; the two thresholds change the image where they are
/// above zero.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Features {
    /// Narrow the lens by dual-space lines found in set-up.
    pub lens_lines: bool,
    /// Narrow the box of lens and time by the side planes of a tile.
    pub side_planes: bool,
    /// Find which face a triangle shows over a tile and its box of lens and time.
    pub facing: bool,
    /// How often the time is bisected at most where it is not decided which face; 0 to 3.
    pub facing_splits: u32,
    /// Bound the edges over a tile and its box of lens and time.
    pub edges: bool,
    /// Find facing and bound edges on coarse tiles, too.
    pub coarse: bool,
    /// Screen single samples by the linearized edges before they are tested.
    pub screen: bool,
    /// Cull tiles behind the farthest stored depth.
    pub z_max: bool,
    /// Run of those switched on only what pays.
    pub auto: bool,
    /// A triangle none of whose points is farther than this many pixels from its place in mid-shutter is drawn there, still. 0: none is.
    pub still_px: f32,
    /// A triangle whose circle of confusion has at most this radius in pixels is drawn in focus. 0: none is.
    pub in_focus_px: f32,
}

impl Default for Features {
    fn default() -> Self {
        Self::ALL
    }
}

impl Features {
    /// Every test there is.
    pub const ALL: Self = Self {
        lens_lines: true,
        side_planes: true,
        facing: true,
        facing_splits: 2,
        edges: true,
        coarse: true,
        screen: true,
        z_max: true,
        auto: false,
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

/// Why a pipeline cannot be built.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum SpecError {
    /// A size is not among those allowed.
    #[error("`{field}` is {value}; {allowed}")]
    Size {
        /// The field.
        field: &'static str,
        /// Its value.
        value: u32,
        /// What would do.
        allowed: &'static str,
    },
    /// A threshold is not a number of pixels.
    #[error("`{field}` is {value}; it has to be 0 to 16384")]
    Threshold {
        /// The field.
        field: &'static str,
        /// Its value.
        value: String,
    },
    /// A cache cannot be built.
    #[error("`{field}`: {source}")]
    Cache {
        /// The field.
        field: &'static str,
        /// Why.
        source: CacheError,
    },
}

/// The largest threshold: the side of the largest image.
const MAX_THRESHOLD_PX: f32 = 16_384.0;

impl SpecError {
    /// The field that is wrong, such as `memory.l2`.
    pub fn field(&self) -> &'static str {
        match self {
            Self::Size { field, .. } | Self::Threshold { field, .. } | Self::Cache { field, .. } => field,
        }
    }
}

impl PipelineSpec {
    /// Checks every size.
    ///
    /// # Errors
    /// Names the first field that cannot be, and what would do.
    pub fn validate(&self) -> Result<(), SpecError> {
        let size = |field, value, fits: bool, allowed| {
            if fits { Ok(()) } else { Err(SpecError::Size { field, value, allowed }) }
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
        let most = Timeline::MOST_SPLITS;
        size("features.facing_splits", facing_splits, facing_splits <= most, "it has to be 0 to 3")?;
        for (field, value) in [("features.still_px", still_px), ("features.in_focus_px", in_focus_px)] {
            if !(0.0..=MAX_THRESHOLD_PX).contains(&value) {
                return Err(SpecError::Threshold { field, value: value.to_string() });
            }
        }
        let boxes = self.depth.boxes;
        let most = boxes.iter().copied().find(|count| !(1..=BoxGrid::MOST).contains(count));
        size("depth.boxes", most.unwrap_or(1), most.is_none(), "it has to be 1 to 16 along each axis")?;
        let caches = [
            ("shading_cache", self.shading_cache),
            ("memory.depth", self.memory.depth),
            ("memory.colour", self.memory.colour),
            ("memory.texture", self.memory.texture),
            ("memory.l2", self.memory.l2),
        ];
        for (field, cache) in caches {
            Cache::new(cache).map_err(|source| SpecError::Cache { field, source })?;
        }
        Ok(())
    }
}

/// What one frame asks of the pipeline.
#[derive(Clone, Copy, Debug)]
pub struct Settings<'a> {
    /// The hardware; validated.
    pub spec: &'a PipelineSpec,
    /// Size of the image.
    pub viewport: Viewport,
    /// Where and when each pixel looks.
    pub samples: &'a dyn SampleSource,
    /// Linear RGB radiance where nothing is hit.
    pub background: Vec3,
}
