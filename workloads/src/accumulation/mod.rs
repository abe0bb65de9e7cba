//! Accumulation buffering (Haeberli and Akeley 1990): many renderings of still geometry through pinholes, added up. What one pass
//! of a five-dimensional rasterizer is held against.
//!
//! - [`SharedSamples`]: the same samples in all pixels, as accumulation has them by nature.
//! - [`Snapshot`]: moving geometry as it stands at one time and from one place on the lens, for a rendering with neither.
//! - [`pinhole`]: the camera at one place on a lens.
//! - [`Rays`]: what a ray hits, as the truth about visibility.

mod pinhole;
mod rays;
mod shared;
mod snapshot;

pub use pinhole::pinhole;
pub use rays::{Face, Rays};
pub use shared::SharedSamples;
pub use snapshot::{Snapshot, SnapshotError};
