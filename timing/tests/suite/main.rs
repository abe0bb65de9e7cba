//! The ladder, level by level.

mod closed_forms;
mod common;
mod conservation;
mod ladder;
