//! Where and when each pixel looks: sample tables over the image, the lens and the shutter.

mod hash;
mod lens;
mod sobol;
mod table;
mod tile;

pub use hash::mix;
pub use lens::LensShape;
pub use table::{Sample, SampleTable, TableError};
pub use tile::TileSamples;
