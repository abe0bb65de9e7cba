//! Experiments with the simulator: the charts of the book and the reproduction of papers.
//!
//! - [`study`]: what all of them share: measured, drawn, written and printed in one go.
//! - [`chart`]: charts of the book.
//! - [`stress`]: the failure catalogue, each tile test on each family of triangles.
//! - [`catalog`]: the list of these studies.
//! - [`reproduce`]: claims of papers, computed and compared with them.

pub mod catalog;
pub mod chart;
pub mod reproduce;
pub mod stress;
pub mod study;
