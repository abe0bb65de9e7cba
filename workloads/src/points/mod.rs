//! Points: random samples of squares, cubes, volumes and densities (thesis, Paper VI, section 5).
//!
//! - [`poisson`]: maximal Poisson-disk points by dart throwing over voids.

pub mod poisson;
mod random;
