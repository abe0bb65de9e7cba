//! Tests of the whole crate, one subject per file.
#![allow(clippy::unwrap_used, reason = "a failed unwrap fails the test")]

mod analytic;
mod builtin;
mod cameras;
mod caustics;
mod clip;
mod collision;
mod common;
mod compute;
mod curved;
mod deferred;
mod failure;
mod flags;
mod frames;
mod glossy;
mod hostile;
mod lens;
mod messages;
mod multiview;
mod occlusion;
mod property;
mod real_scenes;
mod soft_shadows;
mod stress;
mod visibility;
