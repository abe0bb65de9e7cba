//! `--set path=value` in the GPU of the reference.
#![no_main]

use libfuzzer_sys::fuzz_target;
use run::{Change, Plan, RunOptions};

fuzz_target!(|text: &str| {
    let (path, value) = text.split_once('=').unwrap_or((text, ""));
    let changes = vec![Change { path: format!("gpu.{path}"), value: value.to_owned() }];
    let _ = Plan::resolve(RunOptions { scene: "tiny".into(), changes, ..RunOptions::default() });
});
