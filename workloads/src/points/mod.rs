//! Points: random samples of squares, cubes, volumes and densities (thesis, Paper VI, section 5).
//!
//! - [`poisson`]: maximal Poisson-disk points by dart throwing over voids; [`rivals`]: other ways to something like them.
//! - [`volume`]: even points of volumes that moving triangles bound, and of closed surfaces.
//! - [`white`]: independent points that follow a density in one to four dimensions.
//! - [`job`]: voids drawn by the rasterizer, to be timed and turned into watts.
//! - [`quality`]: minimum distance, holes, spectra, chi-square; [`doubt`]: where points are known to be bad.

mod doubt;
pub mod job;
pub mod poisson;
pub mod quality;
mod random;
pub mod rivals;
pub mod volume;
pub mod white;

pub use doubt::{THIN, doubt};
