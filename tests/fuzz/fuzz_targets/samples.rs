//! Sample tables.
#![no_main]

use std::path::Path;

use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    let _ = workloads::FixedSamples::parse(Path::new("a.smp"), data);
});
