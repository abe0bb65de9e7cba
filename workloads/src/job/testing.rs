//! Hardware for tests of jobs.

use pipeline::depth::DepthSpec;
use pipeline::{CacheSpec, Features, MemorySpec, PipelineSpec, Shading};

/// Small caches, with all features on.
pub(crate) fn hardware() -> PipelineSpec {
    let lines = CacheSpec::lru(256, 4);
    let compression = Default::default();
    PipelineSpec {
        tile_px: 8,
        coarse_tile_px: 16,
        batch_triangles: 1000,
        vertex_reuse: 16,
        shading: Shading::default(),
        shading_cache: CacheSpec::lru(1024, 4),
        memory: MemorySpec { depth: lines, colour: lines, texture: lines, l2: lines, compression },
        features: Features::ALL,
        depth: DepthSpec::default(),
    }
}
