//! Visibility as a tool: moving triangles with a camera and samples in, the triangle each sample sees and its depth out.
//!
//! [`load`] reads any of the files that hold a moving mesh into a [`VisibilityScene`]. The layouts of `.m5d`, of sample
//! tables and of results are those of the ray-casting peer (`shared/peers/embree5d/README.md`), little endian and packed,
//! so that both programs can be held against each other sample by sample. `.mts` is read by [`load_mts`] for others, too.

mod bytes;
mod camera;
mod hits;
mod load;
mod m5d;
mod mesh;
mod mts;
mod pair;
mod scene;
mod table;
mod unshaded;

pub use crate::scene::CameraSpec;
pub use hits::write_hits;
pub(crate) use load::Kind;
pub use load::{load, load_surface};
pub use m5d::parse as parse_m5d;
pub use mesh::MovingMesh;
pub use mts::{load_mts, parse_mts};
pub(crate) use pair::moving;
pub use scene::VisibilityScene;
pub use table::{FixedSamples, write_samples};
pub use unshaded::Unshaded;
