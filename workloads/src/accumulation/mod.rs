//! Accumulation buffering (Haeberli and Akeley 1990): the mean of many pinhole renderings of still geometry.
//! It is the method that one 5D pass is compared with.
//!
//! - [`SharedSamples`]: the same samples in all pixels, which accumulation requires.
//! - [`Snapshot`]: moving geometry at one time and one lens position, for a rendering without either.
//! - [`pinhole`]: the camera at one lens position.
//! - [`Rays`]: ray casting, as the ground truth of visibility.

mod rays;
mod still;

pub use rays::{Face, Rays};
pub use still::{SharedSamples, Snapshot, SnapshotError, pinhole};
