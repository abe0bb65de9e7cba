//! Quality measures of points.
//!
//! - [`least_distance`], [`closer_than`]: the minimum distance, exactly.
//! - [`largest_hole`], [`free_share`]: whether another point would fit.
//! - [`Spectrum`]: power over frequency, averaged over directions.
//! - [`chi_square`]: whether counts follow their expectation.
//!
//! `docs/guide/sampling.md` compares these values with an independent implementation.

mod chi_square;
mod distances;
mod spectrum;

pub use chi_square::{ChiSquare, chi_square, upper_tail};
pub use distances::{Hole, closer_than, free_share, largest_hole, least_distance};
pub use spectrum::Spectrum;
