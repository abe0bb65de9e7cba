//! Charts of the book: each measured, drawn and written in one go, one module for each.
//!
//! - [`caustics`]: shader executions of caustics, by how beams are bounded.
//! - [`collision`]: pairs kept in vain by collision detection.
//! - [`frames`]: how well frame starts are found, by method, over rate, noise, resolution and host time.
//! - [`glossy`]: glossy reflection and refraction against brute force and accumulation.
//! - [`growth`]: time of the visibility engine over triangles, samples and blur.
//! - [`occlusion`]: what occlusion queries find, and what they cost.
//! - [`points`]: quality of points over points a second.
//! - [`sampled`]: frames predicted from few against all of them.
//! - [`sampling`]: image error over samples per pixel and over host time.
//! - [`shadows`]: soft shadows in one pass against accumulation buffering.
//! - [`tile_tests`]: what each combination of tile tests gains over what it costs.
//! - [`timing`]: every level of timing against the reference.
//! - [`views`]: stereo and multi-view in one pass against view by view and accumulation.
//! - [`index`]: one page of all of them, with [what each level costs and how wrong it is](standing).
//! - [`fit`]: exponents of curves.

pub mod caustics;
pub mod collision;
mod error;
pub mod fit;
pub mod frames;
mod front;
pub mod glossy;
pub mod growth;
mod image;
pub mod index;
pub mod occlusion;
pub mod points;
mod quantiles;
pub mod sampled;
pub mod sampling;
pub mod shadows;
pub mod standing;
pub mod tile_tests;
pub mod timing;
pub mod views;

pub use error::ChartError;

/// The charts there are, each with a line that says what it shows.
pub const CHARTS: [(&str, &str); 14] = [
    ("all", "every chart, the failure catalogue, and one page of speed against accuracy"),
    ("caustics", "shader executions and images of caustics by how beams are bounded, and where beams fail"),
    (
        "collision",
        "pairs kept in vain by collision detection over resolution, bins of time and cost, and where it fails",
    ),
    ("frames", "frame starts found and energy error, by method, over rate, noise, bits and host time"),
    ("glossy", "glossy reflection and refraction: error over samples, contact hardening, lenses too wide"),
    ("growth", "time of the visibility engine over triangles, samples a pixel and blur, with exponents"),
    (
        "occlusion",
        "occlusion queries: hidden objects found over tests and bytes, by intervals and by samples",
    ),
    ("points", "points of all kinds: quality over points a second, spectra, and where it fails"),
    ("sampled", "frames predicted from few: errors, how often intervals hold the truth, host time"),
    ("sampling", "image error over samples per pixel and over host time, for every sample table"),
    ("shadows", "soft shadows: error over places on the light, one pass against accumulation, and the bias"),
    ("tile-tests", "every combination of tile tests: efficiency and tightness over multiply-adds"),
    ("timing", "every level of timing: error against the reference over host time, and where it fails"),
    ("views", "stereo and multi-view: shader runs over views and caches, one pass against its rivals"),
];
