//! Sampling: sample tables over the image, the lens and the shutter.

mod hashed;
mod lens;
mod pattern;
mod region;
mod sample;
mod table;
mod tile;

pub use hashed::HashedSamples;
pub use lens::LensShape;
pub use pattern::Pattern;
pub use region::{LensRegion, LensRegions};
pub use sample::{Sample, SampleSource};
pub use table::{SampleSpec, SampleTable, TableError};
pub use tile::TileSamples;
