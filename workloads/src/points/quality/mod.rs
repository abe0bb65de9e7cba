//! How good points are.
//!
//! - [`least_distance`], [`closer_than`]: the minimum distance, exactly.
//! - [`largest_hole`], [`free_share`]: whether another point would fit.
//! - [`Spectrum`]: power over frequency, averaged over directions.
//! - [`chi_square`]: whether counts follow what is expected.
//!
//! The same quantities, by other means, are those of `peers/sampling/metrics.py`; `docs/guide/sampling.md` holds both side by side.

mod buckets;
mod chi_square;
mod hole;
mod spectrum;

pub use buckets::{closer_than, least_distance};
pub use chi_square::{ChiSquare, chi_square, upper_tail};
pub use hole::{Hole, free_share, largest_hole};
pub use spectrum::Spectrum;
