//! Tests of the timing levels.

#![allow(clippy::unwrap_used, reason = "a failed unwrap fails the test")]

mod closed_forms;
mod common;
mod compute;
mod conservation;
mod dram;
mod draws;
mod ladder;
mod line_streams;
mod passes;
mod random_gpus;
mod rates;
mod sampled;
mod service;
mod waiting;
