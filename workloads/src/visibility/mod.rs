//! Visibility as a tool: moving triangles with a camera and samples in, the triangle each sample sees and its depth out.
//!
//! The files are those of the ray-casting peer (`shared/peers/embree5d/README.md`), little endian and packed, so that
//! both programs can be held against each other sample by sample.

mod bytes;
mod hits;
mod m5d;
mod table;
mod unshaded;

pub use hits::write_hits;
pub use m5d::M5d;
pub use table::FixedSamples;
pub use unshaded::Unshaded;
