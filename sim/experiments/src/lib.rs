//! Experiments with the simulator: what the book shows and what the papers report.
//!
//! - [`chart`]: charts of the book, measured and drawn.
//! - [`stress`]: the failure catalogue, each tile test on each family of triangles.
//! - [`reproduce`]: what the papers report, computed and compared with them.

pub mod chart;
pub mod reproduce;
pub mod stress;
