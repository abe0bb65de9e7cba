//! The simulator: it joins what happens (`pipeline`), when (here), at what cost (`power-model`) and what a recorder would
//! have seen of it (`traces`).
//!
//! - [`gpu`]: a GPU as a file.
//! - [`timing`]: which model of time a run uses.
//! - [`run`]: a scene through the whole line, from triangles to millijoules per frame.
//! - [`stress`]: the failure catalogue, each tile test on each family of triangles.
//! - [`chart`]: charts of the book, measured and drawn.
//! - [`reproduce`]: what the papers report, computed and held against them.
//! - [`compare`]: two runs, two images, two folders of images.
//! - [`output`]: files, plots, the timeline and the report.
//! - [`visibility`]: what every sample of a scene sees, and how fast.
//! - [`cli`]: the command `quintile`.

pub mod chart;
pub mod cli;
pub mod compare;
pub mod gpu;
pub mod output;
pub mod reproduce;
pub mod run;
pub mod stress;
pub mod timing;
pub mod visibility;
