//! Experiments with the simulator: the charts of the book and the reproduction of papers.
//!
//! - [`study`]: what all of them share: measured, drawn, written and printed in one go.
//! - [`chart`]: charts of the book.
//! - [`stress`]: the failure catalogue, each tile test on each family of triangles.
//! - [`catalog`]: the list of these studies.
//! - [`reproduce`]: claims of papers, computed and compared with them.
//!
//! A study is measured once with an effort, full or quick. Its result is drawn, put into tables and written as JSON, and
//! gives trade-off points: an error and a cost, which `chart all` draws for all methods in one picture.
//!
//! ```
//! let growth = experiments::catalog::all().find(|study| study.name == "growth").expect("a chart of the book");
//! assert!(growth.about.starts_with("Time of the visibility engine"));
//! ```

pub mod catalog;
pub mod chart;
pub mod reproduce;
pub mod stress;
pub mod study;
