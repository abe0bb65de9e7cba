//! Charts of the book: each measured, drawn and written in one go, one module for each.
//!
//! - [`frames`]: how well frame starts are found, by method, over rate, noise, resolution and host time.
//! - [`growth`]: time of the visibility engine over triangles, samples and blur.
//! - [`points`]: quality of points over points a second.
//! - [`sampled`]: frames predicted from few against all of them.
//! - [`sampling`]: image error over samples per pixel and over host time.
//! - [`tile_tests`]: what each combination of tile tests gains over what it costs.
//! - [`timing`]: every level of timing against the reference.
//! - [`index`]: one page of all of them, with [what each level costs and how wrong it is](standing).
//! - [`fit`]: exponents of curves.

mod error;
pub mod fit;
pub mod frames;
pub mod growth;
pub mod index;
pub mod points;
mod quantiles;
pub mod sampled;
pub mod sampling;
pub mod standing;
pub mod tile_tests;
pub mod timing;

pub use error::ChartError;

/// The charts there are, each with a line that says what it shows.
pub const CHARTS: [(&str, &str); 8] = [
    ("all", "every chart, the failure catalogue, and one page of speed against accuracy"),
    ("frames", "frame starts found and energy error, by method, over rate, noise, bits and host time"),
    ("growth", "time of the visibility engine over triangles, samples a pixel and blur, with exponents"),
    ("points", "points of all kinds: quality over points a second, spectra, and where it fails"),
    ("sampled", "frames predicted from few: errors, how often intervals hold the truth, host time"),
    ("sampling", "image error over samples per pixel and over host time, for every sample table"),
    ("tile-tests", "every combination of tile tests: efficiency and tightness over multiply-adds"),
    ("timing", "every level of timing: error against the reference over host time, and where it fails"),
];
