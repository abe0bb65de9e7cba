//! Random points in squares, cubes, volumes and densities (thesis, Paper VI, section 5).
//!
//! - [`poisson`]: maximal Poisson disk points, by dart throwing over uncovered regions; [`rivals`]: other
//!   methods.
//! - [`volume`]: uniform points in volumes bounded by moving triangles, and in closed surfaces.
//! - [`white`]: independent points that follow a density, in one to four dimensions.
//! - [`job`]: uncovered regions drawn by the rasterizer, as a workload of the modelled hardware.
//! - [`quality`]: minimum distance, holes, spectra, chi-square; [`thin_regions_warning`]: when precision
//!   limits the result.

pub mod job;
pub mod poisson;
mod precision;
pub mod quality;
mod random;
pub mod rivals;
pub mod volume;
pub mod white;

pub use precision::{MAX_THIN_PER_POINT, thin_regions_warning};
