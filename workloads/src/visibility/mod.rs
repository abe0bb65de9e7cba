//! Visibility as a tool: computes the visible triangle and depth of every sample of moving triangles.
//!
//! [`load()`] reads any file format with a moving mesh into a [`VisibilityScene`]. `.m5d`, sample tables and
//! results are little endian and packed; `docs/formats.md` describes them. They are shared with a ray caster,
//! so that results can be compared sample by sample. `.mts` is read by [`load_mts`] for other workloads, too.

mod bytes;
mod camera;
mod load;
mod m5d;
mod mesh;
mod mts;
mod scene;
mod table;

pub use crate::scene::CameraSpec;
pub(crate) use load::Kind;
pub use load::{load, load_surface};
pub use m5d::parse as parse_m5d;
pub use mesh::MovingMesh;
pub(crate) use mesh::moving;
pub use mts::{load_mts, parse_mts};
pub use scene::{Unshaded, VisibilityScene};
pub use table::{FixedSamples, write_hits, write_samples};
