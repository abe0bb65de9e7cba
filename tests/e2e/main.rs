//! End-to-end tests of the command, from arguments to files; one subject per file.
#![allow(clippy::unwrap_used, reason = "a failed unwrap fails the test")]

mod bad_input;
mod broken_runs;
mod camera;
mod camera_path;
mod ccd;
mod command_run;
mod compare;
mod determinism_levels;
mod determinism_run;
mod dry_run;
mod energies;
mod importers;
mod info;
mod layering;
mod machines;
mod messages;
mod one_frame;
mod outputs;
mod picture;
mod readme;
mod real_scenes;
mod references;
mod reproduce;
mod results_folder;
mod sample_tables;
mod sampled_run;
mod summary;
mod support;
mod trace_command;
mod trace_guards;
mod trace_refusals;
mod visibility;
mod visibility_inputs;
mod warnings;
mod words;
