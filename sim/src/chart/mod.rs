//! Charts of the book: each measured, drawn and written in one go, one module for each.
//!
//! - [`sampling`]: image error over samples per pixel and over host time.
//! - [`fit`]: exponents of curves.

mod error;
pub mod fit;
pub mod sampling;

pub use error::ChartError;

/// The charts there are, each with a line that says what it shows.
pub const CHARTS: [(&str, &str); 1] =
    [("sampling", "image error over samples per pixel and over host time, for every sample table")];
