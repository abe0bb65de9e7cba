//! Tests of the crate beside the command: outputs and machine files.
#![allow(clippy::unwrap_used, reason = "a failed unwrap fails the test")]

mod machine_files;
mod output_dir;
mod output_image;
mod output_plot;
mod output_report;
