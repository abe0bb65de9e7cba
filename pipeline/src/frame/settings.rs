//! What the modelled hardware is made of, and what one frame asks of it.

use glam::Vec3;
use serde::Deserialize;

use crate::geometry::Viewport;
use crate::memory::{Cache, CacheError, CacheSpec, MemorySpec};
use crate::sampling::SampleSource;

/// The functional side of the hardware: sizes that decide *what* happens. How fast is the business of a timing model.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
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

/// Tests that can be switched off. They change what it costs, never the image.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Features {
    /// Narrow the box of lens and time by the side planes of a tile.
    pub side_planes: bool,
    /// Bound the edges over a tile and its box of lens and time.
    pub edges: bool,
    /// Screen single samples by the linearized edges before they are tested.
    pub screen: bool,
    /// Cull tiles behind the farthest stored depth.
    pub z_max: bool,
}

impl Features {
    /// Every test there is.
    pub const ALL: Self = Self { side_planes: true, edges: true, screen: true, z_max: true };
    /// Bounding boxes only.
    pub const NONE: Self = Self { side_planes: false, edges: false, screen: false, z_max: false };
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
    /// A cache cannot be built.
    #[error("`{field}`: {source}")]
    Cache {
        /// The field.
        field: &'static str,
        /// Why.
        source: CacheError,
    },
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
