//! Design-space exploration: many runs from one file, on one machine or a cluster.
//!
//! ```text
//! SweepSpec (axes) -> points -> SweepPlan (ids) -> Folder -> ShardWork: execute -> a file per point -> merge -> results.parquet
//! ```
//!
//! - [`SweepSpec`]: the sweep file. [`SweepPlan`]: its points with ids, every value tried.
//! - [`Folder`]: the plan and the results on disk, each file whole or absent.
//! - [`Shard`]: which points a task runs. [`ShardWork`]: runs those that are not finished.
//! - [`merge()`]: all results in one table, the same bytes for any number of shards and threads.
//! - [`SweepReport`]: designs on the frontier of time and energy, and main effects.
//! - [`Search`]: points that an optimizer requests.
//!
//! A point has no state but its file, so a sweep may be stopped at any moment and continued anywhere.
//!
//! ```
//! use sweep::SweepPlan;
//!
//! let folder = tempfile::tempdir()?;
//! let file = folder.path().join("two.ron");
//! let axes = r#"[Values(path: "gpu.pipeline.tile_px", values: [4, 8])]"#;
//! std::fs::write(&file, format!(r#"(name: "two", settings: {{"scene": "tiny"}}, axes: {axes})"#))?;
//! let plan = SweepPlan::load(&file, false, None)?;
//! assert_eq!(plan.points.len(), 2);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod ask;
mod axis;
mod constraint;
mod error;
mod execute;
mod folder;
mod merge;
mod plan;
mod points;
mod report;
mod run;
mod screen;
mod setting;
mod shared;
mod slurm;
mod spec;

pub use self::run::{ExpectedRuns, Shard, ShardWork, Status};
pub use ask::{Answer, Dimension, Question, Search};
pub use axis::Axis;
pub use error::SweepError;
pub use execute::{EventCounts, Measured, measured};
pub use folder::Folder;
pub use merge::{RESULTS, merge};
pub use plan::{Point, SweepPlan};
pub use points::combinations;
pub use report::{
    Cost, Effect, Interaction, Measure, NearBest, NoEffect, Pair, RatedDesign, ReportOptions, Share,
    SweepDesign, SweepReport, UnmeasuredPoint, Winner,
};
pub use setting::{Setting, Text, is_option, misspelt, with};
pub use slurm::{Scripts, SlurmArray, SlurmJob, submit};
pub use spec::{Combination, MAX_POINTS, SweepSpec};
