//! `.m5d`: moving triangles with their camera.
#![no_main]

use std::path::Path;

use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    let _ = workloads::visibility::parse_m5d(Path::new("a.m5d"), data);
});
