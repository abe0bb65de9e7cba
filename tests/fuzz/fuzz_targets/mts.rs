//! `.mts`: two instants of a scene of many objects.
#![no_main]

use std::path::Path;

use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    let _ = workloads::visibility::parse_mts(Path::new("a.mts"), data);
});
