//! Experiments with the simulator: what the book shows and what the papers report.
//!
//! - [`study`]: what all of them share: measured, drawn, written and printed in one go.
//! - [`chart`]: charts of the book.
//! - [`stress`]: the failure catalogue, each tile test on each family of triangles.
//! - [`catalog`]: the list of these studies.
//! - [`reproduce`]: what the papers report, computed and compared with them.

pub mod catalog;
pub mod chart;
pub mod reproduce;
pub mod stress;
pub mod study;
