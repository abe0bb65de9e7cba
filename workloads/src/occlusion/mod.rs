//! Occlusion queries in 5D (thesis, Paper VI, section 3).
//!
//! A query tests whether an object is hidden behind the drawn scene, at all times and from all of the lens. A
//! *sampled* query draws the object's bounding box and counts the samples that pass the depth test. An
//! *interval* query uses no samples. In each tile, the tile test gives a box of lens and time and a depth
//! interval, which is compared with the farthest stored depths of the tile. Both answer for the samples of
//! the image.
//!
//! The queries are in the pipeline ([`pipeline::IntervalQueries`], [`pipeline::SampledQueries`]), which counts their
//! work. *An interval query never reports a visible object as hidden.*
//!
//! - [`depths()`]: depths of a scene, of which a [`pipeline::depth::Pyramid`] is made.
//! - [`WallScene`]: walls, solid or slatted, with boxes behind them.

mod job;

pub(crate) use job::FLAGS;
pub use job::{
    MAX_HALF_COVERED_SHARE, OcclusionOptions, QueryKind, WallScene, WallSceneSpec, depths, depths_of, job,
};
