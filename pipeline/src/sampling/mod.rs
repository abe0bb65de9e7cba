//! Where and when each pixel looks: sample tables over the image, the lens and the shutter.

mod hash;
mod hashed;
mod lens;
mod sobol;
mod source;
mod table;
mod tile;

pub use hash::mix;
pub use hashed::HashedSamples;
pub use lens::LensShape;
pub use source::SampleSource;
pub use table::{Sample, SampleTable, TableError};
pub use tile::TileSamples;
