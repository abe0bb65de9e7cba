//! Tests of the whole crate, one subject per file.
#![allow(clippy::unwrap_used, reason = "a failed unwrap fails the test")]
#![allow(clippy::too_many_lines, reason = "a test may be a long list of cases")]

mod accounting;
mod analytic;
mod bins;
mod by_hand;
mod centroid;
mod clipping;
mod closed;
mod common;
mod compute;
mod conservative;
mod conservative_by_hand;
mod conservative_exact;
mod conservative_pass;
mod costs;
mod culling;
mod depth;
mod depth_width;
mod determinism;
mod dimensions;
mod dropped;
mod engine_rounding;
mod golden;
mod heat;
mod hidden;
mod levels;
mod loaded_depths;
mod loads;
mod oracle;
mod orthographic;
mod passes;
mod per_sample;
mod queries;
mod resolve;
mod rounding;
mod settings;
mod slack;
mod state;
mod surfaces;
mod ties;
mod uncounted;
mod views;
mod visibility;
mod watertight;
mod widths;
