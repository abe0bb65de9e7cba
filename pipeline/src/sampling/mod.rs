//! Where and when each pixel looks: sample tables over the image, the lens and the shutter.

mod hashed;
mod lens;
mod pattern;
mod region;
mod sample;
mod sobol;
mod source;
mod spec;
mod table;
mod tile;

pub use hashed::HashedSamples;
pub use lens::LensShape;
pub use pattern::Pattern;
pub use region::{LensRegion, LensRegions};
pub use sample::Sample;
pub use source::SampleSource;
pub use spec::SampleSpec;
pub use table::{SampleTable, TableError};
pub use tile::TileSamples;
